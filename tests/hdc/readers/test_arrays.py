"""Files of arrays: frames come as they were written by the libraries of the field."""

import h5py
import numpy as np
import pytest

from hdc.readers import Ambiguous, BadFrame, SettingError, open_recording
from tests.hdc.readers.writers import (
    BYTES,
    CUBE,
    FRAMES,
    LABELS,
    NAMES,
    RNG,
    TEXTS,
    H,
    N,
    W,
    beside,
    characters,
    check,
    enumerated,
    h5,
    mat,
    npy,
    npz,
    pages,
    save_v73,
    tiff_of,
)


@pytest.mark.parametrize(
    ("name", "write", "arrays", "settings"),
    [
        ("x.npz", npz, {"frames": FRAMES, "labels": TEXTS}, {}),
        ("x.npz", npz, {"frames": FRAMES.astype(">u2", order="F"), "labels": TEXTS}, {}),
        ("x.npz", npz, {"frames": FRAMES, "labels": [0, 1, 0, 1], "classes": ["a", "bb"]}, {}),
        ("x.npz", npz, {"frames": FRAMES, "kind": TEXTS}, {"labels": "kind"}),
        ("x.npy", npy, {"frames": FRAMES, "labels": NAMES}, {}),
        ("x.mat", mat, {"cube": CUBE, "labels": NAMES}, {}),
        ("x.mat", save_v73, {"cube": CUBE, "labels": NAMES}, {}),
        ("x.mat", mat, {"cube": FRAMES, "labels": NAMES}, {}),  # from Python
        ("x.mat", mat, {"s": {"cube": CUBE, "y": TEXTS}}, {"labels": "y"}),
        ("x.mat", mat, {"cube": CUBE, "labels": LABELS, "classes": ["a", "bb", "c"]}, {}),
        ("x.mat", save_v73, {"cube": CUBE, "labels": LABELS[None], "classes": ["a", "bb"]}, {}),
        ("x.mat", characters, {}, {}),
        ("x.h5", h5, {"frames": FRAMES, "labels": NAMES}, {}),
        ("x.h5", h5, {"run__frames": FRAMES, "run__labels": NAMES}, {}),
        ("x.h5", enumerated, {"frames": FRAMES, "labels": NAMES}, {}),
        ("x.tif", pages, {}, {}),
        ("x.tif", pages, {"one_by_one": True}, {}),
        ("x.tif", pages, {"imagej": True}, {}),
        ("x.tif", pages, {"ome": True}, {}),
        ("x.tif", pages, {"bigtiff": True}, {}),
        ("x.tif", pages, {"byteorder": ">"}, {}),
        ("x.tif", pages, {"compression": "lzw"}, {}),
        ("x.tif", pages, {"compression": "zlib", "predictor": 2}, {}),
    ],
)  # fmt: skip
def test_frames_and_labels_are_those_that_were_written(
    tmp_path, name, write, arrays, settings
):
    write(tmp_path / name, **arrays)
    recording = open_recording(tmp_path / name, **settings)
    check(recording)
    window = open_recording(tmp_path / name, crop=[1, 0, 4, 3], subsample=2, **settings)
    assert np.array_equal(window[:], FRAMES[:, ::2, 1::2])


def test_other_arrays_are_samples_or_values_with_names_and_units(tmp_path):
    path = tmp_path / "x.npz"
    about = {"order": [3, 2, 1, 0], "time": np.arange(N) / 2, "other": np.zeros(3)}
    npz(path, frames=FRAMES, labels=TEXTS, **about)
    recording = open_recording(path)
    assert list(recording.samples) == ["order", "time"]
    assert recording.order.tolist() == [3, 2, 1, 0]
    timed = open_recording(path, value_columns=["time"])
    assert timed.values.ravel().tolist() == [0, 0.5, 1, 1.5]
    values = np.arange(8.0).reshape(N, 2)
    names = {"value_names": ["force", "x"], "value_units": ["N", ""]}
    npz(path, frames=FRAMES, values=values, **names)
    both, only = open_recording(path), open_recording(path, value_columns=["x"])
    assert (both.value_names, both.value_units) == (("force", "x"), ("N", ""))
    assert np.array_equal(both.values, values)
    assert np.array_equal(only.values, values[:, 1:])
    npz(path, frames=FRAMES, labels=TEXTS, values=values[:, 0])
    assert open_recording(path).values is None  # unless these are named
    assert open_recording(path, value_columns=["value"]).value_names == ("value",)


