"""Own results become the reference: what is adopted, what is filled in, what may stand."""

import re
import shutil

import pytest

from experiments import reference, report
from experiments.records import steps
from experiments.records.files import ROOT
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


def test_finished_runs_are_adopted_and_what_was_there_stays(
    tmp_path, target, write_run
):
    write_run("hdc", wrong=[0])
    write_run("cnn1", status="failed")
    adopt(tmp_path, target)
    lines = (target / "runs.jsonl").read_text().splitlines()
    assert len(lines) == 1
    (tmp_path / "runs.jsonl").unlink()
    write_run("softmax")
    adopt(tmp_path, target)
    assert (target / "runs.jsonl").read_text().splitlines()[0] == lines[0]
    found = Results(target)
    assert found.problems == []
    assert sorted(run.model for run in found.runs) == ["hdc", "softmax"]
    assert found.groups.group("touch", "hdc").right.sum() == 99
    # The same run measured again takes the place of the one before.
    write_run("hdc", wrong=range(5))
    adopt(tmp_path, target)
    assert Results(target).groups.group("touch", "hdc").right.sum() == 95


def test_records_of_other_revisions_stay_until_they_are_replaced_or_dropped(
    tmp_path, target, write_run, write_measurement
):
    write_run("hdc", seed=1, made_by=OLD)
    write_run("hdc", seed=0, made_by=OLD)
    write_measurement("drift", [{"a": 1}], revisions=OLD)
    write_measurement("crossing", [{"a": 1}], revisions=OLD)
    shutil.move(tmp_path / "runs.jsonl", target / "runs.jsonl")
    shutil.move(tmp_path / "measured", target / "measured")
    again = write_run("hdc", seed=0)
    write_measurement("drift", [{"a": 2}])
    assert adopt(tmp_path, target) == Adopted(1, 1, 0)
    found = Results(target)
    assert sorted((run.record.seed, bool(run.outdated)) for run in found.runs) == [
        (0, False),
        (1, True),
    ]
    # A row of a table rests on one revision.
    assert [run.record.id for run in found.groups.group("touch", "hdc").runs] == [again]
    assert found.measured("drift").rows == [{"a": 2}]
    assert found.measured("crossing").outdated
    adopt(tmp_path, target, drop_older=True)
    assert {run.record.id for run in Results(target).runs} == {again}
    assert [m.record.name for m in Results(target).measurements] == ["drift"]


def a_step(folder, name, mode, status, *records):
    """What the runner leaves of a step that touched these records."""
    path = steps.place(folder, mode, name)
    begun = steps.begin(path)
    begun.write_text("".join(f"{record}\n" for record in records))
    if status == took.FINISHED:
        steps.finish(path)
    row = {"step": name, "mode": mode, "command": f"c {name}", "seconds": 1.0}
    took.note(folder, {**row, "peak_bytes": 1, "status": status, "commit": "c" * 40})


def test_a_step_enters_whole_or_not_at_all(
    tmp_path, target, write_run, write_measurement
):
    one, two, both = write_run("hdc"), write_run("softmax"), write_run("ridge")
    drift = write_measurement("drift", [{"a": 1}])["id"]
    a_step(tmp_path, "first", "full", "finished", one, both)
    a_step(tmp_path, "second", "full", "interrupted", two, both)
    a_step(tmp_path, "third", "quick", "finished", drift)
    assert adopt(tmp_path, target) == Adopted(2, 0, 2)
    assert {run.record.id for run in Results(target).runs} == {one, both}
    assert {row["step"] for row in took.read(target).values()} == {"first", "third"}
    a_step(tmp_path, "second", "full", "finished", two, both)
    a_step(tmp_path, "fourth", "full", "finished", drift)
    assert adopt(tmp_path, target) == Adopted(3, 1, 0)
    a_step(tmp_path, "drift", "full", "finished", drift)
    adopt(tmp_path, target, drop_older=True)  # and what is no step any more
    assert {row["step"] for row in took.read(target).values()} == {"drift"}


def test_a_finished_step_that_is_called_again_and_interrupted_enters_as_it_was(
    tmp_path, target, write_run
):
    one, two = write_run("hdc"), write_run("softmax")
    a_step(tmp_path, "first", "full", "finished", one)
    a_step(tmp_path, "first", "full", "interrupted", two)
    assert adopt(tmp_path, target) == Adopted(1, 0, 1)
    assert {run.record.id for run in Results(target).runs} == {one}
    assert [row["status"] for row in took.read(target).values()] == ["finished"]


