""".npz archives: labels and frames as saved, and nothing unpickled or unpacked unseen."""

import pickle
import tracemalloc
import zipfile

import numpy as np
import pytest

from hdc.readers import archive, open_recording

LABELS = np.arange(12) % 3


@pytest.fixture
def save(tmp_path, pixels):
    def save(compressed=False, **changed):
        arrays = {"frames": pixels, "labels": LABELS, **changed}
        arrays = {key: value for key, value in arrays.items() if value is not None}
        (np.savez_compressed if compressed else np.savez)(tmp_path / "x.npz", **arrays)
        return tmp_path / "x.npz"

    return save


def test_an_archive_is_a_scene(save, pixels):
    times = np.linspace(0, 1, 12)
    scene = open_recording(save(time=times, order=np.arange(12)[::-1], other=np.zeros(3)))
    assert scene.classes == ("0", "1", "2")
    assert np.array_equal(scene.labels, LABELS)
    assert np.array_equal(scene.frames(np.arange(12)), pixels)
    assert list(scene.samples) == ["order", "time"]
    assert np.array_equal(scene.samples["time"], times)
    assert scene.samples["order"].tolist() == list(range(12))[::-1]


def test_classes_can_be_named_or_be_labels_themselves(save):
    names = np.array(["p9", "p10", "p2"])
    named = open_recording(save(classes=names))
    assert named.classes == ("p9", "p10", "p2")
    assert np.array_equal(named.labels, LABELS)
    texts = open_recording(save(labels=names[LABELS]))
    assert texts.classes == ("p2", "p9", "p10")
    assert [texts.classes[c] for c in texts.labels] == names[LABELS].tolist()
    both = open_recording(save(labels=names[LABELS], classes=names))
    assert np.array_equal(both.labels, LABELS)


@pytest.mark.parametrize("dtype", ["<u2", ">u2", "u1"])
@pytest.mark.parametrize("memory_bytes", [2**31, 100])
@pytest.mark.parametrize("fortran", [False, True])
def test_frames_that_do_not_fit_are_mapped(save, pixels, dtype, memory_bytes, fortran):
    frames = np.asarray(pixels.astype(dtype) * 3, order="F" if fortran else "C")
    path = save(frames=frames)
    settings = {"crop": [1, 2, 9, 8], "subsample": 2, "memory_bytes": memory_bytes}
    if fortran and memory_bytes == 100:
        with pytest.raises(ValueError, match=r"\[frames\]: expected .* found"):
            open_recording(path, **settings)
        return
    scene = open_recording(path, **settings)
    made = scene.frames([7, 2])
    assert made.dtype == np.dtype(dtype).newbyteorder("=")
    assert np.array_equal(made, frames[[7, 2], 2:10:2, 1:10:2])
    assert scene.frames([]).shape == (0, 4, 5)
    assert (
        scene.fingerprint()
        == open_recording(path, **{**settings, "memory_bytes": 2**20}).fingerprint()
    )


@pytest.mark.parametrize("dtype", ["<u2", "u1"])
def test_frames_that_are_asked_for_are_copied_once(save, dtype):
    frames = np.zeros((12, 400, 500), dtype)
    scene = open_recording(save(frames=frames), memory_bytes=10**6)
    tracemalloc.start()
    scene.frames(np.arange(12))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert frames.nbytes <= most < 1.2 * frames.nbytes


def member(path, name, data, size=None):
    """An archive whose array ``name`` is made of those bytes."""
    with zipfile.ZipFile(path) as old:
        kept = {n: old.read(n) for n in old.namelist() if n != name}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for n, content in {**kept, name: data}.items():
            new.writestr(n, content)
    return path


def header(shape, descr="|u1"):
    text = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (117 - len(text)) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


class Trap:
    """Fails the test if it is unpickled."""

    def __reduce__(self):
        return (pytest.fail, ("it was unpickled",))


