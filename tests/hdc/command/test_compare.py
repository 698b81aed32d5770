"""``hdc compare``: its numbers are those of the plain computation."""

import json

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression, RidgeClassifierCV
from sklearn.neighbors import NearestCentroid

from hdc import HDCClassifier
from hdc.bits import unpack
from hdc.command import comparison, main

SIDE = 16
NAMES = ("left", "<b>middle</b>", "right $x$")


def frames_of(classes, n, seed=0, noise=90, dtype=np.uint8):
    """[classes · n, 16, 16]: noisy frames of one pattern a class."""
    rng = np.random.default_rng(seed)
    base = rng.integers(0, 150, (classes, 1, SIDE, SIDE))
    frames = (base + rng.integers(0, noise, (classes, n, SIDE, SIDE))).astype(dtype)
    return frames.reshape(-1, SIDE, SIDE)


@pytest.fixture
def archive(tmp_path):
    path = tmp_path / "own [1].npz"
    labels = np.repeat(NAMES, 12)
    np.savez(
        path,
        frames=frames_of(3, 12, noise=40),
        labels=labels,
        order=np.tile(np.arange(12), 3),
    )
    return path


@pytest.fixture
def hdc(capsys):
    def run(*words):
        with pytest.raises(SystemExit) as caught:
            main([str(word) for word in words])
        out, err = capsys.readouterr()
        return caught.value.code, out, err

    return run


def test_every_method_is_in_table_and_json(hdc, archive, tmp_path):
    status, out, err = hdc("compare", archive, "--draws", 2)
    assert (status, err) == (0, "")
    assert out.startswith(
        "36 frames of 3 classes, 16 × 16 pixels, 20% held out, 2 draws"
    )
    assert all(out.count(f"\n {name} ") == 2 for name in comparison.METHODS)
    assert out.splitlines()[-1].startswith(
        "Use hdc train --readout prototype: on the ordered "
    )
    other = tmp_path / "tomorrow.npz"
    np.savez(other, frames=frames_of(3, 5, noise=40), labels=np.repeat(NAMES, 5))
    result = json.loads(hdc("compare", archive, "--test", other, "--json")[1])
    assert list(result["splits"]) == ["random", "other recording"]
    assert set(result["classes"]) == {*NAMES}
    for name, curve in result["splits"]["other recording"].items():
        assert [point["frames_a_class"] for point in curve] == [1, 2, 5, 10, 12]
        assert curve[-1] == pytest.approx({"frames_a_class": 12, "accuracy": 1, "high": 1,
                                           "low": curve[-1]["low"], "tested": 15})  # fmt: skip
        assert name in comparison.METHODS


def test_predictions_are_those_from_pixels_and_of_the_classifier():
    frames = frames_of(3, 30, noise=4000, dtype=np.uint16)
    labels, rng = np.repeat(np.arange(3), 30), np.random.default_rng(1)
    train = np.sort(
        np.concatenate([c * 30 + rng.permutation(30)[:17] for c in range(3)])
    )
    test = np.setdiff1d(np.arange(90), train)
    data = comparison.Frames(frames)
    answers = {
        n: comparison.predict(n, data, labels, train, test) for n in comparison.METHODS
    }
    flat = frames.reshape(90, -1) / 65535
    centroid = NearestCentroid()
    expected = {
        "prototype": HDCClassifier()
        .fit(frames[train], labels[train])
        .predict(frames[test]),
        "mean image": centroid.fit(flat[train], labels[train]).predict(flat[test]),
    }
    for name, found in expected.items():
        assert np.array_equal(answers[name], found), name
    for name, pixels, model in (
        ("softmax", flat, LogisticRegression(C=10, max_iter=1000)),
        ("ridge", 2.0 * unpack(data.words, SIDE**2).numpy() - 1,
         RidgeClassifierCV(np.logspace(-4, 2, 7))),
    ):  # fmt: skip
        centred = pixels - pixels[train].mean(0)
        unit = centred / np.sqrt((centred[train] ** 2).sum() / len(train))
        found = model.fit(unit[train], labels[train]).predict(unit[test])
        assert (answers[name] == found).mean() >= 0.97, name
    distances = data.products["bits"][np.ix_(test, train)].argmax(1)
    assert np.array_equal(answers["neighbours"], labels[train][distances])


def test_advice_follows_the_numbers():
    def said(**accuracies):
        last = {
            name: [{"accuracy": 0.5, "low": 0.4, "high": 0.6}]
            for name in comparison.METHODS
        }
        for name, value in accuracies.items():
            last[name.replace("_", " ")] = [
                {"accuracy": value, "low": value - 0.05, "high": value + 0.05}
            ]
        return comparison.advice({"ordered": last})

    assert said(mean_image=0.9).startswith("Use mean image on grey values: ")
    assert said(ridge=0.9).startswith("Use hdc train --readout ridge: ")
    assert said(softmax=0.58).startswith("Use hdc train --readout prototype: ")


def test_errors_are_one_line(hdc, archive, tmp_path):
    np.savez(tmp_path / "others.npz", frames=frames_of(2, 3), labels=[0, 1] * 3)
    for words, message in (
        (
            (archive, "--crop", 0, 0, 999, 9),
            "expected a window inside frames 16 px wide",
        ),
        ((tmp_path / "nothing",), "found nothing"),
        (
            (archive, "--test", tmp_path / "others.npz"),
            "--test: expected classes among ",
        ),
    ):
        status, out, err = hdc("compare", *words)
        assert (status, out, err.count("\n")) == (1, "", 1), words
        assert message in err


def test_theory_expects_about_what_more_frames_give():
    frames, labels = (
        frames_of(4, 60, noise=600, dtype=np.uint16),
        np.repeat(np.arange(4), 60),
    )
    few = np.flatnonzero(np.arange(240) % 60 < 10)
    expected = comparison.expected(comparison.Frames(frames[few]), labels[few])
    assert list(expected) == [10, 20, 100]
    learnt = np.arange(240) % 60 < 20
    right = (
        HDCClassifier()
        .fit(frames[learnt], labels[learnt])
        .score(frames[~learnt], labels[~learnt])
    )
    assert 0.4 < expected[10] < expected[20] < expected[100] < 1
    assert expected[20] == pytest.approx(right, abs=0.1)
    assert (
        comparison.expected(comparison.Frames(frames[::30]), labels[::30]) == {}
    )  # two a class
    alike = np.repeat(frames[::60], 5, 0)
    assert (
        comparison.expected(comparison.Frames(alike), np.repeat(np.arange(4), 5)) == {}
    )
