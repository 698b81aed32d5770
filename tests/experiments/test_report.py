"""The report: from records alone, the same bytes each time, and one bad record costs itself."""

import csv
import io
import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib.metadata import version

import pytest
from rich.console import Console

from experiments import report
from experiments.records.files import REFERENCE, ROOT
from experiments.records.results import Results
from experiments.report import Answers, all_studies
from experiments.reporting.table import records
from experiments.studies.table1 import view as table1


@pytest.fixture
def alone(tmp_path, monkeypatch):
    """Own results without the reference beside them."""
    monkeypatch.setattr(report, "REFERENCE", tmp_path / "no reference")


def written(folder):
    """What a report of a folder says on the terminal, and its files by name."""
    console = Console(width=report.WIDTH, file=io.StringIO(), highlight=False)
    path = report.write(folder, "cpu", console)
    files = [path, *folder.glob("tables/*"), *folder.glob("figures/*")]
    return console.file.getvalue(), {file.name: file.read_bytes() for file in files}


def rows_of(data):
    return list(csv.DictReader(io.StringIO(data.decode())))


# The committed reference --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The folder that the committed records are written into anew, and what was wrong with any."""
    answers = Answers("reference", Results(REFERENCE), all_studies())
    answers.draw()
    folder = tmp_path_factory.mktemp("reference")
    answers.write(folder)
    return folder, answers


def test_no_committed_record_is_left_out(reference):
    assert reference[1].results.problems == []


@pytest.mark.parametrize("kind", ["tables", "figures"])
def test_the_committed_files_are_those_of_the_committed_records(reference, kind):
    made, committed = (
        {path.name: path.read_bytes() for path in (folder / kind).iterdir()}
        for folder in (reference[0], REFERENCE)
    )
    assert set(made) == set(committed)
    drawn_by = {name: _pinned(name) for name in ("matplotlib", "pillow")}
    if kind == "figures" and drawn_by != {name: version(name) for name in drawn_by}:
        pytest.skip(f"figures are the same with {drawn_by} only")
    assert [name for name in made if made[name] != committed[name]] == []


def _pinned(package):
    text = (ROOT / "constraints.txt").read_text()
    return re.search(rf"^{package}==(\S+)", text, re.MULTILINE)[1]


def test_every_quantity_of_the_reference_is_told_apart(reference):
    made = reference[1].tables["comparison"][0]
    names = [cells[0] for cells in made.cells()]
    assert len(set(names)) == len(names)
    assert "missing" not in {row["verdict"] for row in records(made.data)}


# Own results --------------------------------------------------------------------------------------


def test_the_same_records_give_the_same_bytes(tmp_path, a_full_set, alone):
    before = {path: path.read_bytes() for path in tmp_path.glob("runs/*/*")}
    text, first = written(tmp_path)
    assert (text, first) == written(tmp_path)
    assert {path: path.read_bytes() for path in tmp_path.glob("runs/*/*")} == before
    names = {name.partition(".")[0] for name in first}
    assert {"table1", "comparison", "runs", "scene_touch", "accuracy_vs_n", "report"} <= names
    assert not [name for name, data in first.items() if len(data) < 100]


def test_own_numbers_stand_beside_the_reference(tmp_path, write_run):
    write_run("hdc", wrong=range(9))
    text, files = written(tmp_path)
    page = files["report.html"].decode()
    (line,) = (line for line in text.splitlines() if line.strip().startswith("HDC"))
    assert "91 [" in line  # mine
    assert "100 [" in line  # the paper's and the reference's
    assert "Training time, s, reference" in page
    assert "Training time, s, mine" in page
    # The files are of own results alone.
    assert [row["model"] for row in rows_of(files["runs.csv"])] == ["hdc"]
    assert [row["seeds"] for row in rows_of(files["table1.csv"])] == ["1", "0", "0", "0", "0"]


def test_a_deleted_record_shows(tmp_path, write_run, alone):
    write_run("hdc")
    identity = write_run("softmax", curve=[{"training_s": 1.0, "loss": 1.0}])
    assert rows_of(written(tmp_path)[1]["table1.csv"])[1]["status"] == "ok"
    for path in (tmp_path / "runs" / identity).iterdir():
        path.unlink()
    text, files = written(tmp_path)
    assert [row["status"] for row in rows_of(files["table1.csv"])] == ["ok", *["missing"] * 4]
    assert text.count("missing") == 4


def test_the_terminal_table_fits_into_100_columns(tmp_path, a_full_set, write_run):
    for seed in range(10, 13):  # the longest cells there can be
        last = {"training_s": 1799.123 + seed, "loss": 1.0, "train_accuracy": 0.899}
        write_run("cnn3", seed=seed, wrong=range(3), curve=[last])
    mine = Answers("mine", Results(tmp_path), [table1.STUDY])
    for sets in ([mine], [mine, mine]):
        console = Console(width=report.WIDTH, file=io.StringIO())
        console.print(report.terminal_table(sets))
        text = console.file.getvalue()
        assert max(map(len, text.splitlines())) <= report.WIDTH
        assert "simulated frames" in text
        if len(sets) == 1:
            for cell in ("not reached in 1810 s", "3.00", "441"):
                assert cell in text


