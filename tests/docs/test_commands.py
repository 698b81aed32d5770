"""Every command that README and docs show: run, composed, or named here with why it is not."""

import os
import re
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.docs.test_formats import printed, steps

CHECKOUT = Path(__file__).resolve().parents[2]
PAGES = [CHECKOUT / "README.md", *sorted((CHECKOUT / "docs").glob("*.md"))]
COMMAND = re.compile(r"^(?:\w+=\S+ )*(hdc |python -m |pip |make\b).*")

NOT_RUN = {
    "pip ": "installs: tests/hdc/command/test_package.py does",
    "make": "sets up .venv first; its recipes are the commands below",
    "python -m experiments.reproduce": "is hours: tests/experiments/test_reproduce.py composes it",
    "python -m experiments.report": "reads all records: tests/experiments/test_report.py does",
    "python -m experiments.run -m experiment=validation": "needs the sweeper of Optuna",
    "hdc live": "waits for a browser: tests/live/test_page.py does",
    "python -m scenes.live": "waits for a browser: tests/live/test_page.py does",
}
"""Beginnings of commands → why they are not run here."""


def commands(page):
    """Lines of fenced and indented code that begin a command, comments left out; sessions of
    api.md are those of test_formats.py."""
    text = page.read_text()
    if page.name != "api.md":
        text = text.replace("\n$ ", "\n")
    fence, found = None, []
    for line in text.splitlines():
        if line.startswith("```"):
            fence = line[3:] if fence is None else None
        elif line.startswith("$ "):
            fence = "session"
        elif fence in ("shell", "console") or (
            fence is None and line.startswith("    ")
        ):
            text = line.strip().partition("  #")[0].strip()
            if COMMAND.match(text):
                found.append(re.sub(r"^(\w+=\S+ )+", "", text))
    return found


def reason(command):
    return next(
        (why for start, why in NOT_RUN.items() if command.startswith(start)), None
    )


SHOWN = [(page.name, command) for page in PAGES for command in commands(page)]
RUN = [(page, c) for page, c in SHOWN if reason(c) is None]


def test_commands_are_found_and_each_is_run_composed_or_named():
    pages = {page for page, _ in SHOWN}
    assert {"README.md", "tutorial.md", "extend.md", "numerics.md"} <= pages
    assert all(c.startswith(("hdc ", "python -m experiments.run ")) for _, c in RUN)


@pytest.mark.parametrize(
    "page", sorted({page for page, c in RUN if c.startswith("hdc ")})
)
def test_commands_of_hdc_run_in_the_order_shown(page, tmp_path, monkeypatch, capsys):
    """And print what stands below them, where a session shows it."""
    monkeypatch.chdir(tmp_path)
    if (page, "hdc sample") not in RUN:
        recordings(tmp_path, (500, 570) if page == "export.md" else (40, 50))
    (path,) = (path for path in PAGES if path.name == page)
    sessions = re.findall(
        r"```console\n(\$ .*?)```", path.read_text("utf-8"), re.DOTALL
    )
    shown = {command: out for session in sessions for command, out in steps(session)}
    assert page != "tutorial.md" or next(iter(shown)) == "hdc sample"
    for command in (c for name, c in RUN if name == page and c.startswith("hdc ")):
        # A model of a few frames warns that it can refuse none, and counts those it did.
        out = printed(command, capsys, ("warning: ", "refused "))
        assert out == shown.pop(command, out) != "", command
    assert shown == {}


@pytest.mark.parametrize(
    "command", sorted({c for _, c in RUN if c.startswith("python -m experiments.run ")})
)
def test_runs_are_of_configs_that_there_are(command, monkeypatch):
    from hydra import compose, initialize_config_module

    words = [w for w in shlex.split(command)[3:] if w != "-m"]
    if "--config-dir" in words:  # a folder of the reader's
        at = words.index("--config-dir")
        del words[at : at + 2]
        words = [w for w in words if not w.startswith(("model=", "experiment="))]
    firsts = [w.split(",")[0] for w in words if not w.startswith("hydra")]
    with initialize_config_module("configs", version_base=None):
        config = compose("config", firsts)
    assert config.scene._target_
    # Those that no compose reads: further ones of a sweep, and launchers.
    for word in words:
        group, _, names = word.partition("=")
        if group in ("scene", "model", "experiment", "hydra/launcher"):
            for name in names.split(","):
                assert (CHECKOUT / "configs" / group / f"{name}.yaml").is_file(), word


def recordings(folder, size):
    """Two days of a sensor of two classes, as the pages assume them."""
    rng = np.random.default_rng(0)
    base = rng.integers(0, 160, (2, *size))

    def image(c):
        return (base[c] + rng.integers(0, 90, base[c].shape)).astype(np.uint8)

    for day, number in (("touches", 5), ("tomorrow", 2)):
        for c, name in enumerate(("left", "right")):
            os.makedirs(folder / day / name)
            for i in range(number):
                assert cv2.imwrite(str(folder / day / name / f"{i}.png"), image(c))
    (folder / "frames").mkdir()
    for name in ("frame1.png", "frame2.png", "frames/1.png"):
        assert cv2.imwrite(str(folder / name), image(0))
