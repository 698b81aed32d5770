"""What ``hdc compare`` says of times and sizes, its budget, and one grey level of dither."""

import json
import shlex
from dataclasses import dataclass

import numpy as np
import pytest

from hdc import HDCClassifier, selection
from hdc.command import main
from hdc.command.compare import cost, dither, judge, rivals
from hdc.command.compare.budget import Budget, Growth, estimate, in_words
from hdc.command.compare.frames import FrameBank, Frames
from hdc.encoders import COMPARED
from hdc.readers import open_recording
from hdc.readouts import READOUTS

SIDE = 20


class Clock:
    """Goes on by a second whenever it is asked."""

    def __init__(self):
        self.now = 0

    def __call__(self):
        self.now += 1
        return self.now


@pytest.fixture
def archive(tmp_path):
    """Three classes, 16 frames each, told apart by their patterns under much noise."""
    patterns = np.random.default_rng(0).integers(0, 120, (3, 1, SIDE, SIDE))
    noise = np.random.default_rng(1).integers(0, 130, (3, 16, SIDE, SIDE))
    frames = (patterns + noise).astype(np.uint8).reshape(48, SIDE, SIDE)
    path = tmp_path / "r.npz"
    np.savez(path, frames=frames, labels=np.repeat(["a", "b", "c"], 16))
    return path


def in_memory(frames, labels):
    bank = FrameBank(frames, labels, labels.max() + 1)
    names = tuple(str(c) for c in range(labels.max() + 1))
    return Frames(bank, names, (), None, None)


@dataclass(frozen=True)
class Fake:
    """A method that is always right."""

    name: str

    def answers(self, frames, train, test):
        return frames.labels[test]


def on_front(points, name):
    """By the definition: no other has no more of both and less of one."""
    error, seconds = points[name]
    for other, (e, s) in points.items():
        if other != name and e <= error and s <= seconds and (e < error or s < seconds):
            return False
    return True


def test_a_front_is_what_no_other_beats():
    rng = np.random.default_rng(0)
    points = {str(k): tuple(rng.integers(0, 6, 2).tolist()) for k in range(12)}
    assert cost.front(points) == [name for name in points if on_front(points, name)]
    assert cost.front(
        {"slow": (0.1, 2.0), "fast": (0.1, 1.0), "worse": (0.2, 1.5)}
    ) == ["fast"]


def test_every_tested_model_has_its_times_and_bytes(archive):
    result = judge.compare(open_recording(archive), None, 0.25, 1)
    methods = result["tests"][-1]["methods"]
    assert next(iter(methods)) == "median, majority"
    train, test = result["tests"][-1]["learnt"], result["tests"][-1]["tested"]
    assert (train, test) == (36, 12)
    pixels = SIDE * SIDE
    words = 7  # of 64 bits hold 400
    assert methods["median, majority"]["bytes"] == 3 * words * 8
    assert methods["mean image, raw greys"]["bytes"] == 3 * pixels * 4
    assert methods["1-NN, raw greys"]["bytes"] == 36 * pixels
    for own in methods.values():
        assert own["train_s"] > 0
        assert own["predict_ms"] > 0
    for key in ("train_s", "predict_ms"):
        points = {n: (1 - own["accuracy"], own[key]) for n, own in methods.items()}
        for name, own in methods.items():
            assert own[f"front_{key}"] == on_front(points, name)


def test_a_linear_machine_has_a_function_for_each_pair_of_classes():
    frames = np.random.default_rng(0).integers(0, 255, (8, 5, 5)).astype(np.uint8)
    data = in_memory(frames, np.arange(8) % 4)
    found = {rival.model: rival.n_functions(data) for rival in rivals.rivals(False)}
    assert found["linear SVM"] == 6
    assert found["softmax"] == found["mean image"] == 4


def test_a_short_list_is_tried_and_all_when_asked():
    short = selection.combinations((), (), False)
    assert [(form.encoder, form.readout) for form in short] == [
        ("median", "majority"),
        *selection.FORMS,
    ]
    every = selection.combinations((), (), False, every=True)
    assert every[: len(short)] == short
    assert len(set(every)) == len(every) == len(COMPARED) * len(READOUTS)


