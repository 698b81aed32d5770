"""Files of arrays that would be learnt wrongly are refused, in one line that names them."""

import pickle
import subprocess
import sys
import zipfile
from functools import partial

import h5py
import numpy as np
import pytest
import scipy.io
import tifffile

from hdc.readers import BadFrame, open_recording
from tests.hdc.readers.writers import (
    BYTES,
    CUBE,
    FRAMES,
    LABELS,
    NAMES,
    TEXTS,
    H,
    N,
    W,
    check,
    h5,
    npz,
    pages,
    save_v73,
    virtual,
)


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
        ({"frames": FRAMES[:0]}, r"\[frames\]: expected frames of .* found uint16 \(0, 3, 5\)"),
        ({"frames": FRAMES > 9}, r"\[frames\]: expected frames of integers or floats, found bool"),
        ({"frames": FRAMES / HOLE[:, None, None]}, ", frame 2: expected finite numbers"),
        ({"labels": TEXTS[:3]}, r"\[frames\]: expected shape .* N = 3, as there are"),
        ({"labels": LABELS / 4}, r": expected labels that are integers .* found float64"),
        ({"labels": ["a"] * N}, ": expected two classes or more, found only 'a'"),
        ({"labels": LABELS, "classes": ["a", "bb"]}, r"\[classes\]: .* classes\[labels\]"),
        ({"order": LABELS.astype("M8[s]")}, "4 numbers in the column order, .*datetime64"),
        ({"group": LABELS[:, None]}, r"4 numbers in the column group, found .*\(4, 1\)"),
        ({"session": HOLE}, ", frame 2: expected a number in session, found nan"),
        ({"labels": None, "values": np.zeros((3, 2))}, r"N = 3, as there are labels or"),
        ({"labels": None, "values": np.zeros((N, 2, 1))}, r"values\]: expected shape \(4, k"),
        ({"values": np.zeros((N, 2)), "value_names": ["x"]}, "k different names and k units"),
    ],
)  # fmt: skip
def test_arrays_that_would_be_learnt_wrongly_are_refused(tmp_path, changed, message):
    arrays = {"frames": FRAMES, "labels": TEXTS, **changed}
    npz(tmp_path / "x.npz", **{k: a for k, a in arrays.items() if a is not None})
    with pytest.raises(ValueError, match=rf"x.npz.*{message}"):
        open_recording(tmp_path / "x.npz")[:]


def matlab_string(path):
    save_v73(path, cube=CUBE)
    with h5py.File(path, "r+") as file:
        file["labels"] = np.zeros((1, 6), np.uint32)
        file["labels"].attrs["MATLAB_object_decode"] = 3


def mixed_cells(path):
    cells = np.empty(2, object)
    cells[:] = [np.zeros(2), "a"]
    scipy.io.savemat(path, {"cube": CUBE, "labels": cells})


def dataset(path, written=0, **options):
    """A dataset of which a number of frames are written."""
    with h5py.File(path, "w") as file:
        frames = file.create_dataset("frames", (N, H, W), np.uint8, **options)
        file["labels"] = NAMES
        if written:
            frames[:written] = 1


def cut(path, write, share, **arrays):
    write(path, **arrays)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])


def overwritten(path, write, after, **arrays):
    """With other bytes behind these."""
    write(path, **arrays)
    data = path.read_bytes()
    at = data.index(after) + len(after)
    path.write_bytes(data[:at] + bytes(4) + data[at + 4 :])


CHECKED = {"chunks": (1, H, W), "fletcher32": True}
PALETTE = {"photometric": "palette", "colormap": np.zeros((3, 256), np.uint16)}
SAMPLES = {"planarconfig": "contig", "extrasamples": ["unspecified"] * 3}


