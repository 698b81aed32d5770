"""A run that overflows has a name and a curve, and the sweep goes on."""

from __future__ import annotations

import csv
import subprocess
import sys

import numpy as np

from experiments import record


def test_a_sweep_goes_on_after_a_run_that_diverges(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "results"))
    rng = np.random.default_rng(0)
    labels = np.arange(30) % 3
    frames = rng.integers(0, 150, (3, 12, 12))[labels] + rng.integers(0, 90, (30, 12, 12))
    np.savez(tmp_path / "frames.npz", frames=frames.astype(np.uint8), labels=labels)
    done = subprocess.run(
        [sys.executable, "-m", "experiments.run", "-m", "scene=recorded",
         f"scene.path={tmp_path / 'frames.npz'}", "model=softmax_raw", "model.lr=1e38,1e-4",
         "threads=1"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "(diverged)" in done.stdout
    runs = {}
    for folder in (tmp_path / "results" / "runs").iterdir():
        entry = record.read_record(folder)
        with (folder / "curve.csv").open(newline="") as file:
            runs[entry["config"]["model"]["lr"]] = entry, list(csv.DictReader(file))
    entry, curve = runs[1e38]
    assert (entry["status"], entry["stop"]) == ("finished", "diverged")
    assert len(curve) == entry["reports"]
    assert not np.isfinite(float(curve[-1]["loss"]))
    entry, curve = runs[1e-4]
    assert entry["status"] == "finished"
    assert entry["stop"] != "diverged"
    assert entry["train_accuracy_final"] == 1
    assert len(curve) == entry["reports"] > 1
