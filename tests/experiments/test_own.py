"""A competitor and a scene of one's own, from files outside the tree to the tables and the page.

A competitor is two new files: a class with ``train``, ``predict`` and ``state_tensors``, and a
YAML that names it, in a folder given with ``--config-dir``. A scene is one more YAML, a recording
is a file.
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
        tmp_path / "my $frames$ <b>.npz", frames=frames, labels=np.array(["a", "b", "c"])[labels]
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
    carry_out("-m", "scene=recorded", f"scene.path={own}/my $frames$ <b>.npz",
              "model=hdc,nearest_mean", "split.n_train=6,20,null")  # fmt: skip
    carry_out("scene=recorded", f"scene.path={own}/my $frames$ <b>.npz", "model=nearest_mean",
              "model.power=1.0")  # fmt: skip
    results = own / "results"
    page = report.write(results, "cpu", Console(file=io.StringIO())).read_text(encoding="utf-8")
    read = Results(results)
    assert read.problems == []
    recording = next(name for name in read.scenes if name.startswith("recorded my"))

    runs = table(results, "runs")
    assert len(runs) == 15
    assert [row["overrides"] for row in runs if row["overrides"]] == ["model.power=1.0"]
    assert {row["origin"] for row in runs} == {"simulated", "recorded"}

    # The table of a scene has every model on it, with the accuracies of its records.
    (name,) = (path.stem for path in (results / "tables").glob("scene_recorded*.csv"))
    assert name.startswith("scene_recorded_my_frames_b_npz")
    for stem, scene, models in (
        ("scene_small_touch", "small_touch", ["hdc", "nearest_mean"]),
        (name, recording, ["hdc", "nearest_mean", "nearest_mean (power=1.0)"]),
    ):
        rows = table(results, stem)
        assert [row["model"] for row in rows] == models
        for row in rows:
            group = read.group(scene, row["model"])
            assert float(row["test_accuracy_final"]) == pytest.approx(group.right.mean(), abs=1e-6)
            assert int(row["seeds"]) == len(group.runs) == (2 if scene == "small_touch" else 1)
            assert row["status"].endswith("timed beside other runs")
    size = 3 * 16 * 16 * 4
    assert [row["model_bytes"] for row in rows][1:] == [str(size), str(size)]

    # A learning curve and a confusion matrix of each scene, on the page, too.
    drawn = {path.stem: path.read_text() for path in (results / "figures").glob("*.svg")}
    for stem in ("small_touch", name.removeprefix("scene_")):
        for kind in ("accuracy_vs_n", "confusion"):
            assert f"{kind}_{stem}" in drawn
        assert f"confusion_{stem}_nearest_mean" in drawn  # the competitor's own
    curve = drawn[f"accuracy_vs_n_{name.removeprefix('scene_')}"]
    for words in ("nearest_mean", "HDC", "training samples N", "recorded my $frames$"):
        assert words in curve.replace("\xa0", " "), words
    for stem in drawn:
        assert f'id="mine-figure-{stem}"' in page
    assert "nearest_mean (power=1.0)" in page
    assert "recorded my $frames$ &lt;b&gt;.npz" in page

    # The page says how to make it again: the recording is named, what was changed stays apart.
    place = f"&#39;scene.path={own}/my $frames$ &lt;b&gt;.npz&#39;"
    for model in ("model=hdc,nearest_mean", "model=nearest_mean"):
        assert f"scene=recorded {place} {model} stop=paper seed.run=0" in page

    # Nothing of it is taken for the paper's, whose numbers the reference has.
    assert "agrees</span>" in page
    assert {row["status"] for row in table(results, "table1")} == {"missing"}
    assert {row["verdict"] for row in table(results, "comparison")} == {"missing"}


def test_own_frames_of_an_experiment_are_not_compared_with_the_papers(tmp_path, write_measurement):
    rows = [
        {"origin": "recorded", "seed": seed, "order": "time", "model": "hdc", "method": method,
         "n_new": n, "n_old": 100, "right_new": right, "n_test_new": 100, "right_old": 50,
         "n_test_old": 50, **more}
        for seed in (0, 1) for method, n, right, more in (
            ("stored", 0, 30, {}), ("replace", 50, 90, {"parameter": 0.5, "draw": 0}))
    ]  # fmt: skip
    write_measurement("drift", rows, config={"scene": {"path": "mine.npz"}, "seeds": [0, 1]})
    answers = report.Answers("mine", Results(tmp_path), report.all_studies())
    assert answers.results.measured("drift") is None
    assert set(answers.tables["comparison"][0].data["verdict"]) == {"missing"}
    (plot,) = answers.plots["drift"]
    assert plot.name != "fig8_drift"
    answers.draw()
    assert answers.results.problems == []
    (picture,) = answers.pictures["drift"]
    assert b"recorded frames" in picture.data
    assert b"paper" not in picture.data
