"""The reproduction goes on after failures, knows what is finished and writes down what it cost."""

import io
import json
import os
import subprocess
import sys
import time

import pytest
from hydra import compose, initialize_config_dir
from rich.console import Console

from experiments import reproduce, steps
from experiments.record import ROOT
from experiments.selection import CONFIGS
from experiments.steps import STEPS, Step

NOTHING = "json.tool --help"
FAILING = "json.tool /nowhere"


def step(name, full, stage="a", minutes=(1, 1), **more):
    return Step(name, stage, full, full, minutes, **more)


@pytest.fixture
def commands(monkeypatch):
    """The commands that were run; each is run in a moment, those on /nowhere fail."""
    made = []

    def run(command):
        made.append(" ".join(command))
        status = "failed with 1" if "/nowhere" in command else "finished"
        return {"seconds": 3.0, "peak_bytes": 1000, "status": status}

    monkeypatch.setattr(reproduce, "measured", run)
    return made


def console():
    return Console(file=io.StringIO(), width=120, highlight=False)


def test_it_goes_on_after_a_failure_and_reports_after_each_stage(tmp_path, commands):
    out = console()
    chosen = [step("one", NOTHING), step("two", FAILING), step("three", NOTHING, "b")]
    assert reproduce.run(chosen, False, tmp_path, out) == 1
    report = reproduce.REPORT
    assert commands == [NOTHING, FAILING, report, NOTHING, report]
    last = out.file.getvalue().splitlines()[-1]
    assert last == "failed: two: failed with 1"
    rows = reproduce.read(tmp_path)
    assert [row["status"] for row in rows.values()] == ["finished", "failed with 1", "finished"]
    assert reproduce.run(chosen[:1], False, tmp_path, console()) == 0


def test_an_interruption_ends_it_and_what_it_took_is_added_to_the_rest(tmp_path, monkeypatch):
    def interrupted(command):
        time.sleep(0.01)
        raise KeyboardInterrupt

    one = [step("one", NOTHING)]
    for times in (1, 2):
        with monkeypatch.context() as patch:
            patch.setattr(reproduce, "measured", interrupted)
            assert reproduce.run(one, True, tmp_path, console()) == 130
        (row,) = reproduce.read(tmp_path).values()
        assert row["status"] == "interrupted"
        taken = float(row["seconds"])
        assert taken >= times * 0.01
    rest = {"seconds": 3.0, "peak_bytes": 1000, "status": "finished"}
    monkeypatch.setattr(reproduce, "measured", lambda command: dict(rest))
    assert reproduce.run(one, True, tmp_path, console()) == 0
    row = reproduce.read(tmp_path)["one", "quick"]
    assert (row["status"], row["peak_bytes"]) == ("finished", "1000")
    assert float(row["seconds"]) == pytest.approx(3 + taken, rel=1e-4)


def test_seconds_memory_and_status_of_commands(tmp_path):
    (tmp_path / "large.py").write_text("held = bytearray(b'x' * 200_000_000)")
    code = (
        "import json; from experiments.reproduce import measured; "
        "print(json.dumps([measured([name]) for name in ('large', 'this', 'nowhere')]))"
    )
    # In a process of its own: a child's peak counts from what its parent holds.
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"},
    )  # fmt: skip
    large, small, failed = json.loads(done.stdout.splitlines()[-1])
    assert [row["status"] for row in (large, small, failed)] == [
        "finished", "finished", "failed with 1",
    ]  # fmt: skip
    assert large["peak_bytes"] > 2e8 > 2 * small["peak_bytes"] > 1e7
    assert 0 < small["seconds"] < 60


def test_a_resumed_step_keeps_the_time_of_the_whole(tmp_path):
    row = {"step": "hdc", "mode": "full", "command": "c", "status": "finished", "code": ""}
    for seconds, peak in ((100.0, 10), (2.0, 20)):
        reproduce.write(tmp_path, {**row, "seconds": seconds, "peak_bytes": peak})
    (found,) = reproduce.read(tmp_path).values()
    assert (float(found["seconds"]), int(found["peak_bytes"])) == (100, 20)
    for peak, changed in enumerate([{"command": "other"}, {"command": "other", "code": "new"}]):
        reproduce.write(tmp_path, {**row, **changed, "seconds": 2.0, "peak_bytes": 5 - peak})
        (found,) = reproduce.read(tmp_path).values()
        assert (float(found["seconds"]), int(found["peak_bytes"])) == (2, 5 - peak)


