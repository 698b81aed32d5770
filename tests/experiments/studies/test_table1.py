"""Table I: published and measured side by side, and error against run time."""

import numpy as np
import pytest

from experiments.records.results import Results
from experiments.reporting.table import records
from experiments.studies.table1.view import LINES, STUDY


def epochs(*accuracies):
    return [
        {"training_s": 10.0 * k, "loss": 1.0, "train_accuracy": a, "test_accuracy": a}
        for k, a in enumerate(accuracies, 1)
    ]


def table(folder, name="table1"):
    (made,) = (t for t in STUDY.tables_of(Results(folder)) if t.name == name)
    return {row["model"]: row for row in records(made.data)}, made


def test_the_papers_models_have_a_row_each_whatever_was_run(tmp_path, a_full_set):
    rows, made = table(tmp_path)
    assert list(rows) == [
        model for model in LINES if model != "softmax_dual"
    ]  # not run
    assert rows["cnn3"]["status"] == "missing"  # it failed
    assert rows["softmax"]["published_training_time_s"] == 170
    assert {len(cells) for cells in made.cells()} == {len(made.heads)}


def test_numbers_of_table_1(tmp_path, write_run, number):
    for seed in (0, 1, 2):
        write_run(
            "hdc", seed=seed, curve=[{"training_s": 0.6 * 2**seed}], wrong=range(2)
        )
        write_run(
            "cnn1", seed=seed, curve=epochs(0.5, 0.8), stop="quick", wrong=range(9)
        )
    write_run("softmax", curve=epochs(0.5, 0.95), wrong=range(7))
    accuracy = number(STUDY, "table1/hdc_test_accuracy")
    assert (accuracy.value, accuracy.n, accuracy.seeds) == (98, 300, 3)
    assert accuracy.low < 98 < accuracy.high <= 100
    assert number(STUDY, "table1/hdc_training_time").value == 1.2
    assert number(STUDY, "table1/softmax_training_time").value == 20
    # As published: the maximum of a run, which has no interval.
    best = number(STUDY, "table1/softmax_test_accuracy")
    assert (best.value, best.low, best.high) == (95, None, None)
    assert number(STUDY, "table1/cnn1_training_time").value == "not reached in 20 s"
    assert number(STUDY, "table1/learning_rate").value == 1e-4
    assert number(STUDY, "touch/labels").value == 5
    names = [(q.name, q.condition) for q in STUDY.quantities_of(Results(tmp_path))]
    assert len(set(names)) == len(names)
    assert not [name for name, _ in names if "cnn3" in name]


ROUTE = {
    "operation": "train", "route": "torch.median, torchhd.multiset", "frames": "speckle", "n": 400,
    "d": 250_000, "l": 5, "median_s": 2.0, "min_s": 1.9, "samples": 9, "ratio_to_ours": 50.0,
    "peak_bytes": 1, "equal_result": True, "status": "ok",
}  # fmt: skip


@pytest.fixture
def timed(write_run, write_measurement):
    """timed(**row): three seeds of HDC and softmax, and a benchmark with a row of a route."""

    def make(cpu="A CPU", **row):
        for seed in range(3):
            write_run("hdc", seed=seed, curve=[{"training_s": 0.5 * 2**seed}])
            write_run("softmax", seed=seed, curve=epochs(*[0.5] * (1 + seed), 0.95))
        entry = write_measurement("benchmark", [ROUTE | row])
        write_measurement(
            "benchmark", [ROUTE | row], environment=entry["environment"] | {"cpu": cpu}
        )

    return make


