"""Which runs took unlike as long as others that did the same."""

import json

import pytest

from experiments.records.results import Results
from experiments.records.timing import seconds_a_sample, unlike_siblings


def run_for(write_run, seed, seconds, samples=400, **more):
    curve = [{"training_s": seconds, "samples_seen": samples, "loss": 1.0, "train_accuracy": 0.95}]
    return write_run("softmax", seed=seed, curve=curve, **more)


def flagged(folder):
    return sorted(run.record.seed for run in unlike_siblings(Results(folder).runs))


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [
        ([1, 1, 1], []),
        ([1, 1.4, 1], []),
        # One of five took four times as long a sample, and made the interval of all a decade wide.
        ([1, 4, 1.1, 1.2, 1], [1]),
        ([1, 1, 0.6], [2]),
        ([1, 4, 1], [1]),
        ([1, 1.6], [0, 1]),
        ([1], []),
        ([0.001, 0.004, 0.001], []),  # too short to tell
    ],
)
def test_one_that_took_another_time_a_sample_is_found(tmp_path, write_run, seconds, expected):
    for seed, time in enumerate(seconds):
        run_for(write_run, seed, time)
    assert flagged(tmp_path) == expected


def test_it_is_the_time_of_a_sample_that_counts(tmp_path, write_run):
    for seed, epochs in enumerate((1, 3, 1)):
        run_for(write_run, seed, 2.0 * epochs, samples=400 * epochs)
    assert flagged(tmp_path) == []
    (first, *_) = Results(tmp_path).runs
    assert seconds_a_sample(first.record, first.curve) == pytest.approx(2 / 400)


def test_only_what_did_the_same_on_the_same_machine_is_compared(tmp_path, write_run):
    run_for(write_run, 0, 1.0)
    run_for(write_run, 1, 9.0, n_train=100)
    run_for(write_run, 2, 9.0, change={"model.lr": 0.01})
    identity = run_for(write_run, 3, 9.0)
    path = tmp_path / "runs" / identity / "record.json"
    entry = json.loads(path.read_text())
    entry["environment"]["cpu"] = "Another CPU"
    path.write_text(json.dumps(entry))
    assert flagged(tmp_path) == []


def test_the_row_says_so(tmp_path, write_run):
    for seed, time in enumerate((1, 4, 1)):
        run_for(write_run, seed, time)
    status = Results(tmp_path).group("touch", "softmax").status
    assert status == "timing unlike its siblings': seed 1"
