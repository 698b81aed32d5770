"""``hdc compare``: what it computes is what it says, and its page stands alone."""

import json
import re
import subprocess
import sys
from itertools import pairwise

import cv2
import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression, RidgeClassifier

from hdc import HDCClassifier
from hdc.command import main
from hdc.command.accuracy import wilson
from hdc.command.compare import _Split
from hdc.command.methods import METHODS, Linear
from hdc.command.work import split

SIDE = 16
NAMES = ("left", "<b>middle</b>", "right $x$")


def frames_of(classes, n, seed=0, noise=90, dtype=np.uint8):
    """uint8 [classes, n, 16, 16]: noisy frames of one pattern a class."""
    rng = np.random.default_rng(seed)
    base = rng.integers(0, 150, (classes, 1, SIDE, SIDE))
    return (base + rng.integers(0, noise, (classes, n, SIDE, SIDE))).astype(dtype)


@pytest.fixture
def archive(tmp_path):
    """12 frames of each class, and a class without any."""
    path = tmp_path / "own [1].npz"
    frames = frames_of(3, 12, noise=40).reshape(-1, SIDE, SIDE)
    classes = np.array(["none of it", *NAMES])
    np.savez(path, frames=frames, labels=1 + np.repeat(np.arange(3), 12), classes=classes)
    return path


@pytest.fixture
def hdc(capsys):
    def run(*words):
        with pytest.raises(SystemExit) as caught:
            main([str(word) for word in words])
        out, err = capsys.readouterr()
        return caught.value.code, out, err

    return run


def test_every_method_is_told_in_table_page_and_json(hdc, archive, tmp_path):
    page = tmp_path / "compare.html"
    status, out, err = hdc("compare", archive, "-o", page, "--seeds", 2)
    assert (status, err) == (0, "")
    table = out.splitlines()
    assert table[0].startswith("36 frames of 3 classes, 16 × 16 pixels; 20% of each class held out")
    assert [line.split("  ")[0].strip() for line in table[3:]] == list(METHODS)
    assert {path.name for path in tmp_path.iterdir()} == {archive.name, page.name}

    html = page.read_text()
    assert not re.search(r"(src|href)=[\"'](?!#|data:)|url\((?!#)|@import", html)
    assert "<b>middle</b>" not in html
    assert html.count("<svg") == 3
    for name, (_, settings) in METHODS.items():
        assert f"<li>{name}: " in html
        assert settings in html

    status, out, err = hdc("compare", archive, "--seeds", 1, "--json")
    found = json.loads(out)
    assert found["classes"] == list(NAMES)
    for method in found["methods"]:
        assert method["training_s"] > 0
        assert method["prediction_ms"] > 0
        counts = np.array(method["confusion"])
        assert counts.sum(axis=1).tolist() == [2, 2, 2]
        assert method["curve"][-1]["accuracy"] == pytest.approx(np.trace(counts) / 6)
    by_name = {method["name"]: method for method in found["methods"]}
    assert by_name["HDC"]["curve"][-1]["accuracy"] == 1
    assert by_name["Ridge"]["curve"][-1]["accuracy"] == 1
    assert by_name["HDC"]["bytes"] == 3 * SIDE * SIDE // 8
    assert by_name["Ridge"]["bytes"] == by_name["Softmax"]["bytes"] == 4 * 3 * (SIDE * SIDE + 1)


def test_hdc_is_the_one_of_train_and_a_frame_counts_once(hdc, tmp_path, monkeypatch):
    for name in set(METHODS) - {"HDC"}:
        monkeypatch.delitem(METHODS, name)
    frames = frames_of(3, 10, noise=4000, dtype=np.uint16)
    labels = np.repeat(np.arange(3), 10)
    path = tmp_path / "own.npz"
    np.savez(path, frames=frames.reshape(-1, SIDE, SIDE), labels=labels)
    _, out, _ = hdc("compare", path, "--seeds", 4, "--json", "--test-fraction", 0.3)
    mine = json.loads(out)["methods"][0]

    every, right = frames.reshape(-1, SIDE, SIDE), {}
    for seed in range(4):
        train, test = split([str(c) for c in labels], 0.3, seed)
        predicted = HDCClassifier().fit(every[train], labels[train]).predict(every[test])
        for i, is_right in zip(test, predicted == labels[test], strict=True):
            right.setdefault(i, []).append(is_right)
    shares = [np.mean(answers) for answers in right.values()]
    assert len(shares) < 4 * 9  # some were drawn more than once
    assert 0 < np.mean(shares) < 1
    final = mine["curve"][-1]
    assert final["accuracy"] == pytest.approx(np.mean(shares))
    assert (final["low"], final["high"]) == pytest.approx(wilson(sum(shares), len(shares)))


