"""Things of one's own, from files outside the tree to the tables and the page.

A competitor is two new files: a class and a YAML that names it; a scene is one more YAML; an
encoder or a read-out a class, and a YAML for the harness; a study a module and a YAML.
"""

import csv
import io
import shutil

import numpy as np
import pytest
from rich.console import Console

from experiments import report
from experiments.records.files import ROOT
from experiments.records.results import RUNS, Results

EXAMPLES = ROOT / "docs" / "examples"
pytestmark = pytest.mark.usefixtures("beside_the_reference")

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
              "model=hdc,nearest_mean", "split.n_train=6,21,null")  # fmt: skip
    carry_out("scene=recorded", f"scene.path='{own}/my $frames$ <b>.npz'", "model=nearest_mean",
              "model.power=1.0")  # fmt: skip
    results = own / "results"
    page = report.write(results, Console(file=io.StringIO())).read_text("utf-8")
    read = Results(results)
    assert read.problems == []
    # The table of all scenes has both, of all samples, by the numbers of their records.
    lines = read.frame(RUNS)
    known = lines[lines.asked_n == 0].groupby(["scene", "model"])
    rows = {(r["scene"], r["model"]): r for r in table(results, "all_scenes")}
    assert len(rows) == len(known) == 5
    for place, of_row in known:
        share = float(rows[place]["test_accuracy_final"])
        assert share == pytest.approx(
            of_row.right.sum() / of_row.n_test.sum(), abs=1e-6
        )
        assert int(rows[place]["seeds"]) == len(of_row)
    assert "nearest_mean (power=1.0)" in page
    assert "my $frames$ &lt;b&gt;.npz" in page
    # Nothing of it is taken for the paper's: of what was not measured, nothing is shown.
    assert not (results / "tables" / "comparison.csv").exists()


PARTS = """
from dataclasses import dataclass

import torch

from hdc import bits
from hdc.encoders import Encoder
from hdc.readouts import Readout, State


class Bright(Encoder):
    def encode(self, frames):
        return bits.pack(frames.flatten(1) > 127)


@dataclass(frozen=True, kw_only=True, eq=False)
class Firsts(State):
    first: torch.Tensor


class First(Readout):
    State = Firsts

    def fit(self, words, rows, n_classes):
        packed = [words.packed[rows == c][0] for c in range(n_classes)]
        return Firsts(first=torch.stack(packed))

    def scores(self, state, words):
        return -bits.hamming(words.packed, state.first)
"""
OWN_HDC = """# @package _global_
model:
  _target_: hdc.HDCClassifier
  encoder: {_target_: own_parts.Bright}
  readout: own_parts.First
display: {name: First bright frame, colour: "#117733", marker: h, line: "-", group: other}
"""


def test_an_encoder_and_a_readout_of_ones_own_are_in_every_table_of_their_frames(
    own, carry_out
):
    (own / "own_parts.py").write_text(PARTS)
    (own / "configs" / "model" / "hdc_own.yaml").write_text(OWN_HDC)
    carry_out("-m", "scene=small_touch", "model=hdc,hdc_own", "split.n_train=20")
    carry_out("experiment=recordings", "scene=small_touch", "+model@task.models.hdc_own=hdc_own",
              "task.draws=1", "task.n_per_class=[1,5]")  # fmt: skip
    results = own / "results"
    report.write(results, Console(file=io.StringIO()))
    runs = table(results, "runs")
    assert {row["model"] for row in runs} == {"hdc", "hdc_own"}
    (few, more) = table(results, "recordings")
    assert few["recording"] == more["recording"] == "small_touch"
    for row in (few, more):
        assert 0 <= float(row["hdc_own"]) <= float(row["hdc"]) <= 1


def test_a_question_of_ones_own_is_one_file_with_a_table_and_a_figure(
    own, carry_out, capsys
):
    """The one that docs/extend.md shows."""
    assert len((EXAMPLES / "contrast.py").read_text().splitlines()) <= 60
    shutil.copy(EXAMPLES / "contrast.py", own)
    shutil.copytree(EXAMPLES / "experiment", own / "configs" / "experiment")
    carry_out("experiment=contrast", "scene=small_touch")
    report.main([])
    told = "no table shows it; if contrast has a STUDY: --study contrast"
    assert told in " ".join(capsys.readouterr().out.split())
    report.main(["--study", "contrast"])
    rows = table(own / "results", "contrast")
    assert {row["class"] for row in rows} == {"L1", "L2", "R1", "R2", "None"}
    page = (own / "results" / "report.html").read_text(encoding="utf-8")
    assert 'figures/contrast.svg"' in page
