"""hdc look: what a file holds, and lines that train what they say."""

import shlex

import cv2
import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from hdc.readers import Ambiguous, open_recording, stores

RNG = np.random.default_rng(0)
LABELS = np.arange(12) % 3
NAMES = np.array(["air", "oil", "water"])[LABELS]
BASE = RNG.integers(0, 150, (3, 6, 8))
FRAMES = (BASE[LABELS] + RNG.integers(0, 90, (12, 6, 8))).astype(np.uint8)


@pytest.fixture
def look(typed, tmp_path, monkeypatch):
    """Lines on what a file holds, and blocks of lines on each reading; each is then typed, and has
    to train the frames and what the block says."""
    monkeypatch.chdir(tmp_path)

    def run_look(*words):
        status, out, err = typed("look", *words)
        if status:
            return out.splitlines(), err.splitlines()
        holds, *blocks = (block.splitlines() for block in out.split("\n\n"))
        for block in blocks:
            line = shlex.split(block[-1])
            assert line[:2] == ["hdc", "train"]
            trained = typed(*line[1:])
            assert trained[0] == 0
            _, learnt, size = block[0].split(", ", 2)
            assert f"{learnt}, {size}" in trained[1].splitlines()[0]
            assert "held out" in trained[1]
        return holds, blocks

    return run_look


def test_arrays_and_what_may_be_labels_or_numbers(look):
    arrays = {"cube": np.moveaxis(FRAMES, 0, -1), "kind": NAMES.astype(object),
              "force": np.arange(12) / 2, "order": np.arange(12), "empty": []}  # fmt: skip
    scipy.io.savemat("x.mat", arrays)
    holds, blocks = look("x.mat")
    assert holds[:4] == [
        "cube: uint8 (6, 8, 12)",
        "kind: text (12,)",
        "force: float64 (12,)",
        "order: int64 (12,)",
    ]
    end = "--test-fraction 0.2 -o model.safetensors"
    assert [block[-1] for block in blocks] == [
        f"hdc train x.mat --labels kind {end}",
        f"hdc train x.mat --column force {end}",
    ]
    assert blocks[0][:2] == [
        "12 frames, 3 classes, 8 × 6 pixels",
        "read: x.mat[cube] (6, 8, 12) as height, width, frame",
    ]


def test_frames_that_come_last_are_found_by_what_is_as_long_as_they_are(look):
    cube = np.moveaxis(FRAMES, 0, -1)
    np.savez("x.npz", cube=cube, kind=NAMES, force=np.arange(12.0), rows=np.arange(7))
    _, blocks = look("x.npz")
    assert [shlex.split(block[-1])[3:5] for block in blocks] == [
        ["--labels", "kind"],
        ["--column", "force"],
    ]
    for block in blocks:
        assert block[1] == "read: x.npz[cube] (6, 8, 12) as height, width, frame"


def test_two_cubes_that_can_each_be_read_in_two_ways_have_four_lines(look):
    with h5py.File("x.h5", "w") as file:
        for name in ("day 1", "day 2"):
            file[name] = FRAMES[:, :, [*range(8), 0, 1, 2, 3]]  # [12, 6, 12]
        file["labels"] = LABELS
    _, blocks = look("x.h5")
    axes = ("frame,height,width", "height,width,frame")
    files = ("'x.h5:/day 1'", "'x.h5:/day 2'")
    starts = [f"hdc train {file} --axes {a} --test" for file in files for a in axes]
    assert [block[-1].partition("-fraction")[0] for block in blocks] == starts
    assert [block[0].split(", ")[2] for block in blocks] == [
        "12 × 6 pixels",
        "6 × 12 pixels",
    ] * 2