def test_axes_and_groups_are_named(tmp_path):
    path = tmp_path / "x.npy"
    np.save(path, FRAMES.reshape(2, 2, H, W))
    recording = open_recording(path, axes=("label", "order", "height", "width"))
    check(recording, [*"0011"])
    assert recording.order.tolist() == [0, 1, 0, 1]
    values = open_recording(path, axes=["session", "value", "height", "width"])
    assert values.values[:, 0].tolist() == [0, 1, 0, 1]
    assert values.session.tolist() == [0, 0, 1, 1]
    for axes in ("label,label,height,width", "label,order,height,feature",
                 "x,y,height,width", "label"):  # fmt: skip
        with pytest.raises(SettingError, match="axes: expected 4 different names"):
            open_recording(path, axes=axes.split(","))
    path = tmp_path / "x.h5"
    runs = {
        "1__frames": FRAMES,
        "1__labels": NAMES,
        "2__frames": CUBE,
        "2__labels": NAMES[:3],
    }
    h5(path, **runs)  # fmt: skip
    check(open_recording(f"{path}:/1/frames"))
    check(open_recording(f"{path}:/1/frames", labels="1/labels"))
    assert open_recording(f"{path}:/2/frames").names == NAMES[:3]
    with pytest.raises(SettingError, match=r"expected one of 1/frames .*; no y"):
        open_recording(f"{path}:/y")


def test_vectors_have_no_crop(tmp_path):
    npz(tmp_path / "x.npz", frames=FRAMES.reshape(N, -1), labels=TEXTS)
    recording = open_recording(tmp_path / "x.npz", subsample=7)
    assert recording.frame_shape == (3,)
    assert np.array_equal(recording[:], FRAMES.reshape(N, -1)[:, ::7])
    with pytest.raises(SettingError, match="crop: expected null for frames that are"):
        open_recording(tmp_path / "x.npz", crop=[0, 0, 5, 1])


@pytest.mark.parametrize(
    ("name", "write", "arrays", "choices"),
    [
        # Two axes are as long as there are labels: one was taken.
        ("x.mat", mat, {"c": CUBE[:, :4, :3], "labels": NAMES[:3]},
         ["--axes frame,height,width", "--axes height,width,frame"]),
        ("x.npz", npz, {"a": FRAMES, "b": CUBE, "labels": TEXTS}, ["x.npz:/a", "x.npz:/b"]),
        ("x.mat", save_v73, {"cube": CUBE, "kind": LABELS[None]},
         ["--labels kind", "--column kind"]),
        # Three planes of floats: they were read as red, green and blue.
        ("x.npy", npy, {"frames": RNG.random((4, 3, 8, 9)), "labels": NAMES},
         ["--axes frame,channel,height,width", "--axes frame,order,height,width"]),
    ],
)  # fmt: skip
def test_what_has_several_readings_names_them(tmp_path, name, write, arrays, choices):
    write(tmp_path / name, **arrays)
    with pytest.raises(Ambiguous) as caught:
        open_recording(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)
    found = [choice.replace(f"{tmp_path}/", "") for choice in caught.value.choices]
    assert found == choices


@pytest.mark.parametrize("axes", [None, ("frame", "height", "width", "channel")])
def test_colour_becomes_luminance_and_other_channels_are_refused(tmp_path, axes):
    """Of four that were named, the last was taken for blue; two ended in a traceback."""
    path = tmp_path / "x.npz"
    colour = RNG.integers(0, 256, (N, 20, 30, 4), np.uint8)
    expected = colour[:, 2:10, 1:10, :3] @ [0.299, 0.587, 0.114]  # ITU-R BT.601
    npz(path, frames=colour[..., :3], labels=TEXTS)
    found = open_recording(path, axes=axes, crop=[1, 2, 9, 8])
    assert np.abs(found[:] - expected).max() <= 1
    npz(path, frames=colour[..., :3].astype(float), labels=TEXTS)
    with pytest.raises(BadFrame, match=r"x.npz, frame 3: .* colour of uint8, uint16"):
        open_recording(path, axes=axes)[3]
    for channels in (2, 4) if axes else ():
        npz(path, frames=colour[..., :channels], labels=TEXTS)
        with pytest.raises(SettingError, match=f"axes: .* found {channels}"):
            open_recording(path, axes=axes)


