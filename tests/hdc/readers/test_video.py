"""Videos: the labelled frames, whichever are asked for first, and an end where there is one."""

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from hdc.readers import BadFrame, Window, open_recording
from hdc.readers import film as film_module
from hdc.readers.film import _pixels, stream_video
from tests.hdc.readers.writers import said

RATE, N = 10, 60
# What OpenCV cannot write: uniform frames of grey_of(k), 32 × 32 pixels, 25 Hz, MPEG-2, by FFmpeg
# with -flags +ildct+ilme.
INTERLACED = Path(__file__).parent / "videos" / "interlaced.mkv"
NUMBERS = [3, 4, 5, 6, 50, 51]


def grey_of(number):
    """Neighbours differ by more than the coding changes them."""
    return 10 + 4 * (23 * number % N)


def table(path, *rows, columns="start_s,end_s,label"):
    path.with_suffix(".csv").write_text("\n".join([columns, *rows]) + "\n")
    return path


def check(recording, numbers):
    """The frames are those of these numbers, whichever are asked for first."""
    assert recording.samples["frame"].tolist() == numbers
    expected = np.array([grey_of(number) for number in numbers])
    for index in (np.arange(len(numbers)), [2, 0, 1, 0]):
        made = recording.frames(index).astype(int)
        assert np.abs(made - expected[index, None, None]).max() <= 5
    assert recording[[]].shape == (0, *recording.frame_shape)


@pytest.fixture(params=["x.avi", "x.mp4", "x.mkv"])
def film(request, write_film, tmp_path):
    """Frame k is uniformly grey_of(k), 48 × 32 pixels, 10 Hz."""
    path = tmp_path / request.param
    code = {".avi": "MJPG", ".mp4": "mp4v", ".mkv": "FFV1"}[path.suffix]
    write_film(path, [np.full((32, 48), grey_of(k), np.uint8) for k in range(N)], code)
    return table(path, "0.3,0.5,press", "0.5,0.7,free", "5,5.2,press")


one = pytest.mark.parametrize("film", ["x.avi"], indirect=True)


@pytest.mark.parametrize("memory_bytes", [2**20, 100])
def test_a_video_is_a_recording(film, memory_bytes):
    window = {"crop": [8, 4, 16, 8], "subsample": 2}
    recording = open_recording(film, memory_bytes=memory_bytes, **window)
    check(recording, NUMBERS)
    assert recording.frame_shape == (4, 8)
    assert said(recording, "frame time label") == [
        "3 0.3 press", "4 0.4 press", "5 0.5 free", "6 0.6 free", "50 5 press", "51 5.1 press",
    ]  # fmt: skip
    assert recording.place(2) == f"{film}, frame 5"


def test_an_interlaced_video_is_decoded(tmp_path):
    rows = table(tmp_path / "t.csv", "0,0.2,a", "0.2,0.4,b")
    recording = open_recording(INTERLACED, table=rows)
    check(recording, [*range(10)])


def test_a_video_may_be_left_unread_at_the_end_of_python(monkeypatch):
    """Names of modules are None by then."""
    frames = stream_video(INTERLACED, Window())
    next(frames)
    monkeypatch.setattr(film_module, "av", None)
    frames.close()


