"""The footprint: what is loaded and built is what the scene needs, seen in a process of its own."""

from __future__ import annotations

import os
import subprocess

import hydra
import pytest
from omegaconf import OmegaConf

from experiments import cores, footprint, footprint_probe, measurement, stiffness_tables
from experiments.sources import ROOT
from experiments.trial import instantiate

SMALL = ["scene.samples_per_class=2", "+scene.sensor.camera={grid:64,crop:48,pupil:16}"]


@pytest.fixture(scope="module")
def everything():
    task = OmegaConf.load(ROOT / "configs" / "experiment" / "footprint.yaml").task
    with hydra.initialize_config_dir(str(ROOT / "configs"), version_base="1.3"):
        return hydra.compose("config", [*task.everything, *SMALL])


def test_everything_switched_on_builds_every_part(everything):
    scene = instantiate(everything.scene, "scene")
    scene.frames([0])
    parts = footprint_probe._parts(scene)
    assert {"Creep", "GrainyPress", "TexturedPress", "Room", "Camera", "Layer", "Paths"} <= parts


def test_a_scene_has_what_it_needs_and_no_more():
    row = footprint.probe(
        do="stream", overrides=["scene=touch", "model=hdc", *SMALL], frames=5, n=40
    )
    assert row["status"] == "ok"
    assert row["loaded"] == "scipy"
    assert {"Camera", "Press", "Room"} <= set(row["parts"].split())
    assert not {"Creep", "GrainyPress"} & set(row["parts"].split())
    assert 0 < row["torch_s"] < row["first_prediction_s"]
    assert row["above_torch_bytes"] == row["peak_bytes"] - row["torch_bytes"] > 1e6
    assert "torch:" in row["packages"]


def test_the_run_does_not_wait_for_the_cores_that_its_measurement_holds():
    overrides = ["scene=touch", *SMALL, "scene.samples_per_class=5"]
    with cores.held(os.cpu_count() or 1, "cpu", lambda *_: None):
        rows = list(footprint.rows({"touch": overrides}, ["hdc"], frames=5, stream=[]))
    assert [row["what"] for row in rows] == ["import torch", "build", "run"]
    assert all(row["status"] == "ok" for row in rows)


def test_a_process_that_fails_says_why(monkeypatch):
    failed = subprocess.CompletedProcess([], 1, stdout="", stderr="no such scene\n")
    monkeypatch.setattr(footprint.subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(RuntimeError, match=r"nowhere.*: no such scene"):
        footprint.probe(do="build", overrides=["scene=nowhere"], frames=5)


def test_the_table_shows_what_was_skipped():
    record = {"config": {}, "environment": {"cpu": "A CPU", "threads": 2, "sources": {}}}
    rows = [
        {"scene": "touch", "model": "hdc", "what": "build", "n": "10", "status": "ok",
         "peak_bytes": "3000000", "torch_bytes": "1000000", "above_torch_bytes": "2000000",
         "modules": "7", "frame_s": "0.0125", "loaded": "scipy", "parts": "Camera"},
        {"scene": "fibre", "model": "hdc", "what": "build", "status": "skipped: no data"},
    ]  # fmt: skip
    measured = measurement.Measured(rows, record)
    table = stiffness_tables.footprint(measured)
    assert table[0]["above_torch_bytes"] == 2_000_000
    text = stiffness_tables._footprint_text(measured, table)
    assert (
        "| touch hdc | build, N = 10 | – | – | 12.5 | 3.00 | 2.00 | 7 | scipy | Camera | ok |"
        in text
    )
    assert "skipped: no data" in text
