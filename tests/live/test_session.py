"""What can be taught on the page, without a browser: on a small simulated sensor."""

import time
from functools import partial

import cv2
import numpy as np
import pytest

from hdc import HDCClassifier
from hdc.live import Recorded, Touch
from hdc.live.session import MOST_CLASSES, Session
from hdc.live.worker import Worker
from hdc.readers import Window
from scenes.live import SIXTEEN_DAYS, SimulatedSensor

PLACES = {"left": 0.028, "middle": 0.040, "right": 0.052}


def place(name):
    return (Touch(PLACES[name], 0.0, 1.8e-3),)


def run(job):
    for _ in job:
        pass


def answers(session, name, n=12):
    """What is said of n fresh touches."""
    return [session.ask(session.source.fresh(place(name))).label for _ in range(n)]


def share_right(session):
    return np.mean([label == name for name in PLACES for label in answers(session, name)])


@pytest.fixture
def empty():
    session = Session(SimulatedSensor(side=100))
    yield session
    session.ridge.wait()


@pytest.fixture
def taught(empty):
    for name in PLACES:
        run(empty.new_class(name, 20, place(name)))
    return empty


def test_it_is_taught_drifts_and_is_recalibrated(taught):
    session = taught
    assert session.counts == dict.fromkeys(PLACES, 20)
    before = share_right(session)
    assert before > 0.8
    session.drift(SIXTEEN_DAYS)
    assert share_right(session) < before - 0.2
    run(session.recalibrate(list(PLACES), 20, 0.75, "replace", None))
    assert share_right(session) > 0.8
    session.ridge.wait()
    assert session.ridge.samples == session.shown == 120


@pytest.mark.parametrize("method", ["replace", "merge"])
def test_one_class_is_recalibrated_by_what_is_pressed(taught, method):
    before = taught.prototypes()
    run(taught.recalibrate(["left"], 5, 1.0, method, place("right")))
    after = taught.prototypes()
    assert (after["right"] == before["right"]).all()
    assert (after["left"] != before["left"]).any()


def test_tests_touch_every_class_in_turn_and_begin_anew_with_a_drift(taught):
    for _ in range(12):
        assert taught.test()
    right, n = taught.tests
    assert n == 12
    assert right >= 9
    assert taught.points[-1].accuracy == right / n
    taught.drift(0.3)
    assert taught.tests == (0, 0)


def test_ridge_answers_for_the_same_samples(taught):
    pytest.importorskip("sklearn")
    taught.ridge.wait()
    frame = taught.source.fresh(place("middle"))
    assert taught.ask(frame).ridge == "middle"
    assert taught.ridge.samples == 60


def test_a_frame_of_noise_is_none_of_these(taught):
    noise = np.random.default_rng(0).integers(0, 256, (100, 100), np.uint8)
    answer = taught.ask(noise)
    assert answer.label is None
    assert (answer.distances > answer.limits).all()


def test_forgetting_a_class_is_as_if_it_had_never_been_taught(taught, empty):
    frames, labels = list(taught._frames), list(taught._labels)
    taught.forget("middle")
    kept = [(f, c) for f, c in zip(frames, labels, strict=True) if c != "middle"]
    fresh = HDCClassifier().fit(np.stack([f for f, _ in kept]), [c for _, c in kept])
    assert (taught.model.prototypes_ == fresh.prototypes_).all()
    assert set(taught.places) == {"left", "right"}
    taught.forget(None)
    assert taught.counts == {}
    assert taught.shown == 0


def test_a_model_is_saved_and_loaded(taught):
    content = taught.saved()
    other = Session(SimulatedSensor(side=100))
    other.load(content)
    assert other.counts == taught.counts
    assert (other.model.prototypes_ == taught.model.prototypes_).all()
    assert other.model.metadata_["simulated"]
    with pytest.raises(ValueError, match="Where “left” was touched is not known"):
        run(other.recalibrate(["left"], 2, 0.5, "merge", None))
    with pytest.raises(ValueError, match="everything or nothing"):
        other.forget("left")


@pytest.mark.parametrize(
    ("job", "said"),
    [
        (lambda s: run(s.new_class(" ", 1)), "A class needs a name"),
        (lambda s: run(s.new_class("a" * 30, 1)), "A class needs a name"),
        (lambda s: run(s.new_class("left", 1)), "a class “left” already"),
        (lambda s: run(s.add("nobody", 1)), "There is no class “nobody” any more"),
        (lambda s: run(s.recalibrate(["nobody"], 1, 0.5, "merge", None)), "There is no class"),
        (lambda s: run(s.recalibrate(["left"], 1, float("nan"), "merge", None)), "probability"),
        (lambda s: s.forget("nobody"), "There is no class “nobody”"),
        (lambda s: s.load(b"nonsense"), "This file is no saved model"),
    ],
)
def test_what_cannot_be_is_said_and_changes_nothing(taught, job, said):
    before, version = taught.prototypes(), taught.version
    with pytest.raises(ValueError, match=said):
        job(taught)
    assert taught.version == version
    for name, prototype in taught.prototypes().items():
        assert (prototype == before[name]).all()


