"""Own results become the reference: what is adopted, what is filled in, what may stand."""

import re
import shutil

import pytest

import experiments
from experiments import reference, studies
from experiments.records import store
from experiments.records.files import ROOT
from experiments.records.results import RUNS, Results
from experiments.reporting import documents
from experiments.reporting.answers import Answers
from experiments.reporting.study import studies as studies_of

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
    reference.README.write_text("")
    return folder


def models_of(folder):
    return sorted(run.model.label for run in Results(folder).runs)


# What is adopted ----------------------------------------------------------------------------------


def test_a_record_takes_the_place_of_that_of_its_name_and_others_stay(
    tmp_path, target, write_run, write_measurement
):
    write_run("hdc", wrong=[0])
    write_run("ridge", made_by=OLD)
    shutil.move(tmp_path / store.FILE, target / store.FILE)
    write_run("hdc", wrong=range(5))
    write_run("softmax")
    write_run("cnn1", status="failed")
    write_measurement("drift", [{"a": 1}])
    assert reference.adopt(tmp_path, target) == (3, 0)
    assert models_of(target) == ["hdc", "ridge", "softmax"]
    lines = Results(target).frame(RUNS).set_index("model")
    assert lines.right["hdc"] == 95
    assert [measured.experiment for measured in Results(target).measurements] == [
        "drift"
    ]
    before = (target / store.FILE).read_bytes()
    assert reference.adopt(tmp_path, target) == (3, 0)
    assert (target / store.FILE).read_bytes() == before


@pytest.mark.parametrize(
    "about",
    [
        {"environment": {"commit": None}},
        {"environment": {"changes": "a" * 12}},
        {"made_by": OLD},
    ],
    ids=str,
)
def test_what_is_of_no_commit_or_of_other_revisions_stays_outside(
    tmp_path, target, write_run, monkeypatch, about
):
    monkeypatch.setattr("experiments.records.record.changes", lambda: "a" * 12)
    write_run("hdc", **about)
    assert reference.adopt(tmp_path, target) == (0, 1)
    assert not Results(target)


# What is filled in --------------------------------------------------------------------------------


def test_code_of_which_records_have_another_revision_is_named(
    target, tmp_path, write_run, capsys
):
    write_run("hdc", made_by=OLD)
    shutil.move(tmp_path / store.FILE, target / store.FILE)
    assert reference.main(["--tables"]) == 1
    said = capsys.readouterr().out
    now = f"experiments (revision 0, now {experiments.REVISION})"
    assert f"{now}: 1 records are of another" in said


def test_it_adopts_writes_the_tables_and_fills_readme_and_docs(target, write_run):
    begin, end = "# A title\n<!-- begin table1 -->\n", "\n<!-- end table1 -->\nend\n"
    reference.README.write_text(f"{begin}old{end}")
    write_run("hdc", wrong=range(2))
    assert reference.main([]) == 0
    assert ",0.98," in (target / "tables" / "table1.csv").read_text()
    filled = reference.README.read_text()
    assert filled.startswith(f"{begin}| Model | Seeds |")
    assert filled.endswith(f" | ×1, 100 |{end}")

    def files():
        return {path: path.read_bytes() for path in target.rglob("*") if path.is_file()}

    before = files()
    assert reference.main(["--tables"]) == 0
    assert files() == before


def test_the_committed_reference_skipped_nothing_and_names_no_folder_of_a_machine():
    folder = ROOT / "results" / "reference"
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert len(files) > 40
    for path in files:
        found = re.search(
            rb"skipped: |(?<![\w.])/(?:home|root|tmp|Users)/", path.read_bytes()
        )
        assert found is None, (path, found)


def test_every_part_says_what_is_missing(target):
    parts = reference.parts(Answers("reference", Results(target), studies_of(studies)))
    for name in parts.keys() - {
        "results",
        "models",
    }:  # need no record
        assert parts[name]() == documents.NOT_MEASURED, name
