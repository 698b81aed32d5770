"""The report: from records alone, the same bytes each time, and one bad record costs itself."""

import csv
import io
import json
import os
import re
import subprocess
import sys

import pandas as pd
import pytest
from rich.console import Console

from experiments import report, studies
from experiments.records.files import REFERENCE, ROOT
from experiments.records.results import RUNS
from experiments.reporting.study import Plot, Study
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import Table


@pytest.fixture
def alone(tmp_path, monkeypatch):
    """Own results without the reference beside them."""
    monkeypatch.setattr(report, "REFERENCE", tmp_path / "no reference")


def written(folder):
    """The text of a report of a folder on the terminal, and its files by name."""
    console = Console(width=report.WIDTH, file=io.StringIO(), highlight=False)
    path = report.write(folder, console)
    files = [path, *folder.glob("tables/*"), *folder.glob("figures/*")]
    return console.file.getvalue(), {file.name: file.read_bytes() for file in files}


def rows_of(data):
    return list(csv.DictReader(io.StringIO(data.decode())))


def test_no_committed_record_is_left_out_and_nothing_fails(committed):
    assert committed.results.problems == []
    assert committed.failures == []
    names = [cells[0] for cells in committed.tables["comparison"][0].cells()]
    assert len(set(names)) == len(names)


def test_the_committed_tables_are_those_of_the_committed_records(committed):
    made = {table.name: table.csv() for table in committed.every_table()}
    paths = (REFERENCE / "tables").glob("*.csv")
    expected = {path.stem: path.read_text(encoding="utf-8") for path in paths}
    assert set(made) == set(expected)
    assert [name for name in made if made[name] != expected[name]] == []


def test_whatever_step_of_a_write_fails_the_next_report_is_whole(
    tmp_path, write_run, alone, monkeypatch, full_disk
):
    tables = [
        Table(name, lambda lines: lines[["seed"]], of=RUNS, title="Seeds")
        for name in ("one", "two")
    ]
    empty = Plot("empty", lambda *_: None, of=RUNS, caption="Nothing.")
    small = Study("small", "Small", "Is it whole?", 0, tables=tables, figures=[empty])
    monkeypatch.setattr(report, "studies_of", lambda _: [small])
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    write_run("hdc")
    first, records = written(tmp_path)[1], (tmp_path / "records.jsonl").read_bytes()
    for k in range(100):
        if (failed := full_disk(k, lambda: report.main([]))) is None:
            break
        assert "No space left" in str(failed)
        assert (tmp_path / "records.jsonl").read_bytes() == records
        assert written(tmp_path)[1] == first
    assert k > 20


def test_the_same_records_give_the_same_bytes(tmp_path, a_full_set, alone):
    before = (tmp_path / "records.jsonl").read_bytes()
    first = written(tmp_path)
    assert first == written(tmp_path)
    assert (tmp_path / "records.jsonl").read_bytes() == before
    names = {name.partition(".")[0] for name in first[1]}
    assert {"table1", "comparison", "runs", "accuracy_vs_n", "report"} <= names


@pytest.mark.usefixtures("beside_the_reference")
def test_own_numbers_stand_beside_the_reference(tmp_path, write_run):
    write_run("hdc", wrong=range(9))
    text, files = written(tmp_path)
    hdc = next(line for line in text.splitlines() if line.startswith("HDC "))
    assert "91" in hdc.split()  # mine
    assert re.search(r"^CNN, 1 layer .*\n\(reference\)", text, re.MULTILINE)
    assert [row["model"] for row in rows_of(files["runs.csv"])] == ["hdc"]
    write_run("ridge", scene="finger", wrong=range(20))
    text, _ = written(tmp_path)
    assert re.search(r"^finger +Ridge +1 +80 \[", text, re.MULTILINE)
    assert max(map(len, text.splitlines()[:8])) <= report.WIDTH


BAD = [
    ("environment.cpu", "A\nCPU | <b>\x1b[31m` \\", False),
    ("choices.stop", "\x1b[31m<b>", False),
    ("scene.classes", ["<b>", "$x_{$", "\x1b[31m", "\\", "a\nb"], False),
    ("config", None, True),
]


