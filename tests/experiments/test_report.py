"""The report writes everything from records alone, the same bytes each time."""

import io
import subprocess
import sys

import pytest
from rich.console import Console

from experiments import report
from experiments.record import ROOT
from experiments.selection import Records
from experiments.tables import table1

TABLES = {f"{name}.{kind}" for name in (
    "table1", "table1_extended", "accuracy_vs_n", "accuracy_vs_d", "work_precision"
) for kind in ("csv", "md", "tex")}  # fmt: skip
FIGURES = {f"{name}.{kind}" for name in (
    "error_vs_time", "fig5_confusion", "accuracy_vs_n", "accuracy_vs_d", "work_precision"
) for kind in ("svg", "pdf")}  # fmt: skip

PAGE = {"comparison.csv", "comparison.md", "report.html"}


def run(folder):
    console = Console(width=report.WIDTH, file=io.StringIO(), highlight=False)
    written = report.write(folder, "cpu", console)
    return {path.name: path.read_bytes() for path in written}, console.file.getvalue()


def test_the_same_records_give_the_same_bytes(tmp_path, a_full_set):
    before = sorted(tmp_path.glob("runs/*"))
    first, text = run(tmp_path)
    second, again = run(tmp_path)
    assert first == second
    assert text == again
    assert set(first) == TABLES | FIGURES | PAGE
    assert sorted(tmp_path.glob("runs/*")) == before
    assert not [name for name, data in first.items() if len(data) < 100]


def test_a_deleted_record_shows(tmp_path, write_run):
    write_run("hdc")
    identity = write_run("softmax", curve=[{"training_s": 1.0, "loss": 1.0}])
    _, text = run(tmp_path)
    assert "softmax: missing" not in text
    for path in (tmp_path / "runs" / identity).iterdir():
        path.unlink()
    files, text = run(tmp_path)
    assert "softmax: missing" in text
    assert b"\nsoftmax," in files["table1.csv"]
    assert files["table1.csv"].count(b"missing") == 3


def test_table_fits_into_100_columns(tmp_path, a_full_set, write_run):
    for seed in range(10, 13):  # the longest cells there can be
        last = {"training_s": 1799.123 + seed, "loss": 1.0, "train_accuracy": 0.899}
        write_run("cnn3", seed=seed, wrong=range(3), curve=[last])
    console = Console(width=100, file=io.StringIO())
    rows = table1(Records(tmp_path))
    console.print(report.terminal_table(rows))
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 100
    text = "\n".join(lines)
    assert "not reached" in text
    assert "simulated" in text
    assert text.count("× HDC") >= len(rows)
    for row in rows:
        assert f"{100 * row['published_test_accuracy']:.0f} [" in text


def test_without_any_record_it_exits_with_0_and_says_what_is_missing(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "experiments.report"],
        cwd=ROOT,
        env={"RESULTS_DIR": str(tmp_path), "PATH": "", "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for model in ("hdc", "softmax", "cnn1", "cnn3"):
        assert f"{model}: missing" in done.stdout
    assert (tmp_path / "tables" / "table1.csv").exists()


def test_broken_records_are_named(tmp_path, a_full_set):
    (tmp_path / "runs" / "broken").mkdir()
    (tmp_path / "runs" / "broken" / "record.json").write_text("{")
    _, text = run(tmp_path)
    assert "left out: broken" in text


def test_a_measurement_that_other_code_made_is_left_out_and_named(
    tmp_path, a_full_set, write_measurement
):
    write_measurement("drift", [{"a": 1}])
    write_measurement("stiffness", [{"a": 1}])
    files, text = run(tmp_path)
    assert "left out: the paper's figures: " in text
    assert "left out: numbers beside Table I: " in text
    assert b"Left out" in files["report.html"]


@pytest.mark.parametrize("module", ["experiments.run"])
def test_a_run_imports_neither_matplotlib_nor_pandas(module):
    code = f"import sys, {module}; print([m for m in ('matplotlib', 'pandas') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr
