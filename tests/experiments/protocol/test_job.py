"""One config, one record: named after what determines it, not repeated, kept when it breaks off."""

import json

import numpy as np
import pytest
import torch
from omegaconf import OmegaConf

import hdc
from experiments.protocol import job
from experiments.records import locks, record
from experiments.records.record import Finished, read_curve, read_record
from experiments.records.results import Results


def the_folder(results):
    (folder,) = (results / "runs").iterdir()
    return folder


def test_a_run_says_what_it_was_and_what_came_out(carry_out, frames_and_labels):
    entry = carry_out()
    assert read_record(carry_out.last[0]) == entry
    assert (entry.status, entry.stop, entry.error) == ("finished", "finished", None)
    assert entry.scene.origin == "recorded"
    assert (entry.scene.shape, entry.scene.skipped) == ((16, 16), [])
    assert entry.config["threads"] == entry.environment.threads == 1
    assert (entry.n_train, entry.n_test) == (40, 10)
    # Every figure again, from the predictions in the record.
    held = json.loads((carry_out.last[0] / "record.json").read_text())
    assert entry.test_accuracy_final == entry.right.mean()
    frames, labels = frames_and_labels()
    np.testing.assert_array_equal(entry.test_labels, labels[held["test_indices"]])
    train = np.setdiff1d(np.arange(50), held["test_indices"])
    model = hdc.HDCClassifier().fit(frames[train], labels[train])
    np.testing.assert_array_equal(entry.predicted, model.predict(frames[held["test_indices"]]))
    assert entry.model_bytes == sum(t.nbytes for t in model.state_tensors().values())
    assert 0 < entry.predict_single_s < 1
    assert 0 < entry.training_s < 10


def test_the_config_in_a_record_is_the_whole_config(carry_out, composed_run):
    config = OmegaConf.to_container(composed_run(), resolve=True)
    for key in record.NOT_IDENTITY:
        config.pop(key, None)
    assert carry_out().config == config


IDENTITY = [
    "seed.run=1",
    "seed.sensor=7",
    "seed.samples=7",
    "seed.split=7",
    "seed.init=7",
    "seed.pixels=7",
    "split.kind=ordered",
    "split.test_fraction=0.4",
    "split.n_train=20",
    "data.pixels=100",
    "model.ties=one",
    "stop.most_steps=3000",
    "scene.subsample=2",
]


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


def test_the_same_run_gives_the_same_predictions(carry_out):
    first, again = carry_out(), carry_out("force=true")
    assert first.predicted == again.predicted
    assert first.data_sha256 == again.data_sha256


def test_a_finished_run_is_not_repeated_unless_forced(carry_out, monkeypatch):
    first = carry_out()
    monkeypatch.setattr(job, "train_and_test", lambda *_: pytest.fail("run again"))
    assert carry_out() == first
    assert carry_out.last[1] is True
    monkeypatch.setattr(job, "train_and_test", lambda *_: (_ for _ in ()).throw(ZeroDivisionError))
    with pytest.raises(ZeroDivisionError):
        carry_out("force=true")


def slowed(folder, by=10):
    """The record and curve in a folder as if the machine had done something else beside it."""
    entry = json.loads((folder / "record.json").read_text())
    rows = read_curve(folder / "curve.csv")
    for row in rows:
        row["training_s"] *= by
    record.write_curve(folder, rows)
    record.write_record(folder, entry | {"training_s": entry["training_s"] * by})


def test_one_that_took_unlike_as_long_as_its_siblings_is_made_again_once(carry_out, monkeypatch):
    monkeypatch.setattr("experiments.records.timing._SHORTEST", 0)
    monkeypatch.setattr("experiments.records.timing.FACTOR", 100)  # of so short runs
    for seed in range(3):
        carry_out(f"seed.run={seed}")
    assert carry_out("seed.run=2").timed_again is None
    folder, found = carry_out.last
    assert found
    slowed(folder, 1e4)
    disturbed = read_record(folder).training_s
    made = carry_out("seed.run=2")
    assert (carry_out.last[1], made.timed_again) == (False, disturbed)
    assert made.training_s < disturbed / 100
    # Where it is as before, it stays and is told: the machine is no better.
    slowed(folder, 1e4)
    assert carry_out("seed.run=2").timed_again == disturbed
    assert carry_out.last[1]


