"""Own results become the reference: what is adopted, what is filled in, what may stand."""

import re
import shutil

import pytest

import experiments
from experiments import reference, report
from experiments.records import record, store
from experiments.records.files import ROOT
from experiments.records.groups import Groups
from experiments.records.results import Results
from experiments.reporting import documents
from experiments.reproduction import took
from experiments.reproduction.adopt import Adopted, adopt, go_on_from

OLD = {"experiments": 0}  # revisions of an earlier protocol


@pytest.fixture
def target(tmp_path, monkeypatch):
    """A reference of its own, and a README; own results lie in tmp_path."""
    folder = tmp_path / "reference"
    folder.mkdir()
    monkeypatch.setattr(reference, "REFERENCE", folder)
    monkeypatch.setattr(reference, "README", tmp_path / "README.md")
    monkeypatch.setattr(reference, "DOCS", tmp_path / "docs")
    monkeypatch.setattr(reference.report, "REFERENCE", folder)
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    return folder


# What is adopted ----------------------------------------------------------------------------------

STEPS = ("table1", "cnn3", "drift")  # three of configs/reproduce.yaml


def a_step(folder, name, status="finished", mode="full", commit="c" * 40):
    """What the runner notes of a call of a step."""
    row = {"step": name, "mode": mode, "command": f"python -m c {name}", "lanes": 1}
    row |= {"seconds": 1.0, "peak_bytes": 1, "status": status, "commit": commit}
    took.end(folder, row, took.begin(folder, row))


@pytest.fixture
def in_step(monkeypatch):
    """in_step(name, mode) → records that are written next are of this step."""
    return lambda name, mode="full": monkeypatch.setenv(record.STEP, f"{mode}/{name}")


def models_of(folder):
    return sorted(run.model_label for run in Results(folder).runs)


def test_a_finished_step_takes_the_place_of_what_there_was_of_it(
    tmp_path, target, write_run, in_step
):
    in_step("table1")
    write_run("hdc", wrong=[0])
    before = write_run("softmax", change={"model.lr": 0.5})
    write_run("cnn1", status="failed")
    a_step(tmp_path, "table1")
    assert adopt(tmp_path, target) == Adopted(2, 0, 0)
    in_step("cnn3")
    write_run("cnn3")
    a_step(tmp_path, "cnn3")
    assert adopt(tmp_path, target) == Adopted(3, 0, 0)
    # The same step of another config, measured elsewhere.
    (tmp_path / "records.jsonl").unlink()
    (tmp_path / took.FILE).unlink()
    in_step("table1")
    write_run("hdc", wrong=range(5))
    write_run("softmax")
    a_step(tmp_path, "table1")
    assert adopt(tmp_path, target) == Adopted(2, 1, 0)
    found = Results(target)
    assert found.problems == []
    assert models_of(target) == ["cnn3", "hdc", "softmax"]
    assert Groups(found.runs).group("touch", "hdc").right.sum() == 95
    assert before not in {run.id for run in found.runs}


def test_older_revisions_stay_until_their_step_is_taken_over(
    tmp_path, target, write_run, write_measurement, in_step
):
    in_step("table1")
    write_run("hdc", seed=1, made_by=OLD)
    write_run("hdc", seed=0, made_by=OLD)
    in_step("drift")
    write_measurement("drift", [{"a": 1}], revisions=OLD)
    in_step("a step that is no more")
    write_measurement("crossing", [{"a": 1}], revisions=OLD)
    shutil.move(tmp_path / "records.jsonl", target / "records.jsonl")
    in_step("table1")
    again = write_run("hdc", seed=0)
    a_step(tmp_path, "table1")
    assert adopt(tmp_path, target) == Adopted(1, 2, 0)
    found = Results(target)
    assert [run.id for run in found.runs] == [again]
    assert [(m.name, bool(m.outdated)) for m in found.measurements] == [("drift", True)]


