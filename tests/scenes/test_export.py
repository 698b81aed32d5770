import csv

import numpy as np
import pytest
import torch

from scenes.export import export, main, scene_of
from scenes.recorded import open_recording

SMALL = [
    *("+scene.sensor.camera.grid=64", "+scene.sensor.camera.crop=60"),
    *("+scene.sensor.camera.pupil=24", "scene.samples_per_class=3"),
]


def test_the_same_scene_comes_back(tmp_path):
    made = scene_of(["scene=drift", *SMALL])
    export(made, tmp_path / "out")
    read = open_recording(tmp_path / "out")
    assert read.classes == made.classes
    assert (read.labels == made.labels).all()
    assert torch.equal(read.frames(range(len(made))), made.frames(range(len(made))))
    for name, values in made.samples.items():
        # A column with a "nan" (None is nowhere) comes back as text.
        back = read.samples[name].astype(values.dtype)
        assert np.array_equal(back, values, equal_nan=True), name


def test_command(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    main(["scene=touch", "out=~/touch", "seed.sensor=3", *SMALL])
    assert "15 frames of 5 classes" in capsys.readouterr().out
    with (tmp_path / "touch" / "manifest.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 15
    assert {"label", "class_index", "order", "session", "temperature"} <= set(rows[0])
    assert all((tmp_path / "touch" / row["file"]).exists() for row in rows)


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
