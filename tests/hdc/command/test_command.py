"""Every command end to end, and what can be wrong with what it is given: one line each."""

import json
import os
import re
import subprocess
import sys
import warnings

import cv2
import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor, command
from hdc.command import splits
from hdc.readers import open_recording

SIDE = 24


@pytest.fixture
def frames():
    """uint8 [3, 12, 24, 24]: twelve noisy frames of each of three patterns."""
    rng = np.random.default_rng(0)
    base = rng.integers(0, 150, (3, 1, SIDE, SIDE))
    return (base + rng.integers(0, 90, (3, 12, SIDE, SIDE))).astype(np.uint8)


def write(root, frames, classes="abc"):
    for name, images in zip(classes, frames, strict=True):
        (root / name).mkdir(parents=True, exist_ok=True)
        for i, image in enumerate(images):
            assert cv2.imwrite(str(root / name / f"{i}.png"), image)
    return root


@pytest.fixture
def folder(tmp_path, frames):
    return write(tmp_path / "my frames [1]", frames)


@pytest.fixture
def model(hdc, folder, tmp_path):
    path = tmp_path / "m.safetensors"
    assert hdc("train", folder, "-o", path)[0] == 0
    return path


def contents(root):
    return {str(p): p.read_bytes() for p in root.rglob("*") if p.is_file()}


# What they do ------------------------------------------------------------------------------------


def test_frames_of_one_kind_tell_what_is_unlike_them(hdc, frames, tmp_path):
    one = write(tmp_path / "one", np.concatenate([frames[0]] * 2)[None], "a")
    other = write(tmp_path / "other", frames[1:2], "b")
    path = tmp_path / "m.safetensors"
    status, out, err = hdc("train", one, "-o", path)
    assert (status, err) == (0, [])
    assert "one class: hdc predict --reject tells what is unlike it" in out
    words = ("predict", path, "--reject", 0.1)
    labels = [
        {line.split("\t")[1] for line in hdc(*words, folder)[1][1:]}
        for folder in (one, other)
    ]
    assert labels == [{"a"}, {"(none of these)"}]


def test_any_parameter_of_a_part_is_set(hdc, folder, frames, tmp_path):
    path = tmp_path / "m.safetensors"
    words = ("train", folder, "-o", path, "--encoder", "levels")
    sets = ("--set", "encoder__thresholds=3", "--set", "encoder__ties=raster")
    assert hdc(*words, *sets)[0] == 0
    encoder = HDCClassifier.load(path).encoder_
    assert (encoder.thresholds, encoder.ties) == (3, "raster")
    for text, said in (
        ("encoder__thresholds=0", "thresholds: expected an integer from 1 to 255, found 0"),
        ("encoder__threshold=3", "found 'encoder__threshold'. Did you mean 'encoder__thresh"),
    ):  # fmt: skip
        status, _, (line,) = hdc(*words, "--set", text)
        assert status == 1
        assert said in line


def test_a_model_is_that_of_all_frames(hdc, folder, frames, tmp_path):
    before = contents(tmp_path)
    path = tmp_path / "m.safetensors"
    status, out, err = hdc("train", folder, "-o", path)
    assert (status, err) == (0, [])
    assert out[0] == f"{path}: 36 frames, 3 classes, 24 × 24 pixels"
    model = HDCClassifier.load(path)
    whole = HDCClassifier().fit(
        frames.reshape(-1, SIDE, SIDE), np.repeat(list("abc"), 12)
    )
    assert model.classes_.tolist() == ["a", "b", "c"]
    assert (model.prototypes_ == whole.prototypes_).all()
    assert model.counts_.tolist() == [12, 12, 12]
    assert (model.metadata_["crop"], model.metadata_["subsample"]) == (None, 1)
    after = contents(tmp_path)
    assert after.pop(str(path))
    assert after == before


