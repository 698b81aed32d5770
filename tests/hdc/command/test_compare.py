"""``hdc compare`` and ``hdc train --choose``: their numbers are those of the plain computation."""

import json
import math
import shlex
from dataclasses import dataclass, field

import cv2
import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression, RidgeClassifierCV, RidgeCV
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor, NearestCentroid
from sklearn.svm import SVC, SVR

from hdc import HDCClassifier, HDCRegressor, selection
from hdc.accuracy import wilson
from hdc.command.compare import advice, judge, rivals
from hdc.command.compare.choose import choose
from hdc.command.compare.curve import learning_curve
from hdc.command.compare.frames import FrameBank, Frames, part, read_frames
from hdc.encoders import make_encoder
from hdc.readers import open_recording
from hdc.readouts import (
    NeighbourValues,
    make_readout,
)

SIDE = 16
NAMES = ("left", "<b>middle</b>", "right $x$")


@dataclass(eq=False)
class Said:
    """A model that gives the answers it was told, and keeps what it learnt from."""

    name: str
    told: np.ndarray
    learnt: list[np.ndarray] = field(default_factory=list)

    def answers(self, frames, train, test):
        self.learnt.append(train)
        return self.told[test]


def frames_of(classes, n, seed=0, noise=90, dtype=np.uint8):
    """[classes · n, 16, 16]: noisy frames of one pattern a class."""
    base = np.random.default_rng(0).integers(0, 150, (classes, 1, SIDE, SIDE))
    rng = np.random.default_rng([1, seed])
    frames = (base + rng.integers(0, noise, (classes, n, SIDE, SIDE))).astype(dtype)
    return frames.reshape(-1, SIDE, SIDE)


def in_memory(frames, labels, session=None, values=None):
    names = tuple(str(c) for c in range(labels.max() + 1))
    bank = FrameBank(frames, labels, len(names))
    return Frames(bank, names if values is None else ("depth",), (), session, values)


@pytest.fixture
def archive(tmp_path):
    path = tmp_path / "own [1].npz"
    labels = np.repeat(NAMES, 12)
    order = np.tile(np.arange(12), 3)
    np.savez(path, frames=frames_of(3, 12, noise=40), labels=labels, order=order)
    return path


