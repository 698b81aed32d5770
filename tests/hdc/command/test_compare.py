"""``hdc compare`` and ``hdc train --choose``: their numbers are those of the plain computation."""

import json
import shlex

import cv2
import numpy as np
import pytest
from sklearn.linear_model import RidgeClassifierCV, RidgeCV
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor, NearestCentroid
from sklearn.svm import SVC, SVR

from hdc import HDCClassifier, HDCRegressor
from hdc.command.compare import candidates, judge
from hdc.command.splits import folds
from hdc.readers import open_recording

SIDE = 16
NAMES = ("left", "<b>middle</b>", "right $x$")
PLAIN = {
    "mean image of grey values": NearestCentroid(),
    "1-NN of grey values": KNeighborsClassifier(1),
    "ridge of grey values": RidgeClassifierCV(np.logspace(0, 6, 7)),
    "SVM of grey values": SVC(C=10),
}
PLAIN_VALUES = {
    "1-NN of grey values": KNeighborsRegressor(1),
    "3-NN of grey values": KNeighborsRegressor(3),
    "ridge of grey values": RidgeCV(np.logspace(0, 6, 7)),
    "SVM of grey values": MultiOutputRegressor(SVR(C=10, epsilon=0.01)),
}


def frames_of(classes, n, seed=0, noise=90):
    """[classes · n, 16, 16]: noisy frames of one pattern a class."""
    base = np.random.default_rng(0).integers(0, 150, (classes, 1, SIDE, SIDE))
    rng = np.random.default_rng([1, seed])
    frames = (base + rng.integers(0, noise, (classes, n, SIDE, SIDE))).astype(np.uint8)
    return frames.reshape(-1, SIDE, SIDE)


@pytest.fixture
def archive(tmp_path):
    path = tmp_path / "own [1].npz"
    np.savez(path, frames=frames_of(3, 12, noise=40), labels=np.repeat(NAMES, 12))
    return path


