"""Folders of images: frames come back as written, and a broken image is named."""

import hashlib
import io
import struct
import zlib

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image

from hdc.readers import BadFrame, open_recording
from hdc.readers.images import decode


def write(path, image, *parameters):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image, parameters)


def all_of(recording):
    return recording.frames(np.arange(len(recording)))


@pytest.mark.parametrize("settings", [{}, {"memory_bytes": 0}, {"check": False}])
def test_a_folder_is_a_recording(folder, pixels, settings):
    recording = open_recording(folder, **settings)
    assert recording.classes == ("a", "b", "c")
    assert recording.labels.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert recording.names[4:6] == ["b", "b"]
    assert recording.frame_shape == (20, 30)
    assert recording.order.tolist() == list(range(12))
    assert recording.samples["file"][:2].tolist() == ["a/1.png", "a/2.png"]
    order = np.random.default_rng(1).permutation(12)
    assert np.array_equal(recording.frames(order), pixels[order])
    assert np.array_equal(np.stack(list(recording.stream(order))), pixels[order])
    assert np.array_equal(recording[2:5], pixels[2:5])
    assert np.array_equal(recording[-1 % 12], pixels[11])
    assert recording.frames([]).shape == (0, 20, 30)
    assert recording.place(5) == str(folder / "b" / "2.png")
    with pytest.raises(IndexError, match=r"expected values in \[0, 12\)"):
        recording.frames([12])
    window = {"crop": [3, 2, 20, 11], "subsample": 3}
    part = open_recording(folder, **window, **settings)
    assert np.array_equal(all_of(part), pixels[:, 2:13:3, 3:23:3])
    assert part.fingerprint() != recording.fingerprint()


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tif", ".TIFF", ".PNG", ".jpg"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_every_kind_of_image_comes_back_as_it_was(tmp_path, suffix, dtype):
    if dtype == np.uint16 and suffix in (".bmp", ".jpg"):
        return  # those formats hold 8 bits
    smooth = np.add.outer(np.arange(16), np.arange(16)) * (np.iinfo(dtype).max // 64)
    for name, k in (("a", 0), ("b", 1)):
        write(tmp_path / name / f"x{suffix}", (smooth + k).astype(dtype))
    frames = all_of(open_recording(tmp_path))
    assert frames.dtype == dtype
    expected = np.stack([smooth, smooth + 1])
    assert np.abs(frames.astype(int) - expected).max() <= (3 if suffix == ".jpg" else 0)


@pytest.mark.parametrize(
    ("suffix", "dtype"), [(".png", np.uint8), (".png", np.uint16), (".tif", np.uint8)]
)
def test_colour_becomes_luminance(tmp_path, suffix, dtype):
    rng = np.random.default_rng(0)
    image = rng.integers(0, np.iinfo(dtype).max, (9, 8, 3)).astype(dtype)
    for name in "ab":
        write(tmp_path / name / f"x{suffix}", image)
    blue, green, red = (image[..., k].astype(float) for k in range(3))
    expected = 0.299 * red + 0.587 * green + 0.114 * blue
    frames = all_of(open_recording(tmp_path))
    assert np.abs(frames[0] - expected).max() <= 2  # OpenCV rounds its weights
    alpha = np.dstack([image, rng.integers(0, 255, (9, 8)).astype(dtype)])
    for name in "ab":
        write(tmp_path / "alpha" / name / f"x{suffix}", alpha)
    assert np.array_equal(all_of(open_recording(tmp_path / "alpha")), frames)


def test_fingerprints_are_of_contents_not_of_places(folder, tmp_path, pixels):
    first = open_recording(folder).fingerprint()
    (folder / "notes.txt").write_text("x")
    moved = folder.rename(tmp_path / "elsewhere")
    assert open_recording(moved).fingerprint() == first
    assert open_recording(moved, check=False).fingerprint() == first
    write(moved / "a" / "1.png", pixels[0] ^ 1)
    assert open_recording(moved).fingerprint() != first


def test_a_bad_frame_is_named_at_once_or_when_it_is_asked_for(folder, pixels):
    write(folder / "c" / "9.png", pixels[0].astype(np.uint16))
    with pytest.raises(
        BadFrame, match=r"c/9.png: .*uint8 as in the other frames, found 30 × 20"
    ):
        open_recording(folder)
    (folder / "b" / "9.png").write_bytes(b"")
    with pytest.raises(
        BadFrame, match=r"b/9.png: expected an image \(PNG, .*found other data"
    ):
        open_recording(folder)
    frames = open_recording(folder, check=False).stream()
    assert np.array_equal(next(frames), pixels[0])
    with pytest.raises(BadFrame, match=r"b/9.png"):
        list(frames)


def encoded(image, suffix=".png", *parameters):
    return cv2.imencode(suffix, image, parameters)[1].tobytes()


def saved(format, *images, **options):
    stream = io.BytesIO()
    first, *rest = map(Image.fromarray, images)
    first.save(stream, format, save_all=bool(rest), append_images=rest, **options)
    return stream.getvalue()


def bomb(side):
    """A small PNG that says it is a large one."""
    header = b"IHDR" + struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    checked = header + struct.pack(">I", zlib.crc32(header))
    return (whole := encoded(NOISE))[:12] + checked + whole[12 + len(checked) :]


NOISE = np.random.default_rng(0).integers(0, 256, (20, 30), dtype=np.uint8)


def palette():
    stream = io.BytesIO()
    Image.fromarray(NOISE).quantize(16).save(stream, "TIFF")
    return stream.getvalue()


@pytest.mark.parametrize(
    ("data", "suffix", "message"),
    [
        (encoded(NOISE)[:-30], ".png", "whole image"),
        (encoded(NOISE)[:-1], ".png", "whole image"),
        (encoded(NOISE, ".jpg")[:-40], ".jpg", "whole image"),
        (encoded(NOISE, ".bmp")[:-1], ".bmp", "whole image"),
        (encoded(NOISE, ".tif")[:-100], ".tif", "whole TIFF"),
        (bytes(9), ".png", "found other data"),
        (saved("PNG", NOISE, NOISE), ".png", "a single image, found an animation"),
        (saved("TIFF", NOISE, NOISE), ".tif", "expected a single image, found 2"),
        (bomb(40_000), ".png", "at most 268435456 pixels"),
        (saved("GIF", NOISE), ".png", "found other data"),
        (palette(), ".tif", "expected grey or RGB, found PALETTE"),
    ],
)
def test_images_that_would_be_learnt_wrongly_are_refused(
    tmp_path, data, suffix, message
):
    for name in "ab":
        (tmp_path / name).mkdir()
        (tmp_path / name / f"1{suffix}").write_bytes(data)
    with pytest.raises(BadFrame, match=rf"a/1{suffix}: .*{message}"):
        open_recording(tmp_path)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tif"])
def test_damaged_images_are_refused_or_have_their_size(tmp_path, suffix):
    """Cut anywhere they are refused; bytes that were changed are, where there is a checksum."""
    whole, rng = encoded(NOISE, suffix), np.random.default_rng(0)
    (tmp_path / "b").mkdir()
    write(tmp_path / "a" / "1.png", NOISE)
    (tmp_path / "b" / f"1{suffix}").write_bytes(whole)
    reference = all_of(open_recording(tmp_path))
    for k in range(60):
        damaged, at = bytearray(whole), int(rng.integers(len(whole)))
        if k % 2:
            del damaged[at:]
        else:
            damaged[at] ^= int(rng.integers(1, 256))
        (tmp_path / "b" / f"1{suffix}").write_bytes(damaged)
        try:
            frames = all_of(open_recording(tmp_path))
        except BadFrame as error:
            assert f"b/1{suffix}" in str(error)  # noqa: PT017
        else:
            assert frames.shape == (2, 20, 30)
            if (
                k % 2 or suffix == ".png"
            ):  # what was cut off, such as a last tag, is no pixel
                assert np.array_equal(frames[1], reference[1])


def test_a_jpeg_with_a_lost_block_of_zeros_is_refused(tmp_path):
    """cracks: the decoder went on, with three quarters of the pixels wrong."""
    image = np.random.default_rng(0).integers(0, 256, (120, 160), np.uint8)
    whole = encoded(image, ".jpg")
    for start, end in ((5000, 6024), (5000, len(whole)), (2000, len(whole) - 2)):
        lost = whole[:start] + bytes(end - start) + whole[end:]
        (tmp_path / "1.jpg").write_bytes(lost)
        with pytest.raises(BadFrame, match=r"1.jpg: expected a whole image"):
            decode(tmp_path / "1.jpg")


def test_zeros_beside_a_thumbnail_are_no_damage(tmp_path):
    """Cameras pad what they write beside it."""
    whole, small = encoded(NOISE, ".jpg"), encoded(NOISE[::2, ::2], ".jpg")
    about = b"Exif\0\0" + small + bytes(2000)
    segment = b"\xff\xe1" + struct.pack(">H", len(about) + 2) + about
    (tmp_path / "1.jpg").write_bytes(whole[:2] + segment + whole[2:])
    assert np.array_equal(decode(tmp_path / "1.jpg"), cv2.imdecode(
        np.frombuffer(whole, np.uint8), cv2.IMREAD_UNCHANGED))  # fmt: skip


def test_what_follows_the_end_of_a_jpeg_is_no_damage(tmp_path):
    """Phones append the film of a motion photo."""
    whole = encoded(NOISE, ".jpg")
    film = b"\0\0\0\x18ftypmp42" + bytes(600) + b"\xff\xda" + bytes(600)
    (tmp_path / "1.jpg").write_bytes(whole + film)
    expected = cv2.imdecode(np.frombuffer(whole, np.uint8), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(decode(tmp_path / "1.jpg"), expected)


BITFIELDS = {
    "usual": (32, (0xFF0000, 0xFF00, 0xFF)),
    "red first": (32, (0xFF, 0xFF00, 0xFF0000)),
    "ten bits": (32, (0x3FF00000, 0xFFC00, 0x3FF)),
    "sixteen": (16, (0xF800, 0x7E0, 0x1F)),
}


@pytest.mark.parametrize("name", BITFIELDS)
@pytest.mark.parametrize("down", [False, True])
def test_pixels_of_a_bmp_are_parted_by_its_masks(tmp_path, name, down):
    """OpenCV ignores unusual masks, and calls 16 bits with later headers damaged."""
    bits, masks = BITFIELDS[name]
    image = np.random.default_rng(0).integers(0, 256, (5, 7, 3), np.uint8)
    pixels, levels = np.zeros((5, 7), np.uint32), []
    for plane, mask in zip(np.moveaxis(image, 2, 0)[::-1], masks, strict=True):
        shift = (mask & -mask).bit_length() - 1
        most = mask >> shift
        level = np.round(plane * (most / 255)).astype(np.uint32)
        levels.append(np.round(level * (255 / most)))
        pixels |= level << shift
    rows = pixels.astype(f"<u{bits // 8}")
    rows = np.pad(rows, [(0, 0), (0, 7 * bits // 8 % 4 * 8 // bits)])
    body = (rows if down else rows[::-1]).tobytes()
    header = struct.pack(
        "<IiiHHIIiiII", 108, 7, -5 if down else 5, 1, bits, 3, 0, 0, 0, 0, 0
    )
    header += struct.pack("<IIII", *masks, 0) + bytes(52)
    start = 14 + len(header)
    head = b"BM" + struct.pack("<IHHI", start + len(body), 0, 0, start)
    (tmp_path / "1.bmp").write_bytes(head + header + body)
    expected = np.stack(levels[::-1], axis=2)
    assert np.array_equal(decode(tmp_path / "1.bmp")[..., :3], expected)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("colour", [False, True])
def test_pixels_of_a_tiff_are_as_they_are_stored(tmp_path, orientation, colour):
    """cracks: an orientation tag was applied."""
    image = np.dstack([NOISE] * 3) if colour else NOISE
    data = saved("TIFF", image, exif={274: orientation})
    with Image.open(io.BytesIO(data)) as written:
        assert written.tag_v2.get(274, 1) == orientation
    for name in "ab":
        (tmp_path / name).mkdir()
        (tmp_path / name / "1.tif").write_bytes(data)
    assert np.array_equal(open_recording(tmp_path).frames([0])[0], NOISE)


def test_pixels_that_are_not_finite_are_named_with_their_file(tmp_path):
    """As tables of height have them where nothing was measured."""
    for name in "ab":
        (tmp_path / name).mkdir()
        tifffile.imwrite(tmp_path / name / "1.tif", NOISE.astype("f4"))
    recording = open_recording(tmp_path)
    assert np.array_equal(recording[0], NOISE)
    hole = NOISE.astype("f4")
    hole[3, 4] = np.nan
    tifffile.imwrite(tmp_path / "b" / "1.tif", hole)
    with pytest.raises(BadFrame, match=r"b/1\.tif: expected finite numbers, found nan"):
        open_recording(tmp_path)


def entry(tag, kind, value):
    return struct.pack("<HHII", tag, kind, 1, value)


def test_a_tiff_of_one_bit_may_leave_out_what_is_the_default(tmp_path):
    """TIFF 6.0: one bit a pixel and one sample where no tag says another number."""
    short, long = 3, 4
    tags = [(256, long, 8), (257, long, 2), (259, short, 1), (262, short, 1),
            (273, long, 8), (278, long, 2), (279, long, 2)]  # fmt: skip
    fields = b"".join(entry(*tag) for tag in tags)
    pixels = bytes([0b11110000, 0b00000001])
    data = struct.pack("<2sHI", b"II", 42, 10) + pixels
    data += struct.pack("<H", len(tags)) + fields + bytes(4)
    path = tmp_path / "1.tif"
    path.write_bytes(data)
    assert decode(path).tolist() == [[255] * 4 + [0] * 4, [0] * 7 + [255]]


def test_the_digest_of_images_is_that_of_their_digests(folder):
    """Results are known by it: it is to stay as it is."""
    contents = [path.read_bytes() for path in sorted(folder.rglob("*.png"))]
    whole = hashlib.sha256()
    for content in contents:
        whole.update(hashlib.sha256(content).digest())
    assert open_recording(folder).digest() == whole.hexdigest()


def test_batches_are_the_frames_one_after_the_other_in_the_same_memory(folder, pixels):
    index = np.random.default_rng(0).permutation(12)
    batches = open_recording(folder).batches(index)
    assert (len(batches), batches.shape) == (12, (12, 20, 30))
    first = batches[:5]
    assert first.dtype == np.uint8
    assert np.array_equal(first, pixels[index[:5]])
    second = batches[5:10]
    assert np.shares_memory(first, second)
    assert np.array_equal(second, pixels[index[5:10]])
    assert np.array_equal(batches[10:15], pixels[index[10:]])
