"""The reproduction goes on after failures and interruptions and writes down what each step took."""

import io
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import threading
import time

import pandas as pd
import pytest
from hydra import compose, initialize_config_dir
from rich.console import Console

from experiments import reproduce
from experiments.records.configs import CONFIGS
from experiments.records.files import ROOT
from experiments.reporting.table import Table
from experiments.reproduction import calls, claim, took
from experiments.reproduction.steps import WHAT, Step, claims, cost, steps
from experiments.studies.claims import frozen

NOTHING, FAILING = ("json.tool", "--help"), ("json.tool", "/nowhere")


@pytest.fixture
def commands(monkeypatch):
    """The commands that were run; each is run in a moment, those on /nowhere fail."""
    made = []

    def run(step, mode, results, lanes, processes):
        made.append(step.name)
        return "failed with 1" if "/nowhere" in step.words else "finished"

    monkeypatch.setattr(calls, "carry_out", run)
    return made


def console():
    return Console(file=io.StringIO(), width=120, highlight=False)


# The list -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", WHAT)
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


@pytest.mark.parametrize("mode", WHAT)
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
    assert calls.run(found, "full", tmp_path, shown) == 0
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
    assert calls.run(chosen, "full", tmp_path, out) == 1
    assert commands == ["one", "two", "three"]
    assert "failed: two" in out.file.getvalue().splitlines()[-1]
    assert calls.run(chosen[:1], "full", tmp_path, console()) == 0


def test_seconds_memory_and_status_of_commands(tmp_path):
    (tmp_path / "large.py").write_text("held = bytearray(b'x' * 600_000_000)")
    code = (
        "from pathlib import Path; from experiments.reproduction.calls import Step, carry_out\n"
        "for name in ('large', 'this', 'nowhere'):\n"
        f"    carry_out(Step(name, (name,), 1), 'full', Path({str(tmp_path)!r}))"
    )
    # In a process of its own: a child's peak counts from what its parent holds.
    subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, check=True,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"},
    )  # fmt: skip
    large, small, failed = (took.read(tmp_path)[name, "full"]
                            for name in ("large", "this", "nowhere"))  # fmt: skip
    assert [row["status"] for row in (large, small, failed)] == [
        "finished", "finished", "failed with 1",
    ]  # fmt: skip
    assert int(large["peak_bytes"]) > 6e8 > 2 * int(small["peak_bytes"]) > 1e7
    assert 0 < float(small["seconds"]) < 60
    assert large["command"] == "python -m large"


# What it took -------------------------------------------------------------------------------------

ROW = {"step": "hdc", "mode": "full", "command": "c", "commit": "a"}


def noted(folder, *calls, **more):
    for seconds, status in calls:
        row = {**ROW, "seconds": seconds, "peak_bytes": 7, "status": status, **more}
        took.end(folder, row, took.begin(folder, row))
    (row,) = took.read(folder).values()
    return float(row["seconds"]), row["status"]


@pytest.mark.parametrize(
    ("calls", "expected"),
    [
        (["40 interrupted", "30 interrupted", "5 finished"], (75, "finished")),
        (["40 failed with 1", "30 finished"], (70, "finished")),
        (["40 finished", "1 finished"], (40, "finished")),
        (["40 finished", "1 interrupted"], (40, "finished")),
        (["40 finished", "1 failed with 2"], (40, "finished")),
    ],
    ids=str,
)
def test_calls_of_a_step_add_up_until_it_is_finished(tmp_path, calls, expected):
    pairs = [call.split(" ", 1) for call in calls]
    assert noted(tmp_path, *((float(s), status) for s, status in pairs)) == expected


def test_another_command_of_a_step_begins_anew(tmp_path):
    noted(tmp_path, (40.0, "interrupted"))
    assert noted(tmp_path, (5.0, "finished"), command="d") == (5, "finished")


def test_a_call_that_is_killed_is_one_that_broke_off(tmp_path):
    noted(tmp_path, (40.0, "finished"))
    row = {**ROW, "seconds": 0.0, "peak_bytes": 0, "status": "interrupted"}
    for commit, status in (("a", "finished"), ("b", "interrupted")):
        took.begin(tmp_path, {**row, "commit": commit})
        (found,) = took.read(tmp_path).values()
        assert (found["seconds"], found["status"]) == (40, status)
        assert found["peak_bytes"] == 7  # what earlier calls needed is not forgotten


def note_steps(folder, steps):
    for step in steps:
        row = {
            **ROW,
            "step": step,
            "seconds": 1.0,
            "peak_bytes": 7,
            "status": "finished",
        }
        took.end(folder, row, took.begin(folder, row))


def test_two_processes_lose_no_row_of_each_other(tmp_path):
    """Two processes that noted 25 steps each kept 33 rows."""
    context = multiprocessing.get_context("fork")
    both = [
        context.Process(
            target=note_steps, args=(tmp_path, [f"{name}{k}" for k in range(25)])
        )
        for name in "ab"
    ]
    for process in both:
        process.start()
    for process in both:
        process.join(60)
        assert process.exitcode == 0
    rows = took.read(tmp_path)
    assert len(rows) == 50
    assert {row["status"] for row in rows.values()} == {"finished"}


# Two at a time ------------------------------------------------------------------------------------


