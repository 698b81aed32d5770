"""Videos: the labelled frames, whichever are asked for first, and an end where there is one."""

import cv2
import numpy as np
import pytest

from scenes.frames import Scene
from scenes.recorded import BadFrame, open_recording
from scenes.recorded import video as module

RATE, N = 10, 60
TABLE = "start_s,end_s,label\n0.3,1.0,press\n1.0,2.5,free\n5,6,press\n"
NUMBERS = [*range(3, 25), *range(50, 60)]


def grey_of(number):
    return 10 + 4 * (23 * number % N)  # neighbours differ by more than the coding changes them


@pytest.fixture(params=["x.avi", "x.mp4", "x.mkv"])
def film(request, tmp_path):
    """Frame k is uniformly grey_of(k), 48 × 32 pixels, 10 Hz."""
    path = tmp_path / request.param
    code = {".avi": "MJPG", ".mp4": "mp4v", ".mkv": "FFV1"}[path.suffix]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), RATE, (48, 32))
    if not writer.isOpened():
        pytest.skip(f"this build of OpenCV cannot write {code} videos")
    for k in range(N):
        writer.write(np.full((32, 48, 3), grey_of(k), np.uint8))
    writer.release()
    path.with_suffix(".csv").write_text(TABLE)
    return path


@pytest.mark.parametrize("memory_bytes", [2**31, 0])
def test_a_video_is_a_scene(film, memory_bytes):
    scene = open_recording(film, memory_bytes=memory_bytes, crop=[8, 4, 16, 8], subsample=2)
    assert isinstance(scene, Scene)
    assert scene.classes == ("free", "press")
    assert scene.shape == (4, 8)
    assert scene.samples["frame"].tolist() == NUMBERS
    assert scene.samples["interval"].tolist() == [0] * 7 + [1] * 15 + [2] * 10
    assert np.allclose(scene.samples["time"], np.array(NUMBERS) / RATE)
    assert scene.labels.tolist() == [1] * 7 + [0] * 15 + [1] * 10
    order = np.random.default_rng(0).permutation(len(scene))
    for index in (np.arange(len(scene)), order, [31], [0, 0]):
        made = scene.frames(index).numpy().astype(int)
        expected = np.array([grey_of(NUMBERS[i]) for i in index])
        assert np.abs(made - expected[:, None, None]).max() <= 5
    assert scene.frames([]).shape == (0, 4, 8)


def test_a_stream_does_not_trust_seeking(film, monkeypatch):
    """A container that seeks to the wrong frame costs time, and gives the right frame."""
    monkeypatch.setattr(module, "_SEEK", 0)
    memory, stream = (open_recording(film, memory_bytes=m) for m in (2**31, 0))
    assert memory.fingerprint() == stream.fingerprint()

    class Wrong:
        def __init__(self, path):
            self.capture = open_(path)

        def __getattr__(self, name):
            return getattr(self.capture, name)

        def set(self, property_id, value):
            return self.capture.set(property_id, max(0, value - 5))

    open_ = module._open
    monkeypatch.setattr(module, "_open", Wrong)
    index = [30, 2, 20]
    assert np.array_equal(stream.frames(index).numpy(), memory.frames(index).numpy())


def test_a_video_that_changed_is_named(film):
    stream = open_recording(film, memory_bytes=0)
    other = cv2.VideoWriter_fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(film.with_name("y.avi")), other, RATE, (48, 32))
    writer.write(np.zeros((32, 48, 3), np.uint8))
    writer.release()
    film.with_name("y.avi").replace(film)
    with pytest.raises(BadFrame, match=rf"{film.name}: expected frame 4 as it was opened"):
        stream.frames([1])


def test_a_table_elsewhere(film, tmp_path):
    table = tmp_path / "other.csv"
    table.write_text("label,start_s,end_s,note\nb,1,2,\na,0,1,x\n")
    scene = open_recording(film, intervals=table)
    assert scene.classes == ("a", "b")
    assert scene.labels.tolist() == [0] * 10 + [1] * 10
    assert scene.fingerprint() != open_recording(film).fingerprint()


