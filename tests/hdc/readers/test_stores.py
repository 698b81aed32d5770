"""Files of other programs: frames come as they were written, or the file is refused in one line.

They are written by the libraries of the field. Frames are of 3 × 5 pixels and all different: one
that is turned, or an axis that is taken for another, is seen.
"""

import subprocess
import sys
import zipfile
from types import SimpleNamespace

import cv2
import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
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
MATLAB = np.moveaxis(FRAMES, 0, -1)  # [H, W, N], as MATLAB shows a stack


def check(recording, names=NAMES):
    assert recording.shape == (N, H, W)
    assert recording.dtype == np.uint16
    assert np.array_equal(recording[:], FRAMES)
    assert np.array_equal(recording[[2, 0]], FRAMES[[2, 0]])
    assert recording[[]].shape == (0, H, W)
    assert recording.names == names


def refused(path, message, kind=ValueError, **settings):
    with pytest.raises(kind, match=message) as caught:
        open_recording(path, **settings)
    assert "\n" not in str(caught.value)
    return caught.value


# MATLAB and HDF5 ---------------------------------------------------------------------------------


def save_v5(path, **arrays):
    cells = {k: np.array(a, object) for k, a in arrays.items() if isinstance(a, list)}
    scipy.io.savemat(path, arrays | cells)


@pytest.mark.parametrize("save", [save_v5, save_v73])
def test_frames_of_matlab_are_those_that_it_shows(tmp_path, save):
    def saved(**arrays):
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.mat"
        save(path, **arrays)
        return path

    path = saved(cube=MATLAB, labels=NAMES, trial=np.arange(N)[None] + 0.5)
    recording = open_recording(path)
    check(recording)
    assert recording.notes == ("0.mat[cube] (3, 5, 4) as height, width, frame",)
    assert recording.samples["trial"].tolist() == [0.5, 1.5, 2.5, 3.5]
    path = saved(cube=MATLAB, kind=LABELS[None])
    check(open_recording(path, labels="kind"), ["1", "2", "1", "2"])
    refused(path, "no array labels: expected one of --labels kind; or --column kind")
    path = saved(cube=MATLAB, cube2=MATLAB, labels=LABELS[None])
    error = refused(path, "several arrays: expected one of", Ambiguous)
    assert error.choices == (f"{path}:/cube", f"{path}:/cube2")
    check(open_recording(f"{path}:/cube2"), ["1", "2", "1", "2"])
    check(open_recording(saved(cube=FRAMES, labels=NAMES)))  # frames first, from Python


@pytest.mark.parametrize("save", [save_v5, save_v73])
def test_a_cube_with_two_axes_as_long_as_the_labels_is_refused(tmp_path, save):
    """cracks: [H, W, N] with H = N was taken as [N, H, W]."""
    path, cube = tmp_path / "x.mat", MATLAB[:, :4, :3]
    save(path, cube=cube, labels=LABELS[None, :3])
    error = refused(path, "for 3 labels: expected one of", Ambiguous)
    readings = ("frame,height,width", "height,width,frame")
    assert error.choices == tuple(f"--axes {reading}" for reading in readings)
    first = open_recording(path, axes=readings[0].split(","))
    assert np.array_equal(first[:], cube)
    last = open_recording(path, axes=readings[1].split(","))
    assert np.array_equal(last[:], np.moveaxis(cube, -1, 0))


@pytest.mark.parametrize("save", [save_v5, save_v73])
@pytest.mark.parametrize("first", [0, 1])
def test_numbers_of_classes_count_from_one_in_matlab(tmp_path, save, first):
    """Unless one is 0. The names were shifted where the last class had no frame."""
    path = tmp_path / "x.mat"
    labels = LABELS[None] - 1 + first
    save(path, cube=MATLAB, labels=labels, classes=["a", "bb", "none"])
    recording = open_recording(path)
    check(recording)
    assert recording.classes == ("a", "bb", "none")