def test_folders_of_folders_have_a_line_for_each_level(look, tmp_path):
    for k, frame in enumerate(FRAMES):
        path = tmp_path / "r" / ("train", "val")[k // 6] / NAMES[k] / f"{k}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        assert cv2.imwrite(str(path), frame)
    (tmp_path / "r" / "notes.txt").write_text("x")
    holds, blocks = look("r")
    assert holds == [
        "12 .png files, such as train/air/0.png",
        "1 .txt files, such as notes.txt",
    ]
    templates = [shlex.split(block[-1])[4] for block in blocks]
    assert templates == ["{label}/{group}/*", "{session}/{label}/*"]
    assert blocks[1][:2] == [
        "12 frames, 3 classes, 8 × 6 pixels",
        "sessions: train (6), val (6)",
    ]


def test_tables_and_columns_of_images(look, tmp_path):
    cells = [cv2.imencode(".png", frame)[1].tobytes() for frame in FRAMES]
    table = pa.table({"left eye": cells, "right": cells, "label": NAMES.tolist()})
    pq.write_table(table, "x.parquet")
    holds, blocks = look("x.parquet")
    assert holds == ["left eye: binary", "right: binary", "label: string"]
    assert [shlex.split(block[-1])[4] for block in blocks] == ["left eye", "right"]
    rows = ["label," + ",".join(f"{k}nm" for k in range(400, 448))]
    for name, frame in zip(NAMES, FRAMES, strict=True):
        rows.append(f"{name}," + ",".join(map(str, frame.ravel())))
    (tmp_path / "s.csv").write_text("\n".join(rows))
    holds, blocks = look("s.csv")
    assert blocks[0][1].startswith("a frame is the ")
    assert holds[0].startswith("columns: label, 400nm, ")
    assert holds[0].endswith("410nm, … 37 more")
    assert blocks[0][0] == "12 frames, 3 classes, 48 pixels"


def test_what_is_missing_is_said_after_what_is_there(look, write_film, tmp_path):
    np.save("x.npy", FRAMES)
    holds, error = look("x.npy")
    assert holds == ["frames: uint8 (12, 6, 8)"]
    assert "--labels FILE.csv with a row for each of 12 frames" in error[0]
    (tmp_path / "x.csv").write_text("\n".join(["label", *NAMES]))
    _, blocks = look("x.npy")
    assert len(blocks) == 1
    write_film("v.avi", FRAMES, "MJPG")
    holds, error = look("v.avi")
    assert holds == ["mjpeg, 8 × 6 pixels, 12 frames, 10 a second"]
    assert error == ["error: v.csv: expected a table with start_s, end_s and label, or with a row "
                     "per frame, found none (--values names it)"]  # fmt: skip
    (tmp_path / "v.csv").write_text("start_s,end_s,label\n0,0.6,a\n0.6,1.2,b\n")
    _, blocks = look("v.avi")
    assert blocks[0][0] == "12 frames, 2 classes, 8 × 6 pixels"
    (tmp_path / "cut.mp4").write_bytes(b"x" * 99)
    assert "cut.mp4: expected a whole video, found: Invalid" in look("cut.mp4")[1][0]
    (tmp_path / "cut.parquet").write_bytes(b"x" * 99)
    assert "cut.parquet: expected an intact parquet file" in look("cut.parquet")[1][0]
    (tmp_path / "b.csv").write_text("x" * 200_000)
    assert "b.csv: expected a CSV table" in look("b.csv")[1][0]
    for name in ("nothing", "x.doc"):
        (tmp_path / "x.doc").write_text("x")
        holds, error = look(name)
        assert (holds, len(error)) == ([], 1)


def test_a_file_of_many_arrays_is_loaded_once(typed, tmp_path, monkeypatch):
    """Of 292 arrays it took 17 s; an error listed all of them."""
    with h5py.File(tmp_path / "many.h5", "w") as file:
        for k in range(20):
            file[f"t{k}/frames"], file[f"t{k}/labels"] = FRAMES, NAMES.tolist()
    loaded = []
    plain = stores._hdf5
    monkeypatch.setattr(stores, "_hdf5", lambda p: loaded.append(p) or plain(p))
    out = typed("look", tmp_path / "many.h5")[1]
    assert (out.count("\nhdc train "), len(loaded)) == (12, 1)
    with pytest.raises(Ambiguous, match=r"; or 8 more$"):
        open_recording(tmp_path / "many.h5")