def test_nothing_taught_is_a_sentence(empty):
    with pytest.raises(ValueError, match="teach two classes first"):
        run(empty.recalibrate([], 1, 0.5, "merge", None))
    with pytest.raises(ValueError, match="teach two classes first"):
        empty.saved()
    run(empty.new_class("only", 2, place("left")))
    assert empty.look()[2] is None
    with pytest.raises(ValueError, match="teach two classes first"):
        empty.saved()


def test_models_of_other_frames_are_refused(empty, tmp_path):
    rng = np.random.default_rng(0)
    for frames, labels, said in (
        (rng.random((4, 9, 9)), list("aabb"), "frames of 9 × 9 pixels; here they have 100 × 100"),
        (rng.random((4, 100, 100)), [0, 0, 1, 1], "A class needs a name"),
        (
            rng.random((2 * MOST_CLASSES, 100, 100)),
            [f"c{i // 2:02d}" for i in range(2 * MOST_CLASSES)],
            None,
        ),
        (rng.random((13, 100, 100)), [f"c{i:02d}" for i in range(13)], "13 classes"),
    ):
        path = tmp_path / "m.safetensors"
        HDCClassifier().fit(frames, labels).save(path)
        if said is None:
            empty.load(path.read_bytes())
            assert len(empty.counts) == MOST_CLASSES
        else:
            with pytest.raises(ValueError, match=said):
                empty.load(path.read_bytes())


def test_a_recalibrated_model_learns_on_by_recalibration_only(taught):
    run(taught.recalibrate(["left"], 2, 0.5, "merge", None))
    with pytest.raises(ValueError, match="recalibrate it again"):
        run(taught.add("left", 1, place("left")))


def test_samples_are_bounded(taught, monkeypatch):
    monkeypatch.setattr("hdc.live.session.KEPT_BYTES", 65 * 100 * 100 * 2)
    with pytest.raises(ValueError, match="keeps up to 65 samples"):
        run(taught.add("left", 10, place("left")))
    assert taught.shown == 65


# The worker --------------------------------------------------------------------------------------


def wait_for(true, seconds=60):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.fixture
def worker(empty):
    worker = Worker(empty)
    worker.start()
    yield worker
    worker.stop()
    assert not worker._thread.is_alive()


def test_nothing_stops_the_worker(worker):
    def broken(session):
        raise RuntimeError("nobody thought of it")

    def half(session):
        yield
        raise ValueError("a mistake after a while")

    worker.watch(+1)
    for job, said in ((broken, "nobody thought of it"), (half, "a mistake after a while")):
        worker.do(job)
        wait_for(lambda said=said: said in worker.view.message[1])
    seen = worker.view.number
    wait_for(lambda: worker.view.number > seen + 3)
    assert cv2.imdecode(np.frombuffer(worker.view.picture, np.uint8), 0).shape == (100, 200)


def test_frames_are_made_while_somebody_looks_and_jobs_done_always(worker):
    worker.do(partial(Session.new_class, name="left", n=3, touches=place("left")))
    wait_for(lambda: worker.session.counts == {"left": 3})
    assert worker.view.number == 0
    worker.watch(+1)
    wait_for(lambda: worker.view.number > 2)
    worker.watch(-1)


def test_a_source_that_ends_is_a_sentence(worker):
    def gone():
        raise ValueError("camera: disconnected")

    worker.session.source.frame = gone
    worker.watch(+1)
    wait_for(lambda: "disconnected" in worker.view.message[1])
    assert worker._thread.is_alive()


# A recording -------------------------------------------------------------------------------------


@pytest.fixture
def recorded(tmp_path, frames_and_labels):
    frames, labels = frames_and_labels(n=40, classes=2)
    np.savez(tmp_path / "r.npz", frames=frames, labels=np.array(["a", "b"])[labels])
    return Recorded(tmp_path / "r.npz", Window(), seconds_a_frame=0)


def test_a_recording_is_played_over_and_over_and_learnt_by_the_class_that_is_shown(recorded):
    session = Session(recorded)
    seen = [session.look()[0] for _ in range(41)]
    assert (seen[40] == seen[0]).all()
    for _ in range(2):
        session.look()
        run(session.new_class(recorded.label, 6))
    assert session.counts == {"a": 6, "b": 6}
    run(session.add("a", 4))  # tests itself: each is predicted before it is learnt
    assert session.tests[1] > 0
    assert not session.test()
    session.ridge.wait()
