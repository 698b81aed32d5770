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
from experiments.records.results import RUNS, Results
from experiments.reporting.study import Figure, Study
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import Table


@pytest.fixture
def alone(tmp_path, monkeypatch):
    """Own results in tmp_path, without the reference beside them."""
    monkeypatch.setattr(report, "REFERENCE", tmp_path / "no reference")
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))


def written(folder, **options):
    """The text of a report of a folder on the terminal, and its files by name."""
    console = Console(width=report.WIDTH, file=io.StringIO(), highlight=False)
    path = report.write(folder, console, **options)
    files = [path, *folder.glob("tables/*"), *folder.glob("figures/*")]
    return console.file.getvalue(), {file.name: file.read_bytes() for file in files}


def rows_of(data):
    return list(csv.DictReader(io.StringIO(data.decode())))


# The reference ------------------------------------------------------------------------------------


def test_no_committed_record_is_left_out_and_nothing_fails(committed):
    assert list(committed.every_table())
    assert committed.failures == []
    assert committed.left_out == []


def test_the_committed_numbers_are_those_of_the_committed_records(committed):
    """Of every table, and of every figure that no table shows, the bytes."""
    made = {("tables", table.name): table.csv() for table in committed.every_table()}
    shown = {name for _, name in made}
    for study in committed.studies:
        for figure in committed.figures(study):
            if figure.table.name not in shown:
                made["figures", figure.name] = figure.table.csv()
    expected = {
        (folder, path.stem): path.read_text(encoding="utf-8")
        for folder in ("tables", "figures")
        for path in (REFERENCE / folder).glob("*.csv")
    }
    assert set(made) == set(expected)
    assert [name for name in made if made[name] != expected[name]] == []