def test_a_step_enters_whole_or_not_at_all(
    tmp_path, target, write_run, write_measurement, in_step
):
    first, second, third = STEPS
    in_step(first)
    write_run("hdc")
    in_step(second)
    write_run("softmax")
    a_step(tmp_path, first)
    a_step(tmp_path, second, "interrupted")
    in_step(third, "quick")
    drift = write_measurement("drift", [{"a": 1}])
    a_step(tmp_path, third, mode="quick")
    assert adopt(tmp_path, target) == Adopted(1, 0, 2)
    assert models_of(target) == ["hdc"]
    assert {row["step"] for row in took.read(target).values()} == {first, third}
    a_step(tmp_path, second)
    in_step(third)  # which finds what quick made
    found = store.made_before(tmp_path, drift["id"])
    assert found.steps == ["quick/drift", "full/drift"]
    a_step(tmp_path, third)
    assert adopt(tmp_path, target) == Adopted(3, 0, 0)
    assert Results(target).measurements[0].steps == ["full/drift"]


def test_a_step_that_other_code_began_again_and_that_broke_off_stays_outside(
    tmp_path, target, write_run, in_step
):
    in_step("table1")
    write_run("hdc")
    a_step(tmp_path, "table1")
    a_step(tmp_path, "table1", "interrupted")
    assert adopt(tmp_path, target) == Adopted(1, 0, 0)  # the same commit found it done
    write_run("softmax")
    a_step(tmp_path, "table1", "interrupted", commit="d" * 40)
    assert adopt(tmp_path, target) == Adopted(0, 0, 2)
    assert models_of(target) == ["hdc"]


@pytest.mark.parametrize(
    "refused", [{"environment": {"dirty": True}}, {"made_by": OLD}], ids=str
)
def test_a_step_of_which_nothing_may_enter_leaves_the_reference_as_it_is(
    tmp_path, target, write_run, in_step, refused
):
    in_step("table1")
    write_run("hdc", wrong=[0])
    a_step(tmp_path, "table1")
    adopt(tmp_path, target)
    before = (target / "records.jsonl").read_bytes()
    times = took.read(target)
    write_run("hdc", wrong=range(9), **refused)
    a_step(tmp_path, "table1", commit="d" * 40)
    assert adopt(tmp_path, target) == Adopted(0, 0, 1)
    assert (target / "records.jsonl").read_bytes() == before
    assert took.read(target) == times


def test_a_record_of_two_steps_stays_until_both_are_taken_over_without_it(
    tmp_path, target, write_run, in_step
):
    first, second, _ = STEPS
    in_step(first)
    shared = write_run("hdc")
    a_step(tmp_path, first)
    in_step(second)  # which finds it finished
    store.made_before(tmp_path, shared)
    a_step(tmp_path, second)
    adopt(tmp_path, target)
    # Elsewhere the first step alone is called: it makes the record again, then another one.
    for model in ("hdc", "softmax"):
        (tmp_path / "records.jsonl").unlink()
        (tmp_path / took.FILE).unlink()
        in_step(first)
        write_run(model)
        a_step(tmp_path, first)
        assert adopt(tmp_path, target).left == 0
    (kept,) = (run for run in Results(target).runs if run.id == shared)
    assert kept.steps == [f"full/{second}"]
    (tmp_path / "records.jsonl").unlink()
    a_step(tmp_path, second)  # whose records were lost: it takes nothing away
    assert adopt(tmp_path, target).left == 0


def test_what_was_started_by_hand_stays_outside(tmp_path, target, write_run):
    write_run("hdc")
    a_step(tmp_path, "table1")
    assert adopt(tmp_path, target) == Adopted(0, 0, 1)


def test_another_machine_goes_on_from_the_reference(
    tmp_path, target, write_run, write_measurement, in_step
):
    in_step("table1")
    first = write_run("hdc")
    write_run("softmax", made_by=OLD)
    drift = write_measurement("drift", [{"a": 1}])["id"]
    write_measurement("crossing", [{"a": 1}], revisions=OLD)
    shutil.move(tmp_path / "records.jsonl", target / "records.jsonl")
    a_step(target, "table1")
    own = tmp_path / "own"
    assert go_on_from(target, own) == 2
    assert go_on_from(target, own) == 0
    assert [run.id for run in Results(own).runs] == [first]
    assert [m.id for m in Results(own).measurements] == [drift]
    assert [row["status"] for row in took.read(own).values()] == ["finished"]