def test_rows_of_characters_and_fields_of_a_struct_are_read(tmp_path):
    path = tmp_path / "x.mat"
    scipy.io.savemat(path, {"s": {"cube": MATLAB, "y": np.array(NAMES)}})
    check(open_recording(path, labels="y"))


@pytest.mark.parametrize("names", ["labels", "texts"])
def test_frames_of_hdf5_come_first(tmp_path, names):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file["run/frames"] = FRAMES
        file["run/labels"] = NAMES if names == "texts" else LABELS.astype(int)
    expected = NAMES if names == "texts" else ["1", "2", "1", "2"]
    check(open_recording(path), expected)  # labels of the same group are known by name
    with h5py.File(path, "a") as file:
        file["later/frames"] = FRAMES[:3]
        file["later/labels"] = file["run/labels"][1:]
    check(open_recording(f"{path}:/run/frames"), expected)
    later = open_recording(f"{path}:/later/frames")
    assert later.names == expected[1:]
    check(open_recording(f"{path}:/run/frames", labels="run/labels"), expected)
    refused(f"{path}:/y", "expected one of later/frames .*; no y")
    cut = path.read_bytes()[: path.stat().st_size // 2]
    (tmp_path / "cut.h5").write_bytes(cut)
    refused(tmp_path / "cut.h5", "cut.h5: expected an intact .h5, found")


def test_labels_of_hdf5_are_whole_numbers_one_a_frame(tmp_path):
    """A column of floats ended in a traceback, and infinity became a class."""
    for k, labels in enumerate((LABELS[:, None], [1, 2, 1, np.inf])):
        path = tmp_path / f"{k}.h5"
        with h5py.File(path, "w") as file:
            file["frames"], file["labels"] = FRAMES, labels
        refused(path, r"\[labels\]: expected integers or strings \(4,\), found float64")


def test_what_matlab_saves_in_forms_of_its_own_is_named_with_what_to_do(tmp_path):
    path = tmp_path / "x.mat"
    save_v73(path, cube=MATLAB)
    with h5py.File(path, "r+") as file:
        file["labels"] = np.zeros((1, 6), np.uint32)
        file["labels"].attrs["MATLAB_class"] = np.bytes_("string")
        file["labels"].attrs["MATLAB_object_decode"] = 3
    refused(path, r"not read: labels: .*: cellstr\(labels\) for text")


def test_characters_and_plain_numbers_of_version_73_are_read(tmp_path):
    """Rows of characters are labels; numbers without MATLAB's mark are as MATLAB shows them."""
    path = tmp_path / "x.mat"
    save_v73(path, cube=MATLAB)
    width = max(map(len, NAMES))
    codes = [[ord(c) for c in name.ljust(width)] for name in NAMES]
    with h5py.File(path, "r+") as file:
        file["labels"] = np.array(codes, np.uint16).T
        file["labels"].attrs["MATLAB_class"] = np.bytes_("char")
    check(open_recording(path))
    assert stores.load(path).frames_last
    save_v73(tmp_path / "y.mat", cube=MATLAB)
    with h5py.File(tmp_path / "y.mat", "r+") as file:
        del file["cube"].attrs["MATLAB_class"]
    assert stores.load(tmp_path / "y.mat").frames_last
    (tmp_path / "y.mat").rename(tmp_path / "y.h5")
    assert not stores.load(tmp_path / "y.h5").frames_last


def test_what_matlab_saves_otherwise_is_named(tmp_path):
    path = tmp_path / "x.mat"
    cell = np.empty(2, object)
    cell[:] = [np.zeros(2), "a"]
    scipy.io.savemat(path, {"cube": MATLAB, "labels": cell})
    refused(path, "not read: labels: no numbers or text that MATLAB saves plainly")


# A table beside ----------------------------------------------------------------------------------


def test_a_table_beside_labels_a_cube(tmp_path):
    np.save(tmp_path / "x.npy", FRAMES)
    rows = "".join(f"{name},{k / 2}\n" for k, name in enumerate(NAMES))
    (tmp_path / "x.csv").write_text(f"label,force\n{rows}")
    check(open_recording(tmp_path / "x.npy"))
    (tmp_path / "y.csv").write_text(f"label,force\n{rows}")
    check(open_recording(tmp_path / "x.npy", labels=tmp_path / "y.csv"))
    force = open_recording(tmp_path / "x.npy", table=tmp_path / "y.csv")
    assert force.values[:, 0].tolist() == [0, 0.5, 1, 1.5]
    numbered = "".join(f"{k},{name}\n" for k, name in enumerate(NAMES))
    (tmp_path / "x.csv").write_text(f'"frame","label"\n{numbered}')  # as R quotes
    check(open_recording(tmp_path / "x.npy"))
    for wrong, found in (
        ("1,a 2,bb 3,a 4,bb", "1 to 4"),
        ("0,a 2,a 1,bb 3,bb", "0 to 3"),
    ):
        rows = wrong.replace(" ", "\n")
        (tmp_path / "x.csv").write_text(f"frame,label\n{rows}\n")
        refused(
            tmp_path / "x.npy", f"rows in the order of the frames, .*, found {found}"
        )
    (tmp_path / "x.csv").write_text("label\na\nbb\n")
    refused(tmp_path / "x.npy", r"with N = 2, as there are labels")


# TIFF --------------------------------------------------------------------------------------------

STACKS = {
    "pages": {},
    "pages one by one": {"contiguous": False},
    "ImageJ": {"imagej": True},
    "OME": {"ome": True},
    "BigTIFF": {"bigtiff": True},
    "big-endian": {"byteorder": ">"},
    "LZW": {"compression": "lzw"},
    "deflate": {"compression": "zlib", "predictor": 2},
    "tiles": {"tile": (16, 16)},
}


def write_stack(path, frames, contiguous=True, **options):
    with tifffile.TiffWriter(path, **writer_options(options)) as file:
        if contiguous:
            file.write(frames, photometric="minisblack", **options)
        else:
            for frame in frames:
                file.write(frame, photometric="minisblack", contiguous=False)
    path.with_suffix(".csv").write_text("\n".join(["label", *NAMES]))


def writer_options(options):
    names = ("imagej", "ome", "bigtiff", "byteorder")
    return {name: options.pop(name) for name in names if name in options}


@pytest.mark.parametrize("kind", STACKS)
def test_every_frame_of_a_stack_is_read_as_it_was_written(tmp_path, kind):
    """cracks: of an ImageJ stack of 20 frames one was read."""
    path = tmp_path / "x.tif"
    write_stack(path, FRAMES, **dict(STACKS[kind]))
    check(open_recording(path))


@pytest.mark.parametrize("compression", [None, "lzw"])
@pytest.mark.parametrize("dtype", ["u1", "<u2", ">u2"])
def test_white_is_zero_is_inverted_at_every_depth_and_said(
    tmp_path, compression, dtype
):
    """cracks: at 8 bits it came inverted, and at 16 not. TIFF 6.0: 0 is imaged as white."""
    frames = (FRAMES // 300).astype(dtype)
    options = {"photometric": "miniswhite", "compression": compression}
    path = tmp_path / "x.tif"
    tifffile.imwrite(
        path, frames, byteorder=dtype[0] if dtype[0] != "u" else None, **options
    )
    path.with_suffix(".csv").write_text("\n".join(["label", *NAMES]))
    recording = open_recording(path)
    white = 2 ** (8 * frames.itemsize) - 1
    assert np.array_equal(recording[:], white - frames.astype(int))
    assert recording.dtype.isnative
    assert recording.notes[1] == "white is zero: inverted"
    (tmp_path / "r" / "a").mkdir(parents=True)
    tifffile.imwrite(tmp_path / "r" / "a" / "1.tif", frames[0], **options)
    found = open_recording(tmp_path / "r", fewest_classes=1)[0]
    assert np.array_equal(found, white - frames[0].astype(int))
    tifffile.imwrite(path, frames.astype("i2"), photometric="miniswhite")
    refused(path, "expected unsigned pixels where white is zero, found int16", BadFrame)


def test_signed_and_float_pixels_keep_their_sign(tmp_path):
    """cracks: signed 8-bit TIFF was read as unsigned."""
    for dtype in ("i1", "i2", "f4"):
        frames = (FRAMES // 300).astype(dtype) - 30
        write_stack(tmp_path / "x.tif", frames)
        recording = open_recording(tmp_path / "x.tif")
        assert recording.dtype == frames.dtype
        assert np.array_equal(recording[:], frames)


@pytest.mark.parametrize("planar", ["contig", "separate"])
def test_alpha_is_left_out_and_colour_becomes_luminance(tmp_path, planar):
    colour = RNG.integers(0, 256, (N, H, W, 4), np.uint8)
    stored = colour if planar == "contig" else np.moveaxis(colour, -1, 1)
    options = {
        "photometric": "rgb",
        "extrasamples": ["unassalpha"],
        "planarconfig": planar,
    }
    tifffile.imwrite(tmp_path / "x.tif", stored, **options)
    (tmp_path / "x.csv").write_text("\n".join(["label", *NAMES]))
    recording = open_recording(tmp_path / "x.tif")
    luminance = colour[..., :3] @ [0.299, 0.587, 0.114]  # ITU-R BT.601
    assert np.abs(recording[:] - luminance).max() <= 1
    assert "alpha left out" in recording.notes


@pytest.mark.parametrize("planar", ["contig", "separate"])
def test_samples_of_a_pixel_are_grey_colour_or_alpha(tmp_path, planar):
    """Four grey samples, such as a polariser's angles, were read as red, green and blue."""
    path = tmp_path / "x.tif"
    path.with_suffix(".csv").write_text("\n".join(["label", *NAMES]))
    pixels = RNG.integers(0, 256, (N, H, W, 4), np.uint8)

    def write(samples, photometric, extra):
        stored = pixels[..., :samples]
        if planar == "separate":
            stored = np.moveaxis(stored, -1, 1)
        options = {"photometric": photometric, "planarconfig": planar}
        tifffile.imwrite(path, stored, extrasamples=extra, **options)

    write(4, "minisblack", ["unspecified"] * 3)
    refused(path, "at most alpha beside them, found 4 of MINISBLACK", BadFrame)
    write(2, "minisblack", ["unspecified"])
    refused(path, "at most alpha beside them, found 2 of MINISBLACK", BadFrame)
    write(2, "minisblack", ["assocalpha"])
    assert np.array_equal(open_recording(path)[:], pixels[..., 0])
    write(4, "rgb", ["unspecified"])
    luminance = pixels[..., :3] @ [0.299, 0.587, 0.114]  # ITU-R BT.601
    assert np.abs(open_recording(path)[:] - luminance).max() <= 1


def test_a_tiff_that_is_cut_or_of_a_palette_is_refused(tmp_path):
    path = tmp_path / "x.tif"
    write_stack(path, FRAMES)
    whole = path.read_bytes()
    for length in (9, len(whole) // 2, len(whole) - 20):
        path.write_bytes(whole[:length])
        refused(path, "x.tif: expected a whole", BadFrame)
    palette = np.zeros((3, 256), np.uint16)
    tifffile.imwrite(
        path, np.zeros((N, H, W), "u1"), photometric="palette", colormap=palette
    )
    refused(path, "expected grey or RGB, found PALETTE", BadFrame)


# Parquet -----------------------------------------------------------------------------------------


def png(frame):
    return cv2.imencode(".png", frame)[1].tobytes()


@pytest.mark.parametrize("form", ["bytes", "struct"])
def test_images_of_a_parquet_are_read_group_by_group(tmp_path, form):
    cells = [png(frame) for frame in FRAMES]
    images = cells if form == "bytes" else [{"bytes": c, "path": None} for c in cells]
    table = pa.table({"image": images, "label": NAMES, "force": [0.5, 1, 2, 4]})
    path = tmp_path / "x.parquet"
    pq.write_table(table, path, row_group_size=3)
    check(open_recording(path))
    assert open_recording(path, value_columns=["force"]).values[:, 0].tolist() == [
        0.5,
        1,
        2,
        4,
    ]
    pq.write_table(table.rename_columns(["picture", "kind", "force"]), path)
    check(open_recording(path, labels="kind"))
    assert open_recording(path).value_names == ("force",)
    refused(path, "labels: .*expected one of kind, force, found 'y'", labels="y")
    pq.write_table(table.append_column("depth", table["image"]).rename_columns(
        ["rgb", "label", "force", "depth"]), path)  # fmt: skip
    error = refused(path, "several columns of images", Ambiguous)
    assert str(error).startswith(f"{path}: several columns of images")
    assert error.choices == ("--image-column rgb", "--image-column depth")
    check(open_recording(path, image_column="depth"))
    pq.write_table(table.select(["label", "force"]), path)
    refused(path, r"expected a column of encoded images, found label .string., force")
    path.write_bytes(path.read_bytes()[:-9])
    refused(path, "x.parquet: expected an intact parquet file")


def test_classes_that_are_numbered_have_the_names_that_the_file_states(tmp_path):
    """As Hugging Face writes the feature ClassLabel."""
    info = b'{"info": {"features": {"label": {"names": ["a", "bb"], "_type": "ClassLabel"}}}}'
    cells = [png(frame) for frame in FRAMES]
    table = pa.table({"image": cells, "label": [0, 1, 0, 1]})
    table = table.replace_schema_metadata({"huggingface": info})
    pq.write_table(table, tmp_path / "x.parquet")
    check(open_recording(tmp_path / "x.parquet"))


@pytest.mark.parametrize("kind", [pa.dictionary(pa.int8(), pa.string()), pa.bool_()])
def test_labels_of_every_kind_of_column_are_taken(tmp_path, kind):
    """A data frame has categories and truth values, too."""
    names = NAMES if kind != pa.bool_() else [name == "a" for name in NAMES]
    columns = {
        "image": [png(frame) for frame in FRAMES],
        "label": pa.array(names, kind),
    }
    pq.write_table(pa.table(columns), tmp_path / "x.parquet")
    check(open_recording(tmp_path / "x.parquet"), [str(name) for name in names])


@pytest.mark.parametrize(
    "stated", ["{}", "no JSON", '{"info": {"features": null}}', "[]"]
)
def test_other_metadata_of_a_parquet_is_no_error(tmp_path, stated):
    table = pa.table({"image": [png(frame) for frame in FRAMES], "label": NAMES})
    table = table.replace_schema_metadata({"huggingface": stated})
    pq.write_table(table, tmp_path / "x.parquet")
    check(open_recording(tmp_path / "x.parquet"))


def test_a_damaged_parquet_is_named(tmp_path):
    path = tmp_path / "x.parquet"
    table = pa.table({"image": [png(frame) for frame in FRAMES], "label": NAMES})
    pq.write_table(table, path, compression="gzip")
    whole = path.read_bytes()
    said = []
    for place in range(4, len(whole) - 8, 37):
        damaged = bytearray(whole)
        damaged[place : place + 4] = b"\xff" * 4
        path.write_bytes(damaged)
        try:
            open_recording(path)[:]
        except ValueError as error:
            said.append(str(error))
    assert len(said) > 10
    assert all("x.parquet" in text for text in said)


def test_a_row_with_another_image_or_none_is_named(tmp_path):
    path = tmp_path / "x.parquet"
    for cell, message in ((None, "an image, found none"), (png(FRAMES[0].T), "5 × 3")):
        cells = [*map(png, FRAMES[:3]), cell]
        pq.write_table(pa.table({"image": cells, "label": NAMES}), path)
        with pytest.raises(BadFrame, match=f"x.parquet, row 3: expected {message}"):
            open_recording(path)[:]


def test_a_parquet_without_rows_or_with_a_row_without_a_label_is_refused(tmp_path):
    path = tmp_path / "x.parquet"
    images = [png(frame) for frame in FRAMES]
    table = pa.table({"image": images, "label": ["a", "b", None, "a"]})
    pq.write_table(table, path)
    refused(path, r"x.parquet: expected a label of each frame, found none of frame 2")
    pq.write_table(table.slice(0, 0), path)
    refused(path, r"x.parquet: expected a row per frame, found none", fewest_classes=0)


def test_a_column_of_images_that_is_named_is_taken_or_refused(tmp_path):
    """The only one was taken, whatever was named."""
    path = tmp_path / "x.parquet"
    pq.write_table(pa.table({"rgb": [png(f) for f in FRAMES], "label": NAMES}), path)
    check(open_recording(path))
    check(open_recording(path, image_column="rgb"))
    message = "image_column: expected one of rgb, found 'depth'"
    refused(path, message, SettingError, image_column="depth")


# What is missing ---------------------------------------------------------------------------------


def test_a_missing_library_is_named_with_its_extra(tmp_path):
    write_stack(tmp_path / "x.tif", FRAMES, compression="lzw")
    code = (
        "import sys; sys.modules['imagecodecs'] = None\n"
        "from hdc.readers import open_recording\n"
        f"try: open_recording({str(tmp_path / 'x.tif')!r})\n"
        "except ModuleNotFoundError as error: print(error, '.', error.name)"
    )
    said = subprocess.check_output([sys.executable, "-c", code], text=True)
    package = "expected the package imagecodecs, found none"
    assert said == f"{package}; pip install 'speckle-hdc[files]' . imagecodecs\n"


@pytest.mark.parametrize("suffix", [".npz", ".npy", ".h5"])
def test_three_planes_of_floats_are_colours_or_frames_as_it_is_said(tmp_path, suffix):
    """They were read as red, green and blue without a word."""
    cube = np.random.default_rng(0).random((6, 3, 8, 10)).astype(np.float32)
    labels, path = np.arange(6) % 2, tmp_path / f"cube{suffix}"
    if suffix == ".npz":
        np.savez(path, frames=cube, labels=labels)
    elif suffix == ".npy":
        np.save(path, cube)
        rows = "\n".join(map(str, ["label", *labels]))
        path.with_suffix(".csv").write_text(rows)
    else:
        with h5py.File(path, "w") as file:
            file["frames"], file["labels"] = cube, labels
    readings = ["frame,channel,height,width", "frame,order,height,width"]
    with pytest.raises(Ambiguous) as caught:
        open_recording(path)
    assert str(caught.value).startswith(f"{path}[frames] float32 (6, 3, 8, 10)")
    assert caught.value.choices == tuple(f"--axes {reading}" for reading in readings)
    assert open_recording(path, axes=readings[0].split(",")).shape == (6, 8, 10)
    several = {"labels": tmp_path / "each.csv", "axes": readings[1].split(",")}
    several["labels"].write_text("\n".join(["label", *map(str, np.repeat(labels, 3))]))
    frames = open_recording(path, **several)
    assert np.array_equal(frames[:], cube.reshape(18, 8, 10))
    assert frames.labels.tolist() == np.repeat(labels, 3).tolist()


# What a file holds, and what its library would make up -------------------------------------------

LEFT_RIGHT = np.array([*"ab" * 3])
STACK = np.random.default_rng(0).integers(0, 255, (6, 8, 9), np.uint8)


def virtual(file):
    layout = h5py.VirtualLayout((6, 8, 9), np.uint8)
    layout[:] = h5py.VirtualSource("moved.h5", "frames", (6, 8, 9))
    file.create_virtual_dataset("frames", layout)


def half_written(file):
    file.create_dataset("frames", (6, 8, 9), np.uint8, chunks=(3, 8, 9))[:3] = STACK[:3]


def unwritten(file):
    file.create_dataset("frames", (6, 8, 9), np.uint8)


def external(file):
    file.create_dataset("frames", (6, 8, 9), np.uint8, external=[("moved.raw", 0, 432)])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (virtual, "expected its source moved.h5, found none"),
        (external, "expected its source moved.raw, found none"),
        (half_written, "expected 2 chunks, found 1: the others were not written"),
        (unwritten, "expected 1 chunks, found 0"),
    ],
)  # fmt: skip
def test_what_hdf5_would_fill_in_is_refused(tmp_path, make, message):
    """Zeros were read and learnt, without a word."""
    with h5py.File(tmp_path / "v.h5", "w") as file:
        make(file)
        file["labels"] = [*"ab" * 3]
    with pytest.raises(BadFrame, match=rf"v\.h5\[frames\]: {message}"):
        open_recording(tmp_path / "v.h5")


def test_a_virtual_dataset_beside_its_source_is_read(tmp_path):
    with h5py.File(tmp_path / "moved.h5", "w") as file:
        file["frames"] = STACK
    with h5py.File(tmp_path / "v.h5", "w") as file:
        virtual(file)
        file["labels"] = [*"ab" * 3]
    assert np.array_equal(open_recording(tmp_path / "v.h5")[:], STACK)


def test_numbers_of_an_enumeration_have_its_names(tmp_path):
    kind = h5py.enum_dtype({"left": 0, "right": 1})
    with h5py.File(tmp_path / "e.h5", "w") as file:
        file["frames"] = STACK
        file.create_dataset("labels", data=[0, 1, 1, 0, 1, 0], dtype=kind)
    recording = open_recording(tmp_path / "e.h5")
    assert recording.names == ["left", "right", "right", "left", "right", "left"]


def test_a_dataset_that_cannot_be_read_is_named(tmp_path):
    path = tmp_path / "c.h5"
    with h5py.File(path, "w") as file:
        chunks = {"chunks": (1, 8, 9), "compression": "gzip", "fletcher32": True}
        file.create_dataset("frames", data=STACK, **chunks)
        file["labels"] = [*"ab" * 3]
        start = file["frames"].id.get_chunk_info(4).byte_offset
    data = bytearray(path.read_bytes())
    data[start + 9] ^= 255
    path.write_bytes(data)
    recording = open_recording(path)
    assert np.array_equal(recording[:4], STACK[:4])
    with pytest.raises(
        BadFrame, match=r"c\.h5\[frames\]: expected a dataset that can be"
    ):
        recording[4]


def test_what_is_no_array_of_an_archive_is_left_out(tmp_path):
    """An object that nobody needs, and files beside the arrays, made all of it unreadable."""
    path = tmp_path / "x.npz"
    notes = np.array([{"a": 1}], object)
    np.savez(path, frames=STACK, labels=LEFT_RIGHT, notes=notes)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("meta.json", "{}")
        archive.writestr("folder/", "")
    recording = open_recording(path)
    assert np.array_equal(recording[:], STACK)
    assert recording.notes[1].startswith("left out what is no array: meta.json")


@pytest.mark.parametrize("name", ["a.npy", "a.tif"])
def test_a_file_that_is_rewritten_meanwhile_is_an_error(tmp_path, name):
    """It ended the process with a bus error."""
    path = tmp_path / name
    big = np.zeros((40, 200, 300), np.uint8)

    def write(frames):
        if name == "a.npy":
            np.save(path, frames)
        else:
            tifffile.imwrite(path, frames)

    write(big)
    path.with_suffix(".csv").write_text("\n".join(["label", *"ab" * 20]))
    recording = open_recording(path)
    assert recording[39].sum() == 0
    write(big[:1])
    with pytest.raises(BadFrame, match=f"{name}: expected the file as it was opened"):
        recording[39]


def test_a_folder_without_room_for_compressed_pages_is_named(tmp_path, monkeypatch):
    path = tmp_path / "z.tif"
    tifffile.imwrite(path, STACK, compression="zlib")
    usage = SimpleNamespace(free=100)
    monkeypatch.setattr(tiff.shutil, "disk_usage", lambda _: usage)
    with pytest.raises(
        BadFrame, match=r"z\.tif: expected 432 bytes free in .*, found 100"
    ):
        open_recording(path, fewest_classes=0)