def test_another_machine_goes_on_from_the_reference(
    tmp_path, target, write_run, write_measurement
):
    first = write_run("hdc")
    write_run("softmax", made_by=OLD)
    drift = write_measurement("drift", [{"a": 1}])["id"]
    write_measurement("crossing", [{"a": 1}], revisions=OLD)
    shutil.move(tmp_path / "runs.jsonl", target / "runs.jsonl")
    shutil.move(tmp_path / "measured", target / "measured")
    (target / "measured" / drift).rename(target / "measured" / "drift")
    a_step(target, "first", "full", "finished", first)
    own = tmp_path / "own"
    assert go_on_from(target, own) == 2
    assert go_on_from(target, own) == 0
    assert [run.record.id for run in Results(own).runs] == [first]
    assert [m.folder.name for m in Results(own).measurements] == [drift]
    assert [row["status"] for row in took.read(own).values()] == ["finished"]


@pytest.mark.parametrize(
    "environment",
    [{"dirty": True}, {"commit": None}, {"dirty": False, "changes": "a" * 12}],
    ids=str,
)
def test_what_is_of_no_commit_or_of_other_revisions_stays_outside(
    tmp_path, target, write_run, write_measurement, monkeypatch, environment
):
    monkeypatch.setattr("experiments.records.entry.changes", lambda: "a" * 12)
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
    adopt(tmp_path, target)
    found = Results(target)
    assert (found.runs, found.measurements) == ([], [])


def test_the_same_row_of_another_config_takes_the_place(tmp_path, target, write_run):
    before = write_run("hdc", change={"model.readout.seed": 3})
    adopt(tmp_path, target)
    (tmp_path / "runs.jsonl").unlink()
    again = write_run("hdc")
    adopt(tmp_path, target)
    assert before != again
    assert {run.record.id for run in Results(target).runs} == {again}


def test_measurements_are_adopted_but_those_of_own_recordings(
    tmp_path, target, write_measurement
):
    write_measurement("drift", [{"a": 1}])
    mine = {"_target_": "scenes.recorded.Recording", "path": "mine.npz"}
    write_measurement("correlation", [{"a": 1}], config={"scene": mine})
    old = target / "measured" / "drift"
    old.mkdir(parents=True)
    (old / "left over.png").write_text("")
    adopt(tmp_path, target)
    files = {path.relative_to(target / "measured").as_posix()
             for path in (target / "measured").rglob("*") if path.is_file()}  # fmt: skip
    assert files == {"drift/record.json", "drift/rows.jsonl"}
    assert Results(target).measured("drift").rows == [{"a": 1}]


def test_records_of_other_revisions_are_named(target, tmp_path, write_run, capsys):
    reference.README.write_text("")
    write_run("hdc", made_by=OLD)
    shutil.move(tmp_path / "runs.jsonl", target / "runs.jsonl")
    assert reference.main(["--tables"]) == 1
    said = capsys.readouterr().out
    assert "experiments (revision 0, now 1): 1 records are of another" in said


def test_it_adopts_writes_the_tables_and_fills_the_readme(target, tmp_path, write_run):
    reference.README.write_text(
        "# A title\n<!-- begin table1 -->\nold\n<!-- end table1 -->\nend\n"
    )
    write_run("hdc", wrong=range(2))
    assert reference.main([]) == 0
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
    assert len(files) > 100
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
    assert all(blocks[name].startswith("*missing: ") for name in parts)


def test_every_part_that_fills_the_docs_stands_in_one_of_them(target):
    pages = [path.read_text("utf-8") for path in (ROOT / "docs").glob("*.md")]
    answers = report.Answers("reference", Results(target), [])
    for name in reference.docs_parts(answers):
        assert sum(f"<!-- begin {name} -->" in page for page in pages) == 1, name


def test_parts_of_the_docs_are_filled_too(target, write_run, tmp_path):
    reference.README.write_text("")
    reference.DOCS.mkdir()
    page = reference.DOCS / "gallery.md"
    page.write_text("# Gallery\n<!-- begin gallery -->\n<!-- end gallery -->\n")
    write_run("hdc", wrong=range(2))
    assert reference.main([]) == 0
    text = page.read_text()
    assert "/figures/" in text
    assert "    python -m experiments." in text