def test_a_table_beside_has_a_row_per_frame_in_their_order(tmp_path):
    path = tmp_path / "x.npy"
    npy(path, FRAMES, NAMES)
    rows = [f"{n},{k / 2}" for k, n in enumerate(NAMES)]
    beside(tmp_path / "y", "label,force", *rows)
    check(open_recording(path, labels=tmp_path / "y.csv"))
    force = open_recording(path, table=tmp_path / "y.csv")
    assert force.values[:, 0].tolist() == [0, 0.5, 1, 1.5]
    beside(path, '"frame","label"', *(f"{k},{n}" for k, n in enumerate(NAMES)))
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


# Pixels of a TIFF --------------------------------------------------------------------------------


@pytest.mark.parametrize(("compression", "dtype"), [(None, "u1"), ("lzw", ">u2")])
def test_white_is_zero_is_inverted_at_every_depth_and_said(
    tmp_path, compression, dtype
):
    """At 8 bits it came inverted, and at 16 not. TIFF 6.0: 0 is imaged as white."""
    frames = (FRAMES // 300).astype(dtype)
    options = {"photometric": "miniswhite", "compression": compression}
    order = dtype[0] if dtype[0] != "u" else None
    tiff_of(frames, byteorder=order, **options)(tmp_path / "x.tif")
    white = 2 ** (8 * frames.itemsize) - 1
    recording = open_recording(tmp_path / "x.tif")
    check(recording, frames=(white - frames.astype(int)).astype(frames.dtype))
    assert recording.notes[1] == "white is zero: inverted"


@pytest.mark.parametrize("dtype", ["i1", "i2", "f4"])
def test_signed_and_float_pixels_keep_their_sign(tmp_path, dtype):
    frames = (FRAMES // 300).astype(dtype) - 30
    tiff_of(frames, photometric="minisblack")(tmp_path / "x.tif")
    check(open_recording(tmp_path / "x.tif"), frames=frames)


@pytest.mark.parametrize("planar", ["contig", "separate"])
@pytest.mark.parametrize(
    ("samples", "photometric", "expected"),
    [
        (4, "rgb", BYTES[..., :3] @ [0.299, 0.587, 0.114]),
        (2, "minisblack", BYTES[..., 0]),
    ],
)
def test_alpha_is_left_out_and_colour_becomes_luminance(
    tmp_path, planar, samples, photometric, expected
):
    stored = BYTES[..., :samples]
    stored = stored if planar == "contig" else np.moveaxis(stored, -1, 1)
    options = {"photometric": photometric, "planarconfig": planar}
    tiff_of(stored, extrasamples=["unassalpha"], **options)(tmp_path / "x.tif")
    recording = open_recording(tmp_path / "x.tif")
    assert np.abs(recording[:] - expected).max() <= 1
    assert "alpha left out" in recording.notes


def test_a_cell_of_text_is_read_once_and_a_group_in_itself_ends(tmp_path, monkeypatch):
    """hdc look of 20,000 cells took half a minute: each was visited as a dataset, too."""
    names = [f"class {k % 3}" for k in range(200)]
    path = tmp_path / "cells.mat"
    save_v73(path, frames=np.zeros((3, 5, 200), "u1"), labels=names)
    with h5py.File(path, "r+") as file:
        file["again"] = file["/"]
        file["more/frames"] = file["frames"]
    opened, plain = [], h5py.Group.__getitem__

    def counted(group, name):
        opened.append(name)
        return plain(group, name)

    monkeypatch.setattr(h5py.Group, "__getitem__", counted)
    assert open_recording(path).names == names
    assert len(opened) <= 10
