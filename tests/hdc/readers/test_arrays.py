"""Files of arrays and images: frames come as the libraries of the field wrote them."""

import h5py
import numpy as np
import pytest

from hdc.readers import Ambiguous, BadFrame, SettingError, hdf5, open_recording, stores
from tests.hdc.readers import writers
from tests.hdc.readers.writers import (
    BYTES,
    CUBE,
    FRAMES,
    LABELS,
    NAMES,
    RNG,
    TEXTS,
    N,
    beside,
    check,
    h5,
    mat,
    npy,
    npz,
    pages,
    said,
    save_v73,
)

STACK, STACKED_LAST = (
    {"frames": FRAMES, "labels": NAMES},
    {"cube": CUBE, "labels": NAMES},
)
NAMED = h5py.enum_dtype({"a": 0, "bb": 1})


@pytest.mark.parametrize(
    ("name", "write", "arrays", "settings"),
    [
        ("x.npz", npz, STACK, {}),
        ("x.npz", npz, {"frames": FRAMES.astype(">u2", order="F"), "labels": TEXTS}, {}),
        ("x.npz", npz, {"frames": FRAMES, "kind": TEXTS}, {"labels": "kind"}),
        ("x.npy", npy, STACK, {}),
        ("x.mat", mat, STACKED_LAST, {}),
        ("x.mat", save_v73, STACKED_LAST, {}),
        ("x.mat", mat, {"s": {"cube": CUBE, "y": TEXTS}}, {"labels": "y"}),
        ("x.mat", writers.characters, {}, {}),
        ("x.h5", h5, STACK, {}),
        ("x.h5", h5, {"run__frames": FRAMES, "run__labels": NAMES}, {}),
        ("x.h5", h5, {"frames": FRAMES, "labels": np.array([0, 1, 0, 1], NAMED)}, {}),
        ("x.h5", writers.virtual, {"frames": FRAMES}, {}),
        ("x.tif", pages, {}, {}),
        ("x.tif", pages, {"one_by_one": True}, {}),
        ("x.tif", pages, {"imagej": True}, {}),
        ("x.tif", pages, {"compression": "zlib", "predictor": 2}, {}),
    ],
)  # fmt: skip
def test_frames_and_labels_are_those_that_were_written(
    tmp_path, name, write, arrays, settings
):
    write(tmp_path / name, **arrays)
    check(open_recording(tmp_path / name, **settings))
    window = open_recording(tmp_path / name, crop=[1, 0, 4, 3], subsample=2, **settings)
    assert np.array_equal(window[:], FRAMES[:, ::2, 1::2])


def test_other_arrays_are_samples_or_values_with_names_and_units(tmp_path):
    path, values = tmp_path / "x.npz", np.arange(8.0).reshape(N, 2)
    about = {"order": [3, 2, 1, 0], "time": np.arange(N) / 2, "other": np.zeros(3)}
    npz(path, frames=FRAMES, labels=TEXTS, **about)
    timed = open_recording(path, value_columns=["time"])
    assert {*timed.samples} == {"order", "time"}
    assert said(timed, "label order time") == ["a 3 0", "bb 2 0.5", "a 1 1", "bb 0 1.5"]
    names = {"value_names": ["force", "x"], "value_units": ["N", ""]}
    npz(path, frames=FRAMES, values=values, **names)
    both, only = open_recording(path), open_recording(path, value_columns=["x"])
    assert said(both, "force x") == ["0 1", "2 3", "4 5", "6 7"]
    assert both.value_units == ("N", "")
    assert said(only, "x") == ["1", "3", "5", "7"]
    npz(path, frames=FRAMES, labels=TEXTS, values=values[:, 0])
    assert open_recording(path).values is None  # unless these are named
    assert open_recording(path, value_columns=["value"]).value_names == ("value",)


def test_whole_numbers_are_labels(tmp_path):
    """MATLAB's numbers are floats."""
    mat(tmp_path / "x.mat", cube=CUBE, labels=LABELS)
    assert open_recording(tmp_path / "x.mat").names == ["1", "2", "1", "2"]


def test_axes_and_groups_are_named(tmp_path):
    path = tmp_path / "x.npy"
    npy(path, FRAMES.transpose(2, 0, 1), NAMES)
    check(open_recording(path, axes=("width", "frame", "height")))
    path, few = tmp_path / "x.h5", NAMES[:3]
    h5(path, a__frames=FRAMES, a__labels=NAMES, b__frames=CUBE, b__labels=few)
    check(open_recording(f"{path}:/a/frames"))
    check(open_recording(f"{path}:/a/frames", labels="labels"))
    assert open_recording(f"{path}:/b/frames").names == few


THREE = ("x.npz", npz, {"frames": FRAMES, "labels": TEXTS})
FLAT = {"frames": FRAMES.reshape(N, -1), "labels": TEXTS}
COLOUR = "frame,height,width,channel"


@pytest.mark.parametrize(
    ("name", "write", "arrays", "settings", "message"),
    [
        *((*THREE, {"axes": axes.split(",")}, "axes: expected 3 different names") for axes in (
            "height,height,width", "frame,height,feature", "label,height,width", "frame")),
        # Of four channels the last was taken for blue; two ended in a traceback.
        *(("x.npz", npz, {"frames": BYTES[..., :n], "labels": TEXTS},
           {"axes": COLOUR.split(",")}, f"axes: .* found {n}") for n in (2, 4)),
        ("x.h5:/y", h5, {"a__frames": FRAMES}, {}, "expected one of a/frames .*; no y"),
        ("x.npz", npz, FLAT, {"crop": [0, 0, 5, 1]}, "crop: expected null for frames that are"),
    ],
)  # fmt: skip
def test_settings_that_do_not_fit_are_named(
    tmp_path, name, write, arrays, settings, message
):
    write(tmp_path / name.partition(":")[0], **arrays)
    with pytest.raises(SettingError, match=message):
        open_recording(f"{tmp_path}/{name}", **settings)