def test_nothing_is_unpickled(save, tmp_path):
    objects = np.array([Trap()] * 12, dtype=object)
    for key in ("frames", "labels", "classes"):
        with pytest.raises(ValueError, match=rf"x.npz\[{key}\]: .* found pickled objects"):
            open_recording(save(**{key: objects}))
    assert "other" not in open_recording(save(other=objects)).samples
    path = tmp_path / "x.npz"
    path.write_bytes(pickle.dumps({"frames": 1}))
    with pytest.raises(ValueError, match=r"x.npz: expected an intact .npz"):
        open_recording(path)


def test_kinds_of_zip_that_numpy_does_not_write_are_refused(save, monkeypatch):
    path = save()
    with zipfile.ZipFile(path) as old:
        kept = {name: old.read(name) for name in old.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as new:
        for name, content in kept.items():
            new.writestr(name, content)
    with pytest.raises(ValueError, match=r"x.npz: expected an intact .npz, found: an array of com"):
        open_recording(path)
    with zipfile.ZipFile(path, "w") as new:
        for k in range(9):
            new.writestr(f"{k}.npy", b"")
    monkeypatch.setattr(archive, "_MOST_DIRECTORY_BYTES", 400)
    with pytest.raises(ValueError, match="a directory of 459 bytes where 400 are the most"):
        open_recording(path)
    # 64-bit sizes are what zipfile goes by where they are there.
    monkeypatch.setattr(zipfile, "ZIP_FILECOUNT_LIMIT", 1)
    with zipfile.ZipFile(path, "w") as new:
        for k in range(9):
            new.writestr(f"{k}.npy", b"")
    assert b"PK\6\7" in path.read_bytes()
    with pytest.raises(ValueError, match="a directory of 459 bytes where 400 are the most"):
        open_recording(path)


def test_columns_that_do_not_fit_together_are_refused(save, pixels):
    columns = {f"c{k}": np.zeros(12) for k in range(5)}
    path = save(**columns)
    assert len(open_recording(path, memory_bytes=576).samples) == 6
    with pytest.raises(ValueError, match=r"at most 575 bytes .* beside the frames, found 576"):
        open_recording(path, memory_bytes=575)


def test_an_array_that_is_there_twice_is_refused(save):
    path = save()
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("labels.npy", archive.read("labels.npy"))
    with pytest.raises(ValueError, match=r"x.npz: expected each array once, found one again"):
        open_recording(path)


def test_too_many_frames_are_refused(save):
    n = 2**20 + 1
    frames = np.zeros((n, 1, 1), np.uint8)
    with pytest.raises(ValueError, match=r"x.npz: expected at most 1048576 frames, found 1048577"):
        open_recording(save(True, frames=frames, labels=np.arange(n, dtype=np.int8) % 2))


def test_a_zip_bomb_is_refused_from_its_header(save):
    zeros = np.zeros((4000, 200, 200), np.uint8)
    path = save(compressed=True, frames=zeros, labels=np.arange(4000) % 2)
    assert path.stat().st_size < zeros.nbytes / 100
    with pytest.raises(ValueError, match=r"\[frames\]: expected at most 1000000 bytes .* savez"):
        open_recording(path, memory_bytes=10**6)
    lying = member(path, "frames.npy", header((12, 20, 30)) + bytes(10**7))
    with pytest.raises(
        ValueError, match=r"\[frames\]: expected 10000000 bytes as the archive says"
    ):
        open_recording(lying)
    vast = member(path, "frames.npy", header((10**9, 10**3, 10**3)))
    with pytest.raises(ValueError, match=r"\[frames\]: expected 0 bytes as the archive says"):
        open_recording(vast)
    labels = member(save(), "labels.npy", header((12,), "<U90000000") + bytes(8))
    with pytest.raises(ValueError, match=r"\[labels\]: expected 8 bytes as the archive says"):
        open_recording(labels)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"frames": None}, "expected arrays frames and labels, found no frames"),
        ({"labels": None}, "expected arrays frames and labels, found no labels"),
        ({"frames": np.zeros((12, 5), np.uint8)}, r"\[frames\]: expected shape \[N, H, W\]"),
        ({"frames": np.zeros((0, 5, 5), np.uint8)}, r"\[frames\]: expected shape \[N, H, W\]"),
        ({"frames": np.zeros((12, 5, 5))}, r"\[frames\]: expected uint8 or uint16, found float64"),
        ({"frames": np.zeros((12, 5, 5), np.int8)}, r"\[frames\]: expected uint8 or uint16"),
        ({"frames": np.zeros((12, 5, 5), np.uint32)}, r"\[frames\]: expected uint8 or uint16"),
        ({"labels": LABELS[:5]}, r"\[labels\]: expected shape \(12,\), one a frame, found \(5,\)"),
        ({"labels": LABELS[:, None]}, r"\[labels\]: expected shape \(12,\)"),
        ({"labels": np.where(LABELS == 1, np.nan, 0)}, r"\[labels\]: .* found NaN at index 1"),
        ({"labels": LABELS.astype(float)}, r"\[labels\]: .* found float64"),
        ({"labels": LABELS.astype("M8[s]")}, r"\[labels\]: expected integers or strings"),
        ({"labels": LABELS * 0}, r"\[labels\]: expected two classes or more, found only '0'"),
        ({"classes": np.array(["a", "b"])}, r"\[labels\]: expected one of the 2 classes, found 2"),
        ({"classes": np.array(["a", "a", "b"])}, r"\[classes\]: expected different names"),
        (
            {"classes": np.array(["a", "a\n", "a\\n"])},
            r"\[classes\]: expected a label of printable",
        ),
        ({"labels": np.array(["a\n", "a\\n"] * 6)}, r"\[labels\]: expected a label of printable"),
        (
            {"order": LABELS.astype("M8[s]")},
            r"12 numbers in the column order, .* \(datetime64\[s\]",
        ),
        ({"order": LABELS.astype(complex)}, r"12 numbers in the column order, .* \(complex128"),
        ({"session": LABELS[:5]}, r"12 numbers in the column session, found others .*\(5,\)"),
        ({"classes": np.array(["a", "b", ""])}, r"\[classes\]: expected a label, found none"),
        ({"classes": np.arange(3)}, r"\[classes\]: expected strings \[L\], found int64"),
        (
            {"labels": np.array(["a", "b" * 201, "c"] * 4)},
            r"\[labels\]: expected at most 800 bytes",
        ),
        ({"order": np.full(12, np.nan)}, r"expected 12 numbers in the column order"),
        (
            {"labels": np.array(list("abcx" * 3)), "classes": np.array(list("abc"))},
            r"\[labels\]: expected one of the 3 classes, found 'x'",
        ),
    ],
)
def test_arrays_of_another_kind_are_named(save, changed, message):
    with pytest.raises(ValueError, match=rf"x.npz.*{message}"):
        open_recording(save(**changed))