def test_a_video_that_ends_early_is_named(tmp_path):
    path = tmp_path / "x.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), RATE, (48, 32))
    noise = np.random.default_rng(0).integers(0, 256, (N, 32, 48, 3), dtype=np.uint8)
    for image in noise:
        writer.write(image)
    writer.release()
    path.with_suffix(".csv").write_text("start_s,end_s,label\n0,1,a\n1,6,b\n")
    whole = open_recording(path)
    assert len(whole) == N
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(
        BadFrame, match=r"x.avi: expected 60 frames as its header says, found it end"
    ):
        open_recording(path)
    part = open_recording(path, on_bad_frame="skip")
    path.with_suffix(".csv").write_text("start_s,end_s,label\n0,1,a\n1,5.9,b\n")
    assert len(open_recording(path, on_bad_frame="skip")) == len(part)
    assert open_recording(path, on_bad_frame="skip").fingerprint() != part.fingerprint()
    assert 10 < len(part) < N
    assert len(part) + len(part.skipped) == N
    intact = np.arange(len(part) - 1)  # the last frame may be cut through
    assert np.array_equal(part.frames(intact).numpy(), whole.frames(intact).numpy())


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("start_s,end_s,label\n0,1,a\n5,6.2,b\n", r"within the 6 s of .*, found 5–6.2 s"),
        ("start_s,end_s,label\n0,1,a\n1e30,2e30,b\n", "within the 6 s"),
        ("start_s,end_s,label\n0,1,a\n0.9,2,b\n", "do not overlap, found 0–1 s and 0.9–2 s"),
        ("start_s,end_s,label\n0,1,a\n1.01,1.02,b\n", "at least one frame in each interval"),
        ("start_s,end_s,label\n0,1,a\n2,1,b\n", "row 3: expected 0 ≤ start_s < end_s"),
        ("start_s,end_s,label\n0,1,a\nnan,1,b\n", "row 3: expected 0 ≤ start_s < end_s"),
        ("start_s,end_s,label\n0,1,a\n1,inf,b\n", "row 3: expected 0 ≤ start_s < end_s"),
        ("start_s,end_s,label\n-1,1,a\n", "row 2: expected 0 ≤ start_s < end_s"),
        ("start_s,end_s,label\n0,one,a\n", "row 2: expected seconds"),
        ("start_s,end_s,label\n0,1,\n", "row 2: expected a label"),
        ("start_s,end_s,label\n0,1,a\n2,3,a\n", "expected two classes or more, found only 'a'"),
        ("start,end,label\n0,1,a\n", "expected columns start_s, end_s, label"),
    ],
)
def test_a_table_that_does_not_fit_is_named(film, table, message):
    film.with_suffix(".csv").write_text(table)
    with pytest.raises(ValueError, match=message):
        open_recording(film)


def test_what_is_no_video_is_named(film):
    table = film.with_suffix(".csv")
    with pytest.raises(ValueError, match=r"at most 1000 pixels a frame .*, found 48 × 32"):
        open_recording(film, max_pixels=1000)
    with pytest.raises(ValueError, match=r"scene.crop: expected a window inside"):
        open_recording(film, crop=[0, 0, 49, 1])
    whole = film.read_bytes()
    film.write_bytes(whole[:40])
    with pytest.raises(ValueError, match=film.name):
        open_recording(film)
    for other in (b"", b"#EXTM3U\n#EXTINF:1,\nhttp://localhost/x.ts\n", b"not a video at all"):
        film.write_bytes(other)
        with pytest.raises(
            ValueError, match=rf"{film.name}: expected an mp4, mov, avi, mkv or webm"
        ):
            open_recording(film)
    table.unlink()
    with pytest.raises(ValueError, match=r"x.csv: expected a readable file"):
        open_recording(film)
