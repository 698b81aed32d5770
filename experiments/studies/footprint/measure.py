"""Time, memory and modules of each scene and model: is what a scene does not need left out?"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence

import torch

from experiments.protocol.experiment import Row, Run, experiment
from experiments.records.files import ROOT
from experiments.studies.footprint import probe


@experiment(revision=1, timed=True)
def footprint(
    run: Run,
    scenes: Sequence[str],
    models: Sequence[str],
    frames: int,
    needed: Mapping[str, Mapping[str, Sequence[str]]] | None = None,
) -> Iterator[Row]:
    """One row: a scene and a model in a process of their own (:mod:`…footprint.probe`).

    ``first_prediction_s`` since the import of torch, which took ``torch_s`` of it; ``peak_bytes``;
    the modules ``loaded`` of those watched. ``status``: ``ok``, or which module is loaded that
    neither the scene nor the model needs. Arguments: configs/experiment/footprint.yaml.
    """
    environment = {**os.environ, "OMP_NUM_THREADS": str(torch.get_num_threads())}
    for scene in scenes:
        for model in models:
            run.note(f"{scene}, {model}")
            command = [sys.executable, "-m", probe.__name__, scene, model, str(frames)]
            answer = subprocess.check_output(
                command, cwd=ROOT, env=environment, text=True
            )
            row = json.loads(answer.splitlines()[-1])
            if too_much := unneeded(row, scene, model, needed or {}):
                row["status"] = f"fails: loads {', '.join(too_much)}"
            yield {"scene": scene, "model": model, "n": frames, **row}


def unneeded(
    row: Row,
    scene: str,
    model: str,
    needed: Mapping[str, Mapping[str, Sequence[str]]],
) -> list[str]:
    """Modules that were loaded and that neither the scene nor the model needs, as far as it is
    said what both need."""
    of_scene = needed.get("scenes", {}).get(scene)
    of_model = needed.get("models", {}).get(model)
    if of_scene is None or of_model is None:
        return []
    allowed = {*of_scene, *of_model}
    return [name for name in row.get("loaded", "").split() if name not in allowed]
