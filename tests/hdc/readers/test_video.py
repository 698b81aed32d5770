"""Videos: the labelled frames, whichever are asked for first, and an end where there is one."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from hdc.readers import BadFrame, Window, open_recording
from hdc.readers.video import stream_video

RATE, N = 10, 60
# What OpenCV cannot write: uniform frames of grey_of(k), 32 × 32 pixels, 25 Hz, written by FFmpeg
# with -flags +ildct+ilme, and with setpts.
VIDEOS = Path(__file__).parent / "videos"
TABLE = "start_s,end_s,label\n0.3,1.0,press\n1.0,2.5,free\n5,6,press\n"
NUMBERS = [*range(3, 25), *range(50, 60)]


def grey_of(number):
    return 10 + 4 * (
        23 * number % N
    )  # neighbours differ by more than the coding changes them


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


def test_a_video_is_a_scene(film):
    scene = open_recording(film, crop=[8, 4, 16, 8], subsample=2)
    assert scene.classes == ("free", "press")
    assert scene.shape == (4, 8)
    assert scene.samples["frame"].tolist() == NUMBERS
    assert scene.samples["interval"].tolist() == [0] * 7 + [1] * 15 + [2] * 10
    assert np.allclose(scene.samples["time"], np.array(NUMBERS) / RATE)
    assert scene.labels.tolist() == [1] * 7 + [0] * 15 + [1] * 10
    order = np.random.default_rng(0).permutation(len(scene))
    for index in (np.arange(len(scene)), order, [31], [0, 0]):
        made = scene.frames(index).astype(int)
        expected = np.array([grey_of(NUMBERS[i]) for i in index])
        assert np.abs(made - expected[:, None, None]).max() <= 5
    assert scene.frames([]).shape == (0, 4, 8)


def with_table(tmp_path, name, *intervals):
    """A copy of one of the videos beside this file, with a table of labelled intervals."""
    shutil.copyfile(VIDEOS / name, tmp_path / name)
    rows = ["start_s,end_s,label", *intervals]
    (tmp_path / name).with_suffix(".csv").write_text("\n".join(rows) + "\n")
    return tmp_path / name


def test_an_interlaced_video_is_refused_or_decoded(tmp_path):
    """MPEG-2, 25 Hz, of which OpenCV 5 makes whatever its memory held; uniform frames."""
    path = with_table(tmp_path, "interlaced.mkv", "0,0.2,a", "0.2,0.4,b")
    try:
        scene = open_recording(path)
    except ValueError as error:
        assert "interlaced.mkv: expected frames that differ" in str(error)  # noqa: PT017
    else:  # another version converts them
        means = scene.frames(np.arange(len(scene))).mean((1, 2))
        assert np.abs(means - [grey_of(k) for k in range(len(scene))]).max() <= 5


def test_times_are_those_of_the_container(tmp_path):
    """20 frames at 25 Hz, then 10 at 25/3 Hz: the mean rate would give other labels."""
    path = with_table(tmp_path, "variable_rate.mp4", "0,0.8,a", "0.8,1.3,b", "1.5,2,a")
    scene = open_recording(path)
    times = np.array([*np.arange(20) * 0.04, *(0.8 + np.arange(10) * 0.12)])
    numbers = [*range(25), *range(26, 30)]
    assert scene.samples["frame"].tolist() == numbers
    assert np.allclose(scene.samples["time"], times[numbers], atol=1e-3)
    assert scene.labels.tolist() == [0] * 20 + [1] * 5 + [0] * 4
    greys = scene.frames(np.arange(len(scene))).mean((1, 2))
    assert np.abs(greys - [grey_of(k) for k in numbers]).max() <= 5
    with_table(tmp_path, "variable_rate.mp4", "0,0.8,a", "0.85,0.9,b")
    with pytest.raises(ValueError, match=r"at least one frame of .*, found 0.85–0.9 s"):
        open_recording(path)


def test_which_frames_are_labelled_is_part_of_the_fingerprint(film):
    film.with_suffix(".csv").write_text("start_s,end_s,label\n0,1,a\n1,2,b\n")
    first = open_recording(film)
    film.with_suffix(".csv").write_text("start_s,end_s,label\n2,3,a\n3,4,b\n")
    second = open_recording(film)
    assert np.array_equal(first.labels, second.labels)
    assert first.fingerprint() != second.fingerprint()


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
    assert len(open_recording(path)) == N
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(
        BadFrame, match=r"x.avi: expected 60 frames as its header says, found "
    ):
        open_recording(path)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            "start_s,end_s,label\n0,1,a\n6,6.2,b\n",
            r"at least one frame of .*, found 6–6.2 s",
        ),
        (
            "start_s,end_s,label\n0,1,a\n0.9,2,b\n",
            "do not overlap, found 0–1 s and 0.9–2 s",
        ),
        ("start_s,end_s,label\n0,1,a\n1.01,1.02,b\n", "at least one frame of "),
        ("start_s,end_s,label\n0,1,a\n2,1,b\n", "line 3: expected 0 ≤ start_s < end_s"),
        (
            "start_s,end_s,label\n0,1,a\n1,inf,b\n",
            "line 3: expected 0 ≤ start_s < end_s",
        ),
        ("start_s,end_s,label\n0,one,a\n", "line 2: expected seconds"),
        ("start_s,end_s,label\n0,1,\n", "line 2: expected a label"),
        (
            "start_s,end_s,label\n0,1,a\n2,3,a\n",
            "expected two classes or more, found only 'a'",
        ),
        (
            "start,end,label\n0,1,a\n",
            "expected different columns, with start_s, end_s, label",
        ),
    ],
)
def test_a_table_that_does_not_fit_is_named(film, table, message):
    film.with_suffix(".csv").write_text(table)
    with pytest.raises(ValueError, match=message):
        open_recording(film)


def test_what_is_no_video_is_named(film):
    table = film.with_suffix(".csv")
    with pytest.raises(ValueError, match=r"crop: expected a window inside"):
        open_recording(film, crop=[0, 0, 49, 1])
    whole = film.read_bytes()
    film.write_bytes(whole[:40])
    with pytest.raises(ValueError, match=film.name):
        open_recording(film)
    for other in (b"", b"not a video at all"):
        film.write_bytes(other)
        with pytest.raises(
            ValueError, match=rf"{film.name}: expected a video of known length"
        ):
            open_recording(film)
    table.unlink()
    with pytest.raises(
        ValueError, match=r"x.csv: expected a readable file, found none"
    ):
        open_recording(film)


class Shifted:
    """What OpenCV reads of a video, its times later by three seconds."""

    def __init__(self, *arguments):
        self._capture = OPEN(*arguments)

    def __getattr__(self, name):
        return getattr(self._capture, name)

    def get(self, what):
        found = self._capture.get(what)
        return found + 3000 if what == cv2.CAP_PROP_POS_MSEC else found


OPEN = cv2.VideoCapture


def test_times_count_from_the_first_frame(film, monkeypatch):
    """A container may begin at another time than 0."""
    before = open_recording(film)
    monkeypatch.setattr(cv2, "VideoCapture", Shifted)
    after = open_recording(film)
    assert after.samples["frame"].tolist() == before.samples["frame"].tolist()
    assert after.samples["time"] == pytest.approx(before.samples["time"], abs=1e-3)


def test_frames_lost_in_the_middle_are_noticed(tmp_path):
    """cracks: two frames fewer were learnt, without a word."""
    path = tmp_path / "x.mkv"
    code = cv2.VideoWriter_fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, RATE, (48, 32))
    rng = np.random.default_rng(0)
    for image in rng.integers(0, 256, (N, 32, 48, 3), dtype=np.uint8):
        writer.write(image)
    writer.release()
    table = path.with_suffix(".csv")
    table.write_text("start_s,end_s,label\n0,3,a\n3,6,b\n")
    assert len(open_recording(path)) == N
    damaged = bytearray(path.read_bytes())
    at = len(damaged) * 3 // 10
    damaged[at : at + 400] = bytes(400)
    path.write_bytes(damaged)
    times = [time for time, _ in decoded(path)]
    assert len(times) < N
    assert times[-1] == pytest.approx(5.9)  # they are missing from the middle
    message = (
        rf"x.mkv: expected 60 frames as its header says, found {len(times)} with gaps"
    )
    for rows in ("0,3,a\n3,6,b\n", "0,1,a\n1,4,b\n"):
        table.write_text(f"start_s,end_s,label\n{rows}")
        with pytest.raises(BadFrame, match=message):
            open_recording(path)
    with pytest.raises(BadFrame, match=message):
        list(stream_video(path, Window()))


def decoded(path):
    """Time and image of every frame that OpenCV gives."""
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    while capture.grab():
        yield capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3, capture.retrieve()[1]


def test_a_video_of_varying_rate_is_whole(tmp_path):
    path = tmp_path / "variable_rate.mp4"
    shutil.copyfile(VIDEOS / path.name, path)
    assert len(list(stream_video(path, Window()))) == 30


def test_seconds_are_numbers_as_they_are_written(film):
    film.with_suffix(".csv").write_text("start_s,end_s,label\n0,1_0,a\n")
    with pytest.raises(ValueError, match="line 2: expected seconds, found '1_0'"):
        open_recording(film)
