"""``hdc compare`` and ``hdc train --choose``: their numbers are those of the plain computation."""

import json
import shlex

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression, RidgeClassifierCV
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor, NearestCentroid
from sklearn.svm import SVC

from hdc import HDCClassifier, HDCRegressor, selection
from hdc.accuracy import wilson
from hdc.command import main
from hdc.command.compare import advice, judge, rivals
from hdc.command.compare.frames import FrameBank, Frames, part, read_frames
from hdc.encoders import Median, make_encoder
from hdc.readers import open_recording
from hdc.readouts import Majority, make_readout

SIDE = 16
NAMES = ("left", "<b>middle</b>", "right $x$")


class Own(Median):
    """An encoder of a laboratory."""


class Backwards(Majority):
    """A read-out that takes the farthest class."""

    def scores(self, words):
        return -super().scores(words)


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


@pytest.fixture
def hdc(capsys):
    def run(*words):
        with pytest.raises(SystemExit) as caught:
            main([str(word) for word in words])
        out, err = capsys.readouterr()
        return caught.value.code, out, err

    return run


# The command -------------------------------------------------------------------------------------


def test_tables_and_json_have_every_model(hdc, archive, tmp_path):
    status, out, err = hdc("compare", archive, "--draws", 1)
    assert (status, err) == (0, "")
    assert out.startswith("36 frames, 3 classes, 16 × 16 pixels\nchosen by cross-valid")
    for name in ("median", "quantile", "levels", "reference"):
        assert f"\n {name} " in out
    for name in ("mean image", "ridge", "1-NN", "3-NN"):
        assert out.count(f"{name}, raw greys") >= 1
        assert out.count(f"{name}, standardised greys") == 1
    for name in ("softmax", "linear SVM", "rbf SVM"):
        assert f"{name} (C = " in out
    assert f"Use: hdc train {shlex.quote(str(archive))} --encoder median" in out
    other = tmp_path / "tomorrow.npz"
    tomorrow = frames_of(3, 5, seed=1, noise=40)
    np.savez(other, frames=tomorrow, labels=np.repeat(NAMES, 5))
    result = json.loads(hdc("compare", archive, "--test", other, "--json")[1])
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


