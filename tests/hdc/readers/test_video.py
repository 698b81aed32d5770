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


class Stated:
    """A video of uniform frames at 10 Hz by its times in s, and the length that a header says."""

    def __init__(self, times, length):
        self._times, self._length, self._at = times, length, -1

    def isOpened(self):
        return True

    def get(self, what):
        if what == cv2.CAP_PROP_POS_MSEC:
            return 1000 * self._times[self._at]
        return {cv2.CAP_PROP_FPS: RATE, cv2.CAP_PROP_FRAME_COUNT: self._length}[what]

    def grab(self):
        self._at += 1
        return self._at < len(self._times)

    def retrieve(self):
        return True, np.full((2, 3), self._at, np.uint8)


def tenths(*numbers):
    return [number / 10 for number in numbers]


@pytest.mark.parametrize(
    ("times", "length", "end", "found"),
    [
        (tenths(*range(10)), 10, np.inf, 10),
        (tenths(*range(9)), 10, np.inf, 9),  # a header may count one too many
        (tenths(*range(8)), 10, np.inf, "expected 10 frames .*, found 8$"),
        (tenths(*range(8)), 10, 0.8, 8),  # whole up to where it is needed
        (tenths(*range(8)), 10, 0.5, 5),
        (
            tenths(*range(10), 11),
            12,
            np.inf,
            "expected 12 frames .*, found 11 with gaps",
        ),
        (tenths(*range(10), 11), 12, 0.8, 8),  # the gap is behind
        (tenths(*range(10), 11, 12), 13, 1.15, "13 frames .*, found 12 with gaps"),
        (tenths(*range(10), 11), 11, np.inf, 11),  # the header knows of the gap
        (tenths(*range(9), 10), 11, np.inf, 10),  # a rate that varies has more gaps
        (tenths(0, 1, 3, 4, 6, 7), 8, np.inf, 6),
        (tenths(0, 1, 2, 2), 4, np.inf, "frame 3 at 0.2 s after one at 0.2 s"),
    ],
)
def test_frames_are_missing_by_their_times_and_the_header(
    monkeypatch, times, length, end, found
):
    """At an even rate one gap in nine steps is a loss; more are a rate that varies."""
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: Stated(times, length))
    frames = stream_video(Path("x.mkv"), Window(), end)
    if isinstance(found, str):
        with pytest.raises(ValueError, match=rf"x\.mkv: .*{found}"):
            list(frames)
        return
    given = list(frames)
    assert [time for time, _ in given] == pytest.approx(times[:found])
    assert [frame[0, 0] for _, frame in given] == list(range(found))


def test_times_that_a_container_rounds_are_made_even(monkeypatch):
    rounded = [0.0, 0.1006, 0.1994, 0.35]
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: Stated(rounded, 4))
    times = [time for time, _ in stream_video(Path("x.mkv"), Window())]
    assert times == pytest.approx([0, 0.1, 0.2, 0.35], abs=1e-9)


def test_a_table_of_frames_gives_labels_values_and_sessions(film, tmp_path):
    table = tmp_path / "t.csv"
    table.write_text(
        "frame,label,force,session,note\n40,b,1.5,9,x\n3,a,2,8,y\n7,b,-1,9,z\n"
    )
    scene = open_recording(film, table=table, crop=[8, 4, 16, 8])
    assert (scene.classes, scene.labels.tolist()) == (("a", "b"), [1, 0, 1])
    assert scene.value_names == ("force",)
    assert scene.values.tolist() == [[1.5], [2.0], [-1.0]]
    assert scene.order.tolist() == scene.samples["frame"].tolist() == [40, 3, 7]
    assert scene.samples["time"] == pytest.approx([4, 0.3, 0.7])
    assert scene.session.tolist() == [9, 8, 9]
    assert (scene.shape, scene.dtype) == ((8, 16), np.uint8)
    assert scene.place(1) == f"{film}, frame 3"
    means = scene.frames([0, 1, 2]).mean((1, 2))
    assert np.abs(means - [grey_of(40), grey_of(3), grey_of(7)]).max() <= 5
    first = scene.fingerprint()
    table.write_text(table.read_text().replace("\n7,", "\n8,"))
    assert open_recording(film, table=table, crop=[8, 4, 16, 8]).fingerprint() != first
    table.write_text("frame,label,note\n40,b,x\n3,a,y\n")  # labels alone
    scene = open_recording(film, table=table)
    assert (scene.names, scene.values, scene.value_names) == (["b", "a"], None, ())


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("frame,force\n", r"t\.csv: expected at least one row, found none"),
        ("frame,note\n1,x\n", r"t\.csv: expected columns of numbers, found none"),
        ("frame,label\n1,a\n2,a\n", r"t\.csv: .* two classes or more, found only 'a'"),
        ("frame,x,order\n1,2,z\n", r"t\.csv: expected 1 numbers in the column order"),
        ("frame,x\n5,2\n60,1\n", r"t\.csv: .* the 60 frames of x\.\w+, .* found 60"),
        ("frame,x\n-1,2\n", r"t\.csv, line 2: expected a number of a frame .*'-1'"),
    ],
)
def test_a_table_of_frames_that_does_not_fit_is_named(film, tmp_path, rows, message):
    (tmp_path / "t.csv").write_text(rows)
    with pytest.raises(ValueError, match=message):
        open_recording(film, table=tmp_path / "t.csv")