@pytest.fixture
def of_values(tmp_path):
    """A square that moves: frames, and its place as depth in mm; two sessions."""
    path = tmp_path / "moves.npz"
    rng = np.random.default_rng(0)
    depth = rng.uniform(2, 14, 60)
    columns = np.arange(SIDE)
    bump = 150 * np.exp(-((columns - depth[:, None]) ** 2) / 8)
    noise = rng.integers(0, 20, (60, SIDE, SIDE))
    frames = (bump[:, None, :] + noise).astype(np.uint8)
    np.savez(path, frames=frames, values=depth, session=np.arange(60) // 20)
    return path


# The command -------------------------------------------------------------------------------------


def test_tables_and_json_have_every_model(typed, archive, tmp_path):
    status, out, err = typed("compare", archive, "--draws", 1)
    assert (status, err) == (0, "")
    assert out.startswith("36 frames, 3 classes, 16 × 16 pixels\nread: ")
    assert "as frame, height, width\nchosen by cross-valid" in out
    for encoder, readout in selection.FORMS:
        assert out.count(f"\n{encoder}, {readout}: accuracy ") == 1
    assert "quantile" not in out
    assert "front: no other model" in out
    assert "With one grey level of dither on the last frames: " in out
    for name in ("mean image", "ridge", "1-NN", "3-NN"):
        assert out.count(f"{name}, raw greys") >= 1
        assert out.count(f"{name}, standardised greys") >= 1
    for name in ("softmax", "linear SVM", "rbf SVM"):
        assert f"{name} (C = " in out
    assert f"Use: hdc train {shlex.quote(str(archive))} --encoder median" in out
    other = tmp_path / "tomorrow.npz"
    tomorrow = frames_of(3, 5, seed=1, noise=40)
    np.savez(other, frames=tomorrow, labels=np.repeat(NAMES, 5))
    result = json.loads(typed("compare", archive, "--test", other, "--json")[1])
    assert [test["name"] for test in result["tests"]] == [
        "at random",
        "the other recording",
    ]
    assert set(result["classes"]) == {*NAMES}
    assert [test["tested"] for test in result["tests"]] == [6, 15]
    assert [test["learnt"] for test in result["tests"]] == [30, 36]
    for curve in result["curve"].values():
        assert [point["frames"] for point in curve] == [1, 2, 5, 12]
        last = {"frames": 12, "accuracy": 1, "low": wilson(15, 15)[0], "high": 1}
        assert curve[-1] == pytest.approx(last)


def with_frames(result, parts):
    """Each test of a comparison, with the frames that were learnt and those that were tested."""
    rows = (parts.chosen_on, parts.random), (parts.earlier, parts.later)
    for test, (learnt, tested) in zip(result["tests"], rows, strict=True):
        assert (test["learnt"], test["tested"]) == (len(learnt), len(tested))
        yield test, learnt, tested


def test_a_test_of_classes_is_the_plain_computation(tmp_path):
    """Every number of it, where the choice, the published form and a rival differ."""
    rng, labels = np.random.default_rng(1), np.repeat(NAMES, 10)
    patterns = np.random.default_rng(0).integers(0, 15, (3, 1, SIDE, SIDE))
    frames = patterns + rng.integers(0, 100, (3, 10, SIDE, SIDE))
    frames = frames.astype(np.uint8).reshape(30, SIDE, SIDE)
    np.savez(tmp_path / "r.npz", frames=frames, labels=labels)
    recording = open_recording(tmp_path / "r.npz")
    result = judge.compare(recording, None, 0.4, 1, ["levels"], ["lda"])
    parts = part(recording, None, 0.4)
    assert result["frames"] == 30
    assert result["shape"] == [16, 16]
    assert result["chosen_by"] == (
        f"cross-validation on {len(parts.chosen_on)} training frames, 4 folds at random"
    )
    read = read_frames(recording)
    every = {
        method.name: method
        for method in (*selection.combinations([], [], False), *rivals.rivals(False))
    }
    names = [test["name"] for test in result["tests"]]
    assert names == ["at random", "the last frames"]
    for test, learnt, tested in with_frames(result, parts):
        assert next(iter(test["methods"])) == "median, majority"
        right = {
            name: every[name].answers(read, learnt, tested) == read.labels[tested]
            for name in test["methods"]
        }
        for name, own in right.items():
            low, high = wilson(own.sum(), len(tested))
            found = test["methods"][name]
            expected = {"accuracy": own.mean(), "low": low, "high": high}
            assert {key: found[key] for key in expected} == pytest.approx(expected)
        mine = right[result["chosen"]]
        gain = advice.paired_accuracies(mine, right["median, majority"])
        assert test["gain"] == pytest.approx(gain.as_json())
        over = advice.paired_accuracies(right[result["rival"]], mine)
        assert test["rival_gain"] == pytest.approx(over.as_json())
    accuracies = {name: own.mean() for name, own in right.items()}
    followed = ["median, majority", result["chosen"], result["rival"]]
    assert len({accuracies[name] for name in followed}) == 3
    assert list(result["curve"]) == followed


def test_a_test_of_values_is_the_plain_computation(of_values, tmp_path):
    """Of two values, by the chosen read-out and the default."""
    with np.load(of_values) as arrays:
        frames, depth = arrays["frames"], arrays["values"]
    path = tmp_path / "two.npz"
    values = np.stack([depth, (depth - 8) ** 2], axis=1)
    names, units = ["depth", "force"], ["mm", "N"]
    np.savez(path, frames=frames, values=values, value_names=names, value_units=units)
    recording = open_recording(path)
    result = judge.compare(recording, None, 0.3, 1, ["median"], ["neighbours"])
    assert (result["published"], result["chosen"]) == (
        "median, ridge",
        "median, neighbours",
    )
    assert result["values"] == names
    assert result["units"] == {"depth": "mm", "force": "N"}
    read, parts = read_frames(recording), part(recording, None, 0.3)
    rival = next(r for r in rivals.rivals(True) if r.name == result["rival"])
    for test, learnt, tested in with_frames(result, parts):
        default = HDCRegressor().fit(frames[learnt], values[learnt])
        nearest = HDCRegressor("median", NeighbourValues())
        nearest.fit(frames[learnt], values[learnt])
        truth = values[tested]
        theirs = np.abs(default.predict(frames[tested]) - truth)
        mine = np.abs(nearest.predict(frames[tested]) - truth)
        others = np.abs(rival.answers(read, learnt, tested) - truth)
        kept = test["methods"]["median, ridge"]
        for column, name in enumerate(names):
            assert kept["errors"][name] == pytest.approx(theirs[:, column].mean())
            gain = advice.paired_errors(mine[:, column], theirs[:, column])
            assert test["gain"][name] == pytest.approx(gain.as_json())
            over = advice.paired_errors(others[:, column], mine[:, column])
            assert test["rival_gain"][name] == pytest.approx(over.as_json())
        errors = dict(zip(names, mine.mean(axis=0), strict=True))
        chosen = test["methods"][result["chosen"]]
        assert chosen["errors"] == pytest.approx(errors)


def test_too_few_frames_are_compared_without_a_choice(tmp_path):
    path = tmp_path / "few.npz"
    np.savez(path, frames=frames_of(3, 3), labels=np.repeat(NAMES, 3))
    result = judge.compare(open_recording(path), None, 0.2, 1)
    assert result["chosen_by"] == ""
    assert result["chosen"] == result["published"] == "median, majority"
    assert (result["rival"], result["cross_validation"]) == ("", {})
    test = result["tests"][-1]
    assert (test["learnt"], test["tested"]) == (6, 3)
    assert "rival_gain" not in test
    same = test["gain"]
    assert same["gain"] == 0
    assert list(result["curve"]) == ["median, majority"]


def test_the_line_to_type_trains_the_chosen_model(
    typed, archive, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    words = ("--readout", "lda", "--encoder", "levels", "--subsample", 2)
    result = json.loads(typed("compare", archive, *words, "--json", "--draws", 1)[1])
    assert list(result["cross_validation"])[:2] == ["median, majority", "levels, lda"]
    line = shlex.split(result["command"])
    assert line[:3] == ["hdc", "train", str(archive)]
    assert typed(*line[1:])[0] == 0
    model = HDCClassifier.load(tmp_path / "model.safetensors")
    parts = [type(part).__name__.lower() for part in (model.encoder, model.readout)]
    assert ", ".join(parts) == result["chosen"]
    assert model.frame_shape_ == (8, 8)


def test_a_figure_of_the_curve(typed, archive, of_values, tmp_path):
    def drawn(recording, name):
        parts = ("--encoder", "median", "--readout", "neighbours")
        words = ("compare", recording, "--draws", 1, *parts, "-o", tmp_path / name)
        assert typed(*words)[0] == 0
        return (tmp_path / name).read_bytes()

    first = drawn(archive, "curve.svg")
    assert first.startswith(b"<?xml")
    assert drawn(archive, "curve.svg") == first
    assert drawn(of_values, "curve.svg") != first
    assert drawn(archive, "curve.png").startswith(b"\x89PNG")


def test_train_takes_the_best_combination(typed, tmp_path):
    """Classes that differ in four pixels: the published form does not see it."""
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 200, (60, SIDE, SIDE)).astype(np.uint8)
    labels = np.arange(60) % 2
    frames[labels == 1, :2, :2] = 255
    np.savez(tmp_path / "corner.npz", frames=frames, labels=labels)
    path = tmp_path / "m.safetensors"
    words = ("train", tmp_path / "corner.npz", "-o", path, "--choose")
    status, out, err = typed(*words)
    assert (status, err) == (0, "")
    line = out.splitlines()[1]
    assert line.startswith("chosen: ")
    assert "by 5 folds at random" in line
    model = HDCClassifier.load(path)
    chosen, _, rest = line.removeprefix("chosen: ").partition(" among ")
    assert rest.startswith(f"{1 + len(selection.FORMS)} ")
    encoder, readout = chosen.split(", ")
    assert type(make_encoder(encoder)) is type(model.encoder)
    assert type(make_readout(readout)) is type(model.readout)
    plain = HDCClassifier(model.encoder, model.readout).fit(frames, labels.astype(str))
    assert (model.predict(frames) == plain.predict(frames)).all()
    in_mind = in_memory(frames, labels)
    made, _ = selection.folds(in_mind, np.arange(60))

    def share(*parts):
        right = 0
        for learnt, tested in made:
            own = HDCClassifier(*parts).fit(frames[learnt], labels[learnt])
            right += (own.predict(frames[tested]) == labels[tested]).sum()
        return f"{right / 60:.1%}"

    mine = share(model.encoder, model.readout)
    assert line.endswith(f" (accuracy {mine}, the published form {share()})")
    assert typed(*words, "--readout", "lda")[0] == 2


def test_what_is_chosen_for_numbers_is_held_against_the_default():
    rng = np.random.default_rng(0)
    depth = rng.uniform(2, 14, (25, 1))
    bump = 150 * np.exp(-((np.arange(SIDE) - depth) ** 2) / 8)
    noise = rng.integers(0, 20, (25, SIDE, SIDE))
    frames = (bump[:, None, :] + noise).astype(np.uint8)
    data = in_memory(frames, np.zeros(25, np.int64), values=depth)
    made, _ = selection.folds(data, np.arange(25))
    guess = np.abs(depth - np.median(depth)).mean()

    def error(*parts):
        off = 0.0
        for train, test in made:
            model = HDCRegressor(*parts).fit(frames[train], depth[train])
            off += np.abs(model.predict(frames[test]) - depth[test]).sum()
        return f"{off / 25 / guess:.3g}"

    chosen, line = choose(data)
    pairs = selection.combinations((), (), True)
    mine = error(chosen.encoder, chosen.readout)
    like_it = [pair for pair in pairs if pair.encoder == chosen.encoder]
    least = min((error(p.encoder, p.readout) for p in like_it), key=float)
    assert mine == least
    assert line == (
        f"chosen: {chosen.name} among {len(pairs)} by 5 folds at random "
        f"({mine} of a guess's error, median, ridge {error()})"
    )


@pytest.mark.parametrize("learns_values", [False, True])
def test_nothing_is_chosen_by_too_few_frames(learns_values):
    labels = np.zeros(3, np.int64) if learns_values else np.arange(3)
    values = np.arange(3.0)[:, None] if learns_values else None
    chosen, line = choose(in_memory(frames_of(3, 1), labels, values=values))
    assert chosen == selection.published(learns_values)
    assert line == f"chosen: {chosen.name}, for there are too few frames of a class"


# Its parts ---------------------------------------------------------------------------------------


def test_rivals_are_those_of_plain_scikit_learn():
    frames = frames_of(3, 30, noise=4000, dtype=np.uint16)
    labels, rng = np.repeat(np.arange(3), 30), np.random.default_rng(1)
    train = np.sort(
        np.concatenate([c * 30 + rng.permutation(30)[:17] for c in range(3)])
    )
    test = np.setdiff1d(np.arange(90), train)
    data = in_memory(frames, labels)
    found = {
        rival.name: rival.answers(data, train, test) for rival in rivals.rivals(False)
    }
    raw = frames.reshape(90, -1).astype(float)
    standard = (raw - raw.mean(1, keepdims=True)) / raw.std(1, keepdims=True)
    for pixels, flat in (("raw", raw), ("standardised", standard)):
        centred = flat - flat[train].mean(0)
        unit = centred / np.sqrt((centred[train] ** 2).sum() / len(train))
        for name, model in (
            ("mean image", NearestCentroid()),
            ("ridge", RidgeClassifierCV(rivals.RIDGE_PENALTIES)),
            ("1-NN", KNeighborsClassifier(1)),
            ("3-NN", KNeighborsClassifier(3)),
            ("softmax (C = 10)", LogisticRegression(C=10, max_iter=500)),
            ("linear SVM (C = 1)", SVC(kernel="linear", C=1)),
            ("rbf SVM (C = 10)", SVC(gamma=1.0, C=10)),
        ):
            expected = model.fit(unit[train], labels[train]).predict(unit[test])
            assert (found[f"{name}, {pixels} greys"] == expected).mean() >= 0.97, name


def test_rivals_of_values_are_those_of_plain_scikit_learn():
    """Of two values, one of them constant, from frames of which some pixels are constant."""
    rng = np.random.default_rng(0)
    depth = rng.uniform(2, 14, 40)
    frames = rng.integers(0, 60, (40, SIDE, SIDE)).astype(np.uint8)
    frames[:, :4] = (60 + 10 * depth + rng.normal(0, 4, 40))[:, None, None]
    frames[:, 8:] = 17
    values = np.stack([depth, np.full(40, 1.5)], axis=1)
    data = in_memory(frames, np.zeros(40, np.int64), values=values)
    train, test = np.arange(0, 40, 2), np.arange(1, 40, 2)
    middle, deviation = depth[train].mean(), depth[train].std()
    raw = frames.reshape(40, -1).astype(float)
    standard = (raw - raw.mean(1, keepdims=True)) / raw.std(1, keepdims=True)
    expected = {"mean, raw greys": np.full(20, middle)}
    for pixels, flat in (("raw", raw), ("standardised", standard)):
        centred = flat - flat[train].mean(0)
        unit = centred / np.sqrt((centred[train] ** 2).sum() / len(train))
        models = {
            "ridge": RidgeCV(rivals.RIDGE_PENALTIES),
            "1-NN": KNeighborsRegressor(1),
            "3-NN": KNeighborsRegressor(3),
        }
        for c in (1, 10, 100):
            models[f"SVR (C = {c})"] = SVR(gamma=1.0, C=c, epsilon=0.01)
        for name, model in models.items():
            model.fit(unit[train], (depth[train] - middle) / deviation)
            found = middle + deviation * model.predict(unit[test])
            expected[f"{name}, {pixels} greys"] = found
    every = rivals.rivals(True)
    assert [rival.name for rival in every] == list(expected)
    for rival in every:
        answers = rival.answers(data, train, test)
        assert answers[:, 0] == pytest.approx(expected[rival.name], abs=0.02), rival
        assert answers[:, 1] == pytest.approx(1.5), rival


@pytest.mark.parametrize("n_pixels", [5, 2**13 + 3])  # fewer than frames; two blocks
def test_what_rivals_learn_from_keeps_all_products_and_distances(n_pixels):
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 255, (12, n_pixels)).astype(np.uint8)
    frames[:, 1] = 9
    frames[3] = 40  # a frame without contrast
    bank = FrameBank(frames, np.zeros(12, np.int64), 1)
    raw = frames.astype(float)
    deviations = raw.std(1, keepdims=True)
    deviations[3] = 1
    standard = (raw - raw.mean(1, keepdims=True)) / deviations
    train, test = np.arange(8), np.arange(8, 12)
    for pixels, flat in (("raw", raw), ("standardised", standard)):
        assert bank.products(pixels) == pytest.approx(
            (flat - flat.mean(0)) @ (flat - flat.mean(0)).T
        )
        centred = flat - flat[train].mean(0)
        unit = (centred[train] ** 2).sum(1).mean()
        distances = ((flat[:, None] - flat[train]) ** 2).sum(2) / unit
        inside, across = rivals.rbf_kernel(bank, pixels, train, test)
        assert inside == pytest.approx(np.exp(-distances[train]))
        assert across == pytest.approx(np.exp(-distances[test]))
        trained, queries = rivals.coordinates(bank, pixels, train, test)
        assert trained.shape == (8, np.linalg.matrix_rank(centred[train]))
        assert queries @ trained.T == pytest.approx(
            centred[test] @ centred[train].T / unit
        )


