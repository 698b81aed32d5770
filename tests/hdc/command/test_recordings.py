"""Recordings of every kind through the command: sessions, vectors, values, and odd names."""

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor, io
from hdc.command.source import Source
from hdc.command.work import frames_for, load
from hdc.readers import Window

RNG = np.random.default_rng(0)
BASE = RNG.integers(0, 150, (3, 16, 18))


def image(c, shift=0):
    """A noisy frame of class c."""
    noise = RNG.integers(0, 60, BASE[c].shape)
    return np.roll((BASE[c] + noise).astype(np.uint8), shift, axis=1)


# What the commands share -------------------------------------------------------------------------


def test_a_recording_is_opened_as_a_model_was_trained(tmp_path):
    """A table of other columns of numbers has the model's values, unless others are named."""
    frames = np.random.default_rng(1).integers(0, 256, (3, 20))
    model = HDCRegressor().fit(frames, np.arange(3.0))
    model.metadata_ = {"values": ["20"]}
    rows = [",".join(map(str, row)) for row in [range(21), *np.pad(frames, 1)[1:4, 1:]]]
    (tmp_path / "t.csv").write_text("\n".join(rows))
    found = frames_for(model, Window(), Source(tmp_path / "t.csv"))
    assert (found.value_names, found.shape) == (("20",), (3, 20))
    other = Source(tmp_path / "t.csv", {"value_columns": ("3",)})
    assert frames_for(model, Window(), other).value_names == ("3",)


def test_numbers_of_a_model_made_in_python_are_named_by_their_place(hdc):
    """The command ended with an error of zip()."""
    frames = RNG.integers(0, 256, (12, 4, 5), np.uint8)
    values = RNG.normal(size=(12, 2))
    HDCRegressor().fit(frames, values).save("m")
    np.savez("two.npz", frames=frames, values=values)
    np.savez("one.npz", frames=frames, values=values[:, 0])
    out = hdc("predict", "m", "two.npz")[1]
    assert out[0].split("\t") == ["file", "values value_0", "values value_1"]
    assert hdc("evaluate", "m", "two.npz")[1][1].startswith("value_1: mean absolute")
    (line,) = hdc("evaluate", "m", "one.npz")[2]
    assert "expected 2 numbers per frame as in training, found value" in line


def test_numbers_are_compared_with_those_of_the_model_in_its_order(hdc):
    """Columns in another order were compared crosswise; those of a manifest were not found."""
    os.mkdir("r")
    rows = ["image,label,x,y"]
    for k in range(8):
        assert cv2.imwrite(f"r/{k}.png", image(k % 2, k))
        rows.append(f"{k}.png,{'ab'[k % 2]},{k},{100 * (k % 3)}")
    table = Path("r/t.csv")
    table.write_text("\n".join(rows))
    given = ("r", "--values", "r/t.csv")
    named = ("--column", "x", "--column", "y")
    assert hdc("train", *given, *named, "-o", "m")[0] == 0
    expected = hdc("evaluate", "m", *given)
    assert expected[0] == 0
    assert hdc("evaluate", "m", *given, *named[2:], *named[:2]) == expected
    manifest = table.read_text().replace("image", "file")
    table.with_name("manifest.csv").write_text(manifest)
    assert hdc("evaluate", "m", "r") == expected
    assert hdc("train", "r", "-o", "classes")[0] == 0
    table.write_text(table.read_text().replace("label", "note"))
    (line,) = hdc("evaluate", "classes", *given)[2]
    assert line == "error: r: expected a label of each frame, found only x, y"


def test_what_is_no_model_of_frames_says_what_is_expected(tmp_path):
    io.write_model(tmp_path / "m", {"kind": "HDCIndex", "metadata": {}}, {})
    with pytest.raises(
        ValueError, match=r"m: expected a saved .*, found a saved HDCIndex"
    ):
        load(tmp_path / "m")


# Names -------------------------------------------------------------------------------------------