@pytest.mark.parametrize(
    "environment",
    [{"dirty": True}, {"commit": None}, {"dirty": False, "changes": "a" * 12}],
    ids=str,
)
def test_what_is_of_no_commit_or_of_other_revisions_stays_outside(
    tmp_path, target, write_run, write_measurement, monkeypatch, environment, in_step
):
    monkeypatch.setattr("experiments.records.record.changes", lambda: "a" * 12)
    in_step("table1")
    write_run("hdc", environment=environment)
    write_run("softmax", made_by=OLD)
    made_by = {
        "cpu": "A CPU",
        "threads": 2,
        "commit": "c",
        "dirty": False,
    } | environment
    write_measurement("drift", [{"a": 1}], environment=made_by)
    write_measurement("crossing", [{"a": 1}], revisions=OLD)
    a_step(tmp_path, "table1")
    assert adopt(tmp_path, target) == Adopted(0, 0, 4)
    assert not Results(target)


def test_records_of_older_code_and_their_tables_are_named(
    target, tmp_path, write_run, write_measurement, capsys
):
    reference.README.write_text("")
    write_run("hdc", made_by=OLD)
    row = {"input": "a", "method": "m", "number": "mixed", "verdict": "holds"}
    numbers = {"error": 1e-3, "tolerance": 1e-2, "time_s": 0.1}
    write_measurement("numerics", [row | numbers])
    shutil.move(tmp_path / "records.jsonl", target / "records.jsonl")
    assert reference.main(["--tables"]) == 1
    said = capsys.readouterr().out
    assert (
        f"experiments (revision 0, now {experiments.REVISION}): 1 records are of another"
        in said
    )
    (line,) = (x for x in said.splitlines() if x.startswith("tables with records of"))
    assert "table1" in line
    assert "numerics" not in line


def test_it_adopts_writes_the_tables_and_fills_readme_and_docs(
    target, tmp_path, write_run, in_step
):
    in_step("table1")
    a_step(tmp_path, "table1")
    reference.README.write_text(
        "# A title\n<!-- begin table1 -->\nold\n<!-- end table1 -->\nend\n"
    )
    reference.DOCS.mkdir()
    page = reference.DOCS / "results.md"
    page.write_text("# Results\n<!-- begin results -->\n<!-- end results -->\n")
    write_run("hdc", wrong=range(2))
    assert reference.main([]) == 0
    assert "/figures/" in page.read_text()
    assert "    python -m experiments." in page.read_text()
    lines = (target / "tables" / "table1.md").read_text().splitlines()
    table = "\n".join(line for line in lines if line.startswith("|"))
    assert "98 [93" in table
    assert reference.README.read_text() == (
        f"# A title\n<!-- begin table1 -->\n{table}\n<!-- end table1 -->\nend\n"
    )
    before = {path: path.read_bytes() for path in target.rglob("*") if path.is_file()}
    assert reference.main(["--tables"]) == 0
    assert {
        path: path.read_bytes() for path in target.rglob("*") if path.is_file()
    } == before


def test_the_committed_reference_skipped_nothing_and_names_no_folder_of_a_machine():
    files = [
        path for path in (ROOT / "results" / "reference").rglob("*") if path.is_file()
    ]
    assert len(files) > 50
    for path in files:
        found = re.search(
            rb"skipped: |(?<![\w.])/(?:home|root|tmp|Users)/", path.read_bytes()
        )
        assert found is None, (path, found)


# README.md ----------------------------------------------------------------------------------------


def test_every_part_that_fills_the_readme_stands_there_and_says_what_is_missing(target):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    answers = report.Answers("reference", Results(target), [])
    parts = reference.readme_parts(answers)
    filled = documents.fill(text, parts)
    blocks = dict(re.findall(r"<!-- begin (\w+) -->\n(.*)\n<!-- end \1 -->", filled))
    assert set(blocks) >= set(parts)
    assert all(blocks[name] == "*not measured yet*" for name in parts)


def test_every_part_that_fills_the_docs_stands_in_one_of_them(target):
    pages = [path.read_text("utf-8") for path in (ROOT / "docs").glob("*.md")]
    answers = report.Answers("reference", Results(target), [])
    for name in reference.docs_parts(answers):
        assert sum(f"<!-- begin {name} -->" in page for page in pages) == 1, name