def test_a_clone_shows_a_table_without_pytorch_hydra_and_matplotlib(tmp_path):
    code = (
        "import sys; lacking = ('torch', 'hydra', 'omegaconf', 'cv2', 'sklearn'); "
        "sys.modules.update(dict.fromkeys(lacking)); "
        "from experiments import report; report.main(['footprint']); "
        "sys.exit('matplotlib' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT), "RESULTS_DIR": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Footprint of each scene" in done.stdout
    assert list(tmp_path.iterdir()) == []  # it shows, and writes nothing


# Own results --------------------------------------------------------------------------------------


@pytest.mark.usefixtures("beside_the_reference")
def test_own_numbers_stand_beside_the_reference_unless_some_alone_are_asked_for(
    tmp_path, write_run
):
    title = "Table I, published and measured"
    assert title in written(tmp_path)[0]  # of the reference: there are no own results
    write_run("hdc", scene="finger")
    write_run("ridge", scene="finger", wrong=range(20))
    assert title not in written(tmp_path)[0]  # it is of another scene
    for model in ("hdc", "ridge"):
        write_run(model)
    only = {"model": ["ridge"], "scene": ["finger"]}
    alone = report.sets_of(tmp_path, only=only, mine=True)
    text, files = written(tmp_path, sets=alone)
    (row,) = rows_of(files["all_scenes.csv"])
    assert (row["scene"], row["model"]) == ("finger", "ridge")
    assert float(row["over_hdc"]) < 0  # measured against what is not shown
    assert "eference" not in text
    _, files = written(tmp_path)
    # Nothing that was not measured stands under one's own.
    assert all(row["measured"] for row in rows_of(files["comparison.csv"]))
    assert files["report.html"].decode().count('id="table1"') == 1


def test_the_same_records_give_the_same_bytes(tmp_path, runs_of_table1, alone):
    first = written(tmp_path, tex=True)
    assert first == written(tmp_path, tex=True)
    assert {"table1.csv", "comparison.csv", "report.html"} <= set(first[1])
    assert "\\toprule" in first[1]["table1.tex"].decode()


def small(name, *makers, drawing=lambda *_: None):
    """A study of a table for each function, and a figure of the last."""
    tables = [
        Table(f"{name}_{k}", make, of=RUNS, title="Seeds")
        for k, make in enumerate(makers)
    ]
    figure = Figure(f"{name}_figure", tables[-1], drawing, caption="Nothing.")
    return Study(name, name, "Is it whole?", 0, tables=tables, figures=[figure])


def test_a_scene_that_is_asked_for_is_found_in_columns_of_recordings_too(
    write_run, alone, monkeypatch, capsys
):
    """Every table of recordings showed all of them."""
    asked = ["first", "first, saturated", "first (n=3)"]
    study = small("some", lambda _: pd.DataFrame({"recording": ["second", *asked]}))
    monkeypatch.setattr(report, "studies_of", lambda _: [study])
    write_run("hdc")
    report.main(["some_0", "--scene", "first"])
    shown = map(str.rstrip, capsys.readouterr().out.splitlines())
    assert [line for line in shown if line in ("second", *asked)] == asked


def test_whatever_step_of_a_write_fails_the_next_report_is_whole(
    tmp_path, write_run, alone, monkeypatch, full_disk
):
    study = small("some", lambda lines: lines[["seed"]])
    monkeypatch.setattr(report, "studies_of", lambda _: [study])
    write_run("hdc")
    first, records = written(tmp_path)[1], (tmp_path / "records.jsonl").read_bytes()
    for k in range(100):
        if (failed := full_disk(k, lambda: report.main([]))) is None:
            break
        assert "No space left" in str(failed)
        assert (tmp_path / "records.jsonl").read_bytes() == records
        assert written(tmp_path)[1] == first
    assert k > 10


def test_a_study_that_fails_costs_its_own_table_and_says_so_in_one_line(
    tmp_path, write_run, alone, monkeypatch
):
    def never(frame):
        raise KeyError("a model\nthat is not there")

    def drawn(figure, data):
        raise ValueError("nothing to draw")

    broken = small("broken", never, lambda _: pd.DataFrame({"x": [1]}), drawing=drawn)
    few = [study for study in studies_of(studies) if study.name == "table1"]
    monkeypatch.setattr(report, "studies_of", lambda _: [*few, broken])
    write_run("hdc")
    text, files = written(tmp_path)
    lines = [line for line in text.splitlines() if "failed at" in line]
    assert [line.partition(": ")[2] for line in lines] == [
        "study broken failed at table broken_0: KeyError: 'a model\\nthat is not there'",
        "study broken failed at figure broken_figure: ValueError: nothing to draw",
    ]
    assert {"table1.csv", "broken_1.csv"} <= set(files)
    assert files["report.html"].decode().count('class="failed"') == 2
    report.main([])  # the report is whole: no error


# Bad records --------------------------------------------------------------------------------------

HOSTILE = ("<b>", "$x_{$", "\x1b[31m", "\\", "a\nb")


def test_a_bad_record_costs_itself_only(tmp_path, write_run, alone):
    """Names of the user's are shown as they are, on the terminal and in figures too."""
    write_run("hdc", wrong=[0])
    about = {"choices": {"scene": "mine"}, "origin": "recorded", "classes": HOSTILE}
    write_run("hdc", wrong=[0], environment={"cpu": " ".join(HOSTILE)}, **about)
    path = tmp_path / "records.jsonl"
    first, second = path.read_text().splitlines()
    without = json.dumps(json.loads(first) | {"config": None})
    path.write_text("\n".join([first, second, without, "{", "[]"]) + "\n")
    text, files = written(tmp_path)
    assert re.findall(r"left out of mine: .*line (\d+): ", text) == ["3", "4", "5"]
    assert "failed at" not in text
    assert rows_of(files["table1.csv"])[0]["test_accuracy_final"] == "0.99"
    assert HOSTILE[1] in files["confusions.svg"].decode()
    for name, data in {**files, "terminal": text.encode()}.items():
        if name.endswith(".csv") or name == "terminal":
            assert all(c.isprintable() or c == "\n" for c in data.decode()), name


def test_a_record_is_read_and_none_of_the_code_that_it_names(
    tmp_path, write_run, write_measurement, alone, monkeypatch
):
    """Not by the table, not where it is asked whether the record is of today's code."""
    (tmp_path / "evilmod.py").write_text("raise SystemExit('the code of a record ran')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "this", raising=False)
    names = {"this.s": 1, "evilmod.X": 1, "evilmod.py": "a" * 12}
    made_by = {"made_by": {"experiments": 0, "hdc.HDCClassifier": 0, **names}}
    parts = {"encoder": "this.s", "readout": "evilmod.X"}
    change = {f"model.{key}": name for key, name in parts.items()}
    write_run("hdc", change=change | {"model._target_": "evilmod.X"}, **made_by)
    write_run("hdc", change={"scene._target_": "evilmod.X"}, **made_by)
    config = {
        "model": {"_target_": "evilmod.X", **parts},
        "scene": {"_target_": "this.s"},
    }
    about = {"config": config, "task": "evilmod.X", "revisions": names}
    write_measurement("robustness", [{"model": "hdc"}], **about)
    outdated = [bool(made.outdated) for made in Results(tmp_path).finished]
    assert outdated == [True, True, False]
    _, files = written(tmp_path)
    report.main(["all_scenes"])
    assert not {"this", "evilmod"} & set(sys.modules)
    models = [
        row["model"] for row in rows_of(files["all_scenes.csv"])
    ]  # whose rows stand
    assert any('readout="evilmod.X"' in model for model in models)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], "error: "),
        (["nowhere"], "expected one of "),
        (["--study", "json"], "--study json: expected a name STUDY in it, found none"),
    ],
)
def test_what_cannot_be_done_is_one_line(tmp_path, monkeypatch, alone, words, expected):
    if not words:
        (tmp_path / "file").write_text("")
        monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "file"))
    with pytest.raises(SystemExit) as ended:
        report.main(words)
    line = str(ended.value)  # on standard error; the exit status is 1
    assert line.startswith("error: ")
    assert expected in line
    assert len(line.splitlines()) == 1
