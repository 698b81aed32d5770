"""Settings of a recording: each is checked where it is given."""

import os

import pytest

from scenes.recorded import open_recording


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"crop": [0, 0, 31, 20]}, "scene.crop: expected a window inside frames 30 px wide and 20"),
        ({"crop": [0, 0, 5]}, r"scene.crop: expected null or \[x, y, width, height\]"),
        ({"crop": [0, 0, 5, 0]}, "scene.crop: expected null or"),
        ({"crop": [-1, 0, 5, 5]}, "scene.crop: expected null or"),
        ({"crop": [0, 0, 5.0, 5]}, "scene.crop: expected null or"),
        ({"crop": 5}, "scene.crop: .* found 5"),
        ({"subsample": 0}, "scene.subsample: expected an integer ≥ 1, found 0"),
        ({"subsample": True}, "scene.subsample: .* found True"),
        ({"subsample": "2"}, "scene.subsample: .* found '2'"),
        ({"on_bad_frame": "ignore"}, "scene.on_bad_frame: expected stop or skip, found 'ignore'"),
        ({"on_bad_frame": True}, "scene.on_bad_frame: .* found True"),
        ({"threads": 0}, "scene.threads: expected null or an integer ≥ 1"),
        ({"threads": 10**9}, "scene.threads: .* at most 256, found 1000000000"),
        ({"intervals": 5}, "scene.intervals: expected null or the path of a table, found 5"),
        ({"memory_bytes": -1}, "scene.memory_bytes: expected an integer ≥ 0"),
        ({"max_pixels": 1.5}, "scene.max_pixels: expected an integer ≥ 1"),
        ({"max_pixels": 599}, r"expected at most 599 pixels \(scene.max_pixels\), found 30 × 20"),
        ({"intervals": "x.csv"}, "scene.intervals: expected null unless scene.path is a video"),
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
    with pytest.raises(ValueError, match=r"scene.path: .* found nothing: .*/absent"):
        open_recording(tmp_path / "absent")
    with pytest.raises(ValueError, match=r"scene.path: .* found None"):
        open_recording(None)
    with pytest.raises(ValueError, match=r"scene.path: expected a path, found ~nobody-here/x"):
        open_recording("~nobody-here/x")
    (tmp_path / "x.pkl").write_bytes(b"x")
    with pytest.raises(
        ValueError, match=r"scene.path: expected a folder, an .npz or a video .*x.pkl"
    ):
        open_recording(tmp_path / "x.pkl")