def test_settings_are_checked_for_archives_too(save):
    with pytest.raises(ValueError, match=r"crop: expected a window inside"):
        open_recording(save(), crop=[0, 0, 31, 1])
    with pytest.raises(ValueError, match=r"\[frames\]: expected at most 599 pixels"):
        open_recording(save(), max_pixels=599)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("memory_bytes", [2**31, 1000])
def test_damaged_archives_are_named_or_correct(save, pixels, compressed, memory_bytes):
    """400 random truncations and flipped bytes: an error that names the file, or the frames."""
    if compressed and memory_bytes == 1000:
        return  # refused as a whole
    rng = np.random.default_rng(0)
    path = save(compressed)
    whole = path.read_bytes()
    errors = []
    for k in range(200 if compressed else 100):
        damaged = bytearray(whole)
        at = int(rng.integers(len(whole)))
        if k % 2:
            del damaged[at:]
        else:
            damaged[at] ^= int(rng.integers(1, 256))
        path.write_bytes(damaged)
        try:
            scene = open_recording(path, memory_bytes=memory_bytes)
        except ValueError as error:
            errors.append(str(error))
        else:
            assert np.array_equal(scene.frames(np.arange(12)), pixels)
    assert all(str(path) in error for error in errors)
    assert len(errors) > 90
