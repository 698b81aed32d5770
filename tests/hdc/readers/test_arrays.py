"""Files of arrays: frames come as they were written, or the file is refused in one line.

They are written by the libraries of the field. Frames are of 3 × 5 pixels and all different: one
that is turned, or an axis that is taken for another, is seen.
"""

import pickle
import subprocess
import sys
import zipfile
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import scipy.io
import tifffile

from hdc.readers import Ambiguous, BadFrame, SettingError, open_recording, stores, tiff
from tests.hdc.readers.matlab import save_v73

N, H, W = 4, 3, 5
RNG = np.random.default_rng(0)
FRAMES = RNG.permutation(N * H * W).astype(np.uint16).reshape(N, H, W) * 300
NAMES = ["a", "bb", "a", "bb"]
LABELS = np.array([1.0, 2, 1, 2])
CUBE = np.moveaxis(FRAMES, 0, -1)  # [H, W, N], as MATLAB shows a stack
TEXTS = np.array(NAMES)


def check(recording, names=NAMES, frames=FRAMES):
    assert recording.shape == frames.shape
    assert recording.dtype == frames.dtype.newbyteorder("=")
    assert np.array_equal(recording[:], frames)
    assert np.array_equal(recording[[2, 0]], frames[[2, 0]])
    assert np.array_equal(next(recording.stream([1])), frames[1])
    assert recording[[]].shape == (0, *frames.shape[1:])
    assert recording.names == names


def beside(path, *rows):
    path.with_suffix(".csv").write_text("\n".join(rows))


# Writers: each has arrays by name ----------------------------------------------------------------


def npz(path, **arrays):
    np.savez(path, **arrays)


def npy(path, frames, labels):
    np.save(path, frames)
    beside(path, "label", *map(str, labels))


def mat(path, **arrays):
    cells = {k: np.array(a, object) for k, a in arrays.items() if isinstance(a, list)}
    scipy.io.savemat(path, arrays | cells)


def h5(path, **arrays):
    with h5py.File(path, "w") as file:
        for name, array in arrays.items():
            file[name.replace("__", "/")] = array


def enumerated(path, frames, labels):
    with h5py.File(path, "w") as file:
        file["frames"] = frames
        kind = h5py.enum_dtype({"a": 0, "bb": 1})
        file.create_dataset("labels", data=np.array(labels) == "bb", dtype=kind)


def characters(path, **arrays):
    """As MATLAB writes rows of characters."""
    save_v73(path, cube=CUBE)
    codes = [[ord(c) for c in name.ljust(2)] for name in NAMES]
    with h5py.File(path, "r+") as file:
        file["labels"] = np.array(codes, np.uint16).T
        file["labels"].attrs["MATLAB_class"] = np.bytes_("char")


def pages(path, **options):
    names = ("imagej", "ome", "bigtiff", "byteorder")
    own = {name: options.pop(name) for name in names if name in options}
    one_by_one = options.pop("one_by_one", False)
    with tifffile.TiffWriter(path, **own) as file:
        for frames in FRAMES if one_by_one else [FRAMES]:
            file.write(
                frames, photometric="minisblack", contiguous=not one_by_one, **options
            )
    beside(path, "label", *NAMES)


