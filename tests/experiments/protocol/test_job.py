"""One config, one record: named after what determines it, not repeated, kept when it breaks off."""

import msgspec
import numpy as np
import pytest
import torch

import hdc
from experiments.protocol import job
from experiments.records import locks, record
from experiments.records.results import Results
from experiments.records.rows import unpack_labels


def the_record(results):
    (entry,) = record.read(results)
    return entry


def test_a_run_says_what_it_was_and_what_came_out(
    carry_out, results, frames_and_labels
):
    entry = carry_out()
    assert the_record(results) == entry
    assert (entry.status, entry.stop, entry.error) == ("finished", "finished", None)
    assert entry.scene.origin == "recorded"
    assert entry.scene.shape == (16, 16)
    assert entry.config["threads"] == entry.environment.threads == 1
    assert (entry.n_train, entry.n_test) == (40, 10)
    # Every figure again, from the predictions in the record.
    held = msgspec.json.decode((results / record.RUNS).read_bytes())
    assert entry.test_accuracy_final == entry.right.mean()
    frames, labels = frames_and_labels()
    tested = unpack_labels(held["test_indices"])
    np.testing.assert_array_equal(entry.test_labels, labels[tested])
    train = np.setdiff1d(np.arange(50), tested)
    model = hdc.HDCClassifier().fit(frames[train], labels[train])
    np.testing.assert_array_equal(entry.predicted, model.predict(frames[tested]))
    assert entry.model_bytes == sum(t.nbytes for t in model.state_tensors().values())
    assert 0 < entry.predict_single_s < 1
    assert 0 < entry.training_s < 10


IDENTITY = ["seed.run=1", "seed.pixels=7", "split.kind=ordered", "split.n_train=20",
            "data.pixels=100", "model.readout.ties=one", "scene.subsample=2"]  # fmt: skip


def test_the_id_is_a_function_of_config_and_data(carry_out, recording):
    path = recording()
    first = carry_out(scene=path).id
    ids = [carry_out(override, scene=path).id for override in IDENTITY]
    assert len({first, *ids}) == len(IDENTITY) + 1
    for override in ("force=true", "cache=false", "exclusive=false"):
        assert carry_out(override, scene=path).id == first
    torch.set_num_threads(2)
    assert carry_out(scene=path).id not in {first, *ids}
    torch.set_num_threads(1)
    with np.load(path) as held:
        frames, labels = held["frames"], held["labels"]
    frames[3, 0, 0] ^= 1
    np.savez(path, frames=frames, labels=labels)
    assert carry_out(scene=path).id not in {first, *ids}


def test_a_finished_run_is_not_repeated_unless_forced(carry_out, results, monkeypatch):
    first = carry_out()
    monkeypatch.setattr(job, "train_and_test", lambda *_: pytest.fail("run again"))
    assert carry_out() == first
    assert carry_out.repeated
    monkeypatch.setattr(
        job, "train_and_test", lambda *_: (_ for _ in ()).throw(ZeroDivisionError)
    )
    with pytest.raises(ZeroDivisionError):
        carry_out("force=true")
    assert the_record(results) == first  # the failed repetition leaves it


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (
            RuntimeError("out of memory" + 20_000 * "!"),
            "failed",
        ),  # more than a record can hold
        (KeyboardInterrupt(), "interrupted"),
        (SystemExit(143), "interrupted"),
    ],
)
def test_a_run_that_breaks_off_is_kept_and_run_again(
    carry_out, results, monkeypatch, fake, error, status
):
    real = hdc.HDCClassifier
    fake(
        {"samples_seen": 1, "loss": 1.0}, error
    )  # neither the warm-up nor the first report fails
    with pytest.raises(type(error)):
        carry_out()
    entry = the_record(results)
    assert entry.status == status
    assert entry.error.startswith(type(error).__name__)
    assert len(entry.error) <= 2000
    assert len(record.curve_of(entry)) == 1
    monkeypatch.setattr(hdc, "HDCClassifier", real)
    again = carry_out()
    assert again == the_record(results)
    assert (again.id, again.status, again.error) == (entry.id, "finished", None)


def test_a_run_that_another_process_is_at_is_left_to_it(carry_out, results):
    entry = carry_out()
    with locks.held(results / "cache" / "locks" / entry.id):
        assert carry_out() == entry  # a finished run can be shown
        with pytest.raises(locks.Held):
            carry_out("force=true")


# Nothing trained is lost --------------------------------------------------------------------------


def breaks(*_):
    raise RuntimeError("not that way")


def test_a_model_whose_size_is_not_known_is_finished_without_it(carry_out, fake):
    fake({"samples_seen": 1}, state_tensors=lambda self: {"w": [1]})
    assert carry_out().model_bytes is None


def test_a_model_that_cannot_predict_in_the_end_leaves_its_times_and_curve(
    carry_out, results, fake
):
    calls = []

    def predict(self, frames):
        calls.append(len(frames))
        if len(calls) > 5:  # one in the warm-up, two a report
            raise RuntimeError("not that way")
        return np.zeros(len(frames), np.int64)

    fake(
        {"samples_seen": 1, "loss": 2.0},
        {"samples_seen": 2, "loss": 1.0},
        predict=predict,
    )
    with pytest.raises(RuntimeError, match="not that way"):
        carry_out()
    entry = the_record(results)
    assert (entry.status, entry.error) == ("failed", "RuntimeError: not that way")
    assert entry.training_s > 0
    held = msgspec.json.decode((results / record.RUNS).read_bytes())
    assert held["train_accuracy_max"] == 0.2
    assert held["n_train"] == 40
    assert len(record.curve_of(entry)) == 2


def test_predictions_that_are_no_classes_are_a_failure_that_can_be_read(
    carry_out, results, fake
):
    fake({"samples_seen": 1}, predict=lambda self, frames: np.full(len(frames), 99))
    with pytest.raises(
        ValueError, match="predicted: expected labels below 5, found 99"
    ):
        carry_out()
    entry = the_record(results)
    assert (entry.status, entry.training_s > 0) == ("failed", True)
    assert Results(results).problems == []


# What the user did wrong --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["scene.path=???"], r"^scene\.path: expected a value, found none"),
        (["+scene.colour=1"], r"^scene: .*unexpected keyword argument 'colour'"),
        (["stop.loss=-1"], r"^stop\.loss: expected at least 0, found -1"),
        (
            ["+stop.colour=0"],
            r"^stop\.colour: expected one of target, reached_after_s, loss",
        ),
        (
            ["split.test_fraction=nan"],
            r"^split\.test_fraction: expected a number, found nan",
        ),
        (["model.device=cuda:99"], r"^model\.device: expected one of cpu"),
        (["exclusive=no"], r"^exclusive: expected true or false, found 'no'"),
        (
            ["seed.run=99999999999999999999999"],
            r"^seed\.run: expected an integer from 0 to 2\^53, found 9",
        ),
        (["device=null"], r"^device: expected one of cpu.*, found None"),
    ],
    ids=lambda given: given[-1] if isinstance(given, list) else None,
)
def test_a_wrong_value_is_named_by_its_key(carry_out, results, overrides, message):
    with pytest.raises(ValueError, match=message):
        carry_out(*overrides)