def test_a_folder_without_results_is_reported_on(tmp_path, alone):
    text, files = written(tmp_path / "new")
    assert text.count("missing") == 5
    assert "page: " in text
    assert {row["verdict"] for row in rows_of(files["comparison.csv"])} == {"missing"}


# What was changed ---------------------------------------------------------------------------------


def test_a_changed_model_is_shown_as_one_and_never_as_the_published_one(tmp_path, write_run, alone):
    write_run("hdc")
    write_run("softmax", wrong=range(5), change={"model.lr": 0.01})
    _, files = written(tmp_path)
    changed = next(row for row in rows_of(files["runs.csv"]) if row["model"] == "softmax")
    assert changed["overrides"] == "model.lr=0.01"
    assert rows_of(files["table1.csv"])[1]["status"] == "missing"
    verdicts = {row["quantity"]: row["verdict"] for row in rows_of(files["comparison.csv"])}
    assert verdicts["softmax_test_accuracy"] == "missing"
    shown = {row["model"]: row["test_accuracy_final"] for row in rows_of(files["scene_touch.csv"])}
    assert shown == {"hdc": "1", "softmax (lr=0.01)": "0.95"}
    assert "Softmax (lr=0.01)" in files["report.html"].decode()


def test_a_changed_scene_has_a_table_of_its_own(tmp_path, write_run, alone):
    write_run("hdc", change={"split.kind": "ordered"})
    _, files = written(tmp_path)
    (name,) = (name for name in files if re.fullmatch(r"scene_.*\.csv", name))
    assert name == "scene_touch_kind_ordered.csv"
    assert "scene_touch.csv" not in files
    assert rows_of(files["table1.csv"])[0]["status"] == "missing"
    assert "confusion_touch_kind_ordered.svg" in files


# What is wrong with a record ----------------------------------------------------------------------

STANDS, LEFT_OUT = False, True
BAD = [
    ("train_accuracy_max", None, LEFT_OUT),
    ("test_accuracy_max", None, LEFT_OUT),
    ("stop", "a line\nbreak | and a column", LEFT_OUT),
    ("environment.cpu", "A\nCPU | <b>\x1b[31m` \\", STANDS),
    ("choices.stop", ["paper"], LEFT_OUT),
    ("choices.stop", {"a": 1}, LEFT_OUT),
    ("choices.stop", "\x1b[31m<b>", STANDS),
    ("command", None, LEFT_OUT),
    ("command", ["python"], LEFT_OUT),
    ("command", "\x1b[31m<script>", STANDS),
    ("scene.classes", ["<b>", "$x_{$", "\x1b[31m", "\\", "a\nb"], STANDS),
    ("predicted", [99] * 100, LEFT_OUT),
    ("config.model", None, LEFT_OUT),
    ("config.split", None, LEFT_OUT),
    ("overrides", ["model.\x1b=<b>", "=", "no equals"], STANDS),
]


def test_a_bad_record_costs_itself_only(tmp_path, write_run, alone):
    write_run("hdc", wrong=[0])
    left_out = set()
    for seed, (key, value, goes) in enumerate(BAD):
        identity = write_run("softmax", seed=seed)
        left_out |= {identity} if goes else set()
        path = tmp_path / "runs" / identity / "record.json"
        entry = json.loads(path.read_text())
        *parents, last = key.split(".")
        part = entry
        for parent in parents:
            part = part[parent]
        part[last] = value
        path.write_text(json.dumps(entry))
    text, files = written(tmp_path)
    assert set(re.findall(r"left out of mine: ([\w-]+): ", text)) == left_out
    assert len(rows_of(files["runs.csv"])) == 1 + len(BAD) - len(left_out)
    hdc, *_ = rows_of(files["table1.csv"])
    assert hdc["test_accuracy_final"] == "0.99"
    assert "fig5_confusion.svg" in files
    harmless(text, files)


def _keys(entry, before=()):
    """Every key of a record with its parents, but of the files of code and their versions."""
    for key, value in entry.items():
        yield (*before, key)
        if isinstance(value, dict) and key not in ("sources", "packages"):
            yield from _keys(value, (*before, key))


@pytest.mark.parametrize("value", [None, [], "\x1b<b>\\"], ids=repr)
def test_whatever_is_put_into_a_record_costs_itself_only(tmp_path, write_run, value):
    write_run("hdc", wrong=[0])
    identity = write_run("softmax", curve=[{"training_s": 1.0, "loss": 1.0}])
    path = tmp_path / "runs" / identity / "record.json"
    text, questions = path.read_text(), all_studies()
    for *parents, last in _keys(json.loads(text)):
        entry = part = json.loads(text)
        for parent in parents:
            part = part[parent]
        part[last] = value
        path.write_text(json.dumps(entry))
        answers = Answers("mine", Results(tmp_path), questions)
        (table,) = answers.tables["table1"]
        assert rows_of(table.csv().encode())[0]["test_accuracy_final"] == "0.99"
        assert all(problem.startswith(identity) for problem in answers.results.problems)
        for made in (made for tables in answers.tables.values() for made in tables):
            assert all(c.isprintable() or c == "\n" for c in made.csv() + made.markdown())