@pytest.mark.parametrize(
    ("name", "write", "arrays", "settings"),
    [
        ("x.npz", npz, {"frames": FRAMES, "labels": TEXTS}, {}),
        ("x.npz", npz, {"frames": FRAMES.astype(">u2", order="F"), "labels": TEXTS}, {}),
        ("x.npz", npz, {"frames": FRAMES, "labels": [0, 1, 0, 1], "classes": ["a", "bb"]}, {}),
        ("x.npz", npz, {"frames": FRAMES, "kind": TEXTS}, {"labels": "kind"}),
        ("x.npz", npz, {"cube": CUBE, "labels": TEXTS}, {}),
        ("x.npy", npy, {"frames": FRAMES, "labels": NAMES}, {}),
        ("x.npy", npy, {"frames": CUBE, "labels": NAMES}, {}),
        ("x.mat", mat, {"cube": CUBE, "labels": NAMES}, {}),
        ("x.mat", save_v73, {"cube": CUBE, "labels": NAMES}, {}),
        ("x.mat", mat, {"cube": FRAMES, "labels": NAMES}, {}),  # from Python
        ("x.mat", mat, {"s": {"cube": CUBE, "y": TEXTS}}, {"labels": "y"}),
        ("x.mat", mat, {"cube": CUBE, "labels": LABELS, "classes": ["a", "bb", "c"]}, {}),
        ("x.mat", mat, {"cube": CUBE, "labels": LABELS - 1, "classes": ["a", "bb"]}, {}),
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
        ("x.tif", pages, {"tile": (16, 16)}, {}),
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
    assert recording.place(3) == f"{path}, frame 3"
    assert open_recording(path, value_columns=["time"]).values[:, 0].tolist() == [
        0,
        0.5,
        1,
        1.5,
    ]
    values = np.arange(8.0).reshape(N, 2)
    names = {"value_names": ["force", "x"], "value_units": ["N", ""]}
    npz(path, frames=FRAMES, values=values, **names)
    both = open_recording(path)
    assert (both.value_names, both.value_units) == (("force", "x"), ("N", ""))
    assert np.array_equal(both.values, values)
    only = open_recording(path, value_columns=["x"])
    assert np.array_equal(only.values, values[:, 1:])
    npz(path, frames=FRAMES, labels=TEXTS, values=values[:, 0])
    assert (
        open_recording(path).values is None
    )  # labels are learnt unless these are named
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


@pytest.mark.parametrize("named", [False, True])
def test_colour_becomes_luminance_and_other_channels_are_refused(tmp_path, named):
    """Of four that were named, the last was taken for blue; two ended in a traceback."""
    path, axes = tmp_path / "x.npz", ("frame", "height", "width", "channel")
    colour = RNG.integers(0, 256, (N, 20, 30, 4), np.uint8)
    expected = colour[:, 2:10, 1:10, :3] @ [0.299, 0.587, 0.114]  # ITU-R BT.601
    settings = {"axes": axes if named else None, "crop": [1, 2, 9, 8]}
    npz(path, frames=colour[..., :3], labels=TEXTS)
    assert np.abs(open_recording(path, **settings)[:] - expected).max() <= 1
    npz(path, frames=colour[..., :3].astype(float), labels=TEXTS)
    with pytest.raises(BadFrame, match=r"x.npz, frame 3: .* colour of uint8, uint16"):
        open_recording(path, **settings)[3]
    for channels in (2, 4):
        npz(path, frames=colour[..., :channels], labels=TEXTS)
        with pytest.raises(SettingError, match=f"axes: .* found {channels}"):
            open_recording(path, axes=axes)


def test_a_table_beside_has_a_row_per_frame_in_their_order(tmp_path):
    path = tmp_path / "x.npy"
    npy(path, FRAMES, NAMES)
    beside(
        tmp_path / "y", "label,force", *(f"{n},{k / 2}" for k, n in enumerate(NAMES))
    )
    check(open_recording(path, labels=tmp_path / "y.csv"))
    force = open_recording(path, table=tmp_path / "y.csv")
    assert force.values[:, 0].tolist() == [0, 0.5, 1, 1.5]
    beside(path, '"frame","label"', *(f"{k},{n}" for k, n in enumerate(NAMES)))
    check(open_recording(path))  # as R quotes
    for rows, found in (
        ("1,a 2,bb 3,a 4,bb", "1 to 4"),
        ("0,a 2,a 1,bb 3,bb", "0 to 3"),
    ):
        beside(path, "frame,label", *rows.split())
        with pytest.raises(ValueError, match=f"x.csv: .*the order of .* found {found}"):
            open_recording(path)
    beside(path, "label", "a", "bb")
    with pytest.raises(SettingError, match=r"x.npy.* with N = 2, as there are labels"):
        open_recording(path)
    beside(path, "note", *["good"] * N)
    with pytest.raises(ValueError, match=r"x\.csv: expected a label .*found note"):
        open_recording(path, table=path.with_suffix(".csv"), fewest_classes=1)


# What is refused ---------------------------------------------------------------------------------


class Trap:
    """Fails the test if it is unpickled."""

    def __reduce__(self):
        return (pytest.fail, ("it was unpickled",))


TRAPS = np.array([Trap()] * N, dtype=object)
HOLE = np.where(np.arange(N) == 2, np.nan, 1.0)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"frames": None}, r": expected an array of frames \[N, H, W\] or .*labels \(4,\)"),
        ({"labels": None}, ": expected arrays frames and labels, found no labels"),
        ({"frames": TRAPS}, r"\[frames\]: expected plain arrays, found Python objects"),
        ({"labels": TRAPS}, r"\[labels\]: expected plain arrays, found Python objects"),
        ({"classes": TRAPS}, r"\[classes\]: expected plain arrays, found Python objects"),
        ({"frames": FRAMES[:0]}, r"\[frames\]: expected shape \[N, H, W\]"),
        ({"frames": FRAMES > 9}, r"\[frames\]: expected integers or floats, found bool"),
        ({"frames": FRAMES[:, None, None]}, r"\[frames\]: expected shape"),
        ({"labels": TEXTS[:3]}, r"\[frames\]: expected shape .* N = 3, as there are"),
        ({"labels": LABELS / 4}, r"\[labels\]: .* found float64"),
        ({"labels": LABELS / 0}, r"\[labels\]: .* found float64"),
        ({"labels": LABELS + 2.0**53}, r"\[labels\]: .* found float64"),
        ({"labels": LABELS[:, None]}, r"\[labels\]: expected integers or strings \(4,\)"),
        ({"labels": ["a"] * N}, ": expected two classes or more, found only 'a'"),
        ({"labels": ["a", "", "b", "a"]}, ": expected a label of each .* of frame 1"),
        ({"classes": ["c", "d"]}, ": expected one of the 2 classes, found"),
        ({"classes": ["a", "a", "bb"]}, r"\[classes\]: expected different names"),
        ({"order": LABELS.astype("M8[s]")}, "4 numbers in the column order, .*datetime64"),
        ({"session": LABELS[:3]}, r"4 numbers in the column session, found .*\(3,\)"),
        ({"group": LABELS[:, None]}, r"4 numbers in the column group, found .*\(4, 1\)"),
        ({"session": HOLE}, ", frame 2: expected a number in session, found nan"),
        ({"order": HOLE / 0}, ", frame 0: expected a number in order, found inf"),
        ({"labels": None, "values": HOLE}, ", frame 2: expected a number in value"),
        ({"labels": None, "values": np.zeros((3, 2))}, r"N = 3, as there are labels or"),
        ({"labels": None, "values": np.zeros((N, 2, 1))}, r"values\]: expected shape \(4, k"),
        ({"labels": None, "values": np.full((N, 2), "a")}, "0: expected a number in value_0"),
        ({"values": np.zeros((N, 2)), "value_names": ["x"]}, "expected a name and a unit"),
        ({"values": np.zeros((N, 2)), "value_units": ["N"]}, "expected a name and a unit"),
        ({"values": np.zeros((N, 2)), "value_names": ["x", "x"]}, "different names"),
    ],
)  # fmt: skip
def test_arrays_that_would_be_learnt_wrongly_are_refused(tmp_path, changed, message):
    arrays = {"frames": FRAMES, "labels": TEXTS, **changed}
    npz(tmp_path / "x.npz", **{k: a for k, a in arrays.items() if a is not None})
    with pytest.raises(ValueError, match=rf"x.npz.*{message}"):
        open_recording(tmp_path / "x.npz")