def test_a_budget_ends_the_choice_with_what_is_done():
    """The clock goes on by a second for each question; 60 % of the minute are for the choice."""
    frames = np.random.default_rng(0).integers(0, 255, (12, 5, 5)).astype(np.uint8)
    data = in_memory(frames, np.arange(12) % 2)
    every = [Fake(str(k)) for k in range(40)]
    made, _ = selection.folds(data, np.arange(12))
    scores = selection.Scores()
    budget = Budget(1, Clock())
    done = [*selection.race(every, data, made, scores, lambda: budget.is_spent(0.6))]
    assert done == every[:36]  # the first is tried in any case, and asks for no time
    assert scores.not_tried == [method.name for method in every[36:]]
    assert {*scores.losses} == {*done}
    endless = selection.Scores()
    assert [*selection.race(every, data, made, endless)] == every
    assert endless.not_tried == []


def test_a_spent_budget_leaves_the_tests_of_those_that_are_followed(archive):
    budget = Budget(0.001, Clock())
    result = judge.compare(open_recording(archive), None, 0.25, 1, budget=budget)
    assert [*result["cross_validation"]] == ["median, majority"]
    assert len(result["not_tried"]) == len(selection.FORMS) + len(rivals.rivals(False))
    assert [*result["tests"][-1]["methods"]] == ["median, majority"]
    assert len(result["curve"]["median, majority"]) == 1
    assert result["chosen"] == "median, majority"


