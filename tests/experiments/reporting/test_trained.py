"""The numbers of a row of a table of runs against the records they come from."""

import pytest

from experiments.records.results import RUNS, Results
from experiments.reporting.trained import of_runs

SECONDS = ["training_time_s", "total_time_s", "predict_single_s"]
SECONDS += ["predict_batch_s_per_frame", "at_least_s"]


@pytest.fixture
def rows(tmp_path):
    """rows() → the rows of all runs in tmp_path by model."""
    return lambda: of_runs(Results(tmp_path).frame(RUNS)).set_index("model")


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
