"""Every command end to end: what it writes is what the library computes.

What each prints is shown in docs/tutorial.md, whose sessions are run.
"""

import json

import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor
from hdc.command import splits
from hdc.encoders import Median
from hdc.readers import open_recording

SIDE = 24
PUBLISHED = ("--encoder", "median", "--readout", "majority")
NAMES = np.repeat([*"abc"], 12)


def whole(frames):
    return frames.reshape(-1, *frames.shape[2:])


def test_a_frame_is_encoded_once(hdc, folder, tmp_path, monkeypatch):
    """Whatever is asked of it, by however many folds and read-outs."""
    encoded, plain = [], Median.encode

    def encode(self, frames, *rest):
        encoded.append(len(frames))
        return plain(self, frames, *rest)

    monkeypatch.setattr(Median, "encode", encode)
    model, other = tmp_path / "m", tmp_path / "n"
    asked = ("--reject", 0.2, "--interval", 0.8)
    for words, n in (
        (("train", folder, "-o", model, "--test-fraction", 0.25, *PUBLISHED), 36),
        (("predict", model, folder / "a", *asked, "--proba"), 12),
        (("evaluate", model, folder, *asked), 36),
        (("recalibrate", model, folder, "-o", other), 36),
        # Once for all, and anew for the times of the two forms with this encoder.
        (("compare", folder, "--test", folder), 72 + 2 * 36),
    ):
        encoded.clear()
        assert hdc(*words)[0] == 0
        assert sum(encoded) == n, words


def test_frames_of_one_kind_tell_what_is_unlike_them(hdc, frames, write, tmp_path):
    one = write(tmp_path / "one", np.concatenate([frames[0]] * 3)[None], "a")
    other = write(tmp_path / "other", frames[1:2], "b")
    path = tmp_path / "m"
    words = ("train", one, "-o", path, "--test-fraction", 0.25)
    assert hdc(*words)[::2] == (0, [])
    for images, least, most in ((one, 0, 3), (other, 12, 12)):
        _, (_, *rows), (said,) = hdc("predict", path, "--reject", 0.1, images)
        n = sum("(none of these)" in row for row in rows)
        assert least <= n <= most
        assert said.startswith(
            f"refused {n} of {len(rows)} frames; expected at most 10 %"
        )
        assert "not calibrated for another session" in said


def test_any_parameter_of_a_part_is_set(hdc, folder, tmp_path):
    path = tmp_path / "m"
    words = ("train", folder, "-o", path, "--readout", "majority")
    sets = (
        "encoder__thresholds=3",
        "encoder__lit=0.5",
        "readout__class_weight=balanced",
    )
    assert hdc(*words, *(w for text in sets for w in ("--set", text)))[0] == 0
    model = HDCClassifier.load(path)
    assert (model.encoder_.thresholds, model.encoder_.lit) == (3, 0.5)
    assert model.readout_.class_weight == "balanced"


def test_a_model_is_that_of_all_frames(hdc, folder, frames, tmp_path):
    path = tmp_path / "m.safetensors"
    status, _, err = hdc("train", folder, "-o", path)
    assert (status, err) == (0, [])
    expected = HDCClassifier("levels", "lda").fit(whole(frames), NAMES)
    model = HDCClassifier.load(path)
    for name, tensor in expected.state_.tensors().items():
        assert (getattr(model.state_, name) == tensor).all()


@pytest.mark.parametrize(
    ("most", "words", "form"),
    [
        (36, (), "levels, lda"),
        (35, (), "median, majority"),
        (35, ("--encoder", "deviation"), "deviation, majority"),
        (36, ("--encoder", "median"), "median, lda"),
        (36, ("--readout", "majority"), "levels, majority"),
    ],
)
def test_majority_learns_more_frames_than_lda_can(
    hdc, folder, tmp_path, monkeypatch, most, words, form
):
    monkeypatch.setattr("hdc.readouts.discriminant.MOST_FRAMES", most)
    status, out, err = hdc("train", folder, "-o", tmp_path / "m", *words)
    assert (status, err) == (0, [])
    assert out[-1].startswith(f"form: {form};")
    said = f"majority in place of lda, which learns at most {most} frames of more than {most} bits"
    assert any(line.startswith(f"{said}, found 36 of ") for line in out) == (most == 35)


