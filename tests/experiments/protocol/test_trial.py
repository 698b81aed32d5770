"""Training under the clock: what is counted, when it is evaluated, and why it ends."""

import types

import numpy as np
import pytest

from experiments.protocol import data, measure_run
from experiments.protocol.model import check_model, models_of


def test_only_training_counts(carry_out, fake, monkeypatch):
    now = types.SimpleNamespace(t=0.0)
    monkeypatch.setattr("experiments.protocol.clock.time.perf_counter", lambda: now.t)

    def train(self, frames, labels):
        now.t += 1  # what a model does before its iterator counts as well

        def reports():
            for k in range(3):
                now.t += 10
                yield {"samples_seen": k, "loss": 1.0}

        return reports()

    def predict(self, frames):
        now.t += 1000
        return np.zeros(len(frames), np.int64)

    fake(train=train, predict=predict)
    entry = carry_out("exclusive=false")
    assert entry.results["total_time_s"] == 31
    assert entry.results["predict_single_s"] == 1000
    assert entry.results["predict_batch_s_per_frame"] == 100


def test_the_model_that_is_tested_has_not_seen_the_warm_up(carry_out, fake):
    """Noise warms up one that is thrown away."""
    trained, asked = [], []

    def train(self, frames, labels):
        trained.append(self)
        yield {"samples_seen": len(labels)}

    def predict(self, frames):
        asked.append(self)
        return np.zeros(len(frames), np.int64)

    fake(train=train, predict=predict)
    assert carry_out().results["n_train"] == 40
    warmed_up, tested = trained
    assert asked[0] is warmed_up is not tested
    assert set(asked[1:]) == {tested}


def test_a_curve_is_read_where_it_first_exceeds_the_target(
    carry_out, fake, monkeypatch
):
    pairs = [(0.9, 0.9), (0.91, 0.8), (1.0, 0.95), (0.95, 0.2)]  # training, test
    read = iter([share for pair in pairs for share in pair])
    fake(*({"samples_seen": k, "steps": k, "loss": 1.0} for k in range(4)))
    right = measure_run.accuracy  # of the final predictions
    monkeypatch.setattr(
        measure_run, "accuracy", lambda *given: next(read, None) or right(*given)
    )
    entry = carry_out()
    times = [row["training_s"] for row in entry.curve]
    expected = {
        "training_time_s": times[1],
        "train_accuracy_at_target": 0.91,
        "test_accuracy_at_target": 0.8,
    }
    assert entry.results.items() >= expected.items()


@pytest.mark.parametrize("loss", [np.nan, np.inf])
def test_a_model_whose_loss_is_not_finite_is_tested_at_its_end_alone(
    carry_out, fake, loss
):
    asked = []

    def predict(self, frames):
        asked.append(len(frames))
        return np.zeros(len(frames), np.int64)

    reports = [{"samples_seen": k, "steps": k, "loss": loss} for k in (1, 2)]
    fake(*reports, predict=predict)
    entry = carry_out()
    (row,) = entry.curve
    assert (entry.results["stop"], row["samples_seen"]) == ("diverged", 1)
    assert not {"loss", "train_accuracy", "test_accuracy"} & set(row)
    # One in the warm-up, then the training frames and the test frames, once.
    assert asked[:3] == [2, 40, 10]


# Many frames --------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["hdc", "correlation", "softmax"])
def test_too_many_frames_are_read_in_parts_and_give_the_same_record(
    carry_out, recording, monkeypatch, model
):
    """All test frames were read at once, of however many gigabytes."""
    path = recording(1000, 5, 8)
    words = (f"model={model}", "split.test_fraction=0.5", "force=true")
    whole = carry_out(*words, scene=path)
    most = 300
    monkeypatch.setattr(data, "IN_MEMORY_BYTES", most * 64)
    asked, real = [], data.LazyFrames.__getitem__

    def counted(frames, index):
        asked.append(real(frames, index).numel() / 64)
        return real(frames, index)

    monkeypatch.setattr(data.LazyFrames, "__getitem__", counted)
    lazy = carry_out(*words, scene=path)
    assert 0 < max(asked) <= most
    for key in ("predicted", "test_set", "train_accuracy_final"):
        assert lazy.results[key] == whole.results[key]


# What a model does wrong --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("report", "methods", "message"),
    [
        ({"note": "a"}, {}, r"report\['note'\]: expected a number, found 'a'"),
        ({"training_s": 0.0}, {}, r"report\['training_s'\]: expected no such key"),
        (
            {"samples_seen": 1},
            {"predict": lambda self, frames: frames.zero_()[:, 0, 0].long().numpy()},
            "expected it to leave its frames as they are",
        ),
    ],
    ids=range(3),
)
def test_what_would_spoil_a_record_is_refused(
    carry_out, fake, report, methods, message
):
    fake(report, **methods)
    with pytest.raises(ValueError, match=message):
        carry_out()


def test_a_model_whose_size_is_not_known_is_finished_without_it(carry_out, fake):
    fake({"samples_seen": 1}, state_tensors=lambda self: None)
    assert carry_out().results["model_bytes"] is None


def test_an_object_that_is_no_model_is_refused_with_a_hint():
    for model in (types.SimpleNamespace(fit=None), {"lr": 1}):
        with pytest.raises(ValueError, match=r"^model: expected an object with train"):
            check_model(model)
    wrong = {"_target_": "sklearn.linear_model.RidgeClassifier"}
    message = r"^task\.models\.wrong\.model: expected an object with train"
    with pytest.raises(ValueError, match=message):
        models_of({"wrong": {"model": wrong}})