def test_runs_of_a_sweep_are_counted_by_what_they_computed(tmp_path, write_run):
    sweep = step("n", "experiments.run experiment=table1 stop=paper model=hdc,softmax seed.run=0,1",
                 minutes=(4, 1))  # fmt: skip
    write_run("hdc", curve=[{"training_s": 10.0}])
    write_run("hdc", seed=1, n_train=20)
    write_run("hdc", seed=1, pixels=100)
    write_run("softmax", stop="quick")
    write_run("softmax", seed=1, status="failed")
    found = steps.progress(sweep, False, steps.read_records(tmp_path))
    assert (found.runs, found.finished) == (4, 1)
    assert found.left_s == 3 * 60
    assert found.total_s - found.left_s == pytest.approx(16)


def test_a_measurement_counts_while_its_code_stands(tmp_path, monkeypatch, write_measurement):
    monkeypatch.setattr(steps, "CONFIGS", tmp_path)
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "stability.yaml").write_text("task: {_target_: a.b}")
    command = "experiments.run experiment=stability"
    one = step("stability", command)
    assert steps.progress(one, False, []).left_s == 60
    entry = write_measurement("stability", [{"a": 1}], seconds=7.0, command=f"python -m {command}")
    found = steps.progress(one, False, steps.read_records(tmp_path))
    assert (found.finished, found.total_s, found.left_s) == (1, 7, 0)
    quick = {**entry, "command": f"python -m {command} task.small=true"}
    assert steps.progress(one, False, [quick]).left_s == 7
    assert steps.progress(one, True, [quick]).left_s == 0
    entry["environment"]["sources"] = {"hdc/bits.py": "0" * 12}
    found = steps.progress(one, False, [entry])
    assert (found.finished, found.left_s) == (0, 7)


def test_a_step_without_records_is_finished_when_the_same_code_made_its_file(
    tmp_path, commands, monkeypatch
):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    one = step("check", "scenes.sensor.check", makes="made.csv")
    for _ in range(2):
        reproduce.run([one], False, tmp_path, console())
    assert commands.count("scenes.sensor.check") == 2  # there is no file
    (tmp_path / "made.csv").write_text("")
    reproduce.run([one], False, tmp_path, console())
    assert commands.count("scenes.sensor.check") == 2
    monkeypatch.setattr(steps, "code", lambda _: "changed since")
    reproduce.run([one], False, tmp_path, console())
    assert commands.count("scenes.sensor.check") == 3


def test_every_step_names_something_that_exists_and_a_quick_form_of_minutes():
    assert len({one.name for one in STEPS}) == len(STEPS)
    for one in STEPS:
        for quick in (False, True):
            words = one.command(quick)
            assert one.minutes[quick] > 0 or not words
            if not words:
                continue
            assert steps.progress(one, quick, []).runs > 0
            path = ROOT.joinpath(*words[0].split("."))
            assert words[0] == "pytest" or path.with_suffix(".py").is_file()
            for word in words[1:]:
                key, _, value = word.partition("=")
                if key == "experiment":
                    assert (CONFIGS / "experiment" / f"{value}.yaml").is_file()
                elif key in ("model", "stop", "scene"):
                    for name in value.split(","):
                        assert (CONFIGS / key / f"{name}.yaml").is_file()
    full, quick = (sum(one.minutes[k] for one in STEPS) for k in (False, True))
    assert full <= 4 * 60
    assert quick < 30


def test_every_command_composes():
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        for one in STEPS:
            for quick in (False, True):
                words = one.command(quick)
                if (
                    words[:1] == ["experiments.run"] and len(words) > 2
                ):  # there is more than the name of an experiment
                    # A sweep takes several values of a key, a config one of them.
                    firsts = [w if "[" in w else w.partition(",")[0] for w in words[1:]]
                    assert "model" in compose("config", overrides=firsts)


def test_the_list_runs_nothing(monkeypatch, capsys, commands, tmp_path):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    assert reproduce.main(["--list", "--quick"]) == 0
    assert not commands
    shown = capsys.readouterr().out
    assert "Quick reproduction: about" in shown
    assert all(one.name in shown for one in STEPS if one.quick)
    assert "benchmark" not in shown