def test_the_line_to_type_trains_the_chosen_model(hdc, archive, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ("--readout", "lda", "--encoder", "levels", "--subsample", 2)
    result = json.loads(hdc("compare", archive, *words, "--json", "--draws", 1)[1])
    assert list(result["cross_validation"])[:2] == ["median, majority", "levels, lda"]
    line = shlex.split(result["command"])
    assert line[:3] == ["hdc", "train", str(archive)]
    assert hdc(*line[1:])[0] == 0
    model = HDCClassifier.load(tmp_path / "model.safetensors")
    parts = [type(part).__name__.lower() for part in (model.encoder, model.readout)]
    assert ", ".join(parts) == result["chosen"]
    assert model.frame_shape_ == (8, 8)


def test_own_parts_are_chosen_among(hdc, archive):
    words = ["--encoder", f"{__name__}.Own", "--readout", f"{__name__}.Backwards"]
    result = json.loads(hdc("compare", archive, *words, "--json", "--draws", 1)[1])
    name = f"{__name__}.Own, {__name__}.Backwards"
    assert result["cross_validation"][name] == 0
    assert result["chosen"] == "median, majority"


def test_numbers_are_compared(hdc, of_values):
    status, out, err = hdc("compare", of_values, "--draws", 1)
    assert (status, err) == (0, "")
    assert "60 frames, values of value, 16 × 16 pixels" in out
    assert "90 % cover" in out
    result = json.loads(hdc("compare", of_values, "--draws", 1, "--json")[1])
    frames = read_frames(open_recording(of_values))
    images, values = frames.bank.frames.numpy(), frames.values[:, 0]
    earlier, later = slice(0, 40), slice(40, 60)
    test = result["tests"][-1]
    assert (test["name"], test["learnt"], test["tested"]) == (
        "the last sessions",
        40,
        20,
    )
    default = HDCRegressor().fit(images[earlier], values[earlier])
    found, low, high = default.predict(images[later], return_interval=True)
    own = test["methods"]["median, ridge"]
    truth = values[later]
    assert own["errors"]["value"] == pytest.approx(np.abs(found - truth).mean())
    assert own["coverage"]["value"]["share"] == pytest.approx(
        ((low <= truth) & (truth <= high)).mean()
    )
    assert own["width"]["value"] == pytest.approx((high - low).mean())
    flat = images.reshape(60, -1).astype(float)
    standard = (flat - flat.mean(1, keepdims=True)) / flat.std(1, keepdims=True)
    near = KNeighborsRegressor(3).fit(standard[earlier], values[earlier])
    expected = np.abs(near.predict(standard[later]) - truth).mean()
    errors = test["methods"]["3-NN, standardised greys"]["errors"]
    assert errors["value"] == pytest.approx(expected)
    guess = np.abs(values[earlier].mean() - truth).mean()
    errors = test["methods"]["mean, raw greys"]["errors"]
    assert errors["value"] == pytest.approx(guess)


@pytest.mark.parametrize("suffix", ["svg", "png"])
def test_a_figure_of_the_curve(hdc, archive, of_values, tmp_path, suffix):
    path = tmp_path / f"curve.{suffix}"
    words = ("compare", archive, "--draws", 1, "--encoder", "median", "-o", path)
    assert hdc(*words, "--readout", "lda")[0] == 0
    first = path.read_bytes()
    assert first.startswith(b"<?xml" if suffix == "svg" else b"\x89PNG")
    assert hdc(*words, "--readout", "lda")[0] == 0
    assert path.read_bytes() == first
    words = ("compare", of_values, "--draws", 1, "--encoder", "median", "-o", path)
    assert hdc(*words)[0] == 0
    assert path.read_bytes() != first


def test_train_takes_the_best_combination(hdc, tmp_path):
    """Classes that differ in four pixels: the published form does not see it."""
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 200, (60, SIDE, SIDE)).astype(np.uint8)
    labels = np.arange(60) % 2
    frames[labels == 1, :2, :2] = 255
    np.savez(tmp_path / "corner.npz", frames=frames, labels=labels)
    path = tmp_path / "m.safetensors"
    words = ("train", tmp_path / "corner.npz", "-o", path, "--choose")
    status, out, err = hdc(*words)
    assert (status, err) == (0, "")
    line = out.splitlines()[1]
    assert line.startswith("chosen: ")
    assert "by 5 folds at random" in line
    model = HDCClassifier.load(path)
    chosen, _, rest = line.removeprefix("chosen: ").partition(" among ")
    assert rest.startswith("30 ")
    encoder, readout = chosen.split(", ")
    assert type(make_encoder(encoder)) is type(model.encoder)
    assert type(make_readout(readout)) is type(model.readout)
    plain = HDCClassifier(model.encoder, model.readout).fit(frames, labels.astype(str))
    assert (model.predict(frames) == plain.predict(frames)).all()
    in_mind = in_memory(frames, labels)
    made, _ = selection.folds(in_mind, np.arange(60))
    right = np.concatenate(
        [
            HDCClassifier(model.encoder, model.readout)
            .fit(frames[train], labels[train])
            .predict(frames[test])
            == labels[test]
            for train, test in made
        ]
    )
    assert f"(accuracy {right.mean():.1%}, " in line
    assert hdc(*words, "--readout", "lda")[0] == 2


def test_train_chooses_for_numbers(hdc, of_values, tmp_path):
    path = tmp_path / "m.safetensors"
    words = ("train", of_values, "-o", path, "--choose", "--test-fraction", 0.3)
    status, out, err = hdc(*words)
    assert (status, err) == (0, "")
    assert "chosen: " in out
    assert "by 2 folds by session" in out
    assert HDCRegressor.load(path).frame_shape_ == (SIDE, SIDE)


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


def test_folds_are_whole_sessions_or_even_at_random():
    labels = np.tile([0, 1, 2], 20)
    frames = np.zeros((60, 4, 4), np.uint8)
    rows = np.arange(0, 60, 2)
    session = np.arange(60) // 10
    made, how = selection.folds(in_memory(frames, labels, session), rows)
    assert (len(made), how) == (5, "by session")
    for train, test in made:
        assert not set(session[train]) & set(session[test])
        assert sorted([*train, *test]) == rows.tolist()
    made, how = selection.folds(in_memory(frames, labels), rows)
    assert (len(made), how) == (5, "at random")
    assert sorted(np.concatenate([test for _, test in made])) == rows.tolist()
    for _, test in made:
        assert np.bincount(labels[test]).tolist() == [2, 2, 2]
    alone = np.where(labels == 2, 1, 0)  # a class of one session only
    assert selection.folds(in_memory(frames, labels, alone), rows)[1] == "at random"
    assert selection.folds(in_memory(frames, labels), np.arange(3))[0] == []


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


