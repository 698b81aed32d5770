"""Folders of images: what is read is what was written, and what is broken is named."""

import os
import struct
import threading
import time

import cv2
import numpy as np
import pytest

from scenes.frames import Scene
from scenes.recorded import BadFrame, Options, images, open_recording


def all_of(scene):
    return scene.frames(np.arange(len(scene))).numpy()


def write(path, image, *parameters):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image, parameters)


def test_a_folder_is_a_scene(folder, pixels):
    scene = open_recording(folder)
    assert isinstance(scene, Scene)
    assert scene.origin == "recorded"
    assert scene.classes == ("a", "b", "c")
    assert scene.labels.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert scene.shape == (20, 30)
    assert scene.skipped == ()
    assert scene.samples["order"].tolist() == list(range(12))
    assert scene.samples["file"][:2].tolist() == ["a/1.png", "a/2.png"]
    assert np.array_equal(all_of(scene), pixels)
    assert np.array_equal(scene.frames([5, 0]).numpy(), pixels[[5, 0]])
    with pytest.raises(IndexError, match=r"expected values in \[0, 12\)"):
        scene.frames([12])


def test_a_folder_that_does_not_fit_is_read_as_a_stream(folder, pixels):
    stream = open_recording(folder, memory_bytes=5 * pixels[0].nbytes, threads=2)
    order = np.random.default_rng(1).permutation(12)
    assert np.array_equal(stream.frames(order).numpy(), pixels[order])
    assert stream.frames([]).shape == (0, 20, 30)
    assert stream.fingerprint() == open_recording(folder).fingerprint()
    write(folder / "b" / "2.png", pixels[0])
    with pytest.raises(BadFrame, match=r"b/2.png: expected the file that was opened, found it cha"):
        stream.frames([5])
    assert np.array_equal(stream.frames([4]).numpy(), pixels[[4]])


def test_files_and_classes_are_in_natural_order(tmp_path, pixels):
    names = ["class2/f10.png", "class2/f2.png", "class10/f1.png", "class10/F1.bmp"]
    for name, image in zip(names, pixels, strict=False):
        write(tmp_path / name, image)
    scene = open_recording(tmp_path)
    assert scene.classes == ("class2", "class10")
    assert scene.samples["file"].tolist() == [
        "class2/f2.png", "class2/f10.png", "class10/F1.bmp", "class10/f1.png",
    ]  # fmt: skip


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tif", ".tiff", ".PNG", ".jpg", ".jpeg"])
@pytest.mark.parametrize("bits", [8, 16])
def test_every_kind_of_image_comes_back_as_it_was(tmp_path, suffix, bits):
    if bits == 16 and suffix.lower() in (".bmp", ".jpg", ".jpeg"):
        return  # those formats hold 8 bits
    dtype = np.uint8 if bits == 8 else np.uint16
    smooth = np.add.outer(np.arange(16), np.arange(16)) * (2 ** (bits - 6))
    images = [(smooth + k).astype(dtype) for k in (0, 1)]
    for name, image in zip("ab", images, strict=True):
        write(tmp_path / name / f"x{suffix}", image)
    made = all_of(open_recording(tmp_path))
    assert made.dtype == dtype
    tolerance = 3 if "j" in suffix else 0
    assert np.abs(made.astype(int) - np.stack(images).astype(int)).max() <= tolerance


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [3, 4])
def test_colour_becomes_luminance(tmp_path, dtype, channels):
    image = (
        np.random.default_rng(0).integers(0, np.iinfo(dtype).max, (9, 8, channels)).astype(dtype)
    )
    for name in "ab":
        write(tmp_path / name / "x.png", image)
    blue, green, red = (image[..., k].astype(float) for k in range(3))
    expected = 0.299 * red + 0.587 * green + 0.114 * blue
    assert (
        np.abs(all_of(open_recording(tmp_path))[0] - expected).max() <= 2
    )  # OpenCV rounds its weights


