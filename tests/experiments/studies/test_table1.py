"""Table I: published and measured side by side, and error against run time."""

import csv
import io

import numpy as np
import pytest

from experiments.records.results import Results
from experiments.reporting.rows import PUBLISHED, VALUES
from experiments.studies.table1 import view
from experiments.studies.table1.view import STUDY

LINES = ["hdc", "softmax", "softmax_zero", "cnn1", "cnn3"]


def epochs(*accuracies):
    return [
        {"training_s": 10.0 * k, "loss": 1.0, "train_accuracy": accuracy}
        for k, accuracy in enumerate(accuracies, 1)
    ]


def table(folder):
    (made,) = STUDY.tables(Results(folder))
    return made


def test_a_row_without_records_is_missing_and_stays(tmp_path):
    rows = table(tmp_path).data
    assert rows["model"].tolist() == LINES
    assert set(rows["status"]) == {"missing"}
    rows = rows[rows["model"] != "softmax_zero"]
    assert rows["published_training_time_s"].tolist() == [1.24, 170, 101.3, 441.3]
    assert rows["published_training_time_over_hdc"].tolist() == pytest.approx(
        [1, 170 / 1.24, 101.3 / 1.24, 441.3 / 1.24]
    )


def test_the_three_forms_have_a_cell_for_every_column(tmp_path, a_full_set):
    made = table(tmp_path)
    read = list(csv.DictReader(io.StringIO(made.csv())))
    assert list(read[0]) == [*VALUES, *PUBLISHED]
    assert [row["model"] for row in read] == LINES
    assert read[4]["status"] == "failed: RuntimeError: no memory"
    body = [line for line in made.markdown().splitlines() if line.startswith("|")]
    assert {line.count("|") for line in body} == {len(made.heads) + 1}
    assert made.latex().count(r" \\" + "\n") == 6
    assert "simulated frames of the scene “touch”" in made.title
    assert made.commands == [
        "python -m experiments.run -m scene=touch model=cnn1,hdc,softmax stop=paper seed.run=0,1"
    ]


def test_numbers_of_table_1(tmp_path, write_run, number):
    for seed in (0, 1, 2):
        write_run("hdc", seed=seed, curve=[{"training_s": 0.6 * 2**seed}], wrong=range(2))
        write_run("cnn1", seed=seed, curve=epochs(0.5, 0.8), stop="quick", wrong=range(9))
    write_run("softmax", curve=epochs(0.5, 0.95))
    found = number(STUDY, "table1/hdc_test_accuracy")
    assert (found.value, found.n, found.seeds) == (98, 300, 3)
    assert found.low < 98 < found.high < 100
    found = number(STUDY, "table1/hdc_training_time")
    assert (found.value, found.n) == (1.2, 3)
    assert found.low < 1.24 < found.high
    found = number(STUDY, "table1/softmax_training_time")
    assert (found.value, found.low, found.interval) == (20, None, "")
    found = number(STUDY, "table1/cnn1_training_time")
    assert found.value == "not reached in 20 s"
    assert found.made_by == (
        "python -m experiments.run -m scene=touch model=cnn1 stop=quick seed.run=0,1,2"
    )
    assert number(STUDY, "table1/learning_rate").value == 1e-4
    assert number(STUDY, "touch/labels").value == 5
    names = [quantity.name for quantity in STUDY.quantities(Results(tmp_path))]
    assert len(set(names)) == len(names)
    assert not [name for name in names if "cnn3" in name]


def test_maxima_that_a_record_does_not_have_are_no_numbers(tmp_path, write_run):
    identity = write_run("hdc", train_accuracy_max=None, test_accuracy_max=None)
    (tmp_path / "runs" / identity / "curve.csv").write_text("training_s,loss\n0.5,nan\n")
    names = [quantity.name for quantity in STUDY.quantities(Results(tmp_path))]
    assert "table1/hdc_training_time" in names
    assert not [name for name in names if "accuracy" in name]


@pytest.mark.filterwarnings("error")
def test_the_figure_says_what_it_shows_and_what_is_missing(a_full_set, drawn):
    words = drawn(STUDY)["error_vs_time"]
    for expected in ("training time (s)", "test error", "paper, Table I", "HDC", "Softmax",
                     "CNN, 1 layer", "grey: no error", "simulated frames", "2 seeds",
                     "95 % intervals", "training accuracy > 90 %", "no records: "):  # fmt: skip
        assert expected in words, expected


@pytest.mark.filterwarnings("error")
def test_one_run_is_enough_for_a_figure(write_run, drawn):
    write_run("hdc")
    assert "no records: Softmax" in drawn(STUDY)["error_vs_time"]


def test_published_points_are_drawn_where_they_are(tmp_path, a_full_set):
    figure = view.error_vs_time(Results(tmp_path))
    stars = {
        (float(line.get_xdata()[0]), round(float(line.get_ydata()[0]), 6))
        for line in figure.axes[0].lines
        if line.get_marker() == "*"
    }
    assert {(170.0, 0.1), (101.3, 0.07), (441.3, 0.07)} < stars
    assert min(y for x, y in stars if x == 1.24) < 0.01
    view.plt.close(figure)


def test_curves_end_where_a_run_ended_and_no_error_has_its_strip(tmp_path, write_run):
    for seed in range(5):
        write_run("hdc", seed=seed, wrong=[0] if seed == 0 else [])  # 1 of 500
    figure = view.error_vs_time(Results(tmp_path))
    axes = figure.axes[0]
    points = np.concatenate([np.asarray(line.get_ydata(), float) for line in axes.lines])
    assert axes.get_ylim()[0] < 0.5 / 500
    assert np.min(points) == pytest.approx(0.5 / 500)
    assert 1 / 500 in np.round(points, 12)  # the pooled error is drawn where it is
    view.plt.close(figure)