def test_held_out_frames_are_not_learnt(hdc, folder, frames, tmp_path):
    path = tmp_path / "m"
    words = ("train", folder, "-o", path, "--test-fraction", "0.25")
    hdc(*words, "--encoder", "reference", "--readout", "majority")
    (learnt, _), _ = splits.hold_out(open_recording(folder), 0.25)
    expected = HDCClassifier("reference").fit(whole(frames)[learnt], NAMES[learnt])
    found = HDCClassifier.load(path)
    assert (found.prototypes_ == expected.prototypes_).all()
    assert (found.encoder_.reference_ == expected.encoder_.reference_).all()


def test_crop_and_subsampling_go_with_the_model(hdc, folder, frames, write, tmp_path):
    path, new = tmp_path / "m", tmp_path / "new"
    window = ("--crop", 2, 4, 20, 16, "--subsample", 2)
    hdc("train", folder, "-o", path, *window, *PUBLISHED)
    model = HDCClassifier.load(path)
    kept = model.metadata_["crop"], model.metadata_["subsample"]
    assert (model.frame_shape_, *kept) == ((8, 10), [2, 4, 20, 16], 2)
    answer = json.loads(hdc("predict", path, folder / "b" / "3.png", "--json")[1][0])
    (distances,) = model.distances(frames[1, 3, 4:20:2, 2:22:2])
    assert answer["distances"] == dict(zip("abc", distances / 80, strict=True))
    assert hdc("recalibrate", path, folder, "-o", new, "--p", "0")[0] == 0
    assert HDCClassifier.load(new).metadata_ == model.metadata_
    assert " 36 of 36 frames" in hdc("evaluate", new, folder)[1][0]
    # Another part of a larger image was taken, without a word.
    wide = write(tmp_path / "wide", np.pad(frames, [(0, 0)] * 3 + [(2, 0)]))
    for command in ("evaluate", "predict"):
        (line,) = hdc(command, path, wide)[2]
        assert "images 24 px wide and 24 px high as in training, found 26 × 24" in line


def test_options_reach_the_answers_and_the_score(hdc, model, folder, frames):
    found, image = HDCClassifier.load(model), frames[1, 3:4]
    words = ("--json", "--interval", 0.8, "--reject", 0.5)
    shown = hdc("predict", model, folder / "b" / "3.png", "--proba", *words)
    answer = json.loads(shown[1][0])
    assert answer["set"] == found.predict_set(image, 0.2)[0].tolist()
    assert answer["probability"] == pytest.approx(found.predict_proba(image).max())
    assert (answer["label"] is not None) == found.is_known(image, 0.5)[0]
    result = json.loads(hdc("evaluate", model, folder, *words)[1][0])
    refused = (~found.is_known(whole(frames), 0.5)).sum()
    assert (result["accuracy"], result["refused"]) == (1, refused)
    assert result["coverage"]["asked"] == 0.8


# Recalibration -----------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["replace", "merge"])
def test_recalibration_is_that_of_the_classifier(
    hdc, model, frames, write, tmp_path, method
):
    changed = np.roll(frames, 5, axis=-1)
    new, path = write(tmp_path / "new", changed), tmp_path / "new.safetensors"
    before = model.read_bytes()
    words = ("recalibrate", model, new, "-o", path)
    err = hdc(*words, "--p", "0.7", "--method", method)[2]
    # Published recalibration lowered accuracies that lda raised.
    assert ["replacing bits, as published" in line for line in err] == [True][
        : method == "replace"
    ]
    expected = HDCClassifier.load(model)
    expected.recalibrate(whole(changed), NAMES, 0.7, method=method)
    assert (HDCClassifier.load(path).prototypes_ == expected.prototypes_).all()
    assert model.read_bytes() == before


def test_a_regressor_is_recalibrated_by_numbers(hdc, frames, tmp_path):
    depth = np.arange(12.0)
    for name, of in (("old", 0), ("new", 1)):
        np.savez(tmp_path / f"{name}.npz", frames=frames[of], values=depth)
    path, new = tmp_path / "m", tmp_path / "n"
    assert hdc("train", tmp_path / "old.npz", "-o", path)[0] == 0
    words = ("recalibrate", path, tmp_path / "new.npz", "-o", new)
    assert hdc(*words)[1:] == ([f"{new}: 12 new frames, values of value"], [])
    expected = HDCRegressor.load(path).recalibrate(frames[1], depth[:, None])
    found = HDCRegressor.load(new)
    assert np.array_equal(found.predict(frames[2]), expected.predict(frames[2]))