def test_errors_of_failed_runs_are_quoted_as_they_are(tmp_path, write_run, alone):
    hostile = "<img src=x onerror=alert(1)> | `\x1b[31m` ends in a backslash \\"
    write_run("hdc")
    write_run("cnn3", status="failed", error=hostile)
    text, files = written(tmp_path)
    harmless(text, files)
    (status,) = (r["status"] for r in rows_of(files["table1.csv"]) if r["model"] == "cnn3")
    assert status == "failed: " + hostile.replace("\x1b", "\\x1b")
    assert "failed: &lt;img src=x" in files["report.html"].decode()


def test_what_is_no_record_is_named_and_its_name_printed_plainly(tmp_path, a_full_set, alone):
    for name, record in (("broken", "{"), ("\x1b[31m<b>broken<b>:smile:[red]", "[]")):
        (tmp_path / "runs" / name).mkdir()
        (tmp_path / "runs" / name / "record.json").write_text(record)
    text, files = written(tmp_path)
    assert "left out of mine: broken: " in text
    assert "left out of mine: \\x1b[31m<b>broken<b>:smile:[red]: " in text
    harmless(text, files)


def test_a_measurement_without_its_columns_costs_its_study_only(
    tmp_path, a_full_set, write_measurement, alone
):
    write_measurement("correlation", [{"a": 1}], config={"crop": None})
    none = {"n_test_new": 0, "n_test_old": 0, "right_new": 0, "right_old": 0, "n_new": 0}
    stored = {"method": "stored", "model": "hdc", "order": "time", "seed": 0}
    write_measurement("drift", [{"origin": "simulated", **stored, **none}])
    text, files = written(tmp_path)
    for study in ("drift", "correlation", "fig8_drift", "fig4_correlations"):
        assert f"left out of mine: {study}: " in text
    assert "accuracy_vs_n.svg" in files
    assert "fig8_drift.svg" not in files
    assert rows_of(files["table1.csv"])[0]["seeds"] == "2"


class _Tags(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.keys = set(), set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.keys |= {key for key, _ in attrs}


def harmless(text, files):
    """Nothing of a record does anything: no tag, handler or control character is of its making."""
    page = files["report.html"].decode()
    found = _Tags(page)
    assert not found.tags & {"b", "red"}
    assert page.count("<script>") == 1
    assert not [key for key in found.keys if key.startswith("on")]
    assert "&amp;lt;" not in page  # escaped once
    for name, data in {**files, "terminal": text.encode()}.items():
        if name.endswith((".csv", ".md", ".tex")) or name == "terminal":
            assert all(c.isprintable() or c == "\n" for c in data.decode()), name
    for name, data in files.items():
        if name.endswith(".md"):
            assert not re.findall(r"<(?!!--)", data.decode()), name
            table = [line for line in data.decode().splitlines() if line.startswith("|")]
            assert len({len(re.findall(r"(?<!\\)(?:\\\\)*\|", line)) for line in table}) == 1, name


# From the command line ----------------------------------------------------------------------------


def command(*words, **environment):
    return subprocess.run(
        [sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False,
        env={"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), **environment},
    )  # fmt: skip


def test_in_a_clone_it_writes_the_page_from_the_reference_and_changes_nothing(tmp_path):
    before = _tracked()
    code = (
        "import sys; from experiments import report; report.main([]);"
        "print('imported:', [m for m in ('torch', 'hdc') if m in sys.modules])"
    )
    done = command("-c", code, RESULTS_DIR=str(tmp_path / "mine"))
    assert done.returncode == 0, done.stderr
    assert "imported: []" in done.stdout
    assert _tracked() == before
    (page,) = re.findall(r"page: (.*)", done.stdout)
    path = (ROOT / page).resolve()
    assert path == (tmp_path / "mine" / "report.html").resolve()
    text = path.read_text()
    assert text.count("<img ") == len(list((REFERENCE / "figures").iterdir()))
    assert "reference" in text


def _tracked():
    done = subprocess.run(
        ["git", "status", "--porcelain"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if done.returncode:
        pytest.skip("no git checkout here")
    return done.stdout


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    done = command("-m", "experiments.report", RESULTS_DIR=str(tmp_path / "file"))
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert str(tmp_path / "file") in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_terminal_without_the_characters_ends_nothing(tmp_path):
    for words in (("experiments.report",), ("experiments.reproduce", "--list")):
        done = command("-m", *words, RESULTS_DIR=str(tmp_path), PYTHONIOENCODING="ascii")
        assert done.returncode == 0, done.stderr
        assert "\\u" in done.stdout