def test_one_pixel_and_tiff_of_many_kinds(tmp_path):
    for k, code in enumerate([1, 5, 8]):  # stored, LZW, deflate
        for name in "ab":
            write(tmp_path / name / f"{k}.tif", np.full((1, 1), 7, np.uint8), 259, code)
    scene = open_recording(tmp_path)
    assert scene.shape == (1, 1)
    assert (all_of(scene) == 7).all()


@pytest.mark.parametrize("memory_bytes", [2**31, 0])
def test_crop_and_subsample_keep_the_pixels_they_say(folder, pixels, memory_bytes):
    scene = open_recording(folder, crop=[3, 2, 20, 11], subsample=3, memory_bytes=memory_bytes)
    assert scene.shape == (4, 7)
    assert np.array_equal(all_of(scene), pixels[:, 2:13:3, 3:23:3])
    assert scene.fingerprint() != open_recording(folder).fingerprint()


def test_the_fingerprint_is_of_contents_not_of_places(folder, tmp_path, pixels):
    first = open_recording(folder).fingerprint()
    moved = folder.rename(tmp_path / "elsewhere")
    assert open_recording(moved).fingerprint() == first
    write(moved / "a" / "1.png", pixels[0] ^ 1)
    assert open_recording(moved).fingerprint() != first


MANIFEST = """file,label,order,session,depth,note,class_index
c/1.png,none,2,0,0.5,x,1
a/1.png,touch,0,0,1.5,y,0
b/1.png,touch,1,1,-1e-3,7,0
"""