def test_one_of_another_machine_is_not_made_again(carry_out, monkeypatch):
    monkeypatch.setattr("experiments.records.timing._SHORTEST", 0)
    monkeypatch.setattr("experiments.records.timing.FACTOR", 100)
    for seed in range(3):
        carry_out(f"seed.run={seed}")
    slowed(carry_out.last[0], 1e4)
    monkeypatch.setattr(job, "cpu_model", lambda: "Another CPU")
    carry_out("seed.run=2")
    assert carry_out.last[1]


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (RuntimeError("out of memory" + 20_000 * "!"), "failed"),  # more than a record can hold
        (KeyboardInterrupt(), "interrupted"),
        (SystemExit(143), "interrupted"),
    ],
)
def test_a_run_that_breaks_off_is_kept_and_run_again(
    carry_out, results, monkeypatch, fake, error, status
):
    real = hdc.HDCClassifier
    fake({"samples_seen": 1, "loss": 1.0}, error)  # neither the warm-up nor the first report fails
    with pytest.raises(type(error)):
        carry_out()
    folder = the_folder(results)
    entry = read_record(folder)
    assert entry.status == status
    assert entry.error.startswith(type(error).__name__)
    assert len(read_curve(folder / "curve.csv")) == 1
    monkeypatch.setattr(hdc, "HDCClassifier", real)
    again = carry_out()
    assert again.id == folder.name
    assert (again.status, again.error) == ("finished", None)


def test_the_curve_of_an_earlier_attempt_does_not_outlive_it(carry_out, monkeypatch):
    carry_out()
    monkeypatch.setattr(job, "train_and_test", lambda *_: (_ for _ in ()).throw(OSError("disk")))
    with pytest.raises(OSError, match="disk"):
        carry_out("force=true")
    assert not (carry_out.last[0] / "curve.csv").exists()


@pytest.mark.parametrize("change", [None, {"training_s": "soon"}, {"predicted": [9] * 10}])
def test_a_damaged_record_is_named_and_not_overwritten_unless_forced(carry_out, change):
    carry_out()
    path = carry_out.last[0] / "record.json"
    damaged = json.dumps(json.loads(path.read_text()) | change) if change else '{"schema": 3, "st'
    path.write_text(damaged)
    with pytest.raises(ValueError, match=r"record\.json: .*expected .*force=true") as caught:
        carry_out()
    assert str(path) in str(caught.value)
    assert path.read_text() == damaged
    assert carry_out("force=true").status == "finished"


def test_one_that_another_process_is_at_is_left_to_it(carry_out, results):
    carry_out()
    with locks.held(carry_out.last[0] / locks.FILE):
        assert carry_out().status == "finished"  # what is finished can be shown
        with pytest.raises(locks.Held):
            carry_out("force=true")


def test_many_classes_are_read_again(carry_out, recording):
    """850 classes made a record larger than what was read: finished, and an error ever after."""
    path = recording(5000, 1000, 8)
    first = carry_out("exclusive=false", scene=path)
    assert len(first.scene.classes) == 1000
    assert carry_out(scene=path) == first
    assert carry_out("force=true", scene=path).predicted == first.predicted
    assert (carry_out.last[0] / "record.json").stat().st_size < 100_000


# Nothing trained is lost --------------------------------------------------------------------------


def breaks(*_):
    raise RuntimeError("not that way")


@pytest.mark.parametrize("broken", [breaks, lambda self: {"w": [1]}, lambda self: None])
def test_a_model_whose_size_is_not_known_is_finished_without_it(carry_out, fake, broken):
    fake({"samples_seen": 1}, state_tensors=broken)
    entry = carry_out()
    assert isinstance(entry, Finished)
    assert entry.model_bytes is None


def test_a_model_that_cannot_predict_in_the_end_leaves_its_times_and_curve(
    carry_out, results, fake
):
    calls = []

    def predict(self, frames):
        calls.append(len(frames))
        if len(calls) > 5:  # one in the warm-up, two a report
            raise RuntimeError("not that way")
        return np.zeros(len(frames), np.int64)

    fake({"samples_seen": 1, "loss": 2.0}, {"samples_seen": 2, "loss": 1.0}, predict=predict)
    with pytest.raises(RuntimeError, match="not that way"):
        carry_out()
    folder = the_folder(results)
    entry = read_record(folder)
    assert (entry.status, entry.error) == ("failed", "RuntimeError: not that way")
    assert entry.training_s > 0
    held = json.loads((folder / "record.json").read_text())
    assert held["train_accuracy_max"] == 0.2
    assert held["n_train"] == 40
    assert len(read_curve(folder / "curve.csv")) == 2