def test_classes_named_like_columns_have_columns_of_their_own(hdc, frames, write):
    """A class named label, file or margin overwrote that column."""
    write("r", frames, ("label", "file", "margin"))
    assert hdc("train", "r", "-o", "m", "--readout", "majority")[0] == 0
    header, row = (line.split("\t") for line in hdc("predict", "m", "r/label/0.png")[1])
    distances = HDCClassifier.load("m").distances(cv2.imread("r/label/0.png", 0)[None])
    shares = [f"{share:.4f}" for share in distances[0] / frames[0, 0].size / 7]
    assert row[:2] == ["r/label/0.png", "label"]
    assert header[-3:] == ["distances file", "distances label", "distances margin"]
    assert row[-3:] == shares


def test_tabs_and_line_feeds_in_names_leave_the_table_whole(hdc, frames, write):
    write("r", frames[:2], ("a\tb", "c\nd"))
    words = ("train", "r", "-o", "m", "--readout", "majority")
    assert hdc(*words)[1][1] == r"classes: a\tb (12), c\nd (12)"
    rows = [line.split("\t") for line in hdc("predict", "m", "r")[1]]
    assert {len(row) for row in rows} == {4}
    assert rows[13][:2] == [r"r/c\nd/0.png", r"c\nd"]


def test_a_name_that_is_no_text_is_shown_by_its_bytes(hdc, frames, write):
    """An encoding error ended the command after some of its lines."""
    write("r", frames[:2], "ab")
    odd = os.fsdecode(b"r/a/\xff.png")
    os.rename("r/a/0.png", odd)
    Path(os.fsdecode(b"r/\xff.txt")).touch()
    assert hdc("train", "r", "-o", "m")[0] == 0
    status, out, _ = hdc("predict", "m", "r", "--json")
    assert status == 0
    assert odd in [json.loads(line)["file"] for line in out]
    assert r"1 .txt files, such as \udcff.txt" in hdc("look", "r")[1]


# Options that only some recordings have -----------------------------------------------------------


def test_axes_are_named_to_predict(hdc):
    cube = RNG.integers(0, 256, (12, 9, 12)).astype(np.uint8)
    np.savez("r.npz", frames=cube, labels=np.array([0, 1] * 6))
    last = ("--axes", "height,width,frame")
    assert hdc("train", "r.npz", "-o", "m", *last)[0] == 0
    np.save("new.npy", cube[:, :, :5])
    assert "expected 9 × 12 pixels as in tr" in hdc("predict", "m", "new.npy")[2][0]
    assert len(hdc("predict", "m", "new.npy", *last)[1]) == 1 + 5


def test_labels_that_are_named_are_learnt_anew(hdc):
    """Frames without an array of the name labels are no frames without labels then."""
    frames = np.stack([image(k % 2) for k in range(12)])
    np.savez("r.npz", frames=frames, labels=["a", "b"] * 6)
    np.savez("k.npz", frames=frames, kind=["a", "b"] * 6)
    assert hdc("train", "r.npz", "-o", "m")[0] == 0
    out = hdc("recalibrate", "m", "k.npz", "--labels", "kind", "-o", "new")[1]
    assert "12 new frames of 2 classes" in out[0]


def test_columns_of_vectors_are_those_of_training_in_its_order(hdc):
    """Columns that were permuted, or had other names, were taken as they came."""
    frames = RNG.integers(0, 200, (2, 1, 30)) + RNG.integers(0, 90, (2, 12, 30))
    names = [f"{k}nm" for k in range(400, 430)]

    def save(name, columns):
        rows = [["label", *columns]]
        for label, few in zip(("oil", "water"), frames.tolist(), strict=True):
            rows += [[label, *map(str, row[: len(columns)])] for row in few]
        Path(name).write_text("\n".join(map(",".join, rows)))

    save("r.csv", names)
    hdc("train", "r.csv", "-o", "m", "--subsample", 2)
    assert hdc("recalibrate", "m", "r.csv", "-o", "n")[0] == 0
    np.save("bare.npy", frames.reshape(24, 30))
    assert hdc("predict", "n", "bare.npy")[0] == 0  # an array has no names
    save("p.csv", [names[2], names[1], names[0], *names[3:]])
    for command in ("evaluate m p.csv", "predict n p.csv", "recalibrate m p.csv -o k"):
        (line,) = hdc(*command.split())[2]
        assert "p.csv, line 2: expected the columns of training" in line
        assert line.endswith("found 402nm for 400nm")
