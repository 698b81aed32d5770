"""Recordings of every kind through the command: sessions, vectors, values, and odd names."""

import csv
import json
import os
import shlex
from io import StringIO
from pathlib import Path

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from hdc import HDCClassifier, HDCRegressor, io
from hdc.command.source import Source
from hdc.command.work import frames_for, load
from hdc.readers import BadFrame, Window, open_recording

RNG = np.random.default_rng(0)
BASE = RNG.integers(0, 150, (3, 16, 18))


@pytest.fixture
def hdc(hdc, tmp_path, monkeypatch):
    """A command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return hdc


def image(c, shift=0):
    """A noisy frame of class c."""
    noise = RNG.integers(0, 60, BASE[c].shape)
    return np.roll((BASE[c] + noise).astype(np.uint8), shift, axis=1)


def write(path, frame):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), frame)


def write_classes(root, names, n=4):
    """A folder of n frames for each name of a class."""
    for c, name in enumerate(names):
        for k in range(n):
            write(root / name / f"{k}.png", image(c))


# What is held out --------------------------------------------------------------------------------


def test_numbers_are_held_out_whatever_the_labels(hdc, tmp_path):
    """cracks: a label of one frame was refused, though numbers are learnt."""
    rows = ["image,label,force"]
    for k in range(8):
        write(tmp_path / "pins" / f"{k}.png", image(k % 2, k))
        rows.append(f"{k}.png,only {k},{k / 2}")
    (tmp_path / "pins" / "t.csv").write_text("\n".join(rows))
    words = ("train", "pins", "-o", "m", "--values", "pins/t.csv")
    status, out, err = hdc(*words, "--test-fraction", 0.25)
    assert (status, err) == (0, [])
    assert out[0] == "m: 6 frames, values of force, 18 × 16 pixels"
    assert "held out at random: force: mean absolute error" in out[2]


def test_what_was_read_is_shown(hdc, tmp_path):
    for session in ("day1", "day10", "day2"):
        for c, name in enumerate(("foam_brick", "mug")):
            for k in range(3):
                write(tmp_path / "r" / session / f"{name}_{k}.png", image(c))
    pattern = "{session}/{label}_{order}.png"
    words = ("train", "r", "-o", "m", "--template", pattern, "--test-fraction", 0.3)
    status, out, err = hdc(*words)
    assert (status, err) == (0, [])
    assert out[1:3] == [
        "classes: foam_brick (6), mug (6)",
        "sessions: day1 (6), day2 (6), day10 (6)",
    ]
    assert out[3].startswith("held out in the last sessions: accuracy")
    assert out[4] == "a guess of foam_brick, the largest class: accuracy 50.0%"
    assert len(out) == 6


# Vectors and values ------------------------------------------------------------------------------


def test_values_of_an_archive_have_names_and_units(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    frames = np.stack([image(0, k) for k in range(12)])
    values = np.stack([np.arange(12) / 4, np.arange(12) % 5], axis=1)
    about = {"value_names": ["force", "x"], "value_units": ["N", ""]}
    np.savez(tmp_path / "v.npz", frames=frames, values=values, **about)
    recording = open_recording("v.npz")
    assert (recording.value_names, recording.value_units) == (("force", "x"), ("N", ""))
    assert np.array_equal(recording.values, values)
    only = open_recording("v.npz", value_columns=["x"])
    assert only.values[:, 0].tolist() == values[:, 1].tolist()
    np.savez(
        tmp_path / "l.npz",
        frames=frames,
        values=values[:, 0],
        labels=frames[:, 0, 0] % 2,
    )
    assert (
        open_recording("l.npz").values is None
    )  # labels are learnt unless values are named
    assert open_recording("l.npz", value_columns=["value"]).value_names == ("value",)


def test_a_column_of_images_is_asked_for_by_its_option(hdc, tmp_path):
    write(tmp_path / "r" / "0.png", image(0))
    (tmp_path / "r" / "t.csv").write_text("picture,force\n0.png,1\n")
    (line,) = hdc("train", "r", "-o", "m", "--values", "r/t.csv")[2]
    assert "with image, found ['picture', 'force'] (--image-column names" in line


def test_a_column_of_images_is_named_to_predict_as_well(hdc):
    """Its error named an option that it did not have."""
    cells = [cv2.imencode(".png", image(k % 2))[1].tobytes() for k in range(6)]
    table = pa.table({"left": cells, "right": cells[::-1], "label": [*"ababab"]})
    pq.write_table(table, "two.parquet")
    words = ("two.parquet", "--image-column")
    assert hdc("train", *words, "left", "-o", "m")[0] == 0
    status, _, (line,) = hdc("predict", "m", "two.parquet")
    assert (status, "--image-column right" in line) == (1, True)
    status, out, _ = hdc("predict", "m", *words, "right")
    assert (status, len(out)) == (0, 1 + 6)


# What the commands share -------------------------------------------------------------------------


def test_frames_may_have_neither_labels_nor_values(tmp_path):
    """Loose images, arrays and tables of frames alone; all of the size of training."""
    frames = np.random.default_rng(1).integers(0, 256, (3, 4, 5), np.uint8)
    model = HDCClassifier().fit(frames, [0, 1, 1])

    def read(name, crop=None):
        found = frames_for(model, Window(crop), Source(tmp_path / name), 0)
        assert found.labels is None
        assert found.values is None
        return found[:]

    for k, frame in enumerate(frames):
        write(tmp_path / "loose" / f"{k + 9}.png", frame)
        write(tmp_path / "wide" / f"{k}.png", np.pad(frame, 1))
    np.savez(tmp_path / "a.npz", frames=frames)
    for name, crop in (("loose", None), ("wide", (1, 1, 5, 4)), ("a.npz", None)):
        assert np.array_equal(read(name, crop), frames)
    with pytest.raises(BadFrame, match=r"wide/0\.png: expected 5 × 4 pixels"):
        read("wide")
    model = HDCClassifier().fit(frames.reshape(3, 20), [0, 1, 1])
    rows = [",".join(map(str, row)) for row in [range(20), *frames.reshape(3, 20)]]
    (tmp_path / "t.csv").write_text("\n".join(rows))
    assert np.array_equal(read("t.csv"), frames.reshape(3, 20))


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


def test_numbers_of_a_model_made_in_python_are_named_by_their_place(hdc, tmp_path):
    """The command ended with an error of zip()."""
    frames = np.random.default_rng(1).integers(0, 256, (12, 4, 5), np.uint8)
    values = np.random.default_rng(2).normal(size=(12, 2))
    HDCRegressor().fit(frames, values).save(tmp_path / "m")
    np.savez("two.npz", frames=frames, values=values)
    np.savez("one.npz", frames=frames, values=values[:, 0])
    out = hdc("predict", "m", "two.npz", "--interval", 0.8)[1]
    ends = ["value_0 from", "value_0 to", "value_1 from", "value_1 to"]
    assert out[0].split("\t") == ["file", "value_0", "value_1", *ends]
    assert hdc("evaluate", "m", "two.npz")[1][1].startswith("value_1: mean absolute")
    (line,) = hdc("evaluate", "m", "one.npz")[2]
    assert "expected 2 numbers a frame as in training, found value" in line
    found = json.loads("".join(hdc("info", "m")[1]))
    bits = 8 * found["bytes to predict"]
    assert found["bits per pixel and value"] == round(bits / 20 / 2, 2)


def test_numbers_are_compared_with_those_of_the_model_in_its_order(hdc, tmp_path):
    """Columns in another order were compared crosswise; those of a manifest were not found."""
    rows = ["image,label,x,y"]
    for k in range(8):
        write(tmp_path / "pins" / f"{k}.png", image(k % 2, k))
        rows.append(f"{k}.png,{'ab'[k % 2]},{k},{100 * (k % 3)}")
    table = tmp_path / "pins" / "t.csv"
    table.write_text("\n".join(rows))
    given = ("pins", "--values", "pins/t.csv")
    named = ("--column", "x", "--column", "y")
    assert hdc("train", *given, *named, "-o", "m")[0] == 0
    expected = hdc("evaluate", "m", *given)
    assert expected[0] == 0
    assert hdc("evaluate", "m", *given, *named[2:], *named[:2]) == expected
    manifest = table.read_text().replace("image", "file")
    table.with_name("manifest.csv").write_text(manifest)
    assert hdc("evaluate", "m", "pins") == expected
    assert hdc("train", "pins", "-o", "classes")[0] == 0
    table.write_text(table.read_text().replace("label", "note"))
    (line,) = hdc("evaluate", "classes", *given)[2]
    assert line == "error: pins: expected a label of each frame, found only x, y"


def test_the_line_to_type_has_every_option_that_was_given():
    """Without those left at their defaults."""
    plain = {"template": None, "value_columns": (), "image_column": "image"}
    words = ["hdc", "train", "r", "-o", "model.safetensors"]
    assert shlex.split(Source(Path("r"), plain).training_line(Window())) == words
    source = Source(
        Path("my r"),
        {
            "template": "{label}/*.png",
            "table": Path("t.csv"),
            "value_columns": ("x", "y 2"),
            "image_column": "file",
            "labels": "kind",
            "axes": ("height", "width", "frame"),
            "skip_damaged": True,
            "skip_missing": True,
        },
    )
    window = Window((1, 2, 30, 40), 5)
    assert source.training_line(window, "--encoder", "levels") == (
        "hdc train 'my r' --template '{label}/*.png' --values t.csv --column x --column 'y 2' "
        "--image-column file --labels kind --axes height,width,frame --skip-damaged --skip-missing "
        "--crop 1 2 30 40 --subsample 5 --encoder levels -o model.safetensors"
    )


def test_what_is_no_model_of_frames_says_what_is_expected(tmp_path):
    header = {"kind": "HDCIndex", "metadata": {}}
    io.write_model(tmp_path / "m", header, {}, lambda *_: None)
    expected = "m: expected a saved HDCClassifier or HDCRegressor, found 'HDCIndex'"
    with pytest.raises(ValueError, match=expected):
        load(tmp_path / "m")


# Names -------------------------------------------------------------------------------------------


def test_classes_named_like_columns_have_columns_of_their_own(hdc, tmp_path):
    """cracks: a class named label, file or margin overwrote that column."""
    write_classes(tmp_path / "r", ("label", "file", "margin"))
    assert hdc("train", "r", "-o", "m")[0] == 0
    _, out, _ = hdc("predict", "m", "r/label/0.png")
    rows = list(csv.DictReader(StringIO("\n".join(out)), delimiter="\t"))
    assert rows[0]["file"] == "r/label/0.png"
    assert rows[0]["label"] == "label"
    distances = HDCClassifier.load("m").distances(cv2.imread("r/label/0.png", 0)[None])
    shares = (distances[0] / BASE[0].size).tolist()
    named = [rows[0][f"distance {name}"] for name in ("file", "label", "margin")]
    assert named == [f"{share:.4f}" for share in shares]
    assert float(rows[0]["margin"]) == pytest.approx(
        sorted(shares)[1] - min(shares), abs=1e-4
    )


def test_tabs_and_line_feeds_in_names_leave_the_table_whole(hdc, tmp_path):
    write_classes(tmp_path / "r", ("a\tb", "c\nd"))
    assert hdc("train", "r", "-o", "m")[1][1] == r"classes: a\tb (4), c\nd (4)"
    _, out, _ = hdc("predict", "m", "r")
    assert len(out) == 9
    assert {len(line.split("\t")) for line in out} == {5}
    assert out[5].split("\t")[:2] == [r"r/c\nd/0.png", r"c\nd"]
    assert len(hdc("evaluate", "m", "r")[1]) == 6


def test_a_name_that_is_no_text_is_shown_by_its_bytes(hdc, tmp_path):
    """An encoding error ended the command after some of its lines."""
    write_classes(tmp_path / "r", "ab")
    odd = os.fsdecode(b"r/a/\xff.png")
    (tmp_path / "r" / "a" / "0.png").rename(tmp_path / odd)
    (tmp_path / os.fsdecode(b"r/\xff.txt")).touch()
    assert hdc("train", "r", "-o", "m")[0] == 0
    status, out, _ = hdc("predict", "m", "r", "--json")
    assert status == 0
    assert odd in [json.loads(line)["file"] for line in out]
    assert r"1 .txt files, such as \udcff.txt" in hdc("look", "r")[1]


def test_a_model_is_known_by_its_header(hdc, tmp_path):
    """Not by what an error says: the name of the file has the word in it."""
    write_classes(tmp_path / "r", "ab")
    name = "HDCRegressor.safetensors"
    assert hdc("train", "r", "-o", name)[0] == 0
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[:-1])
    (line,) = hdc("info", name)[2]
    assert line.startswith(f"error: {name}: expected a saved model, found")
    (tmp_path / name).write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    (line,) = hdc("info", name)[2]
    assert line.startswith(
        f"error: {name}: expected a saved HDCClassifier, found other"
    )


# Links and cut videos ----------------------------------------------------------------------------


def test_links_to_folders_are_refused(hdc, tmp_path):
    """cracks: 12 images became 492 frames, and two loops never ended."""
    write_classes(tmp_path / "r", ("left", "right"), 2)
    assert hdc("train", "r", "-o", "m")[1][0].startswith("m: 4 frames, 2 classes")
    (tmp_path / "r" / "left" / "loop").symlink_to(tmp_path / "r")
    for words in (
        ("train", "r", "-o", "n"),
        ("evaluate", "m", "r"),
        ("predict", "m", "r"),
    ):
        status, out, (line,) = hdc(*words)
        assert (status, out) == (1, [])
        assert "r/left/loop: expected a folder, found a link to" in line
    (tmp_path / "link").symlink_to(tmp_path / "r" / "right")
    assert (
        len(hdc("predict", "m", "link")[1]) == 3
    )  # the folder that is named may be one


@pytest.mark.parametrize(
    ("name", "code", "said"),
    [
        ("v.mkv", "FFV1", "expected whole frames, found: File ended"),
        ("v.avi", "MJPG", "expected a whole video, found: "),
    ],
)
def test_a_video_that_is_cut_off_is_refused_by_predict(
    hdc, write_film, tmp_path, name, code, said
):
    """cracks: 30 of 60 frames, and exit 0."""
    write_classes(tmp_path / "r", "ab", 1)
    hdc("train", "r", "-o", "m")
    write_film(name, RNG.integers(0, 256, (60, 16, 18)).astype(np.uint8), code)
    assert len(hdc("predict", "m", name)[1]) == 61
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: len(whole) // 2])
    status, out, (line,) = hdc("predict", "m", name)
    assert (status, out) == (1, [])
    assert f"{name}: {said}" in line


def test_axes_that_two_readings_fit_are_named_on_the_command_line(hdc):
    """cracks: a MATLAB cube [H, W, N] with H = N was taken as [N, H, W]."""
    cube = RNG.integers(0, 256, (12, 9, 12)).astype(np.uint8)
    np.savez("r.npz", frames=cube, labels=np.array([0, 1] * 6))
    status, out, (line,) = hdc("train", "r.npz", "-o", "m")
    assert (status, out) == (1, [])
    both = ("--axes frame,height,width", "--axes height,width,frame")
    assert all(words in line for words in both)
    read = {}
    for words in both:
        status, out, _ = hdc("train", "r.npz", "-o", "m", *words.split())
        assert status == 0
        axes = words.removeprefix("--axes ").replace(",", ", ")
        assert out[-1] == f"read: r.npz[frames] (12, 9, 12) as {axes}"
        read[words] = out[0]
    np.save("new.npy", cube[:, :, :5])
    assert (
        "expected 9 × 12 pixels as in training" in hdc("predict", "m", "new.npy")[2][0]
    )
    assert len(hdc("predict", "m", "new.npy", *both[1].split())[1]) == 1 + 5
    assert read[both[0]] == "m: 12 frames, 2 classes, 12 × 9 pixels"
    assert read[both[1]] == "m: 12 frames, 2 classes, 9 × 12 pixels"


def test_labels_that_are_named_are_learnt_anew(hdc, tmp_path):
    """Frames without an array of the name labels are no frames without labels then."""
    frames = np.stack([image(k % 2) for k in range(12)])
    names = np.array(["a", "b"] * 6)
    np.savez("r.npz", frames=frames, labels=names)
    np.savez("k.npz", frames=frames, kind=names)
    np.save("n.npy", frames)
    (tmp_path / "t.csv").write_text("\n".join(["label", *names]))
    assert hdc("train", "r.npz", "-o", "m")[0] == 0
    for words in (("k.npz", "--labels", "kind"), ("n.npy", "--labels", "t.csv")):
        status, out, _ = hdc("recalibrate", "m", *words, "-o", "new")
        assert (status, "12 new frames of 2 classes" in out[0]) == (0, True)


def test_damaged_and_missing_images_are_counted_and_left_out_when_asked(hdc, tmp_path):
    rows = ["image,label"]
    for k in range(8):
        write(tmp_path / "r" / f"{k}.png", image(k % 2))
        rows.append(f"{k}.png,{'ab'[k % 2]}")
    rows += ["8.png,a", "9.png,b"]
    (tmp_path / "r" / "t.csv").write_text("\n".join(rows))
    whole = (tmp_path / "r" / "7.png").read_bytes()
    (tmp_path / "r" / "7.png").write_bytes(whole[: len(whole) // 2])
    words = ("train", "r", "--values", "t.csv", "-o", "m")
    (line,) = hdc(*words)[2]
    assert "2 of 10 images are missing, the first 8.png" in line
    assert "--skip-missing" in line
    line = hdc(*words, "--skip-missing")[2][-1]
    assert "1 of 8 images are damaged; --skip-damaged" in line
    status, out, _ = hdc(*words, "--skip-missing", "--skip-damaged")
    assert (status, out[0].split(",")[0]) == (0, "m: 7 frames")
    assert "2 of 10 images are missing" in out[-1]
    assert "1 of 8 images are damaged" in out[-1]


@pytest.mark.parametrize("words", [(), ("--choose",), ("--subsample", 2)])
def test_columns_of_vectors_are_those_of_training_in_its_order(hdc, words):
    """cracks: columns that were permuted, or had other names, were taken as they came."""
    frames = RNG.integers(0, 200, (2, 1, 30)) + RNG.integers(0, 90, (2, 12, 30))
    frames = frames.reshape(24, 30)
    labels = np.repeat(["oil", "water"], 12)

    def save(name, columns, numbers, with_labels=True):
        rows = [["label"] * with_labels + columns]
        for label, row in zip(labels, numbers.tolist(), strict=True):
            rows.append([label] * with_labels + row)
        with open(name, "w", newline="") as file:
            csv.writer(file).writerows(rows)

    names = [f"{k}nm" for k in range(400, 430)]
    save("r.csv", names, frames)
    save("new.csv", names, frames, with_labels=False)
    assert hdc("train", "r.csv", "-o", "m", *words)[0] == 0
    assert hdc("evaluate", "m", "r.csv")[0] == 0
    assert hdc("predict", "m", "new.csv")[0] == 0
    assert hdc("recalibrate", "m", "r.csv", "-o", "n")[0] == 0
    model = HDCClassifier.load("n")  # recalibrated models still ask
    assert (
        model.feature_names_in_.tolist() == names[:: 2 if "--subsample" in words else 1]
    )
    np.save("bare.npy", frames)
    assert hdc("predict", "m", "bare.npy")[0] == 0  # an array has no names
    others = {
        "permuted": ([names[2], *names[1:2], names[0], *names[3:]], "402nm for 400nm"),
        "other": (["time", *names[1:]], "time for 400nm"),
    }
    for columns, said in others.values():
        save("p.csv", columns, frames)
        save("q.csv", columns, frames, with_labels=False)
        for command in (("evaluate", "m", "p.csv"), ("predict", "n", "q.csv"),
                        ("recalibrate", "m", "p.csv", "-o", "k")):  # fmt: skip
            status, _, err = hdc(*command)
            assert status == 1
            assert err == [f"error: {command[2]}, line 2: expected the columns of training in its "
                           f"order, found {said}"]  # fmt: skip
    save("p.csv", names[:-2], frames[:, :-2])
    (line,) = hdc("evaluate", "m", "p.csv")[2]
    assert line.endswith("found none for 428nm")
