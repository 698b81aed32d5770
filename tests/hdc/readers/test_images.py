"""Folders of images: what is read is what was written, and what is broken is named."""

import os
import sys
import threading
import time

import cv2
import numpy as np
import pytest

from hdc.readers import BadFrame, Window, images, open_recording
from hdc.readers.listing import image_files


def all_of(scene):
    return scene.frames(np.arange(len(scene)))


def write(path, image, *parameters):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image, parameters)


def test_a_folder_is_a_recording(folder, pixels):
    scene = open_recording(folder)
    assert scene.classes == ("a", "b", "c")
    assert scene.labels.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert scene.shape == (20, 30)
    assert scene.skipped == ()
    assert scene.samples["order"].tolist() == list(range(12))
    assert scene.samples["file"][:2].tolist() == ["a/1.png", "a/2.png"]
    assert np.array_equal(all_of(scene), pixels)
    assert np.array_equal(scene.frames([5, 0]), pixels[[5, 0]])
    with pytest.raises(IndexError, match=r"expected values in \[0, 12\)"):
        scene.frames([12])


def test_a_folder_that_does_not_fit_is_read_as_a_stream(folder, pixels):
    stream = open_recording(folder, memory_bytes=5 * pixels[0].nbytes, threads=2)
    order = np.random.default_rng(1).permutation(12)
    assert np.array_equal(stream.frames(order), pixels[order])
    assert stream.frames([]).shape == (0, 20, 30)
    assert stream.fingerprint() == open_recording(folder).fingerprint()
    write(folder / "b" / "2.png", pixels[0])
    with pytest.raises(BadFrame, match=r"b/2.png: expected the file that was opened, found it cha"):
        stream.frames([5])
    assert np.array_equal(stream.frames([4]), pixels[[4]])


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


def test_threads_are_as_many_as_the_cores_that_may_be_used(folder, monkeypatch):
    started = []
    executor = images.ThreadPoolExecutor
    monkeypatch.setattr(
        images, "ThreadPoolExecutor", lambda n: started.append(n) or executor(max_workers=n)
    )
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    if sys.version_info >= (3, 13):
        monkeypatch.setattr(os, "process_cpu_count", lambda: 3)
    else:
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 5, 7}, raising=False)
    open_recording(folder)
    assert started == [3]


@pytest.mark.parametrize("memory_bytes", [2**31, 0])
def test_frames_come_one_after_the_other_and_are_decoded_ahead(
    folder, pixels, memory_bytes, monkeypatch
):
    scene = open_recording(folder, memory_bytes=memory_bytes, threads=2)
    decoded = []
    decode = cv2.imdecode
    monkeypatch.setattr(cv2, "imdecode", lambda *given: decoded.append(given) or decode(*given))
    order = np.random.default_rng(0).permutation(12)
    frames = scene.stream(order)
    assert np.array_equal(next(frames), pixels[order[0]])
    time.sleep(0.2)
    assert len(decoded) == (0 if memory_bytes else 9)  # 4 a thread and what was taken, not all
    assert np.array_equal(np.stack(list(frames)), pixels[order[1:]])
    assert len(list(scene.stream())) == 12
    with pytest.raises(IndexError, match=r"expected values in \[0, 12\)"):
        scene.stream([12])


def test_a_stream_decodes_each_image_once_in_the_order_asked_for(folder, pixels, monkeypatch):
    decoded = []
    decode = cv2.imdecode
    monkeypatch.setattr(cv2, "imdecode", lambda *given: decoded.append(given) or decode(*given))
    stream = open_stream(folder, options=Options(Window([2, 1, 20, 10], 3)))
    assert decoded == []
    assert stream.labels == [*"aaaabbbbcccc"]
    order = np.random.default_rng(0).permutation(12)
    expected = pixels[order][:, 1:11:3, 2:22:3]
    assert np.array_equal(list(stream.each(order)), expected)
    assert len(decoded) == 12
    assert stream.place(5) == str(folder / "b" / "2.png")
    np.savez(folder / "x.npz", frames=pixels, labels=np.arange(12) // 4)
    archive = open_stream(folder / "x.npz", options=Options(Window([2, 1, 20, 10], 3)))
    assert np.array_equal(list(archive.each(order)), expected)
    assert archive.place(5) == f"{folder}/x.npz, frame 5"


def test_a_stream_stops_at_the_image_that_is_not_like_the_first(folder, pixels):
    write(folder / "b" / "3.png", pixels[0].astype(np.uint16))
    frames = open_stream(folder).each(np.arange(12))
    for i in range(6):
        assert np.array_equal(next(frames), pixels[i])
    with pytest.raises(BadFrame, match=r"b/3.png: .* 30 × 20 pixels uint8 as of .*/a/1.png, found"):
        next(frames)


def test_images_are_found_in_all_sub_folders(folder, pixels, tmp_path):
    write(folder / "b" / "deep" / "10.png", pixels[0])
    write(folder / "b" / "deep" / "9.png", pixels[0])
    write(folder / "b" / ".hidden" / "1.png", pixels[0])
    (folder / "b" / "notes.txt").write_text("x")
    (folder / "c" / "again").symlink_to(folder)
    found = [path.relative_to(folder).as_posix() for path in image_files(folder)]
    assert found[:4] == [f"a/{k}.png" for k in (1, 2, 3, 4)]
    assert found[4:10] == [*(f"b/{k}.png" for k in (1, 2, 3, 4)), "b/deep/9.png", "b/deep/10.png"]
    assert len(found) == 14
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match=r"expected images \(.png, .*, found none"):
        image_files(tmp_path / "empty")