@pytest.mark.parametrize(
    ("name", "write", "message"),
    [
        ("x.npz", lambda path: path.write_bytes(pickle.dumps({})), "an intact .npz"),
        ("x.mat", matlab_string, r"\[labels\]: .*: cellstr\(labels\) for text"),
        ("x.mat", mixed_cells, r"\[labels\]: .*: cellstr\(labels\) for text"),
        # HDF5 fills zeros in, without a word.
        ("x.h5", virtual, r"\[frames\]: expected its source moved.h5, found none"),
        ("x.h5", partial(dataset, external=[("gone.raw", 0, 60)]),
         r"\[frames\]: expected its source gone.raw, found none"),
        ("x.h5", partial(dataset, written=2, chunks=(2, H, W)),
         r"\[frames\]: expected 2 chunks, found 1"),
        ("x.h5", partial(overwritten, write=dataset, after=b"\1" * 9, written=N, **CHECKED),
         r"\[frames\]: expected a dataset that can be read"),
        ("x.h5", partial(cut, write=h5, share=0.5, frames=FRAMES, labels=NAMES),
         ": expected an intact .h5, found"),
        ("x.tif", partial(cut, write=pages, share=0.01), ": expected a whole"),
        ("x.tif", partial(cut, write=pages, share=0.97), ": expected a whole"),
        ("x.tif", partial(pages, frames=BYTES[..., 0], **PALETTE), "grey or RGB .* 1 of PALETTE"),
        # At 8 bits white was the smallest number, and at 16 the largest.
        ("x.tif", partial(pages, photometric="miniswhite"), "grey or RGB .* 1 of MINISWHITE"),
        ("x.tif", partial(pages, frames=FRAMES > 9), "grey or RGB .* 1 bits"),
        # Four grey samples, such as a polariser's angles, were read as red, green and blue.
        ("x.tif", partial(pages, frames=BYTES, **SAMPLES), "found 4 of MINISBLACK"),
    ],
)  # fmt: skip
def test_files_that_would_be_read_wrongly_are_refused(tmp_path, name, write, message):
    write(tmp_path / name)
    with pytest.raises(ValueError, match=rf"{name}.*{message}") as caught:
        open_recording(tmp_path / name)[:]
    assert "\n" not in str(caught.value)


def test_a_filter_of_hdf5_that_is_not_installed_is_named(tmp_path, monkeypatch):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file.create_dataset("frames", data=FRAMES, compression="gzip")
    monkeypatch.setattr(h5py.h5z, "filter_avail", lambda _: False)
    said = r"x\.h5\[frames\]: expected a filter that is installed, found deflate \(1\)"
    with pytest.raises(BadFrame, match=said):
        open_recording(tmp_path / "x.h5")


def test_what_is_no_array_of_an_archive_is_left_out_and_said(tmp_path):
    """An object that nobody needs, and files beside the arrays, made all of it unreadable."""
    path = tmp_path / "x.npz"
    npz(path, frames=FRAMES, labels=TEXTS, notes=TRAPS)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("meta.json", "{}")
        archive.writestr("folder/", "")
    recording = open_recording(path)
    check(recording)
    said = "notes is not read, expected plain arrays, found Python objects"
    assert recording.notes[1].startswith(said)
    other = "is not read, expected an .npy, found another file"
    assert recording.notes[2:] == (f"meta.json {other}", f"folder/ {other}")


@pytest.mark.parametrize(
    ("name", "write"), [("a.npy", np.save), ("a.tif", tifffile.imwrite)]
)
def test_a_file_that_is_rewritten_meanwhile_is_an_error(tmp_path, name, write):
    """It ended the process with a bus error."""
    write(tmp_path / name, np.zeros((40, 200, 300), np.uint8))
    recording = open_recording(tmp_path / name, fewest_classes=0)
    assert recording[39].sum() == 0
    write(tmp_path / name, np.zeros((1, 200, 300), np.uint8))
    with pytest.raises(BadFrame, match=f"{name}: expected the file as it was opened"):
        recording[39]


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
