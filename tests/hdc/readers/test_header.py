"""Image files that are damaged, hostile, or would not be decoded as they were stored."""

import os
import struct
import zlib

import cv2
import numpy as np
import pytest
from PIL import Image

from hdc.readers import BadFrame, open_recording


def all_of(scene):
    return scene.frames(np.arange(len(scene)))


def write(path, image, *parameters):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image, parameters)


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
    struct.pack_into(">I", data, 29, zlib.crc32(data[12:29]))
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
    "bomb.png": (bomb, r"at most 16777216 pixels \(max_pixels\), found 60000 × 60000"),
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


def lost(data):
    """JPEGs that lost coded bytes: the second half, the middle, the end of a stretch."""
    scan = data.rindex(b"\xff\xda") + 14
    middle = (scan + len(data)) // 2
    yield data[:middle] + b"\xff\xd9"
    yield data[: scan + 60] + data[-30:]
    yield data[: scan + 60] + data[:]  # a second image after half of the first
    if (restart := data.find(b"\xff\xd3", scan)) > 0:
        yield data[: restart - 8] + data[restart:]
        yield data[:restart] + b"\xff\xd9"


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("setting", [[], ["PROGRESSIVE", 1], ["RST_INTERVAL", 2], ["OPTIMIZE", 1]])
def test_a_jpeg_that_lost_pixels_is_refused(folder, colour, setting):
    """libjpeg makes up what is missing and says so on the terminal only."""
    image = np.random.default_rng(0).integers(0, 256, (60, 70, 3)[: 2 + colour], dtype=np.uint8)
    image = cv2.GaussianBlur(image, (0, 0), 2)
    parameters = [getattr(cv2, f"IMWRITE_JPEG_{setting[0]}"), setting[1]] if setting else []
    data = cv2.imencode(".jpg", image, parameters)[1].tobytes()
    path = folder / "b" / "x.jpg"
    path.write_bytes(data + b"what a camera puts behind\xff\xd8\xff")
    assert open_recording(folder, on_bad_frame="skip").skipped[0].endswith("70 × 60 uint8")
    versions = list(lost(data))
    assert len(versions) == 3 + 2 * (setting[:1] == ["RST_INTERVAL"])
    for version in versions:
        path.write_bytes(version)
        with pytest.raises(BadFrame, match=r"x.jpg: expected a complete"):
            open_recording(folder)


def test_what_opencv_would_change_in_a_tiff_is_refused(folder):
    """It multiplies by alpha, turns what is marked as turned, and takes 8 of 16 bits."""
    path = folder / "b" / "x.tif"
    refused = {
        "found 4 values a pixel": lambda: Image.new("RGBA", (30, 20)).save(path),
        "found 2 values a pixel": lambda: Image.new("LA", (30, 20)).save(path),
        "without alpha, found 4 values": lambda: write(path, np.zeros((20, 30, 4), np.uint16)),
        "found a TIFF of orientation 3": lambda: Image.new("L", (30, 20)).save(
            path, tiffinfo={274: 3}
        ),
    }
    for message, make in refused.items():
        make()
        with pytest.raises(BadFrame, match=rf"x.tif: expected .*{message}"):
            open_recording(folder)
    ramp = np.add.outer(np.arange(20), 8 * np.arange(30)).astype(np.uint8)
    Image.fromarray(ramp).save(path, tiffinfo={274: 1})
    assert np.array_equal(open_recording(folder).frames([8])[0], ramp)


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