@pytest.mark.parametrize("readout", ["majority", "neighbours"])
def test_arrays_of_several_batches_are_learnt_as_a_whole(hdc, tmp_path, readout):
    frames = np.random.default_rng(0).integers(0, 255, (700, 8, 9), np.uint8)
    labels = np.array(list("abc"))[np.arange(700) % 3]
    np.savez(tmp_path / "x.npz", frames=frames, labels=labels)
    words = ("-o", tmp_path / "n.safetensors", "--readout", readout)
    assert hdc("train", tmp_path / "x.npz", *words)[0] == 0
    whole = HDCClassifier(readout=readout).fit(frames, labels)
    found = HDCClassifier.load(tmp_path / "n.safetensors")
    assert (found.predict(frames[::7]) == whole.predict(frames[::7])).all()


def test_held_out_frames_are_not_learnt(hdc, folder, tmp_path):
    path = tmp_path / "m.safetensors"
    words = ("train", folder, "-o", path, "--test-fraction", "0.25")
    status, out, _ = hdc(*words)
    assert status == 0
    assert out[1:] == [
        "classes: a (9), b (9), c (9)",
        "sessions: none known",
        "held out at random: accuracy 100.0% (95 % interval 70.1% to 100.0%), 9 of 9 frames",
        "a guess of a, the largest class: accuracy 33.3%",
        "--choose would try, besides median, majority: median, neighbours; levels, lda; "
        "deviation, lda; reference_levels, lda; levels, kernel",
        "held out at random because no sessions are known ({session} in a template, or a column "
        "session); frames recorded together are nearly alike",
    ]
    first = HDCClassifier.load(path)
    assert first.counts_.tolist() == [9, 9, 9]
    hdc(*words)
    assert (HDCClassifier.load(path).prototypes_ == first.prototypes_).all()
    named = hdc(*words, "--encoder", "levels")[1]
    assert not [line for line in named if line.startswith("--choose")]


def test_crop_and_subsampling_go_with_the_model(hdc, folder, frames, tmp_path):
    path = tmp_path / "m.safetensors"
    hdc("train", folder, "-o", path, "--crop", 2, 4, 20, 16, "--subsample", 2)
    model = HDCClassifier.load(path)
    assert model.frame_shape_ == (8, 10)
    assert (model.metadata_["crop"], model.metadata_["subsample"]) == (
        [2, 4, 20, 16],
        2,
    )
    status, out, _ = hdc("predict", path, folder / "b" / "3.png", "--json")
    answer = json.loads(out[0])
    seen = frames[1, 3, 4:20:2, 2:22:2]
    (distances,) = model.distances(seen)
    assert answer["distances"] == dict(zip("abc", distances / 80, strict=True))
    new = tmp_path / "new.safetensors"
    assert hdc("recalibrate", path, folder, "-o", new, "--p", "0")[0] == 0
    assert HDCClassifier.load(new).metadata_ == model.metadata_
    assert (status, hdc("evaluate", new, folder)[1][0].split(",")[1]) == (
        0,
        " 36 of 36 frames",
    )


def test_a_crop_is_of_images_of_the_size_of_training(hdc, folder, frames, tmp_path):
    """Another part of a larger image was taken, without a word."""
    path = tmp_path / "m.safetensors"
    assert hdc("train", folder, "-o", path, "--crop", 2, 4, 16, 16)[0] == 0
    assert hdc("evaluate", path, folder)[0] == 0
    larger = np.pad(frames, [(0, 0)] * 3 + [(2, 0)])
    wide = write(tmp_path / "wide", larger)
    np.savez(tmp_path / "wide.npz", frames=larger[0])
    for words in (("evaluate", wide), ("predict", wide), ("predict", f"{wide}.npz")):
        status, _, (line,) = hdc(words[0], path, words[1])
        assert status == 1
        wanted = "images 24 px wide and 24 px high as in training, found 26 × 24"
        assert f"crop: expected {wanted}" in line


