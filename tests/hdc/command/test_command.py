"""Every command end to end: what it writes is what the library computes.

What each prints is shown in docs/tutorial.md, whose sessions are run.
"""

import json
from pathlib import Path

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


def test_a_frame_is_encoded_once(hdc, folder, monkeypatch):
    """Whatever is asked of it."""
    encoded, plain = [], Median.encode

    def encode(self, frames, *rest):
        encoded.append(len(frames))
        return plain(self, frames, *rest)

    monkeypatch.setattr(Median, "encode", encode)
    asked = ("--reject", 0.2, "--interval", 0.8)
    for words, n in (
        (("train", folder, "-o", "m", "--test-fraction", 0.25, *PUBLISHED), 36),
        (("predict", "m", folder / "a", *asked, "--proba"), 12),
        (("evaluate", "m", folder, *asked), 36),
        (("recalibrate", "m", folder, "-o", "n"), 36),
    ):
        encoded.clear()
        assert hdc(*words)[0] == 0
        assert sum(encoded) == n, words


def test_frames_of_one_kind_tell_what_is_unlike_them(hdc, frames, write):
    one = write("one", np.concatenate([frames[0]] * 3)[None], "a")
    other = write("other", frames[1:2], "b")
    words = ("train", one, "-o", "m", "--test-fraction", 0.25)
    assert hdc(*words)[::2] == (0, [])
    for images, least, most in ((one, 0, 3), (other, 12, 12)):
        _, (_, *rows), (said,) = hdc("predict", "m", "--reject", 0.1, images)
        n = sum("(none of these)" in row for row in rows)
        assert least <= n <= most
        assert said.startswith(
            f"refused {n} of {len(rows)} frames; expected at most 10 %"
        )
        assert "not calibrated for another session" in said


def test_any_parameter_of_a_part_is_set(hdc, folder):
    sets = (
        "--readout majority --set encoder__thresholds=3 --set encoder__lit=0.5 "
        "--set readout__class_weight=balanced"
    )
    assert hdc("train", folder, "-o", "m", *sets.split())[0] == 0
    model = HDCClassifier.load("m")
    assert (model.encoder_.thresholds, model.encoder_.lit) == (3, 0.5)
    assert model.readout_.class_weight == "balanced"


def test_a_model_is_that_of_all_frames(hdc, folder, frames):
    status, _, err = hdc("train", folder, "-o", "m")
    assert (status, err) == (0, [])
    expected = HDCClassifier("levels", "lda").fit(whole(frames), NAMES)
    model = HDCClassifier.load("m")
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
    hdc, folder, monkeypatch, most, words, form
):
    monkeypatch.setattr("hdc.readouts.discriminant.MOST_FRAMES", most)
    status, out, err = hdc("train", folder, "-o", "m", *words)
    assert (status, err) == (0, [])
    assert out[-1].startswith(f"form: {form};")
    said = f"majority in place of lda, which learns at most {most} frames of more than {most} bits"
    assert any(line.startswith(f"{said}, found 36 of ") for line in out) == (most == 35)


def test_held_out_frames_are_not_learnt(hdc, folder, frames):
    words = ("train", folder, "-o", "m", "--test-fraction", "0.25")
    hdc(*words, "--encoder", "reference", "--readout", "majority")
    (learnt, _), _ = splits.hold_out(open_recording(folder), 0.25)
    expected = HDCClassifier("reference").fit(whole(frames)[learnt], NAMES[learnt])
    found = HDCClassifier.load("m")
    assert (found.prototypes_ == expected.prototypes_).all()
    assert (found.encoder_.reference_ == expected.encoder_.reference_).all()