def encoded(path, frames, pixels, times_ms, **options):
    """Write frames [n, H, W] losslessly, at these times in ms."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=Fraction(RATE), options=options)
        stream.height, stream.width = frames[0].shape
        stream.pix_fmt = pixels
        stream.codec_context.time_base = Fraction(1, 1000)
        for frame, time in zip(frames, times_ms, strict=True):
            image = av.VideoFrame.from_ndarray(frame, format=pixels)
            image.pts, image.time_base = time, Fraction(1, 1000)
            container.mux(stream.encode(image))
        container.mux(stream.encode())
    return path


def test_times_are_those_of_the_container_from_its_first_frame(tmp_path):
    """20 frames at 25 Hz, then 10 at 25/3 Hz: the mean rate would give other labels."""
    times = np.array([*range(0, 800, 40), *range(800, 2000, 120)])
    frames = np.arange(30, dtype=np.uint8)[:, None, None] + np.zeros((32, 48), "u1")
    path = encoded(tmp_path / "x.mkv", frames, "gray", (3000 + times).tolist())
    recording = open_recording(table(path, "0.7,0.8,a", "0.8,1.3,b", "1.75,2,a"))
    assert said(recording, "frame label time") == [
        "18 a 0.72", "19 a 0.76", "20 b 0.8", "21 b 0.92", "22 b 1.04", "23 b 1.16",
        "24 b 1.28", "28 a 1.76", "29 a 1.88",
    ]  # fmt: skip
    assert recording[:][:, 0, 0].tolist() == recording.samples["frame"].tolist()


@one
def test_sessions_and_groups_of_intervals_are_kept(film):
    """They were read and ignored: near copies were on both sides of a split."""
    columns = "start_s,end_s,label,session,group"
    rows = ["2,2.2,a,day10,p2", "0,0.2,a,day2,p1", "1,1.1,b,day2,p1"]
    recording = open_recording(table(film, *rows, columns=columns))
    assert said(recording, "frame label session group_name") == [
        "0 a 0 p1",
        "1 a 0 p1",
        "10 b 0 p1",
        "20 a 1 p2",
        "21 a 1 p2",
    ]


@one
def test_an_interval_is_a_group_but_for_a_class_of_one(film):
    """Frames of one touch were trained on and tested on; those of a class of one are split."""
    recording = open_recording(table(film, "0,0.2,a", "0.5,0.7,a", "1,1.2,b"))
    assert said(recording, "group") == [*"001178"]
    assert recording.notes == ("b: recorded once, so its frames are split",)


@one
def test_a_table_of_frames_gives_labels_values_and_sessions(film, tmp_path):
    rows, columns = tmp_path / "t.csv", "frame,label,force,session,note"
    table(rows, "40,b,1.5,9,x", "3,a,2,8,y", "7,b,-1,9,z", columns=columns)
    recording = open_recording(film, table=rows)
    check(recording, [3, 7, 40])
    assert recording.value_names == ("force",)
    assert said(recording, "label force order session time") == [
        "a 2 3 8 0.3",
        "b -1 7 9 0.7",
        "b 1.5 40 9 4",
    ]
    table(rows, "40,b,1.5,9,x", "3,a,2,8,y", "8,b,-1,9,z", columns=columns)
    again = open_recording(film, table=rows)  # which frames are labelled counts
    assert again.fingerprint() != recording.fingerprint()


@one
@pytest.mark.parametrize(
    ("columns", "rows", "message"),
    [
        ("start,end,label", "0,1,a", "a table with start_s, end_s and label, .* start,"),
        ("start_s,end_s,label", "0,1,a 6,6.2,b", "line 3: .* a frame of x.avi, found none"),
        ("start_s,end_s,label", "0,1,a 0.9,2,b", "line 3: expected 1 ≤ start_s < end_s"),
        ("start_s,end_s,label", "0,1,a 2,1,b", "line 3: expected 1 ≤ start_s < end_s"),
        ("start_s,end_s,label", "-1,1,a", "line 2: expected 0 ≤ start_s < end_s"),
        ("frame,x", "5,2 60,1", "line 3: expected a frame of x.avi, found none"),
        ("frame,x", "0.5,2", "expected different numbers of frames from 0 .*, found .0.5"),
        ("frame,x", "1,1 1,2", "expected different numbers of frames from 0 .*, found .1 1"),
        ("frame,x", "-1,2", "line 2: expected a frame of x.avi, found none"),
    ],
)  # fmt: skip
def test_a_table_that_does_not_fit_is_named(film, columns, rows, message):
    table(film, *rows.split(), columns=columns)
    with pytest.raises(ValueError, match=rf"x\.csv(:|,) .*{message}"):
        open_recording(film)


# Pixels ------------------------------------------------------------------------------------------


def test_grey_of_more_bits_comes_as_it_was_written(tmp_path):
    frames = np.random.default_rng(0).integers(0, 2**10, (6, 32, 48), np.uint16)
    path = encoded(tmp_path / "x.mkv", frames, "gray10le", range(0, 600, 100))
    recording = open_recording(table(path, "1,a", "4,b", columns="frame,label"))
    assert np.array_equal(recording[:], frames[[1, 4]])
    assert recording.dtype == np.uint16


def test_luminance_of_more_bits_is_scaled_to_16():
    frame = av.VideoFrame(48, 32, "yuv420p10le")
    for plane, level in zip(frame.planes, (940, 512, 512), strict=True):  # white
        plane.update(np.full(plane.buffer_size // 2, level, np.uint16).tobytes())
    image = _pixels(Path("x"), frame)
    assert image.dtype == np.uint16
    assert image.min() == image.max() > 0.99 * 65535


@pytest.mark.parametrize(
    ("matrix", "shown"),
    [
        ((0, 1, -1, 0), lambda image: np.rot90(image, -1)),
        ((-1, 0, 0, 1), np.fliplr),  # of a front camera
        ((0, -1, -1, 0), lambda image: np.rot90(image.T, 2)),
        ((0.5, 0, 0, 1), None),
    ],
)
def test_frames_are_shown_as_the_file_says(write_film, tmp_path, matrix, shown):
    """Clockwise turns (ISO/IEC 14496-12); a mirrored video was turned by 180°."""
    image = np.zeros((32, 48), np.uint8)
    image[:16, :24] = 200  # the upper left quarter
    image[:16, 24:] = 100
    path = table(tmp_path / "x.mp4", "0,a", "1,b", columns="frame,label")
    write_film(path, [image] * 4, "mp4v")
    data = path.read_bytes()
    at = data.index(b"tkhd") + 44
    a, b, c, d = (int(number * 65536) for number in matrix)
    turned = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(data[:at] + turned + data[at + 36 :])
    if shown is None:
        with pytest.raises(ValueError, match=r"x.mp4: .* quarter turns, found 0.5, 0,"):
            open_recording(path)
        return
    recording, expected = open_recording(path), shown(image)
    assert recording.frame_shape == expected.shape
    assert np.abs(recording[0].astype(int) - expected).mean() < 8


# Damage ------------------------------------------------------------------------------------------

NOISE = np.random.default_rng(0).integers(0, 256, (N, 32, 48), np.uint8)


@pytest.mark.parametrize(
    ("name", "code", "damaged", "message"),
    [
        ("x.avi", "MJPG", lambda whole: whole[: len(whole) // 3], "a whole video, found: Inv"),
        ("x.mp4", "mp4v", lambda _: b"", "a whole video, found: Invalid"),
        ("x.avi", "FMP4", lambda whole: whole.replace(b"FMP4", b"ZZZZ"), "a codec that FF"),
    ],
)  # fmt: skip
def test_a_damaged_video_is_named(write_film, tmp_path, name, code, damaged, message):
    path = table(tmp_path / name, "0,1,a", "1,6,b")
    write_film(path, NOISE, code)
    assert len(open_recording(path)) == N
    path.write_bytes(damaged(path.read_bytes()))
    with pytest.raises(ValueError, match=rf"{name}: expected .*{message}"):
        list(stream_video(path, Window()))


def test_what_ffmpeg_logs_and_goes_on_over_is_damage(tmp_path):
    """Slices of FFV1 have checksums: flipped bits gave wrong pixels, without an error."""
    path, checked = tmp_path / "x.mkv", {"slicecrc": "1", "level": "3"}
    encoded(path, NOISE[:6], "gray", range(0, 600, 100), **checked)
    assert len(list(stream_video(path, Window()))) == 6
    damaged = bytearray(path.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(BadFrame, match=r"x.mkv: expected whole frames"):
        list(stream_video(path, Window()))


def test_frames_that_the_header_states_and_that_are_not_there_are_missing(
    write_film, tmp_path
):
    path = tmp_path / "x.avi"
    write_film(path, NOISE, "MJPG")
    data = bytearray(path.read_bytes())
    at = data.index(b"strh") + 40  # dwLength
    assert struct.unpack_from("<I", data, at) == (N,)
    struct.pack_into("<I", data, at, N + 1)
    path.write_bytes(data)
    stated = f"{path}: expected {N + 1} frames as its header says, found {N}"
    with pytest.raises(BadFrame, match=stated):
        list(stream_video(path, Window()))