@pytest.fixture
def of_values(tmp_path):
    """A square that moves: its place as depth in mm and what follows of it; three sessions."""
    depth = np.random.default_rng(0).uniform(2, 14, 60)
    bump = 150 * np.exp(-((np.arange(SIDE) - depth[:, None]) ** 2) / 8)
    noise = np.random.default_rng(1).integers(0, 20, (60, SIDE, SIDE))
    kept = {"values": np.stack([depth, (depth - 8) ** 2], axis=1)}
    kept |= {"value_names": ["depth", "force"], "value_units": ["mm", "N"]}
    path = tmp_path / "moves.npz"
    frames = (bump[:, None, :] + noise).astype(np.uint8)
    np.savez(path, frames=frames, session=np.arange(60) // 20, **kept)
    return path


def prepared(path, period=None):
    """A recording in memory, and its folds."""
    recording = open_recording(path)
    rows = np.arange(len(recording))
    data, (test,) = judge.prepared(recording, rows, period=period)
    return data, test


# Rows --------------------------------------------------------------------------------------------


def greys(frames, train):
    flat = frames.reshape(len(frames), -1).astype(float)
    deviations = flat[train].std(0)
    return (flat - flat[train].mean(0)) / np.where(deviations > 0, deviations, 1)


def test_a_row_of_classes_is_the_plain_computation(archive):
    """Of each form and of each baseline, in folds."""
    recording = open_recording(archive)
    frames, names = recording[:], np.array(recording.names)
    listed = candidates.cheapest_first((), (), False, None)
    forms = dict(zip(map(", ".join, candidates.FORMS), candidates.FORMS, strict=True))
    assert {form.name for form in listed} == {*PLAIN, *forms}
    for candidate in listed:
        wrong = []
        for train, test in folds(recording, np.arange(36))[0]:
            given, model = greys(frames, train), PLAIN.get(candidate.name)
            if model is None:
                given, model = frames, HDCClassifier(*forms[candidate.name])
            model.fit(given[train], names[train])
            wrong.append(model.predict(given[test]) != names[test])
        row = judge.judged(candidate, *prepared(archive))
        assert row.losses.tolist() == np.concatenate(wrong).tolist(), candidate.name
        assert row.train_s > 0
        assert row.frame_ms > 0


def test_a_row_of_values_is_the_plain_computation(of_values):
    recording = open_recording(of_values)
    frames, values = recording[:], recording.values
    spread = np.abs(values - np.median(values, axis=0)).mean(0)
    for candidate in candidates.cheapest_first((), (), True, None):
        off = []
        for session in range(3):
            is_test = np.arange(60) // 20 == session
            train, test = np.flatnonzero(~is_test), np.flatnonzero(is_test)
            middle, scale = values[train].mean(0), values[train].std(0)
            given, model = greys(frames, train), PLAIN_VALUES.get(candidate.name)
            if model is None:
                middle, scale = 0, 1
                given, model = frames, HDCRegressor(*candidate.name.split(", "))
            model.fit(given[train], (values[train] - middle) / scale)
            answers = model.predict(given[test]) * scale + middle
            off.append(np.abs(answers - values[test]))
        row = judge.judged(candidate, *prepared(of_values))
        expected = np.concatenate(off)
        assert np.sort(row.errors, 0) == pytest.approx(np.sort(expected, 0), abs=0.02)
        assert row.losses.mean() == pytest.approx((expected / spread).mean(), rel=1e-4)


def test_losses_of_values_are_multiples_of_those_of_the_constant_baseline(of_values):
    away = np.random.default_rng(0).uniform(-180, 180, (2000, 1))
    assert judge.constant_errors(away, 360) == pytest.approx(90, rel=0.05)
    assert judge.constant_errors(np.ones((12, 1)), None) == [1.0]  # of equal values
    kept = dict(np.load(of_values))
    angles = (kept["values"][:, :1] * 20 - 160) % 360  # to either side of zero
    kept |= {"values": angles, "value_names": ["yaw"], "value_units": ["deg"]}
    np.savez(of_values, **kept)
    row = judge.judged(candidates.forms((), (), True)[0], *prepared(of_values, 360))
    assert row.errors.mean() < 30
    constant = judge.constant_errors(angles, 360)
    assert row.losses == pytest.approx((row.errors / constant)[:, 0])


def test_a_gain_is_tested_by_whole_units():
    losses = {"old": np.ones(8), "new": np.repeat([0.0, 1.0], [6, 2])}
    for units, expected in (
        (np.arange(8), 2**-6),
        (np.arange(8) // 2, 2**-3),
        (np.zeros(8), 0.5),
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
    status, out, err = hdc("compare", archive)
    assert (status, err) == (0, [])
    listed = candidates.cheapest_first((), (), False, None)
    assert [row.split("  ")[0] for row in out[4:14]] == [form.name for form in listed]
    assert [row.split("  ")[0] for row in out[4:14] if row.endswith(" yes")] == [
        "median, majority", "levels, lda", "deviation, lda",
    ]  # fmt: skip
    right = {row.split("  ")[0]: row.split("%")[0].split()[-1] for row in out[4:14]}
    best = [name for name, share in right.items() if share == max(right.values())]
    said = f"Best of the table: {', '.join(best)}. Cross-validation chose median, majority."
    assert out[14:-2] == ([] if best == ["median, majority"] else [said])
    line = f"Use: hdc train {shlex.quote(str(archive))} --encoder median "
    assert out[-2].startswith(line)
    assert out[-1] == "No other form was better than median, majority in the folds."


def corner(path, n=60):
    """Classes that differ in four pixels, which the published form does not see."""
    frames = np.random.default_rng(0).integers(0, 200, (n, SIDE, SIDE)).astype(np.uint8)
    labels = np.arange(n) % 2
    frames[labels == 1, :2, :2] = 255
    np.savez(path, frames=frames, labels=labels)
    return frames, labels.astype(str)


def test_the_line_to_type_trains_the_chosen_model(hdc, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    corner("c.npz")
    words = ("compare", "c.npz", "--readout", "lda", "--encoder", "levels")
    result = json.loads(hdc(*words, "--crop", 0, 0, 16, 8, "--json")[1][0])
    assert result["chosen"] == "levels, lda"
    accuracy = {name: own["accuracy"][0] for name, own in result["models"].items()}
    won = accuracy["levels, lda"] - accuracy["median, majority"]
    assert result["gain"] == pytest.approx(won)
    assert result["p_value"] < 0.01
    said = hdc(*words)[1][-1]
    assert "of single frames; a gain is clear only over sessions or groups" in said
    kept = dict(np.load("c.npz")) | {"session": np.arange(60) // 6}
    np.savez("sessions.npz", **kept)
    assert ", a clear gain (p = " in hdc("compare", "sessions.npz", *words[2:])[1][-1]
    assert hdc(*shlex.split(result["command"])[1:])[0] == 0
    model = HDCClassifier.load("model.safetensors")
    assert repr(model.encoder).startswith("Levels(")
    assert repr(model.readout).startswith("LDA(")
    assert model.frame_shape_ == (8, 16)


def test_another_recording_may_be_called_folds(hdc, folder, monkeypatch):
    """It took the place of the folds."""
    monkeypatch.chdir(folder.parent)
    folder.rename("folds")
    one = ("--encoder", "median", "--readout", "majority")
    (line,) = hdc("compare", "folds", "--test", "folds", *one, "--json")[1]
    assert json.loads(line)["tests"] == {"folds": 36, "./folds": 36}


def test_another_recording_is_tested_and_chooses_nothing(hdc, archive, tmp_path):
    """Its classes are patterns of another sensor: all forms fail, and that is said."""
    other = tmp_path / "tomorrow.npz"
    frames = 255 - frames_of(3, 5, 1, 40)
    np.savez(other, frames=frames, labels=np.repeat(NAMES, 5))
    words = ("compare", archive, "--test", other, "--encoder", "median")
    result = json.loads(hdc(*words, "--readout", "neighbours", "--json")[1][0])
    assert result["tests"] == {"folds": 36, str(other): 15}
    assert result["chosen"] == "median, majority"
    published = HDCClassifier()
    published.fit(frames_of(3, 12, noise=40), np.repeat(NAMES, 12))
    share = published.score(frames, np.repeat(NAMES, 5))
    assert result["models"]["median, majority"]["accuracy"] == [1.0, share]
    assert hdc(*words)[1][-1].startswith("Your sensor differs between")


def test_ctrl_c_keeps_the_rows_that_are_there(hdc, archive, monkeypatch):
    plain = judge.judged

    def interrupted(candidate, *rest):
        if candidate.name == stop:
            raise KeyboardInterrupt
        return plain(candidate, *rest)

    monkeypatch.setattr(judge, "judged", interrupted)
    stop = "median, neighbours"
    status, out, _ = hdc("compare", archive)
    assert (status, out[-4]) == (0, "interrupted: the rows above are whole")
    assert "Use: hdc train" in out[-2]
    stop = "median, majority"
    status, _, (line,) = hdc("compare", archive)
    assert status == 1
    assert "expected median, majority to learn, it was interrupted" in line


@pytest.mark.parametrize(
    ("known", "how", "why"),
    [
        ({"group": np.arange(24) // 4}, "6 folds by group", ""),
        ({"group": np.arange(24) // 4, "session": np.zeros(24, int)}, "6 folds by group",
         "all frames are from one session"),
        ({"session": np.arange(24) // 12}, "5 folds at random",
         "a class has frames from one session only"),
        ({"session": np.arange(24) % 4}, "4 folds by session", ""),
    ],
)  # fmt: skip
def test_folds_are_of_what_was_recorded_together_or_it_is_said_why(
    hdc, tmp_path, known, how, why
):
    """Of 24 videos with groups nothing was chosen; folds were at random without a reason."""
    path = tmp_path / "r.npz"
    labels = np.arange(24) // 12
    np.savez(path, frames=frames_of(2, 12, noise=40), labels=labels, **known)
    words = ("compare", path, "--encoder", "median", "--readout", "majority")
    (line,) = [row for row in hdc(*words)[1] if row.startswith("chosen by")]
    assert line == f"chosen by {how}" + (f", for {why}" if why else "")
    out = hdc("train", path, "-o", tmp_path / "m", "--choose")[1]
    chosen = [row for row in out if row.startswith("chosen")]
    assert f" by {how} (" in chosen[0]
    assert chosen[1:] == ([f"chosen by {how} because {why}"] if why else [])


def test_train_takes_the_best_form(hdc, tmp_path):
    path = tmp_path / "corner.npz"
    frames, names = corner(path)
    assert hdc("train", path, "-o", tmp_path / "m", "--choose")[0] == 0
    listed = candidates.forms((), (), False)
    loss = {c.name: judge.judged(c, *prepared(path)).losses.mean() for c in listed}
    best = min(loss, key=loss.get)
    assert loss[best] < loss[listed[0].name]
    plain = HDCClassifier(*best.split(", ")).fit(frames, names)
    found = HDCClassifier.load(tmp_path / "m")
    assert (found.decision_function(frames) == plain.decision_function(frames)).all()


def test_the_other_recording_has_a_table_of_its_own(hdc, tmp_path, monkeypatch):
    """It was tested with that of the first, on the frames of training."""
    monkeypatch.chdir(tmp_path)
    for name, n in (("pins", 8), ("pins2", 5)):
        (tmp_path / name).mkdir()
        rows = [f"{name}_{k}.png,{k % 4}" for k in range(n)]
        for k, frame in enumerate(frames_of(1, n)):
            assert cv2.imwrite(f"{name}/{name}_{k}.png", frame)
        (tmp_path / name / "t.csv").write_text("\n".join(["image,z", *rows]))
    words = ("compare", "pins", "--test", "pins2", "--json", "--readout", "neighbours")
    (line,) = hdc(*words, "--values", "pins/t.csv")[1]
    assert json.loads(line)["tests"]["pins2"] == 5
    (tmp_path / "pins" / "t.csv").rename("t.csv")
    (line,) = hdc(*words, "--values", "t.csv")[2]
    assert "--test: expected labels and numbers in or beside pins2, found t.csv" in line


def test_errors_are_one_line(hdc, archive, of_values, tmp_path):
    np.savez(tmp_path / "others.npz", frames=frames_of(2, 3), labels=[0, 1] * 3)
    np.savez(tmp_path / "small.npz", frames=np.zeros((6, 3, 3)), labels=[0, 1] * 3)
    for words, status, message in (
        ((archive, "--test", tmp_path / "others.npz"), 1, "--test: expected classes among "),
        ((archive, "--test", tmp_path / "small.npz"), 1, "--test: expected frames (16, 16)"),
        ((of_values, "--test", archive), 1, "--test: expected values depth, force as "),
        ((of_values, "--readout", "lda"), 1, "readout: expected one of "),
        ((archive, "--budget", 5), 2, "--budget: this option left; rows come cheapest first"),
    ):  # fmt: skip
        found, out, (line,) = hdc("compare", *words)
        assert (found, out) == (status, []), words
        assert message in line


def test_a_form_that_cannot_learn_the_frames_is_left_out_and_said(hdc, tmp_path):
    flat = frames_of(3, 12, noise=40).reshape(36, -1)
    np.savez(tmp_path / "flat.npz", frames=flat, labels=np.repeat(NAMES, 12))
    words = ("--readout", "majority", "--encoder", "smoothed")
    status, out, _ = hdc("compare", tmp_path / "flat.npz", *words)
    assert (status, "left out: smoothed, majority: " in "\n".join(out)) == (0, True)
