"""The reproduction goes on after failures, kills and second calls; no step is done twice."""

import io
import multiprocessing
import os
import signal
import sys

import pytest
from rich.console import Console

from experiments import reproduce
from experiments.records import locks
from experiments.records.configs import CONFIGS
from experiments.records.files import REFERENCE, ROOT
from experiments.reproduction import make
from experiments.reproduction.steps import Step, claims, cost_text, steps
from tests.experiments.composed import tree
from tests.experiments.helpers import until

# A step: it notes its name, and after a while its name with a minus.
WORK = """
import pathlib, sys, time
name, seconds, status = sys.argv[1:]
def note(text):
    with pathlib.Path("{folder}", "noted").open("a") as file:
        file.write(f"{{text}}\\n")
note(name)
time.sleep(float(seconds))
note(f"-{{name}}")
sys.exit(int(status))
"""


@pytest.fixture
def step(tmp_path, monkeypatch):
    """step(name, seconds=0, status=0, **attributes) → one that notes that it ran."""
    (tmp_path / "a_step_of_work.py").write_text(WORK.format(folder=tmp_path))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{ROOT}")
    monkeypatch.setattr(make, "digest_of_code", lambda: "of this code")

    def made(name, seconds=0, status=0, **attributes):
        words = ("a_step_of_work", name, str(seconds), str(status))
        return Step(name, words, 1, **attributes)

    return made


def console():
    return Console(file=io.StringIO(), width=120, highlight=False)


def noted(folder):
    path = folder / "noted"
    return path.read_text().split() if path.exists() else []


def done(folder):
    return [word[1:] for word in noted(folder) if word.startswith("-")]


# The list -----------------------------------------------------------------------------------------


def test_every_step_names_something_that_exists_and_composes():
    calls = set()
    for mode in ("full", "quick"):
        found = steps(mode)
        assert len({step.name for step in found}) == len(found)
        assert all(step.minutes > 0 for step in found)
        calls |= {step.words for step in found}
    for module, *words in calls:
        path = ROOT.joinpath(*module.split(".")).with_suffix(".py")
        assert module == "pytest" or path.is_file()
        if module == "experiments.run":
            # A sweep takes several values of a key, a config one of them.
            firsts = [w if "[" in w else w.partition(",")[0] for w in words]
            assert "model" in tree(*(w for w in firsts if w != "-m")), words


def test_every_experiment_is_reproduced():
    there = {path.stem for path in (CONFIGS / "experiment").glob("*.yaml")}
    there.remove("validation")  # of a user's search
    words = {word for step in steps() for word in step.words}
    assert {f"experiment={name}" for name in there} <= words


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--claim", "accurcy"], "invalid choice: 'accurcy' (choose from 'softmax', "),
        (["--claim", "accuracy"], "nothing is measured: skipped"),
        (["--claim", "networks_three_layers", "--quick"], "no step is quick"),
    ],
)
def test_what_cannot_be_run_is_refused_in_one_line(
    words, said, capsys, tmp_path, monkeypatch
):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "mine"))
    monkeypatch.setenv("COLUMNS", "500")
    monkeypatch.delenv("MEASURED_DATA", raising=False)
    try:
        status = reproduce.main(words)
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert said in "".join(capsys.readouterr())
    assert not (tmp_path / "mine").exists()


def test_a_list_counts_the_time_of_what_can_run_here(capsys, monkeypatch):
    monkeypatch.delenv("MEASURED_DATA", raising=False)
    assert reproduce.main(["--list"]) == 0
    first, *_, last = capsys.readouterr().out.splitlines()
    here = [step for step in steps() if step.needs is None]
    assert first.startswith(f"{len(here)} of {len(steps())} steps can run here, ")
    assert f"about {cost_text(here)} from nothing" in first
    assert cost_text(here) != cost_text(steps())
    assert all(name in last for name in claims())