def test_predictions_that_are_no_classes_are_a_failure_that_can_be_read(carry_out, results, fake):
    fake({"samples_seen": 1}, predict=lambda self, frames: np.full(len(frames), 99))
    with pytest.raises(ValueError, match="predicted: expected labels below 5, found 99"):
        carry_out()
    entry = read_record(the_folder(results))
    assert (entry.status, entry.training_s > 0) == ("failed", True)
    assert Results(results).problems == []


# What the user did wrong --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["scene.path=???"], r"^scene\.path: expected a value, found none"),
        (["scene.path=/nowhere"], r"^scene\.path: expected a folder"),
        (["scene.subsample=0"], r"^scene\.subsample: expected"),
        (["+scene.colour=1"], r"^scene: .*unexpected keyword argument 'colour'"),
        (["+model.colour=1"], r"^model: .*unexpected keyword argument 'colour'"),
        (["stop.loss=-1"], r"^stop\.loss: expected at least 0, found -1"),
        (["+stop.colour=0"], r"^stop\.colour: expected one of target, reached_after_s, loss"),
        (["split.kind=sorted"], r"^split\.kind: expected one of"),
        (["data.pixels=1"], r"^data\.pixels: expected"),
        (["exclusive=no"], r"^exclusive: expected true or false, found 'no'"),
        (["exclusive=none"], r"^exclusive: expected true or false, found 'none'"),
        (["force=no"], r"^force: expected true or false, found 'no'"),
        (["cache=7"], r"^cache: expected true or false, found 7"),
        (["seed.run=99999999999999999999999"], r"^seed\.run: expected an integer of at most 2"),
        (["seed.init=1.5", "model=softmax"], r"^seed\.init: expected an integer .*found 1\.5"),
        (["seed.run=abc"], r"^seed\.run: expected an integer .*found 'abc'"),
        *(
            ([f"device={name}"], r"^device: expected one of cpu.*, found")
            for name in ("gpu", "mps", "meta", "1", "null", "true", "cuda:99")
        ),
    ],
    ids=lambda given: given[-1] if isinstance(given, list) else None,
)
def test_a_wrong_value_is_named_by_its_key(carry_out, results, overrides, message):
    with pytest.raises(ValueError, match=message):
        carry_out(*overrides)


@pytest.mark.parametrize("wrong", ["+model.colour=1", "stop.loss=-1", "split.kind=sorted"])
def test_what_is_wrong_is_found_before_frames_are_made(carry_out, monkeypatch, wrong):
    monkeypatch.setattr("experiments.protocol.data.cached", lambda *_: pytest.fail("too late"))
    monkeypatch.setattr("experiments.protocol.data.take", lambda *_: pytest.fail("too late"))
    with pytest.raises(ValueError, match=wrong.lstrip("+")[:5]):
        carry_out(wrong)


def test_a_name_that_no_record_can_have_is_refused_before_the_training(
    carry_out, composed_run, results
):
    with pytest.raises(ValueError, match=r"choices\.model: expected .* regex"):
        job.run(composed_run(), {"scene": "recorded", "model": "my model"}, [], None)
    assert not list(results.glob("runs/*/record.json"))


# Frames that cannot be read -----------------------------------------------------------------------


def test_a_run_stops_at_a_bad_frame_or_lists_what_it_skipped(carry_out, tmp_path):
    import cv2

    folder = tmp_path / "frames"
    for k in range(12):
        (folder / "ab"[k % 2]).mkdir(parents=True, exist_ok=True)
        cv2.imwrite(
            str(folder / "ab"[k % 2] / f"{k}.png"),
            np.add.outer(np.arange(8), np.arange(8) * k).astype(np.uint8),
        )
    whole = carry_out("scene.on_bad_frame=skip", scene=folder)
    bad = folder / "b" / "[bold]7.png"
    bad.write_bytes(b"")
    with pytest.raises(ValueError, match=r"b/\[bold\]7.png: expected an image, found an empty"):
        carry_out(scene=folder)
    without = carry_out("scene.on_bad_frame=skip", scene=folder)
    assert whole.scene.skipped == []
    assert without.scene.skipped == [f"{bad}: expected an image, found an empty file"]
    assert (without.scene.n, without.id == whole.id) == (12, False)
