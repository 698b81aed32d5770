"""Videos: the labelled frames, whichever are asked for first, and an end where there is one."""

import shutil
import struct
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import av
import cv2
import numpy as np
import pytest

from hdc.command.splits import hold_out
from hdc.readers import BadFrame, Window, open_recording
from hdc.readers.film import _pixels, stream_video
_Times = None

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
def film(request, write_film, tmp_path):
    """Frame k is uniformly grey_of(k), 48 × 32 pixels, 10 Hz."""
    path = tmp_path / request.param
    code = {".avi": "MJPG", ".mp4": "mp4v", ".mkv": "FFV1"}[path.suffix]
    write_film(path, [np.full((32, 48), grey_of(k), np.uint8) for k in range(N)], code)
    path.with_suffix(".csv").write_text(TABLE)
    return path


def test_a_video_is_a_scene(film):
    scene = open_recording(film, crop=[8, 4, 16, 8], subsample=2)
    assert scene.classes == ("free", "press")
    assert scene.frame_shape == (4, 8)
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


def test_an_interlaced_video_is_decoded_and_said_to_be_such(tmp_path):
    """MPEG-2, 25 Hz; uniform frames."""
    path = with_table(tmp_path, "interlaced.mkv", "0,0.2,a", "0.2,0.4,b")
    scene = open_recording(path)
    means = scene.frames(np.arange(len(scene))).mean((1, 2))
    assert np.abs(means - [grey_of(k) for k in range(len(scene))]).max() <= 5
    assert scene.notes == ("interlaced: ffmpeg -vf yadif separates fields",)


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
    scene = open_recording(film, table=table)
    assert scene.classes == ("a", "b")
    assert scene.labels.tolist() == [0] * 10 + [1] * 10
    assert scene.fingerprint() != open_recording(film).fingerprint()


def test_intervals_have_sessions_and_groups(film):
    """They were read and ignored: near copies were on both sides of a split."""
    rows = [
        "start_s,end_s,label,session,group",
        "2,3,a,day10,p2",
        "0,1,a,day2,p1",
        "1,2,b,day2,p1",
    ]
    film.with_suffix(".csv").write_text("\n".join(rows))
    scene = open_recording(film)
    assert scene.session.tolist() == [0] * 20 + [1] * 10
    assert scene.samples["session_name"][[0, -1]].tolist() == ["day2", "day10"]
    assert scene.samples["group_name"].tolist() == ["p1"] * 20 + ["p2"] * 10
    assert scene.names == ["a"] * 10 + ["b"] * 10 + ["a"] * 10
    film.with_suffix(".csv").write_text("\n".join([*rows, "3,4,b,,p2"]))
    with pytest.raises(
        ValueError, match=r"csv, line 5: expected the session of each row"
    ):
        open_recording(film)


def test_a_video_that_ends_early_is_named(write_film, tmp_path):
    path, rng = tmp_path / "x.avi", np.random.default_rng(0)
    write_film(path, rng.integers(0, 256, (N, 32, 48), dtype=np.uint8), "MJPG")
    path.with_suffix(".csv").write_text("start_s,end_s,label\n0,1,a\n1,6,b\n")
    assert len(open_recording(path)) == N
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 3])
    with pytest.raises(
        BadFrame, match=r"x.avi: expected a whole video, found: Invalid data"
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
            "line 3: expected seconds, found 'inf'",
        ),
        ("start_s,end_s,label\n0,1_0,a\n", "line 2: expected seconds, found '1_0'"),
        ("start_s,end_s,label\n0,1,\n", "line 2: expected a label"),
        (
            "start_s,end_s,label\n0,1,a\n2,3,a\n",
            "expected two classes or more, found only 'a'",
        ),
        (
            "start,end,label\n0,1,a\n",
            "expected a column frame, or start_s, end_s and label, found start",
        ),
    ],
)
@pytest.mark.parametrize("film", ["x.avi"], indirect=True)
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
            ValueError, match=rf"{film.name}: expected a whole video, found: Invalid"
        ):
            open_recording(film)
    table.unlink()
    with pytest.raises(
        ValueError, match=r"x.csv: expected a table with start_s, end_s and label"
    ):
        open_recording(film)


