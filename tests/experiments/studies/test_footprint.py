"""The footprint: what is loaded and built is what the scene needs, seen in a process of its own."""

from __future__ import annotations

import os
import subprocess

import hydra
import pytest

from experiments.protocol import machine
from experiments.protocol.trial import instantiate
from experiments.records import configs, measurement
from experiments.records.results import Results
from experiments.studies.footprint import measure as footprint
from experiments.studies.footprint import probe
from experiments.studies.footprint.view import STUDY

SMALL = ["scene.samples_per_class=2", "+scene.sensor.camera={grid:64,crop:48,pupil:16}"]


@pytest.fixture(scope="module")
def everything():
    overrides = [*configs.task("footprint")["everything"], *SMALL]
    with hydra.initialize_config_dir(str(configs.CONFIGS), version_base="1.3"):
        return hydra.compose("config", overrides)


def test_everything_switched_on_builds_every_part(everything):
    scene = instantiate(everything.scene, "scene")
    scene.frames([0])
    found = probe.parts(scene)
    assert {"Creep", "GrainyPress", "TexturedPress", "Room", "Camera", "Layer", "Paths"} <= found


def test_a_scene_has_what_it_needs_and_no_more():
    row = footprint.ask(do="stream", overrides=["scene=touch", "model=hdc", *SMALL], frames=5, n=40)
    assert row["status"] == "ok"
    assert row["loaded"] == "scipy"
    assert {"Camera", "Press", "Room"} <= set(row["parts"].split())
    assert not {"Creep", "GrainyPress"} & set(row["parts"].split())
    assert 0 < row["torch_s"] < row["first_prediction_s"]
    assert row["above_torch_bytes"] == row["peak_bytes"] - row["torch_bytes"] > 1e6
    assert "torch:" in row["packages"]


def test_the_run_does_not_wait_for_the_cores_that_its_measurement_holds():
    overrides = ["scene=touch", *SMALL, "scene.samples_per_class=5"]
    with machine.held(os.cpu_count() or 1, "cpu", lambda: None):
        rows = list(footprint.rows({"touch": overrides}, ["hdc"], frames=5, stream=[]))
    assert [row["what"] for row in rows] == ["import torch", "build", "run"]
    assert all(row["status"] == "ok" for row in rows)


def test_a_process_that_fails_says_why(monkeypatch):
    failed = subprocess.CompletedProcess([], 1, stdout="", stderr="no such scene\n")
    monkeypatch.setattr(footprint.subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(RuntimeError, match=r"nowhere.*: no such scene"):
        footprint.ask(do="build", overrides=["scene=nowhere"], frames=5)


def test_the_record_names_the_code_of_scene_model_and_probe(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    monkeypatch.setattr(footprint, "ask", lambda **_: {"status": "ok"})
    task = {key: value for key, value in configs.task("footprint").items() if key != "_target_"}
    task |= {"scenes": ["touch"], "models": ["ridge"], "everything": []}
    record = measurement.read(footprint.run(**task)).record
    assert {
        "experiments/studies/footprint/probe.py",
        "baselines/ridge.py",
        "scenes/sensor/scene.py",
    } < set(record.environment.sources)
    assert record.config["models"]["ridge"]["_target_"] == "baselines.ridge.RidgeReadout"


def test_the_table_shows_what_was_skipped(tmp_path, write_measurement):
    rows = [
        {
            "scene": "touch",
            "model": "hdc",
            "what": "build",
            "n": 10,
            "status": "ok",
            "peak_bytes": 3000000,
            "torch_bytes": 1000000,
            "above_torch_bytes": 2000000,
            "modules": 1829,
            "frame_s": 0.0125,
            "loaded": "scipy",
            "parts": "Camera",
        },
        {"scene": "fibre", "model": "hdc", "what": "build", "status": "skipped: no data"},
    ]
    write_measurement("footprint", rows)
    (table,) = STUDY.tables(Results(tmp_path))
    assert table.csv().splitlines()[1] == (
        "touch,hdc,build,10,ok,3000000,1000000,2000000,1829,0.0125,scipy,Camera"
    )
    expected = (
        "| touch | hdc | build, N = 10 | – | – | 12.5 | 3.00 | 2.00 | 1829 | scipy | Camera | ok |"
    )
    assert expected in table.markdown()
    assert "skipped: no data" in table.markdown()