def test_a_claim_ends_with_its_verdicts_by_rules_4(capsys, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(REFERENCE))
    monkeypatch.setattr(make, "run", lambda *_: 0)
    assert reproduce.main(["--claim", "softmax"]) == 0
    _, title, lines = capsys.readouterr().out.partition("Verdicts by rules 4")
    assert title
    assert "does not hold" in " ".join(lines.split())
    assert "softmax" in lines
    assert "accuracy" not in lines.partition("Points:")[0]


# Running it ---------------------------------------------------------------------------------------


def test_it_goes_on_after_a_failure_and_the_same_call_tries_it_again(
    step, tmp_path, capfd
):
    found = [step("one"), step("two", status=3), step("three", needs="SOME_DATA")]
    found.append(step("four"))
    out = console()
    assert make.run(found, "full", tmp_path, out) == 1
    assert done(tmp_path) == ["one", "two", "four"]
    said = out.file.getvalue()
    assert "SOME_DATA" in said
    assert "failed: two" in said.splitlines()[-1]
    assert "2 of 3: two" in capfd.readouterr().out
    assert make.run(found, "full", tmp_path, console()) == 1
    assert done(tmp_path) == ["one", "two", "four", "two"]


def test_other_code_and_the_other_mode_begin_anew(step, tmp_path, monkeypatch):
    for _ in range(2):
        make.run([step("one")], "full", tmp_path, console())
    assert done(tmp_path) == ["one"]
    make.run([step("one")], "quick", tmp_path, console())
    monkeypatch.setattr(make, "digest_of_code", lambda: "of other code")
    make.run([step("one")], "full", tmp_path, console())
    assert done(tmp_path) == ["one"] * 3


def test_timed_steps_run_first_and_alone_the_others_side_by_side(step, tmp_path):
    untimed = [step(name, 1, timed=False) for name in "ab"]
    timed = [step(name, 0.2) for name in "cd"]
    assert make.run([*untimed, *timed], "full", tmp_path, console()) == 0
    order = noted(tmp_path)
    assert order[:4] == ["c", "-c", "d", "-d"]
    assert {*order[4:6]} == {"a", "b"}
    for name in "ab":
        stamp = make.folder_of_stamps(tmp_path, "full") / name
        assert 1 <= int(stamp.read_text()) <= 30  # seconds


def call(folder, *found):
    """A process, the first of its group, that carries out steps and can be interrupted."""

    def carry_out():
        os.setsid()
        # A job in the background, which these tests may be, ignores an interrupt.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.exit(make.run(found, "full", folder, console()))

    process = multiprocessing.get_context("fork").Process(target=carry_out)
    process.start()
    return process


def test_a_kill_in_the_middle_loses_one_step(step, tmp_path):
    names = ("one", "two", "three")
    process = call(tmp_path, *(step(name, 2) for name in names))
    until(lambda: "two" in noted(tmp_path))
    os.killpg(process.pid, signal.SIGKILL)
    process.join(60)
    assert done(tmp_path) == ["one"]
    assert make.run(list(map(step, names)), "full", tmp_path, console()) == 0
    assert done(tmp_path) == ["one", "two", "three"]


def test_a_second_call_at_once_leaves_it_to_the_first(step, tmp_path):
    first = call(tmp_path, step("one", 4))
    until(lambda: "one" in noted(tmp_path))
    with pytest.raises(locks.Held):
        make.run([step("one")], "full", tmp_path, console())
    first.join(60)
    assert first.exitcode == 0
    assert done(tmp_path) == ["one"]


def test_an_end_by_signal_ends_the_steps(step, tmp_path):
    process = call(tmp_path, step("one", 30), step("two"))
    until(lambda: "one" in noted(tmp_path))
    os.killpg(process.pid, signal.SIGINT)
    process.join(60)
    assert process.exitcode == 128 + signal.SIGINT
    assert done(tmp_path) == []


def test_code_and_configs_have_a_digest(tmp_path, monkeypatch):
    for name in ("hdc/a.py", "configs/b.yaml"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text("x: 1")
    monkeypatch.setattr(make, "ROOT", tmp_path)
    before = make.digest_of_code()
    (tmp_path / "configs" / "b.yaml").write_text("x: 2")
    assert make.digest_of_code() != before