def test_crop_and_subsampling_go_with_the_model(hdc, folder, frames, write):
    window = ("--crop", 2, 4, 20, 16, "--subsample", 2)
    hdc("train", folder, "-o", "m", *window, *PUBLISHED)
    model = HDCClassifier.load("m")
    kept = model.metadata_["crop"], model.metadata_["subsample"]
    assert (model.frame_shape_, *kept) == ((8, 10), [2, 4, 20, 16], 2)
    answer = json.loads(hdc("predict", "m", folder / "b" / "3.png", "--json")[1][0])
    (distances,) = model.distances(frames[1, 3, 4:20:2, 2:22:2])
    assert answer["distances"] == dict(zip("abc", distances / 80, strict=True))
    assert hdc("recalibrate", "m", folder, "-o", "new", "--p", "0")[0] == 0
    assert HDCClassifier.load("new").metadata_ == model.metadata_
    assert " 36 of 36 frames" in hdc("evaluate", "new", folder)[1][0]
    # Another part of a larger image was taken, without a word.
    wide = write("wide", np.pad(frames, [(0, 0)] * 3 + [(2, 0)]))
    for command in ("evaluate", "predict"):
        (line,) = hdc(command, "m", wide)[2]
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
def test_recalibration_is_that_of_the_classifier(hdc, model, frames, write, method):
    changed = np.roll(frames, 5, axis=-1)
    new, path = write("new", changed), "new.safetensors"
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


def test_a_regressor_is_recalibrated_by_numbers(hdc, frames):
    depth = np.arange(12.0)
    for name, of in (("old", 0), ("new", 1)):
        np.savez(f"{name}.npz", frames=frames[of], values=depth)
    assert hdc("train", "old.npz", "-o", "m")[0] == 0
    words = ("recalibrate", "m", "new.npz", "-o", "n")
    assert hdc(*words)[1:] == (["n: 12 new frames, values of value"], [])
    expected = HDCRegressor.load("m").recalibrate(frames[1], depth[:, None])
    found = HDCRegressor.load("n")
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
    hdc, folder, readout, words, status, said
):
    assert hdc("train", folder, "-o", "m", "--readout", readout)[0] == 0
    found = hdc("recalibrate", "m", folder, "-o", "n", *words)
    assert found[0] == status
    assert (found[1] + found[2])[0].endswith(said)


def test_a_model_with_a_reference_is_zeroed_without_labels(hdc, model, folder, frames):
    drift = np.random.default_rng(3).integers(0, 60, (SIDE, SIDE)).astype(np.uint8)
    assert hdc("train", folder, "-o", "r", "--encoder", "reference")[0] == 0
    later = whole(frames + drift)
    expected = HDCClassifier.load("r").rezero(later).encoder_.reference_
    np.savez("today.npz", frames=later)
    line = "n: re-referenced by 36 new frames without labels"
    assert hdc("recalibrate", "r", "today.npz", "-o", "n") == (0, [line], [])
    assert (HDCClassifier.load("n").encoder_.reference_ == expected).all()
    (line,) = hdc("recalibrate", "r", "today.npz", "-o", "n", "--p", 0.2)[2]
    assert "expected no --p for numbers, or for frames without labels" in line
    (line,) = hdc("recalibrate", model, "today.npz", "-o", "n")[2]
    assert "today.npz: expected labels, or a model with an encoder such as" in line


# Models ------------------------------------------------------------------------------------------


def test_models_made_in_python_are_taken_as_well(hdc, frames, write):
    """Of other labels than strings, and of flattened frames."""
    labels = np.repeat([7, 10], 12)
    HDCClassifier().fit(frames[:2].reshape(24, -1), labels).save("m")
    write("f", frames[:2], ["7", "10"])
    assert "24 of 24" in hdc("evaluate", "m", "f")[1][0]
    out = hdc("predict", "m", "f/10/1.png", "--json")[1]
    assert json.loads(out[0])["label"] == 10
    assert json.loads("".join(hdc("info", "m")[1]))["classes"] == {"7": 12, "10": 12}


def test_a_class_of_ones_own_is_imported_where_the_command_line_names_it(
    hdc, folder, frames
):
    model = HDCClassifier(readout="tests.hdc.own.Nearest")
    model.fit(whole(frames), NAMES).save("m")
    trust = ("--trusted", "tests.hdc.own.Nearest")
    status, _, (line,) = hdc("evaluate", "m", folder)
    assert (status, " ".join(trust) in line) == (1, True)
    assert hdc("evaluate", "m", folder, *trust)[0] == 0


def test_info_shows_what_a_model_was_trained_on(hdc, folder):
    path = Path("m")
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