def test_pixels_that_are_not_finite_are_refused_when_they_are_asked_for(tmp_path):
    frames = FRAMES.astype(float)
    frames[3, 0, 0] = np.inf
    npz(tmp_path / "x.npz", frames=frames, labels=TEXTS)
    recording = open_recording(tmp_path / "x.npz")
    assert np.array_equal(recording[:3], frames[:3])
    with pytest.raises(BadFrame, match=r"x.npz, frame 3: expected finite numbers"):
        recording[:]


def matlab_string(path):
    save_v73(path, cube=CUBE)
    with h5py.File(path, "r+") as file:
        file["labels"] = np.zeros((1, 6), np.uint32)
        file["labels"].attrs["MATLAB_object_decode"] = 3


def mixed_cells(path):
    cells = np.empty(2, object)
    cells[:] = [np.zeros(2), "a"]
    scipy.io.savemat(path, {"cube": CUBE, "labels": cells})


def with_labels(make):
    def write(path):
        with h5py.File(path, "w") as file:
            make(file)
            file["labels"] = NAMES

    return write


@with_labels
def virtual(file):
    layout = h5py.VirtualLayout((N, H, W), np.uint16)
    layout[:] = h5py.VirtualSource("moved.h5", "frames", (N, H, W))
    file.create_virtual_dataset("frames", layout)