def test_steps_that_time_nothing_run_two_at_a_time_with_one_thread(
    tmp_path, monkeypatch
):
    (tmp_path / "meeting.py").write_text(
        "import os, sys, time\n"
        "from pathlib import Path\n"
        "me, other = sys.argv[1:3]\n"
        "Path(me).touch()\n"
        "limit = time.monotonic() + 20\n"
        "while not Path(other).exists():\n"
        "    assert time.monotonic() < limit\n"
        "    time.sleep(0.01)\n"
        "assert os.environ['OMP_NUM_THREADS'] == '1'\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    places = [str(tmp_path / name) for name in ("a", "b")]
    chosen = [
        Step("one", ("meeting", *places), 1, timed=False),
        Step("two", ("meeting", *places[::-1]), 1, timed=False),
    ]
    assert calls.run(chosen, "full", tmp_path, console()) == 0
    rows = took.read(tmp_path).values()
    assert [row["lanes"] for row in rows] == [2, 2]
    assert sum(map(took.wall_seconds, rows)) < 20


def test_timed_steps_have_the_machine_alone(tmp_path, monkeypatch):
    together, running = {}, set()
    lock = threading.Lock()

    def call(step, mode, results, lanes, processes):
        with lock:
            running.add(step.name)
        time.sleep(0.05)
        with lock:
            together[step.name] = set(running)
            running.remove(step.name)
        return "finished"

    monkeypatch.setattr(calls, "carry_out", call)
    found = [Step(str(k), NOTHING, 1, timed=k in (2, 5)) for k in range(7)]
    assert calls.run(found, "full", tmp_path, console()) == 0
    assert together["2"] == {"2"}
    assert together["5"] == {"5"}
    assert {"0", "1"} <= together["0"] | together["1"]
    assert max(map(len, together.values())) == 2


def test_after_the_running_commands_were_ended_none_begins():
    processes = calls.Processes()
    waiting = [sys.executable, "-c", "import time; time.sleep(60)"]
    process = processes.start(waiting, os.environ)
    processes.end()
    assert process.wait(20) == -signal.SIGTERM
    with pytest.raises(KeyboardInterrupt):
        processes.start(waiting, os.environ)


def test_a_run_that_times_nothing_has_one_thread_and_does_not_wait():
    step = Step("one", ("experiments.run", "-m", "threads=1"), 1, timed=False)
    assert step.command == "python -m experiments.run -m threads=1 exclusive=false"
    assert Step("one", ("experiments.run",), 1).command == "python -m experiments.run"


# Claims -------------------------------------------------------------------------------------------


def test_every_claim_has_steps_and_every_step_serves_claims_that_there_are():
    assert set(claims()) == set(frozen.rules().claims)
    for name in set(claims()) - {
        "networks_one_layer",
        "networks_three_layers",
    }:  # too long
        assert steps("quick", name), name
        assert cost(steps("quick", name)) < reproduce.ASKS


@pytest.mark.parametrize(
    ("data", "expected"),
    [(True, ["correlation", "fibre_correlation"]), (False, ["correlation"])],
    ids=["with data", "without"],
)
def test_a_claim_runs_its_steps_that_can_run_and_no_others_and_shows_its_rule(
    commands, tmp_path, monkeypatch, capsys, data, expected
):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    monkeypatch.setenv("MEASURED_DATA", str(tmp_path) if data else "")
    assert reproduce.main(["--claim", "contrast"]) == 0
    assert sorted(commands) == expected
    said = capsys.readouterr().out
    assert "Prototypes sharpen the contrast" in said
    assert "rule sharper" in said
    assert "no evidence of it yet" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--claim", "nothing"], "expected one of softmax, "),
        (["--claim", "softmax"], "add --full, or --quick"),
        (["--claim", "networks_three_layers", "--quick"], "no step for --quick"),
        # Without the public recordings it did nothing, and ended as if all were well.
        (
            ["--claim", "accuracy", "--quick"],
            "error: nothing is measured: every step is skipped: .* MEASURED_DATA .*scenes.measured",
        ),
        (["--step", "nothing"], "expected one of .*; found nothing"),
    ],
    ids=str,
)
def test_what_cannot_or_may_not_begin_is_refused_in_one_line(
    commands, capsys, tmp_path, monkeypatch, words, said
):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    monkeypatch.delenv("MEASURED_DATA", raising=False)
    monkeypatch.setattr(reproduce, "ASKS", 10)
    assert reproduce.main(words) == 2
    assert re.search(said, capsys.readouterr().out.splitlines()[-1])
    assert commands == []


def test_a_long_claim_that_was_asked_for_in_full_begins(
    commands, tmp_path, monkeypatch
):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    monkeypatch.setenv("MEASURED_DATA", str(tmp_path))
    monkeypatch.setattr(reproduce, "ASKS", 10)
    assert reproduce.main(["--claim", "softmax", "--full"]) == 0
    assert set(commands) == {step.name for step in steps("full", "softmax")}


def test_own_numbers_of_a_claim_stand_beside_the_reference(
    tmp_path, write_measurement, monkeypatch
):
    shown = console()
    reference = tmp_path / "reference"
    reference.mkdir()
    monkeypatch.setattr(claim, "REFERENCE", reference)
    tables = {
        tmp_path: [("one", 0.1, "yes")],
        reference: [("one", 0.2, "yes"), ("two", 0.3, "no")],
    }

    def made(folder):
        rows = [
            {"claim": "contrast", "evidence": name, "value": value, "value_low": value,
             "value_high": value, "word": word}
            for name, value, word in tables[folder]
        ]  # fmt: skip
        yield (
            "some",
            Table("some", data=pd.DataFrame(rows), key=("claim", "evidence")),
        )

    monkeypatch.setattr(claim, "_tables", made)
    claim.show("contrast", tmp_path, shown)
    said = shown.file.getvalue()
    (row,) = (line for line in said.splitlines() if line.strip().startswith("one"))
    numbers = "0.100 [0.100, 0.100] 0.200 [0.200, 0.200]"
    assert " ".join(row.split()) == f"one {numbers} yes yes"
    assert "not measured here, in the reference: two" in said
