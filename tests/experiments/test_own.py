"""A competitor and a scene of one's own, from files outside the tree to the tables and the page.

A competitor is two new files: a class and a YAML that names it; a scene is one more YAML.
"""

import csv
import io

import numpy as np
import pytest
from rich.console import Console

from experiments import report
from experiments.records.results import Results

COMPETITOR = '''
import numpy as np
import torch


class NearestMean:
    """The class whose mean frame is nearest, in the norm of a power."""

    def __init__(self, power=2.0):
        self.power = power

    def train(self, frames, labels):
        pixels = frames[:].flatten(1).float()
        self.classes = torch.unique(torch.as_tensor(labels))
        self.means = torch.stack([pixels[labels == int(c)].mean(0) for c in self.classes])
        yield {"samples_seen": len(labels)}

    def predict(self, frames):
        distance = torch.cdist(frames[:].flatten(1).float(), self.means, p=self.power)
        return self.classes[distance.argmin(1)].numpy()

    def state_tensors(self):
        return {"means": self.means}
'''
MODEL = """# @package _global_
model:
  _target_: a_competitor.NearestMean
  power: 2.0
"""
SCENE = """
defaults: [touch]
samples_per_class: 12
sensor:
  camera: {_target_: scenes.sensor.camera.Camera, grid: 64, crop: 60, pupil: 24}
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """The folders of a user: code, configs, recordings and results."""
    (tmp_path / "a_competitor.py").write_text(COMPETITOR)
    for name, text in (("model/nearest_mean", MODEL), ("scene/small_touch", SCENE)):
        path = tmp_path / "configs" / f"{name}.yaml"
        path.parent.mkdir(parents=True)
        path.write_text(text)
    rng = np.random.default_rng(0)
    labels = np.arange(60) % 3
    base = rng.integers(0, 150, (3, 16, 16))
    frames = (base[labels] + rng.integers(0, 90, (60, 16, 16))).astype(np.uint8)
    np.savez(
        tmp_path / "my $frames$ <b>.npz",
        frames=frames,
        labels=np.array(["a", "b", "c"])[labels],
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "results"))
    return tmp_path


@pytest.fixture
def carry_out(own, start):
    """carry_out(*words): python -m experiments.run with these words and the user's configs."""

    def run(*words):
        process = start("--config-dir", str(own / "configs"), *words, "exclusive=false")
        process.join(120)
        assert process.exitcode == 0, process.out.read_text()

    return run


def table(folder, name):
    with (folder / "tables" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_competitor_on_a_scene_and_a_recording_of_ones_own(own, carry_out):
    carry_out("-m", "scene=small_touch", "model=hdc,nearest_mean", "split.n_train=10,null",
              "seed.run=0,1")  # fmt: skip
    carry_out("-m", "scene=recorded", f"scene.path='{own}/my $frames$ <b>.npz'",
              "model=hdc,nearest_mean", "split.n_train=6,20,null")  # fmt: skip
    carry_out("scene=recorded", f"scene.path='{own}/my $frames$ <b>.npz'", "model=nearest_mean",
              "model.power=1.0")  # fmt: skip
    results = own / "results"
    page = report.write(results, Console(file=io.StringIO())).read_text(
        encoding="utf-8"
    )
    read = Results(results)
    assert read.problems == []
    recording = next(r.scene for r in read.runs if r.scene.startswith("recorded my"))

    runs = table(results, "runs")
    assert len(runs) == 15
    assert [row["overrides"] for row in runs if row["overrides"]] == ["model.power=1.0"]
    assert {row["origin"] for row in runs} == {"simulated", "recorded"}

    # Table I of the scene's name is untouched; the table of all scenes has both.
    rows = table(results, "all_scenes")
    for scene, models in (
        ("small_touch", ["hdc", "nearest_mean"]),
        (recording, ["hdc", "nearest_mean", "nearest_mean (power=1.0)"]),
    ):
        lines = {row["model"]: row for row in rows if row["scene"] == scene}
        assert list(lines) == models
        for model, row in lines.items():
            group = read.group(scene, model)
            assert float(row["test_accuracy_final"]) == pytest.approx(
                group.right.mean(), abs=1e-6
            )
            assert int(row["seeds"]) == len(group.runs)
    assert "nearest_mean (power=1.0)" in page
    assert "recorded my $frames$ &lt;b&gt;.npz" in page
    # Nothing of it is taken for the paper's, whose numbers the reference has.
    assert {row["verdict"] for row in table(results, "comparison")} == {"missing"}
