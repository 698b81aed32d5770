"""Things of one's own, from files outside the tree to the tables and the page.

The files are those that docs/extend.md shows, with a class that it names, and a scene.
"""

import csv
import io
import re
import shutil

import numpy as np
import pytest
from rich.console import Console

from experiments import report
from experiments.records.files import ROOT
from experiments.records.results import RUNS, Results

EXAMPLES = ROOT / "docs" / "examples"
pytestmark = pytest.mark.usefixtures("beside_the_reference")

FILES = {
    "nearest_mean.py": """
import torch


class NearestMean:
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
""",
    "scene/small_touch.yaml": """
defaults: [touch]
samples_per_class: 12
sensor:
  camera: {_target_: scenes.sensor.camera.Camera, grid: 64, crop: 60, pupil: 24}
""",
}


@pytest.fixture
def own(tmp_path, monkeypatch, frames_and_labels):
    """The folders of a user: code and configs, a recording, results."""
    page = (ROOT / "docs" / "extend.md").read_text("utf-8")
    of_page = re.findall(r"```\w+\n# MINE/(\S+)\n(.*?)```", page, re.DOTALL)
    for name, text in (FILES | dict(of_page)).items():
        path = tmp_path / "mine" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    frames, labels = frames_and_labels(60, 3)
    names = np.array(["a", "b", "c"])[labels]
    np.savez(tmp_path / "my $frames$ <b>.npz", frames=frames, labels=names)
    monkeypatch.syspath_prepend(tmp_path / "mine")
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "results"))
    return tmp_path


@pytest.fixture
def carry_out(own, start):
    """carry_out(*words): python -m experiments.run with these words and the user's configs."""

    def run(*words):
        process = start("--config-dir", str(own / "mine"), *words, "exclusive=false")
        process.join(120)
        assert process.exitcode == 0, process.out.read_text()

    return run


def rows_of(own, name):
    with (own / "results" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_models_on_a_scene_and_a_recording_of_ones_own(own, carry_out):
    models = "model=hdc,nearest_mean,hdc_first,linear_svc"
    sizes = "split.n_train=10,null"
    carry_out("-m", "scene=small_touch", models, sizes, "seed.run=0,1")
    scene = ("scene=recorded", f"scene.path='{own}/my $frames$ <b>.npz'")
    carry_out("-m", *scene, "model=hdc,nearest_mean", "split.n_train=6,21,null")
    carry_out(*scene, "model=nearest_mean", "+model.power=1.0")
    carry_out("experiment=recordings", "scene=small_touch", "task.draws=1",
              "+model@task.models.hdc_first=hdc_first", "task.n_per_class=[1]")  # fmt: skip
    results = own / "results"
    page = report.write(results, Console(file=io.StringIO())).read_text("utf-8")
    read = Results(results)
    assert read.problems == []
    # The table of all scenes has all of them, of all samples, by the numbers of their records.
    lines = read.frame(RUNS)
    known = lines[lines.asked_n == 0].groupby(["scene", "model"])
    rows = {(r["scene"], r["model"]): r for r in rows_of(own, "tables/all_scenes")}
    assert len(rows) == len(known) == 7
    for place, of_row in known:
        share = float(rows[place]["test_accuracy_final"])
        right = of_row.right.sum() / of_row.n_test.sum()
        assert share == pytest.approx(right, abs=1e-6)
        assert int(rows[place]["seeds"]) == len(of_row)
    assert "Nearest mean (power=1.0)" in page
    assert "my $frames$ &lt;b&gt;.npz" in page
    # Runs that were started by hand stand in the figure of samples, too.
    sizes = {int(row["n_train"]) for row in rows_of(own, "tables/accuracy_vs_n")}
    assert sizes == {10, 48, 6, 21}
    (recording,) = rows_of(own, "tables/recordings")
    assert all(0 <= float(recording[model]) <= 1 for model in ("hdc", "hdc_first"))
    # Nothing of it is taken for the paper's: of what was not measured, nothing is shown.
    assert not (results / "tables" / "comparison.csv").exists()


def test_a_question_of_ones_own_is_one_file_with_a_table_and_a_figure(own, carry_out):
    """The one that docs/extend.md shows."""
    assert len((EXAMPLES / "contrast.py").read_text().splitlines()) <= 60
    shutil.copy(EXAMPLES / "contrast.py", own / "mine")
    shutil.copytree(EXAMPLES / "experiment", own / "mine" / "experiment")
    carry_out("experiment=contrast", "scene=small_touch")
    report.main(["--study", "contrast"])
    rows = rows_of(own, "tables/contrast")
    assert {row["class"] for row in rows} == {"L1", "L2", "R1", "R2", "None"}
    page = (own / "results" / "report.html").read_text(encoding="utf-8")
    assert 'figures/contrast.svg"' in page