def test_a_bad_record_costs_itself_only(tmp_path, write_run, alone):
    write_run("hdc", wrong=[0])
    for seed in range(len(BAD)):
        write_run("softmax", seed=seed)
    path = tmp_path / "records.jsonl"
    lines = path.read_text().splitlines()
    for k, (key, value, _) in enumerate(BAD, 1):
        entry = part = json.loads(lines[k])
        *parents, last = key.split(".")
        for parent in parents:
            part = part[parent]
        part[last] = value
        lines[k] = json.dumps(entry)
    path.write_text("\n".join([*lines, "{", "[]"]) + "\n")
    text, files = written(tmp_path)
    left_out = [k for k, (*_, goes) in enumerate(BAD, 2) if goes] + [
        len(BAD) + 2,
        len(BAD) + 3,
    ]
    assert [
        int(n) for n in re.findall(r"left out of mine: .*line (\d+): ", text)
    ] == left_out
    assert rows_of(files["table1.csv"])[0]["test_accuracy_final"] == "0.99"
    for name, data in {**files, "terminal": text.encode()}.items():
        if name.endswith((".csv", ".md")) or name == "terminal":
            assert all(c.isprintable() or c == "\n" for c in data.decode()), name


def test_in_a_clone_it_writes_the_page(tmp_path):
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", "experiments.report"], cwd=ROOT, capture_output=True, text=True,
        check=False, env=environment | {"RESULTS_DIR": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    page = tmp_path / "report.html"
    assert 2e5 < page.stat().st_size < 1e6  # with the whole reference
    assert not list(page.parent.glob("tables/*"))  # they are the reference's


def test_a_bad_folder_is_one_line(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "file"))
    with pytest.raises(SystemExit) as ended:
        report.main([])
    line = str(ended.value)  # on standard error; the exit status is 1
    assert line.startswith("error: ")
    assert len(line.splitlines()) == 1


@pytest.fixture
def a_study_that_fails(monkeypatch):
    """Table I, and a study of which one table and one figure fail."""

    def never(frame):
        raise KeyError("a model\nthat is not there")

    def drawn(figure, frame):
        raise ValueError("nothing to draw")

    broken = Study(
        "broken",
        "Broken",
        "Does it end the report?",
        0,
        tables=[
            Table("never", never, of=RUNS, title="Never"),
            Table("other", lambda _: pd.DataFrame({"x": [1]}), of=RUNS, title="Other"),
        ],
        figures=[Plot("drawn", drawn, of=RUNS, caption="Never drawn.")],
    )
    few = [study for study in studies_of(studies) if study.name == "table1"]
    monkeypatch.setattr(report, "studies_of", lambda _: [*few, broken])


def test_a_study_that_fails_costs_its_own_table_and_says_so_in_one_line(
    tmp_path, write_run, alone, a_study_that_fails, monkeypatch
):
    write_run("hdc")
    text, files = written(tmp_path)
    lines = [line for line in text.splitlines() if "failed at" in line]
    assert [line.partition(": ")[2] for line in lines] == [
        "study broken failed at table never: KeyError: 'a model\\nthat is not there'",
        "study broken failed at figure drawn: ValueError: nothing to draw",
    ]
    assert {"table1.csv", "other.csv"} <= set(files)
    page = files["report.html"].decode()
    assert page.count('class="failed"') == 2
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    report.main([])  # the report is whole: no error


def test_tables_become_latex_when_it_is_asked_for(tmp_path, write_run, alone):
    write_run("hdc")
    console = Console(file=io.StringIO())
    report.write(tmp_path, console)
    assert not list(tmp_path.glob("tables/*.tex"))
    report.write(tmp_path, console, tex=True)
    text = (tmp_path / "tables" / "table1.tex").read_text(encoding="utf-8")
    assert text.startswith("\\begin{table}")
    # As docs/extend.md says.
    assert {"\\toprule", "\\label{tab:table1}"} <= set(text.split())
    assert "Training time to 90 \\% (s)" in text


def test_nothing_unmeasured_stands_under_mine(tmp_path, write_run, alone):
    write_run("hdc", wrong=range(9))
    _, files = written(tmp_path)
    rows = rows_of(files["comparison.csv"])
    assert rows
    assert all(row["measured"] for row in rows)


@pytest.mark.usefixtures("beside_the_reference")
def test_own_numbers_outside_the_reference_are_named_and_table_1_stands_once(
    tmp_path, write_run
):
    write_run("hdc", wrong=range(50))
    text, files = written(tmp_path)
    assert text.count("Table I,") == 1
    assert "table1: HDC has a test accuracy of 50 % (reference: 99.5 to 100)." in text
    page = files["report.html"].decode()
    assert page.index("<h2>Your results</h2>") < page.index(
        "<h2>Reference results</h2>"
    )
    assert page.count('id="table1"') == 1  # one's own
    assert "of your numbers lie outside the interval of the reference" in page
    assert page.count('<li><a href="#table1">table1</a>: ') == 2
