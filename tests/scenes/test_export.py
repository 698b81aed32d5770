"""A scene that is written to disk is read back as the same scene."""

import numpy as np
import pytest
import torch

from scenes.export import main, scene_of
from scenes.frames import Scene
from scenes.recorded import open_recording

SMALL = [
    *("+scene.sensor.camera.grid=64", "+scene.sensor.camera.crop=60"),
    *("+scene.sensor.camera.pupil=24", "scene.samples_per_class=3", "seed.sensor=3"),
]


def test_the_same_scene_comes_back(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    main(["scene=drift", "out=~/out", *SMALL])
    assert "30 frames of 5 classes" in capsys.readouterr().out
    made = scene_of(["scene=drift", *SMALL])
    read = open_recording(tmp_path / "out")
    assert isinstance(read, Scene)
    assert (read.origin, read.classes) == ("recorded", made.classes)
    assert (read.labels == made.labels).all()
    assert torch.equal(read.frames(range(30)), made.frames(range(30)))
    for name, values in made.samples.items():
        # A column with a "nan" (None is nowhere) comes back as text.
        back = read.samples[name].astype(values.dtype)
        assert np.array_equal(back, values, equal_nan=True), name
    part = open_recording(tmp_path / "out", crop=[1, 0, 3, 5], subsample=2)
    assert torch.equal(part.frames([4, 1]), read.frames([4, 1])[:, :5:2, 1:4:2])
    assert part.fingerprint() != read.fingerprint()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("scene=touch",), "out: expected a new or an empty folder"),
        (("scene=nowhere",), "nowhere"),
    ],
)
def test_what_cannot_be_exported_is_one_line_and_replaces_nothing(
    tmp_path, words, said
):
    (tmp_path / "mine.txt").write_text("precious")
    with pytest.raises(SystemExit) as ended:
        main([f"out={tmp_path}", *words])
    assert str(ended.value.code).startswith("error: ")
    assert said in ended.value.code
    assert (tmp_path / "mine.txt").read_text() == "precious"