def test_what_is_far_behind_is_given_up_and_not_chosen():
    right, wrong = np.zeros(40), np.ones(40)
    some = np.arange(40) % 20 == 0
    first = selection.Combination("median", "majority")
    good = selection.Combination("levels", "lda")
    near = selection.Combination("levels", "ridge")
    found = selection.far_behind({first: wrong, good: right, near: some.astype(float)})
    assert found == [first]
    scores = selection.Scores({good: 0.3, near: 0.1}, given_up=[near.name])
    assert scores.best(selection.Combination) == good


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


def test_advice_follows_the_numbers():
    def said(mine, published, rival, chosen="levels, lda"):
        n = 200
        right = {}
        for name, share in (
            ("median, majority", published),
            ("levels, lda", mine),
            ("1-NN, raw greys", rival),
        ):
            right[name] = np.arange(n) < share * n
        gain = advice.paired_accuracies(right[chosen], right["median, majority"])
        over = advice.paired_accuracies(right["1-NN, raw greys"], right[chosen])
        methods = {name: {"accuracy": own.mean()} for name, own in right.items()}
        test = {
            "name": "the last sessions",
            "tested": n,
            "methods": methods,
            "gain": gain.as_json(),
            "rival_gain": over.as_json(),
        }
        result = {
            "tests": [test],
            "chosen": chosen,
            "published": "median, majority",
            "rival": "1-NN, raw greys",
            "command": "hdc train",
            "chosen_by": "cross-validation",
        }
        return advice.of_classes(result)

    lines = said(0.9, 0.6, 0.5)
    assert lines[0] == "Use: hdc train"
    assert "90.0% on 200 frames of the last sessions" in lines[1]
    assert "+30.0 points (95 % interval +23" in lines[1]
    assert lines[2].startswith("That is a clear gain")
    assert lines[3].startswith("The best rival outside the library is worse: 1-NN")
    assert said(0.6, 0.9, 0.5)[2].startswith("That is a loss")
    assert said(0.61, 0.6, 0.6)[2].startswith("That is no clear gain")
    assert said(0.6, 0.6, 0.95)[3].startswith("A rival outside the library is better")
    assert "not clearly better or worse" in said(0.9, 0.6, 0.9)[3]
    none = said(0.1, 0.6, 0.5, chosen="median, majority")
    assert none[1].startswith("No combination was better than the published form")


def test_errors_are_one_line(hdc, archive, of_values, tmp_path):
    np.savez(tmp_path / "others.npz", frames=frames_of(2, 3), labels=[0, 1] * 3)
    np.savez(tmp_path / "small.npz", frames=np.zeros((6, 3, 3)), labels=[0, 1] * 3)
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
        ((of_values, "--test", archive), "--test: expected "),
        ((archive, "--encoder", "mean"), "encoder: expected one of "),
        ((archive, "--readout", "nowhere.Part"), "readout: expected a class "),
        ((of_values, "--readout", "lda"), "readout: expected one of "),
        ((archive, "-o", tmp_path / "curve.txt"), "-o: expected a file of .svg, .pdf"),
        ((archive, "-o", tmp_path / "no" / "curve.svg"), "-o: expected a folder to"),
    ):
        status, out, err = hdc("compare", *words)
        assert (status, out, err.count("\n")) == (1, "", 1), words
        assert message in err


def test_theory_expects_about_what_more_frames_give():
    frames = frames_of(4, 60, noise=600, dtype=np.uint16)
    labels = np.repeat(np.arange(4), 60)
    data = in_memory(frames, labels)
    few = np.flatnonzero(np.arange(240) % 60 < 10)
    expected = judge.expected(data, few)
    assert list(expected) == [10, 20, 100]
    learnt = np.arange(240) % 60 < 20
    model = HDCClassifier().fit(frames[learnt], labels[learnt])
    right = model.score(frames[~learnt], labels[~learnt])
    assert 0.4 < expected[10] < expected[20] < expected[100] < 1
    assert expected[20] == pytest.approx(right, abs=0.1)
    assert judge.expected(data, np.arange(0, 240, 30)) == {}  # two a class
    alike = in_memory(np.repeat(frames[::60], 5, 0), np.repeat(np.arange(4), 5))
    assert judge.expected(alike, np.arange(20)) == {}
