"""The sessions of docs/api.md: each command prints what stands below it, and the lines that
``hdc look`` shows train a model."""

import re
import shlex
from pathlib import Path

import pytest

from hdc.command import main
from tests.docs.laboratory import make

PAGE = Path(__file__).resolve().parents[2] / "docs" / "api.md"
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


def printed(command, capsys, may_say="warning: fit: groups"):
    """What a command prints that ends well and says nothing else than this."""
    with pytest.raises(SystemExit) as caught:
        main(shlex.split(command)[1:])
    out, err = capsys.readouterr()
    errors = [line for line in err.splitlines() if not line.startswith(may_say)]
    assert (caught.value.code, errors) == (0, []), command
    return out


def test_each_format_has_a_session(files):
    shown = {next(steps(session))[0] for session in SESSIONS}
    names = {shlex.split(command)[2] for command in shown}
    assert len(SESSIONS) == len(names) == 7
    assert all((files / name).exists() for name in names)


@pytest.mark.parametrize("session", SESSIONS, ids=lambda text: text.split()[3])
def test_commands_print_what_the_page_shows_and_train(
    files, monkeypatch, capsys, session
):
    monkeypatch.chdir(files)
    for command, shown in steps(session):
        assert printed(command, capsys) == shown, command
    lines = re.findall(r"^hdc train .*", session, re.MULTILINE)
    assert lines
    for line in lines:
        trained = printed(line, capsys)
        if "classes: left (" in trained:
            evaluated = printed("hdc evaluate model.safetensors later.npz", capsys)
            assert evaluated.startswith("accuracy 100.0 %"), line