@with_labels
def external(file):
    file.create_dataset("frames", (N, H, W), np.uint8, external=[("gone.raw", 0, 60)])


@with_labels
def half_written(file):
    file.create_dataset("frames", (N, H, W), np.uint8, chunks=(2, H, W))[:2] = 1


@with_labels
def unwritten(file):
    file.create_dataset("frames", (N, H, W), np.uint8)


def cut(suffix, share):
    def write(path):
        pages(path) if suffix == ".tif" else h5(path, frames=FRAMES, labels=NAMES)
        data = path.read_bytes()
        path.write_bytes(data[: int(len(data) * share)])

    return write


def tiff_of(frames, **options):
    def write(path):
        tifffile.imwrite(path, frames, **options)
        beside(path, "label", *NAMES)

    return write


BYTES = RNG.integers(0, 256, (N, H, W, 4), np.uint8)
PALETTE = {"photometric": "palette", "colormap": np.zeros((3, 256), np.uint16)}


@pytest.mark.parametrize(
    ("name", "write", "message"),
    [
        ("x.npz", lambda path: path.write_bytes(pickle.dumps({})), "an intact .npz"),
        ("x.mat", matlab_string, r"\[labels\]: .*: cellstr\(labels\) for text"),
        ("x.mat", mixed_cells, r"\[labels\]: .*: cellstr\(labels\) for text"),
        # HDF5 fills zeros in, without a word.
        ("x.h5", virtual, r"\[frames\]: expected its source moved.h5, found none"),
        ("x.h5", external, r"\[frames\]: expected its source gone.raw, found none"),
        ("x.h5", half_written, r"\[frames\]: expected 2 chunks, found 1"),
        ("x.h5", unwritten, r"\[frames\]: expected 1 chunks, found 0"),
        ("x.h5", cut(".h5", 0.5), ": expected an intact .h5, found"),
        ("x.tif", cut(".tif", 0.01), ": expected a whole"),
        ("x.tif", cut(".tif", 0.5), ": expected a whole"),
        ("x.tif", cut(".tif", 0.97), ": expected a whole"),
        ("x.tif", tiff_of(BYTES[..., 0], **PALETTE), "grey or RGB, .* 1 of PALETTE"),
        ("x.tif", tiff_of(FRAMES.astype("i2"), photometric="miniswhite"),
         "unsigned pixels where white is zero, found int16"),
        # Four grey samples, such as a polariser's angles, were read as red, green and blue.
        ("x.tif", tiff_of(BYTES, photometric="minisblack", planarconfig="contig",
                          extrasamples=["unspecified"] * 3), "found 4 of MINISBLACK"),
        ("x.tif", tiff_of(BYTES[..., :2], photometric="minisblack", planarconfig="contig",
                          extrasamples=["unspecified"]), "found 2 of MINISBLACK"),
    ],
)  # fmt: skip
def test_files_that_would_be_read_wrongly_are_refused(tmp_path, name, write, message):
    write(tmp_path / name)
    with pytest.raises(ValueError, match=rf"{name}.*{message}") as caught:
        open_recording(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_virtual_dataset_beside_its_source_is_read(tmp_path):
    h5(tmp_path / "moved.h5", frames=FRAMES)
    virtual(tmp_path / "v.h5")
    check(open_recording(tmp_path / "v.h5"))


def test_a_dataset_that_cannot_be_read_is_named(tmp_path):
    path = tmp_path / "c.h5"
    with h5py.File(path, "w") as file:
        chunks = {"chunks": (1, H, W), "compression": "gzip", "fletcher32": True}
        file.create_dataset("frames", data=FRAMES, **chunks)
        file["labels"] = NAMES
        start = file["frames"].id.get_chunk_info(3).byte_offset
    data = bytearray(path.read_bytes())
    data[start + 9] ^= 255
    path.write_bytes(data)
    recording = open_recording(path)
    assert np.array_equal(recording[:3], FRAMES[:3])
    with pytest.raises(BadFrame, match=r"c\.h5\[frames\]: expected a dataset that can"):
        recording[3]


def test_what_is_no_array_of_an_archive_is_left_out_and_said(tmp_path):
    """An object that nobody needs, and files beside the arrays, made all of it unreadable."""
    path = tmp_path / "x.npz"
    npz(path, frames=FRAMES, labels=TEXTS, notes=TRAPS)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("meta.json", "{}")
        archive.writestr("folder/", "")
    recording = open_recording(path)
    check(recording)
    assert recording.notes[1] == "not read: notes, meta.json, folder/"


@pytest.mark.parametrize(
    ("name", "write"),
    [("a.npy", np.save), ("a.tif", tifffile.imwrite)],
)
def test_a_file_that_is_rewritten_meanwhile_is_an_error(tmp_path, name, write):
    """It ended the process with a bus error."""
    write(tmp_path / name, np.zeros((40, 200, 300), np.uint8))
    recording = open_recording(tmp_path / name, fewest_classes=0)
    assert recording[39].sum() == 0
    write(tmp_path / name, np.zeros((1, 200, 300), np.uint8))
    with pytest.raises(BadFrame, match=f"{name}: expected the file as it was opened"):
        recording[39]


def test_a_folder_without_room_for_compressed_pages_is_named(tmp_path, monkeypatch):
    pages(tmp_path / "z.tif", compression="zlib")
    usage = SimpleNamespace(free=100)
    monkeypatch.setattr(tiff.shutil, "disk_usage", lambda _: usage)
    with pytest.raises(BadFrame, match=r"z\.tif: expected 120 bytes free in .* 100"):
        open_recording(tmp_path / "z.tif")


def test_a_missing_library_is_named_with_its_extra(tmp_path):
    pages(tmp_path / "x.tif", compression="lzw")
    code = (
        "import sys; sys.modules['imagecodecs'] = None\n"
        "from hdc.readers import open_recording\n"
        f"try: open_recording({str(tmp_path / 'x.tif')!r})\n"
        "except ModuleNotFoundError as error: print(error, '.', error.name)"
    )
    said = subprocess.check_output([sys.executable, "-c", code], text=True)
    package = "expected the package imagecodecs, found none"
    assert said == f"{package}; pip install 'speckle-hdc[files]' . imagecodecs\n"


def test_frames_come_last_in_files_of_matlab_alone(tmp_path):
    save_v73(tmp_path / "x.mat", cube=CUBE)
    assert open_recording(tmp_path / "x.mat", fewest_classes=0).shape == (N, H, W)
    (tmp_path / "x.mat").rename(tmp_path / "x.h5")
    assert stores.load(tmp_path / "x.h5").frames_last
    h5(tmp_path / "y.h5", cube=FRAMES)
    assert not stores.load(tmp_path / "y.h5").frames_last


# Pixels of a TIFF --------------------------------------------------------------------------------


@pytest.mark.parametrize("compression", [None, "lzw"])
@pytest.mark.parametrize("dtype", ["u1", "<u2", ">u2"])
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
    ("samples", "photometric", "extra", "expected"),
    [
        (4, "rgb", "unassalpha", BYTES[..., :3] @ [0.299, 0.587, 0.114]),
        (4, "rgb", "unspecified", BYTES[..., :3] @ [0.299, 0.587, 0.114]),
        (2, "minisblack", "assocalpha", BYTES[..., 0]),
    ],
)
def test_alpha_is_left_out_and_colour_becomes_luminance(
    tmp_path, planar, samples, photometric, extra, expected
):
    stored = BYTES[..., :samples]
    stored = stored if planar == "contig" else np.moveaxis(stored, -1, 1)
    options = {"photometric": photometric, "planarconfig": planar}
    tiff_of(stored, extrasamples=[extra], **options)(tmp_path / "x.tif")
    recording = open_recording(tmp_path / "x.tif")
    assert np.abs(recording[:] - expected).max() <= 1
    assert "alpha left out" in recording.notes
