"""Teaching, recalibrating, saving and loading without a browser, on a small simulated sensor."""

import time

import cv2
import numpy as np
import pytest

from hdc import HDCClassifier
from hdc.live import open_source
from hdc.live.session import Session
from hdc.live.worker import Worker
from hdc.readers import Window
from scenes.pressed import DEPTH, PressedSession
from scenes.sensor.contact import Touch
from scenes.simulated import SIXTEEN_DAYS, SimulatedSensor

PLACES = {name: Touch(DEPTH, x, 0.0)
          for name, x in (("left", 0.028), ("middle", 0.040), ("right", 0.052))}  # fmt: skip


def teach(session, name, n=20):
    session.source.press(PLACES[name])
    session.learn(name, n, new=name not in session.counts)


def accuracy(session):
    asked = [(c, f) for c in PLACES for f in session.source.touched(30, PLACES[c])]
    return np.mean([session.ask(frame).label == name for name, frame in asked])


@pytest.fixture
def empty():
    return PressedSession(SimulatedSensor(side=100))


@pytest.fixture
def taught(empty):
    for name in PLACES:
        teach(empty, name)
    return empty


def test_it_is_taught_drifts_and_is_recalibrated(taught):
    before = accuracy(taught)
    assert before > 0.75  # chance is a third
    for _ in range(12):
        taught.test()
    assert len(taught.tests) == 12
    assert sum(taught.tests) >= 9
    taught.drift(SIXTEEN_DAYS)
    assert not taught.tests
    assert accuracy(taught) < before - 0.2
    taught.recalibrate_all(20)
    assert accuracy(taught) > 0.75
    assert taught.counts == dict.fromkeys(PLACES, 40)


def test_one_class_is_recalibrated_by_the_present_touch_and_learns_on(taught):
    before = taught.model.prototypes_
    taught.recalibrate("left", 5)
    changed = (taught.model.prototypes_ != before).any(1).tolist()
    assert changed == [name == "left" for name in taught.model.classes_]
    teach(taught, "left", 5)
    assert taught.counts == {"left": 30, "middle": 20, "right": 20}


def test_tests_and_recalibration_return_to_where_a_class_was_touched_last(taught):
    elsewhere = Touch(1.5e-3, 0.033, 2e-3)
    taught.source.press(elsewhere)
    taught.learn("left", 5)
    asked = []
    taught.source.touched = lambda n, touch: asked.append(touch) or []
    taught.recalibrate_all(1)
    assert asked == [elsewhere, PLACES["middle"], PLACES["right"]]


def test_forgetting_a_class_equals_never_teaching_it(taught):
    other = PressedSession(SimulatedSensor(side=100))
    teach(other, "left")
    other.source.touched(21, PLACES["middle"])  # as the other: a press and 20 samples
    teach(other, "right")
    taught.forget("middle")
    assert (taught.model.prototypes_ == other.model.prototypes_).all()
    assert list(taught.counts) == list(taught.places) == ["left", "right"]
    taught.recalibrate_all(5)
    taught.forget("left")  # one class is left, which cannot be recalibrated
    assert taught.counts == {"right": 25}
    taught.forget("right")
    assert (taught.counts, taught.model) == ({}, None)


def test_the_model_is_saved(taught, tmp_path):
    frames = taught.source.touched(20, PLACES["left"])
    (tmp_path / "m").write_bytes(taught.saved())
    saved = HDCClassifier.load(tmp_path / "m")
    assert (saved.predict(frames) == taught.model.predict(frames)).all()
    assert saved.metadata_["subsample"] == 1


@pytest.mark.parametrize(
    ("job", "message"),
    [
        (lambda s: s.learn(" ", 1, new=True), "A class needs a name"),
        (lambda s: s.learn("left", 1, new=True), "a class “left” already"),
        (lambda s: s.learn("nobody", 1), "There is no class “nobody” any more"),
        (lambda s: s.forget("nobody"), "There is no class “nobody” any more"),
    ],
)
def test_a_refused_operation_changes_nothing(taught, job, message):
    before = taught.counts, taught.places, taught.model
    with pytest.raises(ValueError, match=message):
        job(taught)
    assert (taught.counts, taught.places, taught.model) == before


def wait_for(condition, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_the_worker_survives_jobs_and_frames_that_fail(empty, monkeypatch):
    worker = Worker(empty)
    worker.start()
    worker.do(lambda session: teach(session, "left", 3))
    assert worker.view.drawn is None  # no page asks for pictures
    monkeypatch.setattr(empty.source, "frame", lambda: np.zeros(0).max())
    worker.picture()
    wait_for(lambda: "zero-size array" in worker.view.error)
    monkeypatch.undo()
    with pytest.raises(KeyError):
        worker.do(lambda session: session.places["nobody"])
    wait_for(lambda: worker.picture() and not worker.view.error)
    picture = cv2.imdecode(np.frombuffer(worker.picture(), np.uint8), 0)
    assert picture.shape == (100, 200)
    worker.stop()


def test_a_recording_is_played_over_and_over_and_learnt(tmp_path, frames_and_labels):
    frames, labels = frames_and_labels(n=40, classes=2)
    order = np.argsort(labels, kind="stable")
    np.savez(tmp_path / "r.npz", frames=frames, labels=labels, order=np.argsort(order))
    session = Session(open_source(Window(), tmp_path / "r.npz", None, 0))
    seen = [np.hsplit(session.look().drawn, 2)[0] for _ in range(80)]
    # The first was looked at for its size.
    assert np.array_equal(seen[:40], np.roll(frames[order], -1, axis=0))
    assert np.array_equal(seen[40:], seen[:40])
    session.learn("1 mm", 6, new=True)
    while not np.array_equal(session.source.frame(), frames[order[20]]):
        pass
    session.learn("2 mm", 6, new=True)
    session.learn("2 mm", 4)
    assert session.counts == {"1 mm": 6, "2 mm": 10}
    asked = [session.ask(frame).label for frame in frames[order]]
    assert asked.count("1 mm") == asked[:20].count("1 mm") >= 6


def test_what_is_no_image_is_not_played(tmp_path):
    np.savez(tmp_path / "v.npz", frames=np.ones((6, 7)), labels=[0, 1] * 3)
    with pytest.raises(ValueError, match=r"v\.npz: expected images .* found float64"):
        open_source(Window(), tmp_path / "v.npz", None, 0)
