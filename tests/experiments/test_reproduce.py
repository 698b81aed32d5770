"""The reproduction goes on after failures and interruptions and writes down what each step took."""

import io
import os
import subprocess
import sys

import pytest
from hydra import compose, initialize_config_dir
from rich.console import Console

from experiments import reproduce
from experiments.records.configs import CONFIGS
from experiments.records.files import ROOT
from experiments.reproduce import Step, steps

NOTHING, FAILING = ("json.tool", "--help"), ("json.tool", "/nowhere")


@pytest.fixture
def commands(monkeypatch):
    """The commands that were run; each is run in a moment, those on /nowhere fail."""
    made = []

    def run(step, mode, results):
        made.append(step.name)
        return "failed with 1" if "/nowhere" in step.words else "finished"

    monkeypatch.setattr(reproduce, "measured", run)
    return made


def console():
    return Console(file=io.StringIO(), width=120, highlight=False)


# The list -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", reproduce.WHAT)
def test_every_step_names_something_that_exists(mode):
    found = steps(mode)
    assert len({step.name for step in found}) == len(found)
    for step in found:
        assert step.minutes > 0, step.name
        path = ROOT.joinpath(*step.words[0].split("."))
        assert step.words[0] == "pytest" or path.with_suffix(".py").is_file()
        for word in step.words[1:]:
            key, _, value = word.partition("=")
            for name in (
                value.split(",")
                if key in ("experiment", "model", "stop", "scene")
                else ()
            ):
                assert (CONFIGS / key / f"{name}.yaml").is_file(), (step.name, word)


@pytest.mark.parametrize("mode", reproduce.WHAT)
def test_every_step_composes(mode):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        for step in steps(mode):
            if step.words[0] == "experiments.run":
                # A sweep takes several values of a key, a config one of them.
                words = (w if "[" in w else w.partition(",")[0] for w in step.words[1:]
                         if w != "-m")  # fmt: skip
                assert "model" in compose("config", overrides=list(words)), step.name


def test_every_experiment_is_reproduced():
    there = {path.stem for path in (CONFIGS / "experiment").glob("*.yaml")}
    words = {word for step in steps() for word in step.words}
    assert {f"experiment={name}" for name in there} <= words


def test_a_step_without_the_data_it_needs_is_skipped_and_that_is_said(
    commands, monkeypatch, tmp_path
):
    monkeypatch.delenv("SOME_DATA", raising=False)
    shown = console()
    found = [Step("one", NOTHING, 1, "SOME_DATA"), Step("two", NOTHING, 1)]
    assert reproduce.run(found, "full", tmp_path, shown) == 0
    assert commands == ["two"]
    assert "SOME_DATA" in shown.file.getvalue()


def test_the_list_runs_nothing(monkeypatch, capsys, commands, tmp_path):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "mine"))
    monkeypatch.setenv("COLUMNS", "200")
    assert reproduce.main(["--list", "--quick"]) == 0
    assert not commands
    assert not (tmp_path / "mine").exists()
    shown = capsys.readouterr().out
    assert all(step.name in shown for step in steps("quick"))


# Running it ---------------------------------------------------------------------------------------


def test_it_goes_on_after_a_failure_and_tells_of_it_at_the_end(tmp_path, commands):
    out = console()
    chosen = [
        Step("one", NOTHING, 1),
        Step("two", FAILING, 90),
        Step("three", NOTHING, 1),
    ]
    assert reproduce.run(chosen, "full", tmp_path, out) == 1
    assert commands == ["one", "two", "three"]
    assert "failed: two" in out.file.getvalue().splitlines()[-1]
    assert reproduce.run(chosen[:1], "full", tmp_path, console()) == 0


def test_seconds_memory_and_status_of_commands(tmp_path):
    (tmp_path / "large.py").write_text("held = bytearray(b'x' * 200_000_000)")
    code = (
        "from pathlib import Path; from experiments.reproduce import Step, measured\n"
        "for name in ('large', 'this', 'nowhere'):\n"
        f"    measured(Step(name, (name,), 1), 'full', Path({str(tmp_path)!r}))"
    )
    # In a process of its own: a child's peak counts from what its parent holds.
    subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, check=True,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"},
    )  # fmt: skip
    large, small, failed = (reproduce.read(tmp_path)[name, "full"]
                            for name in ("large", "this", "nowhere"))  # fmt: skip
    assert [row["status"] for row in (large, small, failed)] == [
        "finished", "finished", "failed with 1",
    ]  # fmt: skip
    assert int(large["peak_bytes"]) > 2e8 > 2 * int(small["peak_bytes"]) > 1e7
    assert 0 < float(small["seconds"]) < 60
    assert large["command"] == "python -m large"


# What it took -------------------------------------------------------------------------------------

ROW = {"step": "hdc", "mode": "full", "command": "c"}


def test_the_rest_of_an_interrupted_step_adds_up(tmp_path):
    for seconds, status in (
        (40.0, "interrupted"),
        (30.0, "interrupted"),
        (5.0, "finished"),
    ):
        reproduce.note(
            tmp_path, {**ROW, "seconds": seconds, "peak_bytes": 7, "status": status}
        )
    (row,) = reproduce.read(tmp_path).values()
    assert (float(row["seconds"]), row["status"]) == (75, "finished")