@pytest.mark.parametrize(
    ("name", "write", "arrays", "choices"),
    [
        # Two axes are as long as there are labels: one was taken.
        ("x.mat", mat, {"c": CUBE[:, :4, :3], "labels": NAMES[:3]},
         ["--axes frame,height,width", "--axes height,width,frame"]),
        ("x.npz", npz, {"a": FRAMES, "b": CUBE, "labels": TEXTS}, ["x.npz:/a", "x.npz:/b"]),
        ("x.npz", npz, {"frames": FRAMES, "kind": LABELS}, ["--labels kind", "--column kind"]),
    ],
)  # fmt: skip
def test_what_has_several_readings_names_them(tmp_path, name, write, arrays, choices):
    write(tmp_path / name, **arrays)
    with pytest.raises(Ambiguous, match=name) as caught:
        open_recording(tmp_path / name)
    found = [choice.replace(f"{tmp_path}/", "") for choice in caught.value.choices]
    assert found == choices


LUMINANCE = [0.299, 0.587, 0.114]  # ITU-R BT.601


@pytest.mark.parametrize("axes", [None, COLOUR.split(",")])
def test_colour_becomes_luminance_where_its_numbers_are_a_camera_s(tmp_path, axes):
    path = tmp_path / "x.npz"
    colour = RNG.integers(0, 256, (N, 20, 30, 3), np.uint8)
    npz(path, frames=colour, labels=TEXTS)
    found = open_recording(path, axes=axes, crop=[1, 2, 9, 8])
    assert np.abs(found[:] - colour[:, 2:10, 1:10] @ LUMINANCE).max() <= 1
    npz(path, frames=colour.astype(float), labels=TEXTS)
    with pytest.raises(BadFrame, match=r"x.npz, frame 3: .* colour of uint8, uint16"):
        open_recording(path, axes=axes)[3]


def test_a_table_beside_has_a_row_per_frame_in_their_order(tmp_path):
    path, other = tmp_path / "x.npy", tmp_path / "y.csv"
    np.save(path, FRAMES)
    beside(other, "label,force", "a,0", "bb,1", "a,2", "bb,3")
    with pytest.raises(SettingError, match=r"labels: .* \(--values names a table\)"):
        open_recording(path, labels=str(other))
    forced = open_recording(path, table=other)
    assert said(forced, "label force") == ["a 0", "bb 1", "a 2", "bb 3"]
    beside(path, '"frame","label"', "0,a", "1,bb", "2,a", "3,bb")
    check(open_recording(path))  # as R quotes
    beside(path, "frame,label", "0,a", "2,a", "1,bb", "3,bb")
    with pytest.raises(ValueError, match=r"x.csv: .*the order of .* found 0 to 3"):
        open_recording(path)
    beside(path, "label", "a", "bb")
    with pytest.raises(SettingError, match=r"x.npy.* with N = 2, as there are labels"):
        open_recording(path)


def test_labels_of_a_file_are_not_those_of_a_table_beside_it(tmp_path):
    """press.csv replaced those of press.mat, without a word."""
    npz(tmp_path / "own.npz", frames=FRAMES, labels=TEXTS)
    beside(tmp_path / "own.npz", "label", *NAMES[::-1])
    recording = open_recording(tmp_path / "own.npz")
    check(recording)
    assert recording.notes[1] == "labels and values of the file, not of own.csv"


SMALL = (FRAMES // 300).astype("i2") - 30
ALPHA = {"extrasamples": ["unassalpha"]}


@pytest.mark.parametrize(
    ("pixels", "options", "expected"),
    [
        (SMALL, {}, SMALL),
        (FRAMES, {"byteorder": ">", "compression": "lzw"}, FRAMES),
        (np.moveaxis(BYTES, -1, 1), {"photometric": "rgb", "planarconfig": "separate", **ALPHA},
         BYTES[..., :3] @ LUMINANCE),
    ],
)  # fmt: skip
def test_pixels_of_a_tiff_are_as_its_tags_say(tmp_path, pixels, options, expected):
    pages(tmp_path / "x.tif", pixels, **options)
    recording = open_recording(tmp_path / "x.tif")
    if "extrasamples" in options:  # OpenCV rounds the weights of colours
        assert np.abs(recording[:] - expected).max() <= 1
    else:
        check(recording, frames=expected)


def test_a_cell_of_text_is_no_array_and_a_link_to_the_root_renames_nothing(tmp_path):
    """hdc look of 20,000 cells took half a minute: each was visited as a dataset, too."""
    path = tmp_path / "cells.mat"
    save_v73(path, frames=CUBE, labels=NAMES)
    with h5py.File(path, "r+") as file:
        file["again"] = file["/"]
        file["more/frames"] = file["frames"]
    assert hdf5.load(path).arrays.keys() == {"frames", "labels"}


def test_a_file_is_read_once_while_someone_has_its_arrays(tmp_path):
    """hdc look loaded a file of 292 arrays for each of its readings."""
    path = tmp_path / "x.npz"
    npz(path, **STACK)
    first = stores.load(path)
    assert stores.load(path) is first
    npz(path, frames=FRAMES[:2], labels=NAMES[:2])
    assert stores.load(path).arrays["frames"].shape == (2, 3, 5)
