"""``hdc compare``: its numbers are those of the plain computation."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from sklearn.compose import TransformedTargetRegressor
from sklearn.linear_model import RidgeClassifierCV, RidgeCV
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor, NearestCentroid
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC, SVR

from hdc import HDCClassifier, HDCRegressor
from hdc.command.compare import candidates, judge
from hdc.command.splits import folds
from hdc.readers import open_recording

SIDE = 16
NAMES = ("left", "<b>middle</b>", "right $x$")


def of_greys(model):
    return make_pipeline(StandardScaler(), model)


def of_values_of_greys(model):
    return TransformedTargetRegressor(of_greys(model), transformer=StandardScaler())


CLASSES = {
    "mean image of grey values": of_greys(NearestCentroid()),
    "1-NN of grey values": of_greys(KNeighborsClassifier(1)),
    "ridge of grey values": of_greys(RidgeClassifierCV(np.logspace(0, 6, 7))),
    "SVM of grey values": of_greys(SVC(C=10)),
}
SVM = MultiOutputRegressor(SVR(C=10, epsilon=0.01))
VALUES = {
    "1-NN of grey values": of_values_of_greys(KNeighborsRegressor(1)),
    "3-NN of grey values": of_values_of_greys(KNeighborsRegressor(3)),
    "ridge of grey values": of_values_of_greys(RidgeCV(np.logspace(0, 6, 7))),
    "SVM of grey values": of_values_of_greys(SVM),
}


def frames_of(classes, n, seed=0, noise=90):
    """[classes · n, 16, 16]: noisy frames of one pattern a class."""
    base = np.random.default_rng(0).integers(0, 150, (classes, 1, SIDE, SIDE))
    rng = np.random.default_rng([1, seed])
    frames = (base + rng.integers(0, noise, (classes, n, SIDE, SIDE))).astype(np.uint8)
    return frames.reshape(-1, SIDE, SIDE)


@pytest.fixture
def archive():
    path = "own [1].npz"
    np.savez(path, frames=frames_of(3, 12, noise=40), labels=np.repeat(NAMES, 12))
    return path


@pytest.fixture
def of_values():
    """A square that moves: its place as depth in mm and what follows of it; three sessions."""
    depth = np.random.default_rng(0).uniform(2, 14, 60)
    bump = 150 * np.exp(-((np.arange(SIDE) - depth[:, None]) ** 2) / 8)
    noise = np.random.default_rng(1).integers(0, 20, (60, SIDE, SIDE))
    kept = {"values": np.stack([depth, (depth - 8) ** 2], axis=1)}
    kept |= {"value_names": ["depth", "force"], "value_units": ["mm", "N"]}
    path = "moves.npz"
    frames = (bump[:, None, :] + noise).astype(np.uint8)
    np.savez(path, frames=frames, session=np.arange(60) // 20, **kept)
    return path


def rows_of(out):
    """Cells of each row by the name of its model."""
    start = next(k for k, line in enumerate(out) if line.startswith("model "))
    rows = (line.split("  ", 1) for line in out[start + 1 :])
    return {name: rest.split() for name, *rest in rows if rest for rest in rest}


# Rows --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("plain", "library"), [(CLASSES, HDCClassifier), (VALUES, HDCRegressor)]
)
def test_a_row_is_the_plain_computation(plain, library, archive, of_values):
    """Of each form and of each baseline, in folds."""
    of_classes = plain is CLASSES
    recording = open_recording(archive if of_classes else of_values)
    frames = recording[:]
    truth = np.array(recording.names) if of_classes else recording.values
    splits, _ = folds(recording)
    listed = candidates.cheapest_first(not of_classes)
    assert plain.keys() <= listed.keys()
    for name, model in listed.items():
        flat, other = frames.reshape(len(frames), -1), plain.get(name)
        given = flat
        if other is None:
            given, other = frames, library(*name.split(", "))
        answers = np.empty_like(truth)
        for train, test in splits:
            answers[test] = other.fit(given[train], truth[train]).predict(given[test])
        found = judge.tested(model, flat, truth, splits).errors
        if of_classes:
            assert found[:, 0].tolist() == (answers != truth).tolist(), name
        else:
            assert found == pytest.approx(np.abs(answers - truth), abs=0.02), name


def test_errors_of_values_are_weighed_by_those_of_the_constant_baseline():
    values = np.array([[0.0, 5], [1, 5], [9, 5], [2, 5]])
    assert judge.scale(values).tolist() == [2.5, 1]  # one of equal values


def test_a_gain_is_tested_by_whole_units():
    losses = {"old": np.ones(8), "new": np.repeat([0.0, 1.0], [6, 2])}
    for units, expected in (
        (np.arange(8), 2**-6),
        (np.arange(8) // 2, 2**-3),
        (np.zeros(8, int), 0.5),
    ):
        p = judge.p_value("new", "old", losses, units)
        assert p == pytest.approx(expected, rel=0.3)


def test_chance_is_called_a_gain_as_seldom_as_it_says():
    """Of forms that are all alike, the best is below 0.1 once in ten."""
    rng = np.random.default_rng(1)
    below = 0
    for _ in range(200):
        losses = {str(k): rng.integers(0, 2, 30) * 1.0 for k in range(5)}
        best = min([*"1234"], key=lambda name: losses[name].mean())
        below += judge.p_value(best, "0", losses, np.arange(30)) < 0.1
    assert below <= 32  # 20 are expected, with a deviation of 4.2


# The command -------------------------------------------------------------------------------------


def test_rows_come_cheapest_first_and_the_last_lines_say_what_to_type(hdc, archive):
    status, out, _ = hdc("compare", archive)
    assert status == 0
    rows = rows_of(out)
    assert [*rows] == [*candidates.cheapest_first(False)]
    assert [name for name, cells in rows.items() if cells[-1] == "yes"] == [
        "median, majority", "levels, lda", "deviation, lda",
    ]  # fmt: skip
    right = {name: float(cells[0]) for name, cells in rows.items()}
    best = [name for name, share in right.items() if share == max(right.values())]
    said = f"Best of the table: {', '.join(best)}. Cross-validation chose median, majority."
    assert out[14:-2] == ([] if best == ["median, majority"] else [said])
    assert out[-2:] == [
        "Use: hdc train with --encoder median --readout majority",
        "No other form was better than median, majority in the folds.",
    ]


def corner(path, n=60):
    """Classes that differ in four pixels, which the published form does not see."""
    frames = np.random.default_rng(0).integers(0, 200, (n, SIDE, SIDE)).astype(np.uint8)
    labels = np.arange(n) % 2
    frames[labels == 1, :2, :2] = 255
    np.savez(path, frames=frames, labels=labels)
    return frames, labels.astype(str)


def test_a_gain_is_clear_only_over_what_was_recorded_together(hdc):
    corner("c.npz")
    words = ("--crop", 0, 0, 16, 8)
    out = hdc("compare", "c.npz", *words)[1]
    why = "chosen by 5 folds at random, for no sessions are known ("
    assert any(line.startswith(why) for line in out)
    right = {name: float(cells[0]) for name, cells in rows_of(out).items()}
    best = max(right, key=lambda name: ("grey" not in name, right[name]))
    won = right[best] - right["median, majority"]
    said = f"{best} over median, majority: {won:+.1f} points of accuracy, p = 0.0001 of"
    assert out[-1].startswith(said)
    assert out[-1].endswith("a gain is clear only over sessions or groups.")
    assert out[-2] == "Use: hdc train with --encoder {} --readout {}".format(
        *best.split(", ")
    )
    kept = dict(np.load("c.npz")) | {"session": np.arange(60) // 6}
    np.savez("sessions.npz", **kept)
    out = hdc("compare", "sessions.npz", *words)[1]
    assert "chosen by 10 folds by session" in out
    assert ", a clear gain (p = " in out[-1]


def test_a_gain_of_values_is_in_the_error_of_the_constant_baseline(hdc, of_values):
    out = hdc("compare", of_values, "--column", "depth")[1]
    errors = {name: float(cells[0]) for name, cells in rows_of(out).items()}
    depth = np.load(of_values)["values"][:, 0]
    constant = np.abs(depth - np.median(depth)).mean()
    best = min(errors, key=lambda name: ("grey" in name, errors[name]))
    change = 100 * (errors[best] - errors["median, ridge"]) / constant
    said = re.fullmatch(
        rf"{best} over median, ridge: (\S+) % of the constant baseline's error, no clear gain "
        r"\(p = 0\.\d+ of sessions\)\.",
        out[-1],
    )
    assert float(said[1]) == pytest.approx(change, abs=0.1)
    assert change < 0


def test_another_recording_is_tested_and_chooses_nothing(hdc, archive):
    """Its classes are patterns of another sensor: all forms fail, and that is said."""
    other = "tomorrow.npz"
    frames = 255 - frames_of(3, 5, 1, 40)
    np.savez(other, frames=frames, labels=np.repeat(NAMES, 5))
    out = hdc("compare", archive, "--test", other)[1]
    assert f"tested on {other}: 15 frames" in out
    assert "Use: hdc train with --encoder median --readout majority" in out
    published = HDCClassifier()
    published.fit(frames_of(3, 12, noise=40), np.repeat(NAMES, 12))
    share = published.score(frames, np.repeat(NAMES, 5))
    row = rows_of(out)["median, majority"]
    *accuracies, learn_s, frame_ms, exported = row
    assert accuracies == ["100.0", "%", f"{100 * share:.1f}", "%"]
    assert min(float(learn_s), float(frame_ms)) > 0
    assert exported == "yes"
    assert out[-1].startswith("Your sensor differs between")


def test_ctrl_c_keeps_the_rows_that_are_there(hdc, archive, monkeypatch):
    plain = judge.tested

    def interrupted(model, *rest):
        if getattr(model, "readout", "") == stop:
            raise KeyboardInterrupt
        return plain(model, *rest)

    monkeypatch.setattr(judge, "tested", interrupted)
    stop = "neighbours"
    status, out, _ = hdc("compare", archive)
    assert (status, out[-4]) == (0, "interrupted: the rows above are whole")
    assert "Use: hdc train" in out[-2]
    stop = "majority"
    status, _, (line,) = hdc("compare", archive)
    assert (status, "expected median, majority to learn" in line) == (1, True)


def test_the_other_recording_has_a_table_of_its_own(hdc):
    """It was tested with that of the first, on the frames of training."""
    for name, n in (("pins", 8), ("pins2", 5)):
        Path(name).mkdir()
        rows = [f"{name}_{k}.png,{k % 4}" for k in range(n)]
        for k, frame in enumerate(frames_of(1, n)):
            assert cv2.imwrite(f"{name}/{name}_{k}.png", frame)
        Path(name, "t.csv").write_text("\n".join(["image,z", *rows]))
    words = ("compare", "pins", "--test", "pins2")
    assert "tested on pins2: 5 frames" in hdc(*words, "--values", "t.csv")[1]
    (line,) = hdc(*words, "--values", "pins/t.csv")[2]
    assert "--test: expected labels and numbers in pins2, found pins/t.csv" in line


def test_errors_are_one_line(hdc, archive, of_values):
    np.savez("others.npz", frames=frames_of(2, 3), labels=[0, 1] * 3)
    np.savez("small.npz", frames=np.zeros((6, 3, 3)), labels=[0, 1] * 3)
    for recording, other, message in (
        (archive, "others.npz", "--test: expected classes among "),
        (archive, "small.npz", "--test: expected frames (16, 16)"),
        (of_values, archive, "and values depth, force as "),
    ):
        status, out, (line,) = hdc("compare", recording, "--test", other)
        assert (status, out) == (1, []), message
        assert message in line


def test_a_form_that_cannot_learn_the_frames_is_left_out_and_said(
    hdc, archive, monkeypatch
):
    monkeypatch.setattr("hdc.readouts.discriminant.MOST_FRAMES", 20)
    status, out, _ = hdc("compare", archive)
    assert (status, "left out: levels, lda: " in "\n".join(out)) == (0, True)
