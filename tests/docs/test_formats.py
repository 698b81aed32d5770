"""The sessions that docs/formats.md shows: each command prints what stands below it."""

import re
import shlex
from pathlib import Path

import pytest

from hdc.command import main
from tests.docs.laboratory import make

PAGE = Path(__file__).resolve().parents[2] / "docs" / "formats.md"
SESSIONS = re.findall(r"```console\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("laboratory")
    make(folder)
    return folder


def steps(session):
    """Each command, and what it prints."""
    for step in re.split(r"^\$ ", session, flags=re.MULTILINE)[1:]:
        command, _, printed = step.partition("\n")
        yield command, printed


def test_each_format_has_a_session_of_three_commands(files):
    verbs = ["look", "train", "evaluate"]
    for session in SESSIONS:
        assert [command.split()[1] for command, _ in steps(session)] == verbs
    shown = {shlex.split(next(steps(session))[0])[2] for session in SESSIONS}
    assert len(SESSIONS) == len(shown) == 8
    assert all((files / name).exists() for name in shown)


@pytest.mark.parametrize("session", SESSIONS, ids=lambda text: text.split()[3])
def test_commands_print_what_the_page_shows(files, monkeypatch, capsys, session):
    monkeypatch.chdir(files)
    for command, printed in steps(session):
        with pytest.raises(SystemExit) as caught:
            main(shlex.split(command)[1:])
        out, err = capsys.readouterr()
        assert (caught.value.code, err, out) == (0, "", printed), command