def test_options_reach_the_answers_and_the_score(hdc, model, folder, frames, tmp_path):
    found, image = HDCClassifier.load(model), frames[1, 3:4]
    words = ("--json", "--interval", 0.8, "--reject", 0.5)
    shown = hdc("predict", model, folder / "b" / "3.png", "--proba", *words)
    answer = json.loads(shown[1][0])
    assert answer["set"] == found.predict_set(image, 0.2)[0].tolist()
    assert answer["probability"] == pytest.approx(found.predict_proba(image).max())
    assert (answer["label"] is not None) == found.is_known(image, 0.5)[0]
    (folder / "a" / "0.png").rename(folder / "c" / "wrong.png")
    result = json.loads(hdc("evaluate", model, folder, *words)[1][0])
    known = found.is_known(frames.reshape(-1, SIDE, SIDE), 0.5)
    assert (result["accuracy"], result["refused"]) == (35 / 36, (~known).sum())
    assert result["coverage"]["asked"] == 0.8
    assert hdc("evaluate", model, folder)[1][-1].split() == ["c", "1", "0", "12"]
    only = write(tmp_path / "only", frames[1:2], "b")
    assert hdc("evaluate", model, only)[1][0].endswith("12 of 12 frames")
    HDCRegressor().fit(frames[0], np.arange(12.0)).save(tmp_path / "n")
    line = "error: --proba: expected a model of classes, found HDCRegressor"
    assert hdc("predict", tmp_path / "n", folder, "--proba")[::2] == (1, [line])


@pytest.mark.parametrize("method", ["replace", "merge"])
def test_recalibration_is_that_of_the_classifier(hdc, model, frames, tmp_path, method):
    changed = np.roll(frames, 5, axis=-1)
    new, path = write(tmp_path / "new", changed), tmp_path / "new.safetensors"
    before = model.read_bytes()
    words = (
        "recalibrate",
        model,
        new,
        "-o",
        path,
        "--p",
        "0.7",
        "--method",
        method,
        "--seed",
        3,
    )
    status, out, err = hdc(*words)
    assert (status, err) == (0, [])
    assert out == [
        f"{path}: 36 new frames of 3 classes, at least 12 of each, {method}, p = 0.7"
    ]
    some = write(tmp_path / "some", changed[:1, :1], "a")
    (line,) = hdc("recalibrate", model, some, "-o", tmp_path / "some.safetensors")[2]
    assert line.startswith("warning: recalibrate: no new frames of 'b', 'c'; ")
    expected = HDCClassifier.load(model).recalibrate(
        changed.reshape(-1, SIDE, SIDE), np.repeat(list("abc"), 12), 0.7, 3, method
    )
    assert (HDCClassifier.load(path).prototypes_ == expected.prototypes_).all()
    assert model.read_bytes() == before


def test_a_regressor_is_recalibrated_by_numbers(hdc, frames, tmp_path):
    depth = np.arange(12.0)
    np.savez(tmp_path / "old.npz", frames=frames[0], values=depth)
    np.savez(tmp_path / "new.npz", frames=frames[1], values=depth)
    path, new = tmp_path / "m.safetensors", tmp_path / "n.safetensors"
    assert hdc("train", tmp_path / "old.npz", "-o", path)[0] == 0
    words = ("recalibrate", path, tmp_path / "new.npz", "-o", new)
    assert hdc(*words)[1:] == ([f"{new}: 12 new frames, values of value"], [])
    expected = HDCRegressor.load(path).recalibrate(frames[1], depth[:, None])
    found = HDCRegressor.load(new)
    assert np.array_equal(found.predict(frames[2]), expected.predict(frames[2]))
    assert hdc(*words, "--p", 0.2)[::2] == (2, ["error: expected no --p for numbers"])


