"""The numbers of a row of a table of runs against the records they come from."""

import numpy as np
import pytest

from experiments.records.results import RUNS, Results
from experiments.reporting.estimates import mean_share
from experiments.reporting.trained import of_runs

SECONDS = ["training_time_s", "total_time_s", "predict_single_s"]
SECONDS += ["predict_batch_s_per_frame", "at_least_s"]


@pytest.fixture
def rows(tmp_path):
    """rows() → the rows of all runs in tmp_path by model."""
    return lambda: of_runs(Results(tmp_path).frame(RUNS)).set_index("model")


def test_numbers_are_those_of_the_records(rows, write_run, epochs):
    times, reached = [0.4, 0.3, 0.35], (1, 0.9, 0.95)
    for seed in range(3):
        curve = [{"training_s": times[seed], "train_accuracy": reached[seed]}]
        write_run("hdc", seed=seed, wrong=range(seed), curve=curve)
        curve = epochs(0.5, 0.9, 0.95)  # 0.9 does not exceed 90 %
        write_run("softmax", seed=seed, wrong=range(2), curve=curve)
    hdc, softmax = rows().loc["hdc"], rows().loc["softmax"]
    names = ["seeds", "status", "training_time_s", "train_accuracy_max", "pixels"]
    expected = [3, "ok", 0.35, pytest.approx(0.95), 250_000]
    assert hdc[names].tolist() == expected
    assert hdc.split == "random split, 20 % test"
    found = [hdc[f"test_accuracy_final{end}"] for end in ("", "_low", "_high")]
    assert found == pytest.approx(mean_share([1, 0.99, 0.98], 100))
    assert np.isnan(hdc.over_hdc)
    assert softmax.over_hdc == pytest.approx(-0.01)
    assert softmax.over_hdc_low < -0.01 < softmax.over_hdc_high
    assert (softmax.training_time_s, softmax.total_time_s) == (30, 30)


def test_a_training_that_never_got_there_has_no_time_but_a_bound(
    rows, write_run, epochs
):
    write_run("cnn1", curve=epochs(0.5, 0.6))
    line = rows().loc["cnn1"]
    assert (line.training_time_s, line.at_least_s) == (None, 20)
    assert line.seeds_at_target == 0
    # The median of three is that of one which got there.
    write_run("cnn1", seed=1, curve=epochs(0.95))
    write_run("cnn1", seed=2, curve=epochs(0.5, 0.95))
    line = rows().loc["cnn1"]
    assert (line.training_time_s, line.at_least_s, line.seeds_at_target) == (
        20,
        None,
        2,
    )


def test_seconds_are_those_of_runs_that_were_alone_and_of_no_others(rows, write_run):
    for model, alone in (("hdc", (True, True)), ("ridge", (True, False))):
        for seed, exclusive in enumerate(alone):
            about = {"environment": {"exclusive": exclusive}}
            write_run(model, seed=seed, wrong=range(2), **about)
    found = rows()
    assert found.loc["hdc", SECONDS[:-1]].tolist() == [0.5, 0.5, 1e-3, 1e-4]
    assert found.loc["ridge", SECONDS].isna().all()
    assert found.loc["ridge"].status == "1 timed beside other runs"
    assert found.loc["ridge"].test_accuracy_final == 0.98
