"""Settings of a recording: each is checked where it is given."""

import os

import cv2
import numpy as np
import pytest

from hdc.readers import BadFrame, camera, open_recording


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"crop": [0, 0, 31, 20]}, "crop: expected a window inside frames 30 px wide and 20"),
        ({"crop": [0, 0, 5]}, r"crop: expected null or \[x, y, width, height\]"),
        ({"crop": [0, 0, 5, 0]}, "crop: expected null or"),
        ({"crop": [-1, 0, 5, 5]}, "crop: expected null or"),
        ({"crop": [0, 0, 5.0, 5]}, "crop: expected null or"),
        ({"crop": 5}, "crop: .* found 5"),
        ({"subsample": 0}, "subsample: expected an integer ≥ 1, found 0"),
        ({"subsample": True}, "subsample: .* found True"),
        ({"subsample": "2"}, "subsample: .* found '2'"),
        ({"on_bad_frame": "ignore"}, "on_bad_frame: expected stop or skip, found 'ignore'"),
        ({"on_bad_frame": True}, "on_bad_frame: .* found True"),
        ({"threads": 0}, r"threads: expected null or an integer in \[1, 256\], found 0"),
        ({"threads": 10**9}, "threads: .* found 1000000000"),
        ({"intervals": 5}, "intervals: expected null or the path of a table, found 5"),
        ({"memory_bytes": -1}, "memory_bytes: expected an integer ≥ 0"),
        ({"max_pixels": 1.5}, "max_pixels: expected an integer ≥ 1"),
        ({"max_pixels": 599}, r"expected at most 599 pixels \(max_pixels\), found 30 × 20"),
        ({"intervals": "x.csv"}, "intervals: expected null unless path is a video"),
    ],
)
def test_settings_of_the_wrong_type_or_out_of_range_are_named(folder, settings, message):
    with pytest.raises(ValueError, match=message):
        open_recording(folder, **settings)


@pytest.mark.parametrize("name", ["x.npz", "x.mp4"])
def test_a_pipe_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(ValueError, match=rf"{name}: expected a file, found no regular file"):
        open_recording(tmp_path / name)


def test_paths_that_lead_nowhere_are_named(tmp_path):
    with pytest.raises(ValueError, match=r"path: .* found nothing: .*/absent"):
        open_recording(tmp_path / "absent")
    with pytest.raises(ValueError, match=r"path: .* found None"):
        open_recording(None)
    with pytest.raises(ValueError, match=r"path: expected a path, found ~nobody-here/x"):
        open_recording("~nobody-here/x")
    (tmp_path / "x.pkl").write_bytes(b"x")
    with pytest.raises(ValueError, match=r"path: expected a folder, an .npz or a video .*x.pkl"):
        open_recording(tmp_path / "x.pkl")


def test_a_path_is_read_as_a_shell_would(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    moved = folder.rename(tmp_path / "my [frames] (1), a=b")
    assert len(open_recording(f"~/{moved.name}")) == 12


class Connected:
    """Two frames, in colour and in grey of 16 bits, and then none."""

    def __init__(self, index):
        colour = np.full((4, 6, 3), 90, np.uint8)
        self.images = [colour, np.arange(24, dtype=np.uint16).reshape(4, 6)] * (index == 2)
        self.there, self.released = index == 2, False

    def isOpened(self):
        return self.there

    def read(self):
        return (True, self.images.pop(0)) if self.images else (False, None)

    def release(self):
        self.released = True


def test_a_camera_gives_grey_frames_until_it_is_gone(monkeypatch):
    opened = []
    monkeypatch.setattr(cv2, "VideoCapture", lambda n: opened.append(Connected(n)) or opened[-1])
    frames = camera(2, crop=[2, 0, 4, 4], subsample=2)
    assert next(frames).tolist() == [[90, 90], [90, 90]]
    assert next(frames).tolist() == [[2, 4], [14, 16]]
    assert not opened[0].released
    with pytest.raises(BadFrame, match="camera 2: expected a frame, found none"):
        next(frames)
    assert opened[0].released
    with pytest.raises(ValueError, match=r"camera: expected a camera .* index 5, found none"):
        camera(5)
    with pytest.raises(ValueError, match="camera: expected an integer ≥ 0, found -1"):
        camera(-1)


def test_where_there_is_no_camera_is_said():
    with pytest.raises(
        ValueError, match="expected a camera that can be opened at index 987, found"
    ):
        camera(987)