@pytest.mark.parametrize(
    ("readout", "words", "status", "said"),
    [
        ("counts", (), 0, "at least 12 of each, merge, p = 0.5"),
        ("lda", ("--p", 0.2), 0, "at least 12 of each, p = 0.2"),
        ("ridge", (), 0, "36 new frames of 3 classes, at least 12 of each"),
        ("ridge", ("--p", 0.2), 2, "error: expected no --p for the read-out Ridge"),
        ("lda", ("--seed", 1), 2, "error: expected no --seed for the read-out LDA"),
        ("trained", (), 1, "hdc train on the new frames"),
    ],
)
def test_a_readout_is_recalibrated_by_what_it_uses(
    hdc, folder, tmp_path, readout, words, status, said
):
    path = tmp_path / "m.safetensors"
    assert hdc("train", folder, "-o", path, "--readout", readout)[0] == 0
    found = hdc("recalibrate", path, folder, "-o", tmp_path / "n", *words)
    assert found[0] == status
    assert (found[1] + found[2])[0].endswith(said)


def test_models_made_in_python_are_taken_as_well(hdc, frames, tmp_path):
    """Of other labels than strings, of flattened frames, and without a crop."""
    flat = frames[:2].reshape(24, -1)
    path = tmp_path / "m.safetensors"
    HDCClassifier().fit(flat, np.repeat([7, 10], 12)).save(path)
    folder = write(tmp_path / "f", frames[:2], ["7", "10"])
    assert "24 of 24" in hdc("evaluate", path, folder)[1][0]
    assert (
        json.loads(hdc("predict", path, folder / "10" / "1.png", "--json")[1][0])[
            "label"
        ]
        == 10
    )
    assert hdc("recalibrate", path, folder, "-o", tmp_path / "n.safetensors")[0] == 0
    found = json.loads("".join(hdc("info", path)[1]))
    assert (found["frames"], found["classes"]) == (
        f"{SIDE**2} pixels",
        {"7": 12, "10": 12},
    )


def test_a_class_of_ones_own_is_imported_where_the_command_line_names_it(
    hdc, folder, frames, tmp_path
):
    path = tmp_path / "m.safetensors"
    labels = np.repeat([*"abc"], 12)
    images = frames.reshape(-1, SIDE, SIDE)
    HDCClassifier(readout="tests.hdc.own.Nearest").fit(images, labels).save(path)
    status, _, (line,) = hdc("evaluate", path, folder)
    assert status == 1
    assert "--trusted tests.hdc.own.Nearest" in line
    words = ("evaluate", path, folder, "--trusted", "tests.hdc.own.Nearest")
    assert hdc(*words)[0] == 0


def test_an_encoder_that_learns_sees_no_frame_that_is_held_out(
    hdc, folder, frames, tmp_path
):
    path = tmp_path / "m.safetensors"
    words = ("--encoder", "reference", "--test-fraction", 0.25)
    assert hdc("train", folder, "-o", path, *words)[0] == 0
    labels = np.repeat([0, 1, 2], 12)
    (train, held_out), _ = splits.hold_out(open_recording(folder), 0.25)
    assert len(held_out) == 9
    images = frames.reshape(-1, SIDE, SIDE)
    expected = HDCClassifier("reference").fit(images[train], labels[train])
    found = HDCClassifier.load(path)
    assert (found.encoder_.reference_ == expected.encoder_.reference_).all()
    assert (found.prototypes_ == expected.prototypes_).all()


