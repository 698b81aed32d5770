"""hdc look: what a file holds, and lines that train what they say."""

import shlex
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
import scipy.io

RNG = np.random.default_rng(0)
LABELS = np.arange(12) % 3
NAMES = np.array(["air", "oil", "water"])[LABELS]
BASE = RNG.integers(0, 150, (3, 6, 8))
FRAMES = (BASE[LABELS] + RNG.integers(0, 90, (12, 6, 8))).astype(np.uint8)
CUBE = np.moveaxis(FRAMES, 0, -1)


def archive(path):
    np.savez(path, cube=CUBE, kind=NAMES, force=np.arange(12.0), rows=np.arange(7))


def cubes(path):
    with h5py.File(path, "w") as file:
        for name in ("day 1", "day 2"):
            file[name] = FRAMES[:, :, [*range(8), 0, 1, 2, 3]]  # [12, 6, 12]
        file["labels"] = LABELS


def spectra(path):
    rows = [["label", *(f"{k}nm" for k in range(400, 448))]]
    for name, frame in zip(NAMES, FRAMES, strict=True):
        rows.append([name, *map(str, frame.ravel())])
    path.write_text("\n".join(map(",".join, rows)))


@pytest.mark.parametrize(
    ("name", "write", "holds", "options", "first"),
    [
        ("x.npz", archive, ["cube: uint8 (6, 8, 12)"],  # by what is as long as they are
         ["--labels kind", "--column force"], "12 frames, 3 classes, 8 × 6 pixels"),
        ("x.h5", cubes, ["day 1: uint8 (12, 6, 12)"],
         ["--axes frame,height,width", "--axes height,width,frame"] * 2,
         "12 frames, 3 classes, 12 × 6 pixels"),
        ("s.csv", spectra, [f"columns: label, {', '.join(f'{k}nm' for k in range(400, 411))}, "
                            "… 37 more"], [""], "12 frames, 3 classes, 48 pixels"),
    ],
)  # fmt: skip
def test_each_reading_has_a_line_that_trains_what_it_says(
    typed, name, write, holds, options, first
):
    """More of them are sessions of docs/api.md."""
    write(Path(name))
    status, out, _ = typed("look", name)
    assert status == 0
    blocks = [block.splitlines() for block in out.split("\n\n")]
    assert blocks.pop(0)[: len(holds)] == holds
    assert blocks[0][0] == first
    assert len(blocks) == len(options)
    for block, option in zip(blocks, options, strict=True):
        assert f" {option} --test-fraction 0.2 -o m".replace("  ", " ") in block[-1]
        trained = typed(*shlex.split(block[-1])[1:])[1]
        _, learnt, size = block[0].split(", ", 2)
        assert f"{learnt}, {size}" in trained.splitlines()[0]
        assert "held out" in trained


def test_what_is_missing_is_said_after_what_is_there(typed):
    np.save("x.npy", FRAMES)
    _, out, err = typed("look", "x.npy")
    assert out == "frames: uint8 (12, 6, 8)\n"
    assert "(or x.csv with a row for each of 12 frames)" in err


def runs(path):
    for k, frame in enumerate(FRAMES):
        file = path / f"{NAMES[k]}{k // 6}" / f"{k}.png"
        file.parent.mkdir(parents=True, exist_ok=True)
        assert cv2.imwrite(str(file), frame)


def trials(path):
    arrays = {"cube": CUBE, "label": LABELS, "runNo": np.arange(12) // 4 % 2}
    scipy.io.savemat(path, arrays)


@pytest.mark.parametrize(
    ("name", "write", "asked", "option", "held_out"),
    [
        ("runs", runs, "do numbers of the classes count recordings? "
         "--template '{label}{group:d}/*' reads them so",
         "--template {label}{group:d}/*", "in groups"),
        ("x.mat", trials, "runNo has 2 values: --sessions runNo tests whole recordings, --groups "
         "runNo whole objects", "--sessions runNo", "in the last sessions"),
    ],
)  # fmt: skip
def test_what_seems_to_be_recorded_apart_raises_a_question(
    typed, name, write, asked, option, held_out
):
    """A trial was offered as something to learn, and each of several runs as a class."""
    write(Path(name))
    out = typed("look", name)[1]
    assert asked in out.splitlines()
    words = ("train", name, *option.split(), "--test-fraction", 0.4, "-o", "m")
    out = typed(*words)[1]
    assert f"\nheld out {held_out}" in out


def test_of_many_arrays_the_first_are_shown(typed):
    with h5py.File("many.h5", "w") as file:
        for k in range(20):
            file[f"t{k}/frames"], file[f"t{k}/labels"] = FRAMES, NAMES.tolist()
    err = typed("train", "many.h5", "-o", "m")[2]
    assert "expected one of --template '{group}/frames'; or" in err
    assert err.endswith("; or 10 more\n")
    assert typed("look", "many.h5")[1].count("\nhdc train ") == 12