@pytest.mark.parametrize(
    ("readout", "words", "status", "said"),
    [
        ("counts", (), 0, "at least 12 of each"),
        ("lda", ("--p", 0.2), 0, "at least 12 of each"),
        ("ridge", ("--p", 0.2), 1, "which does not use it, found 0.2"),
        ("kernel", (), 1, "hdc train on the frames of both days"),
    ],
)
def test_a_readout_is_recalibrated_by_what_it_uses(
    hdc, folder, tmp_path, readout, words, status, said
):
    path = tmp_path / "m"
    assert hdc("train", folder, "-o", path, "--readout", readout)[0] == 0
    found = hdc("recalibrate", path, folder, "-o", tmp_path / "n", *words)
    assert found[0] == status
    assert (found[1] + found[2])[0].endswith(said)


def test_a_model_with_a_reference_is_zeroed_without_labels(
    hdc, model, folder, frames, tmp_path
):
    drift = np.random.default_rng(3).integers(0, 60, (SIDE, SIDE)).astype(np.uint8)
    path, new, today = tmp_path / "r", tmp_path / "n", tmp_path / "today.npz"
    assert hdc("train", folder, "-o", path, "--encoder", "reference")[0] == 0
    later = whole(frames + drift)
    expected = HDCClassifier.load(path).rezero(later).encoder_.reference_
    np.savez(today, frames=later)
    line = f"{new}: re-referenced by 36 new frames without labels"
    assert hdc("recalibrate", path, today, "-o", new) == (0, [line], [])
    assert (HDCClassifier.load(new).encoder_.reference_ == expected).all()
    (line,) = hdc("recalibrate", path, today, "-o", new, "--p", 0.2)[2]
    assert "expected no --p for numbers, or for frames without labels" in line
    (line,) = hdc("recalibrate", model, today, "-o", new)[2]
    assert "today.npz: expected labels, or a model with an encoder such as" in line


# Models ------------------------------------------------------------------------------------------


def test_models_made_in_python_are_taken_as_well(hdc, frames, write, tmp_path):
    """Of other labels than strings, and of flattened frames."""
    path = tmp_path / "m"
    labels = np.repeat([7, 10], 12)
    HDCClassifier().fit(frames[:2].reshape(24, -1), labels).save(path)
    folder = write(tmp_path / "f", frames[:2], ["7", "10"])
    assert "24 of 24" in hdc("evaluate", path, folder)[1][0]
    out = hdc("predict", path, folder / "10" / "1.png", "--json")[1]
    assert json.loads(out[0])["label"] == 10
    assert json.loads("".join(hdc("info", path)[1]))["classes"] == {"7": 12, "10": 12}


def test_a_class_of_ones_own_is_imported_where_the_command_line_names_it(
    hdc, folder, frames, tmp_path
):
    path = tmp_path / "m"
    model = HDCClassifier(readout="tests.hdc.own.Nearest")
    model.fit(whole(frames), NAMES).save(path)
    trust = ("--trusted", "tests.hdc.own.Nearest")
    status, _, (line,) = hdc("evaluate", path, folder)
    assert (status, " ".join(trust) in line) == (1, True)
    assert hdc("evaluate", path, folder, *trust)[0] == 0


def test_info_shows_what_a_model_was_trained_on(hdc, folder, tmp_path):
    path = tmp_path / "m"
    words = ("--crop", 0, 0, 24, 12, "--encoder", "levels", "--readout", "lda")
    hdc("train", folder, "-o", path, *words)
    text = "".join(hdc("info", path)[1])
    assert text.isascii()  # a terminal without × got no JSON
    assert "`" not in text
    found, model = json.loads(text), HDCClassifier.load(path)
    assert (found["encoder"], found["crop"]) == (repr(model.encoder_), [0, 0, 24, 12])
    assert found["classes"] == {"a": 12, "b": 12, "c": 12}
    assert found["bytes to predict"] == model.prediction_bytes_
    assert found["bytes of the file"] == path.stat().st_size