def test_info_shows_what_a_model_was_trained_on(hdc, folder, tmp_path):
    path = tmp_path / "m.safetensors"
    hdc("train", folder, "-o", path, "--crop", 0, 0, 24, 12)
    status, out, _ = hdc("info", path)
    assert status == 0
    assert "".join(out).isascii()  # a terminal without × got no JSON
    found = json.loads("".join(out))
    assert found["crop"] == [0, 0, 24, 12]
    assert found["trained"].startswith("20")
    assert found["frames"] == "24 × 12 pixels"
    assert found["classes"] == {"a": 12, "b": 12, "c": 12}
    assert found["kind"] == "HDCClassifier"
    assert found["encoder"] == "Median(ties='spread')"
    assert (
        found["readout"] == "Majority(ties='zero', class_weight=None, random_state=0)"
    )
    assert found["encoder in words"].endswith(".")
    assert "`" not in "".join(out)
    assert found["bits per pixel and class"] == pytest.approx(1, abs=0.2)
    assert found["bytes of the file"] == path.stat().st_size
    share = 8 * found["bytes to predict"] / (24 * 12) / 3
    assert round(share, 2) == found["bits per pixel and class"]
    words = ("--encoder", "levels", "--readout", "lda")
    hdc("train", folder, "-o", path, *words)
    found = json.loads("".join(hdc("info", path)[1]))
    assert "quantiles" in found["encoder in words"]
    assert found["readout in words"].startswith("Shrinkage discriminant analysis")
    # Seven bits per pixel, four planes of weights, besides what the last word and scales need.
    assert 28 <= found["bits per pixel and class"] < 29


def test_a_model_with_a_reference_is_zeroed_without_labels(hdc, frames, tmp_path):
    rng = np.random.default_rng(3)
    drift = rng.integers(0, 60, (SIDE, SIDE)).astype(np.uint8)
    old = write(tmp_path / "old", frames)
    path, new = tmp_path / "m.safetensors", tmp_path / "n.safetensors"
    assert hdc("train", old, "-o", path, "--encoder", "reference")[0] == 0
    (tmp_path / "today").mkdir()
    later = (frames + drift).reshape(-1, SIDE, SIDE)
    for k, frame in enumerate(later):
        assert cv2.imwrite(str(tmp_path / "today" / f"{k:02}.png"), frame)
    status, out, err = hdc("recalibrate", path, tmp_path / "today", "-o", new)
    assert (status, err) == (0, [])
    assert out == [f"{new}: re-referenced by 36 new frames without labels"]
    expected = HDCClassifier.load(path).rezero(later)
    found = HDCClassifier.load(new)
    assert (found.encoder_.reference_ == expected.encoder_.reference_).all()
    before = HDCClassifier.load(path).encoder_.reference_
    assert (found.encoder_.reference_ != before).any()
    assert (found.prototypes_ == HDCClassifier.load(path).prototypes_).all()
    for beside in ({}, {"values": np.arange(36.0)}):
        np.savez(tmp_path / "today.npz", frames=later, **beside)
        assert hdc("recalibrate", path, tmp_path / "today.npz", "-o", new)[0] == 0
        again = HDCClassifier.load(new).encoder_.reference_
        assert (again == expected.encoder_.reference_).all()
    words = ("recalibrate", path, tmp_path / "today", "-o", new)
    assert hdc(*words, "--p", 0.3)[2] == [
        "error: expected no --p for frames without labels"
    ]
    plain = tmp_path / "plain.safetensors"
    hdc("train", old, "-o", plain)
    status, _, (line,) = hdc("recalibrate", plain, tmp_path / "today", "-o", new)
    assert status == 1
    assert line.endswith("today: expected labels, or a model with an encoder such as reference, "
                         "which adapts without")  # fmt: skip


# What can be wrong -------------------------------------------------------------------------------


def test_what_is_read_is_named_in_one_line(hdc, model, folder, frames, tmp_path):
    out = tmp_path / "out.safetensors"
    (tmp_path / "empty").mkdir()
    before = contents(tmp_path)
    for words, message in [
        (("train", tmp_path / "no", "-o", out), f"found nothing: {tmp_path}/no"),
        (
            ("train", folder / "a", "-o", out),
            f"{folder}/a holds ",
        ),
        (("train", folder, "-o", folder), f"{folder}: expected a regular file or"),
        (
            ("train", folder, "-o", tmp_path / "no" / "m"),
            "expected a folder to save m in",
        ),
        (("predict", tmp_path / "no", "x.png"), f"{tmp_path}/no"),
        (("predict", folder / "a" / "0.png", model), f"{folder}/a/0.png: expected"),
        (("evaluate", folder, model), "found a folder (the MODEL comes first)"),
        (
            ("predict", model, "no\n.png"),
            "no .png: expected a readable file, found none",
        ),
        (
            ("predict", model, tmp_path / "empty"),
            f"{tmp_path}/empty: expected images (.png",
        ),
    ]:
        status, shown, (line,) = hdc(*words)
        assert (status, shown) == (1, [])
        assert line.startswith("error: ")
        assert message in line
    assert contents(tmp_path) == before