def test_a_manifest_says_what_belongs_to_the_scene(folder, pixels):
    (folder / "manifest.csv").write_text(MANIFEST)
    scene = open_recording(folder)
    assert scene.classes == ("touch", "none")
    assert scene.labels.tolist() == [1, 0, 0]
    assert np.array_equal(all_of(scene), pixels[[8, 0, 4]])
    assert {k: v.tolist() for k, v in scene.samples.items()} == {
        "order": [2, 0, 1],
        "session": [0, 0, 1],
        "depth": [0.5, 1.5, -1e-3],
        "note": ["x", "y", "7"],
        "file": ["c/1.png", "a/1.png", "b/1.png"],
    }
    (folder / "manifest.csv").write_text("file,label\nb/1.png,x10\na/1.png,x9\n")
    scene = open_recording(folder)
    assert scene.classes == ("x9", "x10")
    assert scene.samples["order"].tolist() == [0, 1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty file"),
        ("a,b\n1,2\n", "expected columns file, label, found no file, label"),
        ("file,label\n", "expected at least one row"),
        ("file,label\na/1.png\n", "row 2: expected 2 values, found 1"),
        ("file,label\na/1.png,\nb/1.png,y\n", "row 2: expected a label"),
        ("file,label\n../x.png,a\n", "row 2: expected a path inside the folder"),
        ("file,label\n/etc/x.png,a\n", "row 2: expected a path inside the folder"),
        ("file,label\na/1.png,x\na/./1.png,y\n", "row 3: expected each file once"),
        ("file,label\na/1.png,x\nb/9.png,y\n", "b/9.png: expected a readable file"),
        ("file,label\na/1.png,x\nb/1.png,x\n", "expected two classes or more, found only 'x'"),
        ("file,label,order\na/1.png,x,?\nb/1.png,y,1\n", "expected numbers in the column order"),
        ("file,label,class_index\na/1.png,x,1\nb/1.png,y,2\n", "one class_index a label, 0 … 1"),
        ("file,label,class_index\na/1.png,x,0\nb/1.png,y,0\n", "one class_index a label, 0 … 1"),
        ("file,label,label\na/1.png,x,y\n", "expected different column names"),
        (b"file,label\n\xff\xfe,x\n", "expected a CSV table in UTF-8"),
        ("file,label,session\na/1.png,x,nan\nb/1.png,y,1\n", "numbers in the column session"),
        (f"file,label\na/1.png,{'x' * 201}\nb/1.png,y\n", "row 2: expected a label of at most 200"),
        (b"file,label\n" + b"a,b\n" * 2**21, "expected at most 8388608 bytes, found 8388619"),
        (f"{'x' * 200_000}\n", "expected a CSV table in UTF-8, found: field larger"),
        ('file,label\n"a/1.png,x\n', "expected a CSV table in UTF-8"),
        ("file,label\na/1\0.png,x\nb/1.png,y\n", r"1\\x00.png"),
    ],
)
def test_a_broken_manifest_is_named(folder, text, message):
    (folder / "manifest.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=message) as caught:
        open_recording(folder)
    assert str(folder) in str(caught.value)


def cmyk(path):
    """A JPEG whose frame header announces four components."""
    data = bytearray(cv2.imencode(".jpg", np.zeros((20, 30, 3), np.uint8))[1].tobytes())
    at = data.index(b"\xff\xc0")
    data[at + 9] = 4
    path.write_bytes(data)


def bomb(path):
    """A small PNG that announces 60,000 × 60,000 pixels."""
    data = bytearray(cv2.imencode(".png", np.zeros((20, 30), np.uint8))[1].tobytes())
    data[16:24] = (60_000).to_bytes(4, "big") * 2
    path.write_bytes(data)


def animated(path):
    frames = [np.full((20, 30, 4), k, np.uint8) for k in (10, 200)]
    animation = cv2.Animation()
    animation.frames, animation.durations = frames, [100, 100]
    assert cv2.imwriteanimation(str(path), animation)


def many_scans(path):
    """A JPEG of one frame header whose scan is there 65 times."""
    data = cv2.imencode(".jpg", np.zeros((20, 30), np.uint8))[1].tobytes()
    scan = data[data.rindex(b"\xff\xda") : -2]
    path.write_bytes(data[:-2] + 64 * scan + data[-2:])


def tags(change):
    """Writes a TIFF whose directory of tags was changed."""

    def make(path):
        data = bytearray(cv2.imencode(".tif", np.zeros((20, 30), np.uint8))[1].tobytes())
        (at,) = struct.unpack_from("<I", data, 4)
        change(data, at + 2)
        path.write_bytes(data)

    return make


@tags
def tag_twice(data, at):
    data[at + 12 : at + 14] = data[at : at + 2]  # the height becomes a second width


@tags
def volume(data, at):
    struct.pack_into("<HHII", data, at + 12 * 9, 32997, 4, 1, 2)  # depth 2 for the plane layout


BROKEN = {
    "zero.png": (lambda p: p.write_bytes(b""), "expected an image, found an empty file"),
    "text.png": (lambda p: p.write_text("not an image"), "expected PNG data in a file .png"),
    "jpeg.png": (
        lambda p: p.write_bytes(cv2.imencode(".jpg", np.zeros((20, 30)))[1]),
        "expected PNG data in a file .png, found JPEG",
    ),
    "image.gif": (lambda p: p.write_bytes(b"GIF89a"), "expected a file .png, .*, found .gif"),
    "note": (lambda p: p.write_text("x"), "expected a file .png, .*, found no suffix"),
    "bomb.png": (bomb, r"at most 16777216 pixels \(scene.max_pixels\), found 60000 × 60000"),
    "cmyk.jpg": (cmyk, "expected a grey or colour image, found CMYK"),
    "moving.png": (animated, "expected a single image, found an animated PNG"),
    "pages.tif": (
        lambda p: cv2.imwritemulti(str(p), [np.zeros((20, 30), np.uint8)] * 2),
        "expected a single image, found a multi-page TIFF",
    ),
    "float.tif": (
        lambda p: cv2.imwrite(str(p), np.zeros((20, 30), np.float32)),
        "unsigned integer pixels, found signed or floating",
    ),
    "size.png": (
        lambda p: write(p, np.zeros((30, 20), np.uint8)),
        r"expected 30 × 20 pixels uint8 as in 12 of 13 frames, found 20 × 30 uint8",
    ),
    "depth.png": (lambda p: write(p, np.zeros((20, 30), np.uint16)), "found 30 × 20 uint16"),
    "loop.png": (lambda p: p.symlink_to(p.name), "expected a readable file, found: Too many lev"),
    "gone.png": (lambda p: p.symlink_to("nowhere"), "expected a readable file, found: No such"),
    "pipe.png": (lambda p: os.mkfifo(p), "expected a file, found no regular file"),
    "deeper": (lambda p: p.mkdir(), "expected a file, found a folder"),
    "back": (lambda p: p.symlink_to(p.parents[1]), "expected a file, found a folder"),
    "scans.jpg": (many_scans, "expected at most 64 scans, found 65"),
    "twice.tif": (tag_twice, "expected each TIFF tag once, found 256 again"),
    "volume.tif": (volume, "expected a single image, found a TIFF of several planes"),
    "jpeg.tif": (
        lambda p: cv2.imwrite(str(p), np.zeros((20, 30), np.uint8), [259, 7]),
        "expected no compression, LZW, deflate or PackBits, found 7",
    ),
    "<script>\n|[b].png": (lambda p: p.write_bytes(b""), r"<script>\\n\|\[b\].png: expected"),
    "latin\udce9.png": (lambda p: p.write_bytes(b""), r"latin\\udce9.png: expected"),
    "escape\x1b[31m.png": (lambda p: p.write_bytes(b""), r"escape\\x1b\[31m.png: expected"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_bad_frame_stops_or_is_skipped_and_is_named(folder, pixels, name):
    make, message = BROKEN[name]
    make(folder / "b" / name)
    with pytest.raises(BadFrame, match=message) as caught:
        open_recording(folder)
    plain = name.replace("\x1b", "\\x1b").replace("\n", "\\n").replace("\udce9", "\\udce9")
    assert str(caught.value).startswith(str(folder / "b" / plain))
    scene = open_recording(folder, on_bad_frame="skip")
    assert scene.skipped == (str(caught.value),)
    assert np.array_equal(all_of(scene), pixels)


def test_what_was_skipped_is_part_of_the_fingerprint(folder, tmp_path):
    whole = open_recording(folder, on_bad_frame="skip")
    (folder / "b" / "9.png").write_bytes(b"")
    one = open_recording(folder, on_bad_frame="skip")
    (folder / "c" / "9.png").write_bytes(b"")
    two = open_recording(folder, on_bad_frame="skip")
    assert [len(scene.skipped) for scene in (whole, one, two)] == [0, 1, 2]
    assert len({scene.fingerprint() for scene in (whole, one, two)}) == 3
    moved = folder.rename(tmp_path / "elsewhere")
    assert open_recording(moved, on_bad_frame="skip").fingerprint() == two.fingerprint()


def test_large_images_are_decoded_a_few_at_a_time(folder, monkeypatch):
    """Sixteen threads with a small file each that announces a large image would fill the memory."""
    cost = images._cost(folder / "a" / "1.png", Options())
    assert cost == (folder / "a" / "1.png").stat().st_size + 10 * 20 * 30
    monkeypatch.setattr(images, "_DECODING_BYTES", int(2.5 * cost))
    assert list(images._groups([7, 8, 9], [cost] * 3)) == [[7, 8], [9]]
    assert list(images._groups([7, 8, 9], [9 * cost, 0, 9 * cost])) == [[7], [8], [9]]
    held, most = set(), 0
    inspect = images._inspect

    def watched(file, options):
        nonlocal most
        held.add(file)
        most = max(most, len(held))
        try:
            time.sleep(0.005)
            return inspect(file, options)
        finally:
            held.discard(file)

    monkeypatch.setattr(images, "_inspect", watched)
    assert len(open_recording(folder, threads=16)) == 12
    assert 1 <= most <= 2


def test_truncated_and_damaged_images_are_named_or_correct(tmp_path):
    """300 random truncations and 300 flipped bytes over all formats: an error or a frame."""
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (24, 24), dtype=np.uint8)
    write(tmp_path / "a" / "good.png", image)
    named = {suffix: [] for suffix in (".png", ".jpg", ".bmp", ".tif")}
    for suffix in named:
        whole = cv2.imencode(suffix, image)[1].tobytes()
        bad = tmp_path / "b" / f"x{suffix}"
        bad.parent.mkdir(exist_ok=True)
        for cut in rng.integers(0, len(whole), 75):
            bad.write_bytes(whole[:cut])
            with pytest.raises(BadFrame) as caught:
                open_recording(tmp_path)
            assert str(caught.value).startswith(str(bad))
        for at, value in zip(
            rng.integers(0, len(whole), 75), rng.integers(1, 256, 75), strict=True
        ):
            damaged = bytearray(whole)
            damaged[at] ^= value
            bad.write_bytes(damaged)
            try:
                made = all_of(open_recording(tmp_path))[1]
            except ValueError as error:
                named[suffix].append(str(error))
            else:
                assert made.shape == (24, 24)
        bad.unlink()
    assert all(str(tmp_path) in error for errors in named.values() for error in errors)
    # Every chunk of a PNG has a check sum, so no damage to one goes unseen.
    assert len(named[".png"]) == 75
    assert len(named[".bmp"]) < 75  # a pixel of a bitmap has none


def test_what_desktops_leave_behind_is_no_frame(folder):
    for name in (".DS_Store", "Thumbs.db", "._1.png"):
        (folder / "a" / name).write_bytes(b"x")
    (folder / ".cache").mkdir()
    (folder / "README.txt").write_text("about")
    assert len(open_recording(folder)) == 12


def test_folders_that_make_no_scene_are_named(tmp_path, folder, pixels, monkeypatch):
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(ValueError, match="empty: expected one sub-folder a class, found none"):
        open_recording(empty)
    write(empty / "x.png", pixels[0])
    with pytest.raises(ValueError, match=r"x.png: expected images in one sub-folder a class"):
        open_recording(empty)
    one = tmp_path / "one"
    write(one / "a" / "x.png", pixels[0])
    with pytest.raises(ValueError, match="expected two classes or more, found only 'a'"):
        open_recording(one)
    (one / "b").mkdir()
    with pytest.raises(ValueError, match="one/b: expected images of this class, found none"):
        open_recording(one)
    (one / "b" / "x.png").write_bytes(b"")
    with pytest.raises(ValueError, match="one: class 'b': none of its frames can be used"):
        open_recording(one, on_bad_frame="skip")
    (one / "a" / "x.png").write_bytes(b"")
    with pytest.raises(BadFrame, match="one: expected images, found none that can be read"):
        open_recording(one, on_bad_frame="skip")
    (folder / "loop").symlink_to("loop")
    with pytest.raises(ValueError, match="loop: expected a file or folder, found: Too many levels"):
        open_recording(folder)
    (folder / "loop").unlink()

    listdir = os.listdir  # chmod does not stop root, under whom tests may run

    def refuse(path):
        if str(path).endswith("/b"):
            raise PermissionError(13, "Permission denied")
        return listdir(path)

    monkeypatch.setattr(os, "listdir", refuse)
    with pytest.raises(
        ValueError, match="/b: expected a readable folder, found: Permission denied"
    ):
        open_recording(folder)


def test_threads_decode_and_no_more_than_asked_for(folder, monkeypatch):
    seen = set()
    decode = cv2.imdecode

    def watched(*arguments):
        seen.add(threading.get_ident())
        return decode(*arguments)

    monkeypatch.setattr(cv2, "imdecode", watched)
    open_recording(folder, threads=1)
    assert len(seen) == 1
    assert threading.get_ident() not in seen