def test_the_best_setting_of_a_rival_was_tried_to_the_end():
    few, some, many, other = (
        rivals.Rival(model, "raw", setting, None)
        for model, setting in (
            ("SVR", " (C = 1)"),
            ("SVR", " (C = 10)"),
            ("SVR", " (C = 100)"),
            ("ridge", ""),
        )
    )
    elsewhere = rivals.Rival("SVR", "standardised", " (C = 1)", None)
    first, second = selection.combinations(["median"], ["majority", "lda"], False)
    losses = {few: 0.1, many: 0.3, other: 0.2, first: 0.5, second: 0.4}
    scores = selection.Scores(losses, {some.name: "why"}, given_up=[few.name])
    every = [few, some, many, other, elsewhere]
    judged = judge.Judged.of(first, every, scores)
    assert judged.rivals == [many, other, elsewhere]
    assert (judged.published, judged.chosen, judged.rival) == (first, second, other)
    assert judged.all() == [first, second, many, other, elsewhere]
    assert judged.followed() == [first, second, other]
    nothing = judge.Judged.of(first, every, selection.Scores())
    assert (nothing.chosen, nothing.rival) == (first, None)
    assert nothing.followed() == [first]


def test_a_learning_curve_of_classes_is_the_mean_over_draws():
    """Of classes with 25 and 30 training frames: 20 a class say little beside all."""
    labels = np.repeat([0, 1], [29, 36])
    data = in_memory(np.zeros((65, 4, 4), np.uint8), labels)
    test = np.array([0, 1, 2, 3, *range(29, 35)])
    train = np.setdiff1d(np.arange(65), test)
    right = Said("right", labels)
    ones = Said("ones", np.ones(65, np.int64))
    found = learning_curve(data, train, test, [right, ones], 3)
    assert list(found) == ["right", "ones"]
    for points, share in ((found["right"], 1.0), (found["ones"], 0.6)):
        assert [point["frames"] for point in points] == [1, 2, 5, 10, 27.5]
        for point in points:
            low, high = wilson(10 * share, 10)
            values = (point["accuracy"], point["low"], point["high"])
            assert values == pytest.approx((share, low, high))
    assert all(map(np.array_equal, right.learnt, ones.learnt))
    assert len(right.learnt) == 4 * 3 + 1
    for number, rows in enumerate(right.learnt[:-1]):
        size = (1, 2, 5, 10)[number // 3]
        assert np.bincount(labels[rows]).tolist() == [size, size]
        assert (np.diff(rows) > 0).all()
        assert not set(rows) - set(train)
    assert len({rows.tobytes() for rows in right.learnt}) == 13
    assert (right.learnt[-1] == train).all()
    again = Said("again", labels)
    learning_curve(data, train, test, [again], 3)
    assert all(map(np.array_equal, right.learnt, again.learnt))


def test_a_point_of_a_learning_curve_counts_a_test_frame_once():
    """Half of the draws are right: half of the frames, and the interval is of all frames once."""
    labels = np.repeat([0, 1], 10)
    data = in_memory(np.zeros((20, 4, 4), np.uint8), labels)

    @dataclass(eq=False)
    class Turning(Said):
        def answers(self, frames, train, test):
            super().answers(frames, train, test)
            return self.told[test] if len(self.learnt) % 2 else 1 - self.told[test]

    test = np.array([0, 1, 10, 11])
    train = np.setdiff1d(np.arange(20), test)
    points = learning_curve(data, train, test, [Turning("turning", labels)], 2)
    *halves, last = points["turning"]
    low, high = wilson(2, 4)
    for half, size in zip(halves, (1, 2, 5), strict=True):
        point = {"frames": size, "accuracy": 0.5, "low": low, "high": high}
        assert half == pytest.approx(point)
    assert last["accuracy"] == 1


def test_a_learning_curve_of_values_starts_at_five_frames_in_all():
    values = np.array([[0.0, 10.0], [1.0, 30.0]])[np.arange(40) % 2]
    data = in_memory(
        np.zeros((40, 4, 4), np.uint8), np.zeros(40, np.int64), None, values
    )
    off = Said("off", values + np.array([0.25, 20.0]))
    train, test = np.arange(30), np.arange(30, 40)
    found = learning_curve(data, train, test, [off], 2)
    # Off by 0.25 of a mean distance of 0.5 from the middle, and by 20 of 10.
    error = pytest.approx((0.5 + 2.0) / 2)
    assert found == {
        "off": [{"error": error, "frames": size} for size in (5, 10, 20, 30)]
    }
    assert [len(rows) for rows in off.learnt] == [5, 5, 10, 10, 20, 20, 30]


def test_combinations_are_the_models_themselves():
    frames, labels = (
        frames_of(3, 10, noise=600, dtype=np.uint16),
        np.repeat([0, 1, 2], 10),
    )
    data = in_memory(frames, labels)
    train = np.arange(0, 30, 2)
    test = np.arange(1, 30, 2)
    for pair in selection.combinations((), (), False):
        plain = HDCClassifier(pair.encoder, pair.readout)
        plain.fit(frames[train], labels[train])
        expected = plain.predict(frames[test])
        for _ in range(2):  # the second time an encoder that learns is remembered
            assert (pair.answers(data, train, test) == expected).all(), pair.name
    turned = selection.Combination("reference", "majority")
    plain = HDCClassifier("reference").fit(frames[test], labels[test])
    assert (turned.answers(data, test, train) == plain.predict(frames[train])).all()


def test_floating_point_frames_are_compared():
    rng = np.random.default_rng(0)
    base = rng.normal(size=(3, 1, 40))
    frames = (base + rng.normal(size=(3, 12, 40)) / 2).reshape(36, 40) / 1e4
    labels = np.repeat([0, 1, 2], 12)
    data = in_memory(frames, labels)
    train, test = np.arange(0, 36, 2), np.arange(1, 36, 2)
    near = KNeighborsClassifier(1).fit(frames[train], labels[train])
    rival = next(r for r in rivals.rivals(False) if r.name == "1-NN, raw greys")
    assert (rival.answers(data, train, test) == near.predict(frames[test])).all()
    plain = HDCClassifier().fit(frames[train], labels[train])
    found = selection.published(False).answers(data, train, test)
    assert (found == plain.predict(frames[test])).all()


@pytest.mark.parametrize("learns_values", [False, True])
def test_training_frames_that_are_all_equal_stop_no_rival(learns_values):
    frames = np.full((6, 4, 4), 7, np.uint8)
    labels = np.array([1, 1, 0, 0, 0, 1])
    values = np.arange(6.0)[:, None] if learns_values else None
    data = in_memory(frames, labels, values=values)
    train, test = np.arange(1, 6), np.array([0])
    expected = 3.0 if learns_values else 0  # the mean, or the class of most frames
    for rival in rivals.rivals(learns_values):
        answers = rival.answers(data, train, test)
        assert answers.item() == pytest.approx(expected), rival.name


def test_nothing_that_is_tested_was_chosen_by(tmp_path):
    labels, session = np.tile([0, 1], 30), np.arange(60) // 12
    frames = np.random.default_rng(0).integers(0, 255, (60, 5, 5), np.uint8)
    np.savez(tmp_path / "r.npz", frames=frames, labels=labels, session=session)
    recording = open_recording(tmp_path / "r.npz")
    parts = part(recording, None, 0.2)
    assert set(session[parts.later]) == {4}
    assert set(session[parts.earlier]) == {0, 1, 2, 3}
    both = [*parts.chosen_on, *parts.random]
    assert sorted(both) == parts.earlier.tolist()
    assert len(parts.random) == 10
    parts = part(recording, recording, 0.2)
    assert parts.later.tolist() == [*range(60, 120)]


def test_the_last_frames_of_each_class_in_time_are_later(tmp_path):
    labels, order = np.tile([0, 1], 10), np.arange(20)[::-1]
    frames = np.zeros((20, 5, 5), np.uint8)
    np.savez(tmp_path / "r.npz", frames=frames, labels=labels, order=order)
    parts = part(open_recording(tmp_path / "r.npz"), None, 0.2)
    assert parts.later_name == "the last frames"
    assert parts.later.tolist() == [0, 1, 2, 3]
    assert parts.earlier.tolist() == [*range(4, 20)]
    assert np.bincount(labels[parts.random]).tolist() == [2, 2]
    tests = [(name, len(learnt), len(tested)) for name, learnt, tested in parts.tests()]
    assert tests == [("at random", 12, 4), ("the last frames", 16, 4)]
    np.savez(tmp_path / "v.npz", frames=frames, values=labels * 1.0, order=order)
    parts = part(open_recording(tmp_path / "v.npz"), None, 0.2)
    assert parts.later.tolist() == [0, 1, 2, 3]


def test_two_recordings_are_read_one_after_the_other(tmp_path):
    frames, session = frames_of(3, 4), np.arange(12) % 2
    names = np.repeat(["b", "a", "c"], 4)
    kept = {"frames": frames, "session": session}
    np.savez(tmp_path / "first.npz", labels=names, **kept)
    np.savez(tmp_path / "second.npz", labels=names[:8], frames=frames[:8] + 1)
    first, second = (
        open_recording(tmp_path / f"{name}.npz") for name in ("first", "second")
    )
    both = read_frames(first, second)
    assert both.names == ("a", "b", "c")
    assert both.labels.tolist() == [1] * 4 + [0] * 4 + [2] * 4 + [1] * 4 + [0] * 4
    assert both.bank.n_classes == 3
    assert (both.bank.frames.numpy() == [*frames, *(frames[:8] + 1)]).all()
    assert (both.units, both.values) == ((), None)
    assert both.session[:12].tolist() == session.tolist()
    rows = part(first, second, 0.2).chosen_on
    assert selection.folds(both, rows)[1] == "by session"
    some = read_frames(first, rows=np.array([1, 2, 9]))
    assert some.names == ("b", "c")
    assert some.labels.tolist() == [0, 0, 1]
    assert some.session.tolist() == [1, 0, 1]
    assert (some.bank.frames.numpy() == frames[[1, 2, 9]]).all()


def test_the_other_recording_has_a_table_of_its_own(typed, tmp_path, monkeypatch):
    """It was tested with that of the first, on the frames of training."""
    monkeypatch.chdir(tmp_path)
    for name, n in (("pins", 8), ("pins2", 5)):
        (tmp_path / name).mkdir()
        rows = [f"{name}_{k}.png,{k % 4}" for k in range(n)]
        for k, frame in enumerate(frames_of(1, n)):
            assert cv2.imwrite(f"{name}/{name}_{k}.png", frame)
        (tmp_path / name / "t.csv").write_text("\n".join(["image,z", *rows]))
    words = ("compare", "pins", "--test", "pins2", "--json", "--draws", 1)
    words = (*words, "--encoder", "median", "--readout", "neighbours")
    for table in ("pins/t.csv", "t.csv"):
        status, out, _ = typed(*words, "--values", table)
        assert status == 0
        assert json.loads(out)["tests"][-1]["tested"] == 5
    (tmp_path / "pins" / "t.csv").rename("t.csv")
    (line,) = typed(*words, "--values", "t.csv")[2].splitlines()
    assert "--test: expected labels and numbers in or beside pins2, found t.csv" in line
    np.save("b.npy", frames_of(2, 4))
    (tmp_path / "b.csv").write_text("\n".join(["label", *"ab" * 4]))
    words = ("compare", "b.npy", "--test", "b.npy")
    (line,) = typed(*words, "--labels", "b.csv")[2].splitlines()
    assert "found b.csv for both recordings" in line


def test_an_interval_of_paired_accuracies_is_newcombes():
    """His own example, Stat. Med. 17, 2635 (1998), table III: 36, 12, 2, 0 by method 10."""
    mine = np.repeat([True, True, False, False], [36, 12, 2, 0])
    theirs = np.repeat([True, False, True, False], [36, 12, 2, 0])
    found = advice.paired_accuracies(mine, theirs)
    assert found.gain == pytest.approx(0.2)
    assert (found.low, found.high) == pytest.approx((0.0569, 0.3404), abs=5e-5)
    turned = advice.paired_accuracies(theirs, mine)
    assert (turned.low, turned.high) == pytest.approx((-found.high, -found.low))
    same = advice.paired_accuracies(mine, mine)
    assert same.low < 0 < same.high


@pytest.mark.parametrize(
    ("counts", "correlation"),
    [
        ((1, 1, 0, 1), 0),  # 1·1 − 1·0 is less than half of the frames
        ((4, 4, 4, 4), 0),
        ((5, 10, 10, 5), -75 / 225),  # no correction where they disagree
        ((0, 1, 1, 0), -1),
        ((0, 5, 0, 0), 0),  # one is always right, the other never
        ((9, 0, 0, 1), (9 - 5) / 9),  # with the correction for continuity, n/2
    ],
)
def test_newcombes_interval_joins_wilsons_by_the_correlation(counts, correlation):
    """Both right, only mine, only theirs, neither; the correlation is worked out by hand."""
    both, mine, theirs, _ = counts
    n = sum(counts)
    found = advice.paired_accuracies(
        np.repeat([True, True, False, False], counts),
        np.repeat([True, False, True, False], counts),
    )
    p, q = (both + mine) / n, (both + theirs) / n
    (p_low, p_high), (q_low, q_high) = wilson(both + mine, n), wilson(both + theirs, n)

    def joined(a, b):
        return math.sqrt(a * a - 2 * correlation * a * b + b * b)

    low = p - q - joined(p - p_low, q_high - q)
    high = p - q + joined(p_high - p, q - q_low)
    assert found.as_json() == pytest.approx({"gain": p - q, "low": low, "high": high})


def test_an_interval_of_paired_errors_holds_the_difference():
    rng = np.random.default_rng(0)
    held = 0
    for _ in range(100):
        theirs = rng.normal(1.0, 0.5, 50)
        mine = theirs - rng.normal(0.2, 0.4, 50)
        found = advice.paired_errors(mine, theirs)
        assert found.gain == pytest.approx((theirs - mine).mean())
        held += found.low <= 0.2 <= found.high
    assert 87 <= held <= 100


def test_errors_are_one_line(typed, archive, of_values, tmp_path):
    np.savez(tmp_path / "others.npz", frames=frames_of(2, 3), labels=[0, 1] * 3)
    np.savez(tmp_path / "small.npz", frames=np.zeros((6, 3, 3)), labels=[0, 1] * 3)
    named = {"values": np.zeros((6, 2)), "value_names": ["x", "y"]}
    np.savez(tmp_path / "place.npz", frames=frames_of(2, 3), **named)
    for words, message in (
        ((archive, "--crop", 0, 0, 999, 9), "a window inside frames 16 px wide"),
        ((tmp_path / "nothing",), "found nothing"),
        (
            (archive, "--test", tmp_path / "others.npz"),
            "--test: expected classes among ",
        ),
        (
            (archive, "--test", tmp_path / "small.npz"),
            "--test: expected frames (16, 16)",
        ),
        ((of_values, "--test", archive), "--test: expected values value, found none"),
        (
            (of_values, "--test", tmp_path / "place.npz"),
            "--test: expected values value, found x, y",
        ),
        ((archive, "--encoder", "mean"), "encoder: expected one of "),
        ((archive, "--readout", "nowhere.Part"), "readout: expected a class "),
        ((of_values, "--readout", "lda"), "readout: expected one of "),
        ((archive, "-o", tmp_path / "curve.txt"), "-o: expected a file of .svg, .pdf"),
    ):
        status, out, err = typed("compare", *words)
        assert (status, out, err.count("\n")) == (1, "", 1), words
        assert message in err