def test_bad_frames_are_named_in_one_line(hdc, model, folder, frames, tmp_path):
    out = tmp_path / "out.safetensors"

    def error(*words):
        status, _, (line,) = hdc(*words)
        assert status == 1
        assert not out.exists()
        return line.removeprefix("error: ")

    one = write(tmp_path / "one", frames[:1], "a")
    found = f"{one}: expected two classes or more, found only 'a'"
    assert error("train", one, "-o", out, "--choose") == found
    other = write(tmp_path / "other", frames[:1], "x")
    for words in (("evaluate", model, other), ("recalibrate", model, other, "-o", out)):
        assert error(*words) == (
            f"{other}: expected classes among a, b, c, found 'x' (to add a class: hdc train on all "
            "of them, or partial_fit in Python)"
        )
    wide = write(tmp_path / "wide", np.pad(frames, [(0, 0)] * 3 + [(0, 2)]))
    assert error("evaluate", model, wide) == (
        f"{wide}/a/0.png: expected 24 × 24 pixels as in training, found 26 × 24 pixels"
    )
    assert error("train", wide, "-o", out, "--crop", 20, 0, 20, 20).startswith(
        f"{wide}/a/0.png: crop: expected a window inside frames 26 px wide and 24 px high"
    )
    broken = folder / "a" / "7.png"
    broken.write_bytes(broken.read_bytes()[:-20])
    assert error("train", folder, "-o", out).startswith(
        f"{broken}: expected a whole image"
    )
    (one / "b").mkdir()
    (folder / "c" / "1.png").rename(one / "b" / "1.png")
    assert error("train", one, "-o", out, "--test-fraction", "0.5") == (
        "--test-fraction: expected two frames or more of each class, found one"
    )


def test_a_wrong_command_line_is_one_line_and_2(hdc, folder):
    for words, said in [
        (["trian"], "Did you mean 'train'?"),
        (["train", folder], "Missing option '-o'"),
        (
            ["train", folder, "-o", "m", "--subsample", 0],
            "'--subsample': 0 is not in the range",
        ),
        (
            ["train", folder, "-o", "m", "--test-fraction", 1],
            "'--test-fraction': 1.0 is not in",
        ),
        (["predict", "m"], "Missing argument 'IMAGES...'"),
        (["train", folder, "-o", "-"], "expected the name of a file, found -"),
        (
            ["train", folder, "-o", "m", "--choose", "--set", "encoder__ties=below"],
            "expected --choose, or --encoder, --readout and --set",
        ),
        (
            ["train", folder, "-o", "m", "--set", "thresholds=15"],
            "expected PART__NAME=VALUE such as encoder__thresholds=15, found thresholds=15",
        ),
        (
            ["predict", "m", "x", "--reject", "0.9"],
            "'--reject': 0.9 is not in the range",
        ),
        (
            ["recalibrate", "m", folder, "-o", "n", "--method", "add"],
            "'replace', 'merge'",
        ),
    ]:
        status, out, (line,) = hdc(*words)
        assert (status, out) == (2, [])
        assert line.startswith("error: ")
        assert said in line
    assert hdc()[0] == 2
    for words in ([], ["train"], ["predict"], ["evaluate"], ["recalibrate"], ["info"]):
        status, out, err = hdc(*words, "--help")
        assert (status, err) == (0, [])
        assert out[0].startswith("Usage: hdc")


