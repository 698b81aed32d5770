"""Folders of images: frames come back as written, and a broken image is named."""

import hashlib
import io
import struct

import cv2
import numpy as np
import pytest
from PIL import Image

from hdc.readers import BadFrame, open_recording
from hdc.readers.images import decode
from tests.hdc.readers.writers import said, write_image

NOISE = np.random.default_rng(0).integers(0, 256, (20, 30), dtype=np.uint8)
COLOUR = np.random.default_rng(1).integers(0, 256, (20, 30, 4), dtype=np.uint8)


def encoded(image, suffix):
    return cv2.imencode(suffix, image)[1].tobytes()


def saved(format, *images, **options):
    stream = io.BytesIO()
    first, *rest = map(Image.fromarray, images)
    first.save(stream, format, save_all=bool(rest), append_images=rest, **options)
    return stream.getvalue()


@pytest.mark.parametrize("settings", [{}, {"memory_bytes": 0}, {"check": False}])
def test_a_folder_is_a_recording(folder, pixels, settings):
    recording = open_recording(folder, **settings)
    assert said(recording, "label order file")[3:5] == ["a 3 a/4.png", "b 4 b/1.png"]
    order = np.random.default_rng(1).permutation(12)
    assert np.array_equal(recording.frames(order), pixels[order])
    assert np.array_equal(recording[-1], pixels[11])
    assert recording.place(5) == str(folder / "b" / "2.png")
    for index in ([12], [-1], [0.5]):
        with pytest.raises(IndexError, match=r"expected values in \[0, 12\)"):
            recording.frames(index)
    part = open_recording(folder, crop=[3, 2, 20, 11], subsample=3, **settings)
    assert np.array_equal(part[:], pixels[:, 2:13:3, 3:23:3])
    assert part.fingerprint() != recording.fingerprint()


def luminance(image):
    return image[..., :3] @ np.array([0.114, 0.587, 0.299])  # BT.601, blue first


DEEP = NOISE.astype(np.uint16) * 255
SMOOTH = np.add.outer(np.arange(16), np.arange(16)).astype(np.uint8) * 4


@pytest.mark.parametrize(
    ("suffix", "image", "expected", "most"),
    [
        (".PNG", NOISE, NOISE, 0),
        (".tif", DEEP, DEEP, 0),
        (".jpg", SMOOTH, SMOOTH, 3),
        (".bmp", COLOUR[..., :3], luminance(COLOUR), 2),
        (".png", COLOUR, luminance(COLOUR), 2),
        (".tif", COLOUR, luminance(COLOUR), 2),
        (".png", COLOUR.astype(np.uint16) * 257, luminance(COLOUR) * 257, 2),
    ],
)  # fmt: skip
def test_images_of_every_kind_come_back_in_grey(
    tmp_path, suffix, image, expected, most
):
    write_image(tmp_path / "a" / f"x{suffix}", image)
    frames = open_recording(tmp_path, fewest_classes=1)
    assert frames.dtype == image.dtype
    assert np.abs(frames[0] - expected).max() <= most  # OpenCV rounds its weights


@pytest.mark.parametrize("orientation", range(1, 9))
def test_pixels_of_a_tiff_are_as_they_are_stored(tmp_path, orientation):
    """An orientation tag was applied."""
    (tmp_path / "1.tif").write_bytes(saved("TIFF", NOISE, exif={274: orientation}))
    assert np.array_equal(decode(tmp_path / "1.tif"), NOISE)


def test_fingerprints_are_of_contents_and_order_not_of_places(folder, tmp_path, pixels):
    """Results are known by the digest of images, that of their digests: it is to stay."""
    whole = hashlib.sha256()
    for path in sorted(folder.rglob("*.png")):
        whole.update(hashlib.sha256(path.read_bytes()).digest())
    assert open_recording(folder).digest() == whole.hexdigest()
    first = open_recording(folder).fingerprint()
    (folder / "notes.txt").write_text("x")
    moved = folder.rename(tmp_path / "elsewhere")
    assert open_recording(moved, check=False).fingerprint() == first
    write_image(moved / "a" / "1.png", pixels[0] ^ 1)
    prints = {first, open_recording(moved).fingerprint()}
    for order in ((0, 1), (1, 0), (0, 2)):
        rows = "file,label,order\na/1.png,x,{}\nb/1.png,y,{}\n".format(*order)
        (moved / "manifest.csv").write_text(rows)
        prints.add(open_recording(moved).fingerprint())
    assert len(prints) == 5


WHOLE = (".png", ".jpg", ".bmp", ".tif")
PNG = encoded(NOISE, ".png")
SIZES = struct.pack(">II", 40_000, 40_000)
MASKS = (0xFF, 0xFF00, 0xFF0000, 0)
MASKED = struct.pack("<2sIHHI", b"BM", 138, 0, 0, 122)
MASKED += struct.pack("<IiiHHI20x4I68x", 108, 2, 2, 1, 32, 3, *MASKS)


@pytest.mark.parametrize(
    ("data", "suffix", "message"),
    [
        (b"GIF89a", ".png", "found other data"),
        (saved("PNG", NOISE, NOISE), ".png", "a single image, found an animation"),
        (saved("TIFF", NOISE, NOISE), ".tif", "expected a single image, found 2"),
        *((encoded(NOISE, suffix)[:-30], suffix, "whole") for suffix in WHOLE),
        (PNG[:16] + SIZES + PNG[24:], ".png", "whole image"),  # too large
        # OpenCV ignores masks.
        (MASKED, ".bmp", "without masks of its own"),
        (encoded(NOISE[1:], ".png"), ".png", r"30 × 20 pixels uint8 as in the other .* 30 × 19"),
        (encoded(NOISE.astype(np.uint16), ".png"), ".png", "as in the other frames, found 30 × 20"),
    ],
)  # fmt: skip
def test_images_that_would_be_learnt_wrongly_are_refused(
    tmp_path, data, suffix, message
):
    write_image(tmp_path / "a" / "1.png", NOISE)
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / f"1{suffix}").write_bytes(data)
    with pytest.raises(BadFrame, match=rf"b/1{suffix}: .*{message}"):
        open_recording(tmp_path)
    frames = open_recording(tmp_path, check=False).stream()
    assert np.array_equal(next(frames), NOISE)
    with pytest.raises(BadFrame, match=rf"b/1{suffix}"):
        next(frames)


def test_thumbnails_and_films_in_a_jpeg_are_no_damage(tmp_path):
    """Cameras pad what they write beside it, and append the film of a motion photo."""
    whole = encoded(NOISE, ".jpg")
    expected = cv2.imdecode(np.frombuffer(whole, np.uint8), cv2.IMREAD_UNCHANGED)
    about = b"Exif\0\0" + encoded(NOISE[::2, ::2], ".jpg") + bytes(2000)
    about = b"\xff\xe1" + struct.pack(">H", len(about) + 2) + about
    film = b"\0\0\0\x18ftypmp42" + bytes(600) + b"\xff\xda" + bytes(600)
    for data in (whole[:2] + about + whole[2:], whole + film):
        (tmp_path / "1.jpg").write_bytes(data)
        assert np.array_equal(decode(tmp_path / "1.jpg"), expected)


def test_batches_are_the_frames_one_after_the_other_in_the_same_memory(folder, pixels):
    index = np.random.default_rng(0).permutation(12)
    batches, places = open_recording(folder).batches(index), set()
    for start in (0, 5, 10):
        part = slice(start, start + 5)
        batch = batches[part]
        assert np.array_equal(batch, pixels[index[part]])
        places.add(batch.ctypes.data)
    assert len(places) == 1