def test_times_are_judged_as_ratios_to_both_kinds_of_hdc(tmp_path, timed, number):
    timed()
    # 20, 30 and 40 s over 0.5, 1 and 2 s: 40, 30 and 20 in each run.
    ours = number(STUDY, "table1/softmax_time_over_hdc", "HDC as written here")
    assert (ours.value, ours.low, ours.high) == pytest.approx((30, 20, 40))
    ordinary = number(STUDY, "table1/softmax_time_over_hdc", "HDC by ordinary routes")
    assert (ordinary.value, ordinary.low, ordinary.high) == pytest.approx((15, 10, 20))
    rows, _ = table(tmp_path)
    assert rows["softmax"]["training_time_over_ordinary_hdc"] == pytest.approx(15)


@pytest.mark.parametrize(
    "row",
    [
        {"n": 40},
        {"d": 10_000},
        {"median_s": None, "status": "skipped"},
        {"cpu": "Another"},
    ],
)
def test_a_denominator_that_was_not_measured_is_missing(tmp_path, timed, number, row):
    timed(**row)
    ratio = number(STUDY, "table1/softmax_time_over_hdc", "HDC by ordinary routes")
    assert ratio.value is None
    assert ratio.made_by == "python -m experiments.run experiment=benchmark"
    assert table(tmp_path)[0]["softmax"]["training_time_over_ordinary_hdc"] is None


def test_the_time_to_hdcs_accuracy_is_that_of_the_first_report_that_has_it(
    tmp_path, write_run
):
    for seed in (0, 1):
        write_run("hdc", seed=seed, curve=[{"training_s": 0.5}], wrong=range(4))
        write_run("softmax", seed=seed, curve=epochs(0.5, 0.92, 0.96, 0.9)[seed:])
        write_run("cnn1", seed=seed, curve=epochs(0.5, 0.94 + 0.02 * seed))
        write_run("correlation", seed=seed, curve=[{"training_s": 2.0}], wrong=range(5))
        for pixels, wrong in (
            (100, 4 + seed),
            (300, 4),
            (1000, 0),
        ):  # 300 suffice every seed
            pixel = [{"training_s": pixels / 1000}]
            write_run(
                "correlation", seed=seed, pixels=pixels, curve=pixel, wrong=range(wrong)
            )
    write_run("ridge", seed=7)  # no HDC of its seed
    rows, made = table(tmp_path, "equal_accuracy")
    assert list(rows) == ["hdc", "softmax", "cnn1", "correlation"]
    assert [cells[1] for cells in made.cells()] == ["all"] * 4 + ["300"]
    assert (rows["correlation"]["time"], rows["correlation"]["ratio"]) == (
        0.3,
        0.6,
    )  # the last
    assert rows["hdc"]["ratio"] == 1
    assert (rows["softmax"]["time"], rows["softmax"]["ratio"]) == (30, 60)
    assert (rows["cnn1"]["ratio_low"], rows["cnn1"]["ratio_high"]) == (40, np.inf)
    assert [cells[3] for cells in made.cells()][2:4] == ["never [20.0, never]", "never"]


@pytest.mark.filterwarnings("error")
def test_the_figure_has_the_papers_points_and_an_end_for_each_run(
    tmp_path, write_run, drawn
):
    for seed in range(5):
        write_run("hdc", seed=seed, wrong=[0] if seed == 0 else [])  # 1 of 500
    assert "training time, × HDC" in drawn(STUDY)["error_vs_time"]
    (plot,) = STUDY.plots_of(Results(tmp_path))
    axes = plot.draw().axes[0]
    stars = {
        (round(float(line.get_xdata()[0]), 6), round(float(line.get_ydata()[0]), 6))
        for line in axes.lines
        if line.get_marker() == "*"
    }
    published = {(round(170 / 1.24, 6), 0.1), (round(101.3 / 1.24, 6), 0.07)}
    assert published | {(round(441.3 / 1.24, 6), 0.07)} < stars  # over HDC's 1.24 s
    errors = np.concatenate(
        [np.asarray(line.get_ydata(), float) for line in axes.lines]
    )
    assert np.min(errors) == pytest.approx(0.5 / 500)  # no error has its strip
    assert 1 / 500 in np.round(errors, 12)