@pytest.mark.parametrize(
    ("name", "words", "extra"),
    [
        ("click", ["--help"], "command"),
        ("nicegui", ["live", "--folder", "FOLDER"], "live"),
        ("fastapi", ["live", "--folder", "FOLDER"], "live"),
        ("sklearn", ["compare", "FOLDER"], "compare"),
        ("av", ["train", "film.mp4", "-o", "m"], "files"),
        ("h5py", ["train", "stack.h5", "-o", "m"], "files"),
        ("tifffile", ["train", "stack.tif", "-o", "m"], "readers"),
        ("pyarrow", ["train", "rows.parquet", "-o", "m"], "files"),
        ("scipy", ["train", "cube.mat", "-o", "m"], "files"),
    ],
)
def test_a_missing_package_names_its_extra(folder, tmp_path, name, words, extra):
    code = f"import sys; sys.modules[{name!r}] = None\nfrom hdc.command import main; main()"
    for file in ("film.mp4", "stack.h5", "stack.tif", "rows.parquet", "cube.mat"):
        (tmp_path / file).write_bytes(b"x")
    words = [str(folder) if word == "FOLDER" else word for word in words]
    command = [sys.executable, "-c", code, *words]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.splitlines() == [
        f"error: expected the package {name}, found none; pip install 'speckle-hdc[{extra}]'"
    ]


def test_only_models_are_replaced(hdc, model, folder, tmp_path):
    """cracks: an image of the recording, a device, a pipe and a link were replaced."""
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "link").symlink_to(model)
    os.mkfifo(tmp_path / "pipe")
    before = {p: p.lstat() for p in tmp_path.rglob("*")}
    for name in (folder / "a" / "0.png", "notes.txt", "link", "pipe", "/dev/null"):
        for words in (["train", folder], ["recalibrate", model, folder]):
            status, out, (line,) = hdc(*words, "-o", tmp_path / name)
            assert (status, out) == (1, [])
            assert re.search(r"expected .* or (no file|none), found", line)
    assert {p: p.lstat().st_mtime_ns for p in tmp_path.rglob("*")} == {
        p: status.st_mtime_ns for p, status in before.items()
    }
    assert hdc("train", folder, "-o", model)[0] == 0


def test_help_does_without_torch():
    code = (
        "import sys; from hdc.command import main\n"
        "try: main(['train', '--help'])\n"
        "except SystemExit: print('torch' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "False"


def test_a_memory_that_is_too_small_is_one_line(capsys, monkeypatch):
    def fill(_):
        raise MemoryError("Unable to allocate 9 GiB")

    monkeypatch.setattr(command, "_run", fill)
    with pytest.raises(SystemExit) as ended:
        command.main([])
    assert ended.value.code == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(
        "error: expected more memory, found: Unable to allocate 9 GiB"
    )


def test_no_code_of_a_name_reaches_the_terminal(hdc, tmp_path):
    status, _, (line,) = hdc("train", tmp_path / "a\x1b[31m\u202eb", "-o", "m")
    assert (status, line.isprintable()) == (1, True)
    assert r"a\x1b[31m\u202eb" in line


def test_a_warning_is_said_once_whatever_its_share(capsys, monkeypatch):
    """A comparison trains the same model fold after fold, and each has its share of ties."""

    def warn(_):
        for share in (80, 81, 45):
            warnings.warn(f"{share}% of the pixels are tied", stacklevel=2)
        for day in (1, 2):
            warnings.warn(f"left out day{day}/notes.txt", stacklevel=2)
        return 0

    monkeypatch.setattr(command, "_run", warn)
    with pytest.raises(SystemExit):
        command.main([])
    assert capsys.readouterr().err.splitlines() == [
        "warning: 80% of the pixels are tied",
        "warning: left out day1/notes.txt",
        "warning: left out day2/notes.txt",
    ]