@pytest.mark.parametrize("classes", [2, 3])
@pytest.mark.parametrize(
    "solver", [RidgeClassifier, lambda: LogisticRegression(max_iter=10_000, tol=1e-8)]
)
def test_solved_among_samples_is_solved_among_pixels(solver, classes):
    frames = frames_of(classes, 8, noise=250, dtype=np.uint16)
    queries = frames_of(classes, 40, noise=250, dtype=np.uint16).reshape(-1, SIDE, SIDE)
    labels = np.repeat(np.arange(classes), 8)
    frames = frames.reshape(-1, SIDE, SIDE)
    model = Linear(solver)
    model.fit(np.concatenate([frames, frames[:1]]), np.append(labels, 0))  # one twice: singular
    unit = (np.concatenate([frames, frames[:1]]) / 65535).reshape(-1, SIDE * SIDE)
    direct = solver().fit(unit, np.append(labels, 0))
    np.testing.assert_allclose(model._weights, np.atleast_2d(direct.coef_), rtol=1e-3, atol=1e-5)
    np.testing.assert_allclose(model._bias, np.atleast_1d(direct.intercept_), rtol=1e-3, atol=1e-5)
    expected = direct.predict((queries / 65535).reshape(-1, SIDE * SIDE))
    assert (model.predict(queries) == expected).mean() > 0.99


def test_frames_all_alike_are_refused():
    with pytest.raises(ValueError, match="expected some that differ"):
        Linear(RidgeClassifier).fit(np.full((4, 8, 8), 7, np.uint8), np.array([0, 0, 1, 1]))


def test_portions_are_nested_of_every_class_and_never_tested():
    labels = np.repeat(np.arange(3), [40, 30, 20])
    train, test = split([str(c) for c in labels], 0.2, 0)
    portions = _Split(train, test, labels, 0).portions
    assert len(portions) > 2
    assert portions[-1].tolist() == train.tolist()
    for small, large in pairwise(portions):
        assert set(small) < set(large)
        assert set(labels[small]) == {0, 1, 2}
        assert np.bincount(labels[small]).min() >= 2
    assert not set(portions[-1]) & set(test)


@pytest.mark.parametrize("name", ["Softmax", "Small network"])
@pytest.mark.parametrize("shape", [(5, 3), (260, 300)])
def test_what_is_trained_by_steps_learns_and_repeats(name, shape):
    rng = np.random.default_rng(0)
    base = rng.integers(0, 200, (2, 1, *shape))
    frames = (base + rng.integers(0, 30, (2, 6, *shape))).astype(np.uint8).reshape(-1, *shape)
    labels = np.repeat([0, 1], 6)
    answers = []
    for _ in range(2):
        method = METHODS[name][0](3)
        method.fit(frames, labels)
        answers.append(method.predict(frames))
    assert (answers[0] == labels).mean() > 0.9
    assert (answers[0] == answers[1]).all()


def test_errors_are_one_line(hdc, tmp_path):
    path = tmp_path / "own"
    for name, n in (("a", 3), ("b", 1)):
        (path / name).mkdir(parents=True)
        for i, image in enumerate(frames_of(1, n)[0]):
            cv2.imwrite(str(path / name / f"{i}.png"), image)
    for words, said in (
        ((path,), "class 'b': expected two frames or more to hold out, found one"),
        ((path, "-o", tmp_path / "no" / "c.html"), "expected a folder to write into, found none"),
        ((path, "--crop", 0, 0, 999, 9), "expected a window inside frames 16 px wide"),
        ((tmp_path / "nothing",), "found nothing"),
    ):
        status, out, err = hdc("compare", *words)
        assert (status, out, err.count("\n")) == (1, "", 1), words
        assert said in err


@pytest.mark.parametrize("package", ["sklearn", "matplotlib"])
def test_a_package_that_is_missing_names_its_extra(package, archive, tmp_path):
    code = f"import sys; sys.modules[{package!r}] = None\nfrom hdc.command import main; main()"
    words = [sys.executable, "-c", code, "compare", archive, "-o", tmp_path / "c.html"]
    done = subprocess.run(words, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        f"error: expected the package {package}, found none; pip install 'hdc[compare]'\n"
    )
