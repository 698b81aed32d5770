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
    assert "simulated frames, scene “touch”" in made.title
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
    assert found.low < 98 < found.high <= 100
    found = number(STUDY, "table1/hdc_training_time")
    assert (found.value, found.n, found.low, found.interval) == (1.2, 3, None, "")
    found = number(STUDY, "table1/softmax_training_time")
    assert (found.value, found.low, found.interval) == (20, None, "")
    found = number(STUDY, "table1/cnn1_training_time")
    assert found.value == "not reached in 20 s"
    assert found.made_by == (
        "python -m experiments.run -m scene=touch model=cnn1 stop=quick seed.run=0,1,2"
    )
    assert number(STUDY, "table1/learning_rate").value == 1e-4
    assert number(STUDY, "touch/labels").value == 5
    names = [(one.name, one.condition) for one in STUDY.quantities(Results(tmp_path))]
    assert len(set(names)) == len(names)
    assert not [name for name, _ in names if "cnn3" in name]


def test_maxima_and_training_accuracies_have_no_interval(tmp_path, write_run, number):
    for seed in range(3):
        write_run("softmax", seed=seed, curve=epochs(0.5, 0.95), train_accuracy_max=0.95)
    found = number(STUDY, "table1/softmax_training_accuracy")
    assert found.value == pytest.approx(95)
    assert (found.low, found.high, found.interval) == (None, None, "")
    assert found.note.startswith("maximum of the run")


@pytest.fixture
def timed(write_run, write_measurement):
    """timed(**row): three seeds of HDC and softmax, and a benchmark with a row of a route."""

    def make(**row):
        for seed in range(3):
            write_run("hdc", seed=seed, curve=[{"training_s": 0.5 * 2**seed}])
            write_run("softmax", seed=seed, curve=epochs(*[0.5] * (1 + seed), 0.95))
        route = {
            "operation": "train",
            "route": "torch.median, torchhd.multiset",
            "frames": "speckle",
            "n": 400,
            "d": 250_000,
            "l": 5,
            "median_s": 2.0,
            "min_s": 1.9,
            "samples": 9,
            "ratio_to_ours": 50.0,
            "peak_bytes": 1,
            "equal_result": "yes",
            "status": "ok",
        }
        write_measurement("benchmark", [route | row])  # fmt: skip

    return make


def test_times_are_judged_as_ratios_to_both_kinds_of_hdc(tmp_path, timed, number):
    timed()
    # 20, 30 and 40 s over 0.5, 1 and 2 s: 40, 30 and 20 in each run.
    own = number(STUDY, "table1/softmax_time_over_hdc", "HDC as written here")
    assert own.value == pytest.approx(30)
    spread = np.std(np.log([40, 30, 20]), ddof=1)
    assert np.log(own.high / own.value) == pytest.approx(4.30265 * spread * np.sqrt(4 / 3))
    ordinary = number(STUDY, "table1/softmax_time_over_hdc", "HDC by ordinary routes")
    assert ordinary.value == pytest.approx(30 / 2)
    rows = table(tmp_path).data.set_index("model")
    assert rows["training_time_over_ordinary_hdc"]["softmax"] == pytest.approx(15)
    assert rows["training_time_over_ordinary_hdc"]["hdc"] == pytest.approx(0.5)


@pytest.mark.parametrize(
    "row", [{"n": 40}, {"d": 10_000}, {"route": "numpy"}, {"median_s": None, "status": "skipped"}]
)
def test_a_denominator_that_was_not_measured_is_missing(tmp_path, timed, number, row):
    timed(**row)
    found = number(STUDY, "table1/softmax_time_over_hdc", "HDC by ordinary routes")
    assert found.value is None
    assert found.made_by == "python -m experiments.run experiment=benchmark"
    assert set(table(tmp_path).data["training_time_over_ordinary_hdc"]) == {None}


def test_a_time_of_another_machine_is_no_denominator(tmp_path, timed, number):
    timed()
    (path,) = tmp_path.glob("measured/*/record.json")
    path.write_text(path.read_text().replace("A CPU", "Another CPU"))
    found = number(STUDY, "table1/softmax_time_over_hdc", "HDC by ordinary routes")
    assert found.value is None


def test_what_so_few_seeds_can_tell_is_said_once(tmp_path, timed):
    timed()
    assert table(tmp_path).note.count("no sign test over them can go below p = 0.25") == 1


def test_maxima_that_a_record_does_not_have_are_no_numbers(tmp_path, write_run):
    identity = write_run("hdc", train_accuracy_max=None, test_accuracy_max=None)
    (tmp_path / "runs" / identity / "curve.csv").write_text("training_s,loss\n0.5,nan\n")
    names = [quantity.name for quantity in STUDY.quantities(Results(tmp_path))]
    assert "table1/hdc_training_time" in names
    identity = write_run("softmax", train_accuracy_max=None, test_accuracy_max=None)
    (tmp_path / "runs" / identity / "curve.csv").write_text("training_s,loss\n0.5,nan\n")
    names = [quantity.name for quantity in STUDY.quantities(Results(tmp_path))]
    assert "table1/softmax_training_time" in names
    assert not [name for name in names if "softmax" in name and "accuracy" in name]


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