def test_rows_and_an_estimate_come_before_the_end(archive, monkeypatch):
    said = []
    monkeypatch.setattr(judge.Judged, "of", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        judge.compare(open_recording(archive), None, 0.25, 1, say=said.append)
    assert said[0].startswith("48 frames, 3 classes")
    assert "a guess of a, the largest class, has 33.3%" in said[0]
    assert said[1].startswith("This takes about ")
    assert said[2].startswith("median, majority: accuracy ")
    assert len(said) == 2 + 1 + len(selection.FORMS) + len(rivals.rivals(False))


def test_json_has_no_line_before_it(archive, capsys):
    with pytest.raises(SystemExit):
        main(["compare", str(archive), "--json", "--draws", "1", "--budget", "0.01"])
    result = json.loads(capsys.readouterr().out)
    assert result["estimate_s"] > 0


def test_growth_goes_through_both_trials():
    straight = Growth.through(60, 0.5, 1.0)
    assert straight.at(600) == pytest.approx(10)
    bent = Growth.through(60, 0.25, 1.0)  # all of it is quadratic
    assert bent.at(600) == pytest.approx(100)
    mixed = Growth.through(60, 0.4, 1.0)
    assert (mixed.at(30), mixed.at(60)) == pytest.approx((0.4, 1.0))


def test_an_estimate_counts_calls():
    frames = np.random.default_rng(0).integers(0, 255, (40, 5, 5)).astype(np.uint8)
    data = in_memory(frames, np.arange(40) % 2)

    class Slow:
        name = "slow"
        calls = 0

        def answers(self, frames, train, test):
            self.calls += 1
            return np.zeros(len(test), np.int64)

    method = Slow()
    assert estimate(data, np.arange(40), method, 1, 1) > 0
    assert method.calls == 6  # one warm-up and two trials, twice each
    assert estimate(data, np.arange(3), method, 1, 1) == 0
    assert [in_words(s) for s in (3, 44, 130, 3600)] == [
        "a few seconds",
        "40 seconds",
        "2 minutes",
        "60 minutes",
    ]


class Passing:
    """Time that passes only where it is made to."""

    def __init__(self):
        self.now = 1000.0

    def perf_counter(self):
        return self.now


@dataclass
class Sharing:
    """Takes 20 ms a frame to make what it shares, and 10 ms a frame in every call."""

    time: Passing
    name: str = "sharing"

    def answers(self, frames, train, test):
        n = len(train)
        assert frames.values.shape == (n, 2)
        if not hasattr(frames.bank, "made"):
            frames.bank.made = True
            self.time.now += 0.020 * n
        self.time.now += 0.010 * n
        return np.zeros((len(test), 2))


def test_an_estimate_knows_what_calls_share(monkeypatch):
    """Two calls that make it, five in all, of 80 frames."""
    passing = Passing()
    monkeypatch.setattr("hdc.command.compare.budget.time", passing)
    frames = np.random.default_rng(0).integers(0, 255, (80, 5, 5)).astype(np.uint8)
    bank = FrameBank(frames, np.zeros(80, np.int64), 1)
    data = Frames(bank, ("x", "y"), (), None, np.zeros((80, 2)))
    assert estimate(data, np.arange(80), Sharing(passing), 2, 3) == pytest.approx(
        2 * 0.020 * 80 + 5 * 0.010 * 80
    )


def test_milliseconds_are_those_of_a_frame(monkeypatch):
    """The first answer, which may compile, is not counted."""
    passing = Passing()
    monkeypatch.setattr(cost, "time", passing)
    frames = np.zeros((250, 5, 5), np.uint8)
    costs = cost.Costs(
        in_memory(frames, np.arange(250) % 2), np.arange(9), np.arange(250)
    )
    asked = []

    def predict(batch):
        passing.now += 0.002 * len(batch) if asked else 100
        asked.append(len(batch))

    assert costs._per_frame(predict) == pytest.approx(2)
    assert asked == [1, 100, 100, 50]


def test_dither_moves_pixels_by_one_level_at_most_and_is_seeded():
    images = np.random.default_rng(0).integers(0, 256, (5, 40, 40)).astype(np.uint8)
    moved = dither.with_dither(images)
    steps = moved.astype(int) - images
    assert set(np.unique(steps)) == {-1, 0, 1}
    inner = (images > 0) & (images < 255)
    assert np.abs(steps[inner].mean()) < 0.03
    assert (moved == dither.with_dither(images)).all()


@pytest.mark.parametrize("contrast", [1, 60])
def test_dither_costs_frames_whose_bits_rounding_decides(contrast):
    """Classes that differ by one grey level, and by sixty."""
    rng = np.random.default_rng(0)
    patterns = rng.integers(0, 2, (4, SIDE, SIDE))
    labels = np.arange(80) % 4
    bright = patterns[labels] ^ (rng.random((80, SIDE, SIDE)) < 0.35)
    frames = (100 + contrast * bright).astype(np.uint8)
    data = in_memory(frames, labels)
    train, test = np.arange(40), np.arange(40, 80)
    found = dither.dithered(data, selection.published(False), train, test)
    model = HDCClassifier().fit(frames[:40], labels[:40])
    assert found["before"] == model.score(frames[40:], labels[40:])
    expected = model.score(dither.with_dither(frames[40:]), labels[40:])
    assert found["after"] == expected
    assert found["warns"] == (found["before"] - expected > dither.FALL)
    assert found["warns"] == (contrast == 1)
    other = selection.Combination("median", "neighbours")
    found = dither.dithered(data, other, train, test)
    model = HDCClassifier(readout="neighbours").fit(frames[:40], labels[:40])
    assert found["before"] == model.score(frames[40:], labels[40:])


def test_frames_of_other_than_8_bits_have_no_dither():
    frames = np.zeros((4, 5, 5), np.uint16)
    data = in_memory(frames, np.arange(4) % 2)
    rows = np.arange(4)
    assert dither.dithered(data, selection.published(False), rows, rows) == {}


@pytest.mark.parametrize("form", [("median", "majority"), *selection.FORMS])
def test_whatever_is_recommended_trains_and_recalibrates(
    form, archive, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    chosen = selection.Combination(*form)
    monkeypatch.setattr(selection.Scores, "best", lambda *_: chosen)
    monkeypatch.setattr(selection.Scores, "finished", lambda *_: [chosen])
    monkeypatch.setattr(judge, "rivals", lambda _: [])
    monkeypatch.setattr(judge.Judged, "followed", lambda self: [chosen])
    monkeypatch.setattr(judge, "_estimate", lambda *_: 0.0)
    monkeypatch.setattr(judge, "learning_curve", lambda *_: {})
    monkeypatch.setattr(judge, "folds", lambda *_: ([], ""))
    words = ["compare", str(archive), "--json", "--draws", "1"]
    for line in (words, None, ["recalibrate", "model.safetensors", "new.npz"]):
        if line is None:
            line = shlex.split(json.loads(capsys.readouterr().out)["command"])[1:]
            assert line[line.index("--encoder") + 1] == form[0]
        if line[0] == "recalibrate":
            with np.load(archive) as kept:
                changed = np.roll(kept["frames"], 1, axis=1)
                np.savez("new.npz", frames=changed, labels=kept["labels"])
            line += ["-o", "moved.safetensors"]
        with pytest.raises(SystemExit) as caught:
            main(line)
        assert caught.value.code == 0, line
    model = HDCClassifier.load("moved.safetensors")
    with np.load("new.npz") as new:
        assert model.score(new["frames"], new["labels"]) > 0.9