def encoded(path, frames, pixels, code, times_ms):
    """Write frames [n, H, W] losslessly, at these times in ms."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(code, rate=Fraction(RATE))
        stream.height, stream.width = frames[0].shape
        stream.pix_fmt = pixels
        stream.codec_context.time_base = Fraction(1, 1000)
        for frame, time in zip(frames, times_ms, strict=True):
            image = av.VideoFrame.from_ndarray(frame, format=pixels)
            image.pts, image.time_base = time, Fraction(1, 1000)
            for packet in stream.encode(image):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


def test_times_count_from_the_first_frame(tmp_path):
    """A container may begin at another time than 0."""
    frames = np.arange(20, dtype=np.uint8)[:, None, None] + np.zeros((32, 48), "u1")
    path = encoded(tmp_path / "x.mkv", frames, "gray", "ffv1", range(3000, 5000, 100))
    with av.open(str(path)) as container:
        assert next(container.decode(video=0)).time == 3
    path.with_suffix(".csv").write_text("start_s,end_s,label\n0,0.5,a\n0.5,1,b\n")
    scene = open_recording(path)
    assert scene.samples["frame"].tolist() == list(range(10))
    assert scene.samples["time"] == pytest.approx(np.arange(10) / 10)
    assert scene.names == ["a"] * 5 + ["b"] * 5
    assert scene.frames(range(10))[:, 0, 0].tolist() == list(range(10))


@pytest.mark.parametrize(("pixels", "bits"), [("gray16le", 16), ("gray10le", 10)])
def test_grey_of_more_bits_comes_as_it_was_written(tmp_path, pixels, bits):
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 2**bits, (6, 32, 48), dtype=np.uint16)
    path = encoded(tmp_path / "x.mkv", frames, pixels, "ffv1", range(0, 600, 100))
    path.with_suffix(".csv").write_text("frame,label\n1,a\n4,b\n")
    scene = open_recording(path)
    assert np.array_equal(scene[:], frames[[1, 4]])
    assert scene.dtype == np.uint16
    assert scene.notes == (f"{bits} bits per pixel",)


def test_luminance_of_more_bits_is_scaled_to_16_and_said():
    frame = av.VideoFrame(48, 32, "yuv420p10le")
    for plane, level in zip(frame.planes, (940, 512, 512), strict=True):  # white
        plane.update(np.full(plane.buffer_size // 2, level, np.uint16).tobytes())
    notes = []
    image = _pixels(Path("x"), frame, notes)
    assert notes == ["luminance of 10 bits, scaled to 16"]
    assert image.dtype == np.uint16
    assert image.min() == image.max() > 0.99 * 65535


def shown_by(path, a, b, c, d):
    """An mp4 whose header has this display matrix."""
    one = 1 << 16
    matrix = [a * one, b * one, 0, c * one, d * one, 0, 0, 0, 1 << 30]
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + 44
    assert data[at : at + 36] == struct.pack(">9i", one, 0, 0, 0, one, 0, 0, 0, 1 << 30)
    data[at : at + 36] = struct.pack(">9i", *map(int, matrix))
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("matrix", "shown", "said"),
    [
        ((1, 0, 0, 1), lambda i: i, ""),
        ((0, 1, -1, 0), lambda i: np.rot90(i, -1), "turned by 270° as the file says"),
        ((-1, 0, 0, -1), lambda i: np.rot90(i, 2), "turned by 180° as the file says"),
        ((0, -1, 1, 0), np.rot90, "turned by 90° as the file says"),
        ((-1, 0, 0, 1), np.fliplr, "mirrored as the file says"),  # of a front camera
        ((1, 0, 0, -1), np.flipud, "mirrored as the file says"),
        ((0, 1, 1, 0), np.transpose, "mirrored as the file says"),
        ((0, -1, -1, 0), lambda i: np.rot90(i.T, 2), "mirrored as the file says"),
        ((0.5, 0, 0, 1), None, "expected a display matrix of quarter turns, found 0.5, 0"),
    ],
)  # fmt: skip
def test_frames_are_shown_as_the_file_says(write_film, tmp_path, matrix, shown, said):
    """Clockwise turns (ISO/IEC 14496-12); a mirrored video was turned by 180°."""
    image = np.zeros((32, 48), np.uint8)
    image[:16, :24] = 200  # the upper left quarter
    image[:16, 24:] = 100
    path = tmp_path / "x.mp4"
    write_film(path, [image] * 4, "mp4v")
    shown_by(path, *matrix)
    path.with_suffix(".csv").write_text("frame,label\n0,a\n1,b\n")
    if shown is None:
        with pytest.raises(ValueError, match=rf"x.mp4: {said}"):
            open_recording(path)
        return
    scene = open_recording(path)
    expected = shown(image)
    assert scene.frame_shape == expected.shape
    assert np.abs(scene[0].astype(int) - expected).mean() < 8
    assert scene.notes == ((said,) if said else ())


def test_what_ffmpeg_logs_and_goes_on_over_is_damage(tmp_path):
    """Slices of FFV1 have checksums: flipped bits gave wrong pixels, without an error."""
    path = tmp_path / "x.mkv"
    frames = np.random.default_rng(0).integers(0, 256, (6, 64, 96), np.uint8)
    stream_options = {"slicecrc": "1", "level": "3"}
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=10, options=stream_options)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "gray"
        for frame in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, "gray")))
        container.mux(stream.encode())
    assert len(list(stream_video(path, Window()))) == 6
    whole = path.read_bytes()
    for place in range(2000, len(whole) - 500, 3000):
        damaged = bytearray(whole)
        damaged[place] ^= 1
        path.write_bytes(damaged)
        with pytest.raises(BadFrame, match=r"x.mkv: expected"):
            list(stream_video(path, Window()))


def test_a_codec_that_nobody_knows_is_one_line(write_film, tmp_path):
    write_film(tmp_path / "x.avi", np.zeros((3, 32, 32), np.uint8), "FMP4")
    data = (tmp_path / "x.avi").read_bytes().replace(b"FMP4", b"ZZZZ")
    (tmp_path / "x.avi").write_bytes(data)
    with pytest.raises(
        ValueError, match=r"x.avi: expected a codec that FFmpeg decodes"
    ):
        list(stream_video(tmp_path / "x.avi", Window()))


def test_a_video_that_does_not_fit_in_memory_is_decoded_anew(film):
    whole = open_recording(film)
    again = open_recording(film, memory_bytes=1000)
    for index in ([3, 4, 20], [20, 3, 3], []):
        assert np.array_equal(again.frames(index), whole.frames(index))


def test_frames_lost_in_the_middle_are_noticed(write_film, tmp_path):
    """cracks: two frames fewer were learnt, without a word."""
    path, rng = tmp_path / "x.mkv", np.random.default_rng(0)
    write_film(path, rng.integers(0, 256, (N, 32, 48), dtype=np.uint8), "MJPG")
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
    message = r"x.mkv: expected (frames at an even rate, found 1 gaps: some are lost|whole frames)"
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


@pytest.mark.parametrize(
    ("lasts", "end_s", "is_whole"),
    [(0.5, 3.8, True), (0.5, 3.9, False), (None, 3.2, True), (None, 3.3, False)],
)
def test_a_video_ends_within_one_and_a_half_frames_of_what_its_header_says(
    lasts, end_s, is_whole
):
    """Frames at 3.0 and 3.1 s, the last of which may be shown longer."""
    container = SimpleNamespace(duration=end_s * av.time_base, streams=[None])
    kept = _Times(Path("x.mkv"), container, SimpleNamespace(frames=0, metadata={}))
    for time in (3.0, 3.1):
        duration = None if lasts is None else 1000 * lasts
        kept.of(SimpleNamespace(time=time, duration=duration, time_base=0.001))
    if is_whole:
        kept.check_whole()
    else:
        with pytest.raises(BadFrame, match=rf"expected {end_s:g} s .*, found 2 frames"):
            kept.check_whole()


def test_a_video_of_varying_rate_is_whole(tmp_path):
    path = tmp_path / "variable_rate.mp4"
    shutil.copyfile(VIDEOS / path.name, path)
    assert len(list(stream_video(path, Window()))) == 30


def tenths(*numbers):
    return [number / 10 for number in numbers]


@pytest.mark.parametrize(
    ("times", "stated", "early", "found"),
    [
        (tenths(*range(10)), 10, False, None),
        (tenths(*range(10)), 0, False, None),  # the header says nothing
        (tenths(*range(9)), 10, False, "expected 10 frames .*, found 9$"),
        (tenths(*range(9)), 10, True, None),  # whole up to where it is needed
        (tenths(*range(10), 11), 11, False, None),  # the header knows of the gap
        (tenths(*range(10), 11), 0, False, "found 1 gaps"),
        (tenths(*range(10), 11), 0, True, "found 1 gaps"),
        (tenths(*range(9), 10), 0, False, None),  # a rate that varies has more gaps
        (tenths(0, 1, 3, 4, 6, 7), 0, False, None),
        ([], 0, False, "expected frames, found none"),
        ([], 0, True, None),
        (tenths(0, 1, 2, 2), 0, False, "frame 3 at 0.2 s after one at 0.2 s"),
    ],
)
def test_frames_are_missing_by_their_times_or_the_header(times, stated, early, found):
    """At an even rate one gap in nine steps is a loss; more are a rate that varies."""
    container = SimpleNamespace(duration=None, streams=[None])
    stream = SimpleNamespace(frames=stated, metadata={})
    kept = _Times(Path("x.mkv"), container, stream)

    def read():
        for time in times:
            frame = SimpleNamespace(time=time + 3, duration=0, time_base=1)
            assert kept.of(frame) == pytest.approx(time)
        kept.check_whole(early)

    if found is None:
        read()
    else:
        with pytest.raises(BadFrame, match=rf"x\.mkv: .*{found}"):
            read()


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
    assert (scene.frame_shape, scene.dtype) == ((8, 16), np.uint8)
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
        ("frame,force\n", r"t\.csv: expected a row per frame, found none"),
        ("frame,note\n1,x\n", r"t\.csv: expected a label of each .*, found note"),
        ("frame,label\n1,a\n2,a\n", r"t\.csv: .* two classes or more, found only 'a'"),
        ("frame,x,order\n1,2,z\n", r"t\.csv, line 2: expected a number in order"),
        (
            "frame,x\n5,2\n60,1\n",
            r"t\.csv: expected numbers of the 60 frames of x\.avi, from 0, found 60",
        ),
        ("frame,x\n-1,2\n", r"t\.csv, line 2: expected a number of a frame .*'-1'"),
        ("frame,x\n1,1\n1,2\n", r"line 3: expected a number .* from 0, each once"),
        ("frame,x\n1,1\n2,\n", "line 3: expected a number in x, found ''"),
    ],
)
@pytest.mark.parametrize("film", ["x.avi"], indirect=True)
def test_a_table_of_frames_that_does_not_fit_is_named(film, tmp_path, rows, message):
    (tmp_path / "t.csv").write_text(rows)
    with pytest.raises(ValueError, match=message):
        open_recording(film, table=tmp_path / "t.csv")


@pytest.mark.parametrize("fraction", [0.1, 0.25, 0.4])
def test_whole_intervals_are_held_out_of_each_class_alike(film, fraction):
    """Frames of one touch were trained on and tested on."""
    rows = [f"{k / 2},{k / 2 + 0.5},{'ab'[k % 2]}" for k in range(8)]
    film.with_suffix(".csv").write_text("\n".join(["start_s,end_s,label", *rows]))
    recording = open_recording(film)
    (train, test), unit = hold_out(recording, fraction)
    assert unit.kind == "group"
    counts = [np.bincount(recording.labels[side]) for side in (train, test)]
    assert all(len(set(found.tolist())) == 1 for found in counts)
    intervals = [set(recording.samples["interval"][side]) for side in (train, test)]
    assert intervals[0].isdisjoint(intervals[1])


def test_the_frames_of_a_class_of_one_interval_are_split_and_it_is_said(film):
    rows = ["start_s,end_s,label", "0,1,a", "1,2,b", "2,3,a"]
    film.with_suffix(".csv").write_text("\n".join(rows))
    recording = open_recording(film)
    assert recording.notes == ("b: one interval, whose frames are split",)
    (train, test), _ = hold_out(recording, 0.5)
    assert np.bincount(recording.labels[test]).tolist() == [10, 5]
    assert set(recording.labels[train]) == {0, 1}
    film.with_suffix(".csv").write_text("\n".join(rows[:3]))  # one interval of each
    assert hold_out(open_recording(film), 0.5)[1].kind == "frame"
