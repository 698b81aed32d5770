"""Time, memory and modules of each scene and model: is what a scene does not need left out?"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence

import torch

from experiments.protocol.experiment import Row, Run, experiment
from experiments.records.files import ROOT
from experiments.studies.footprint import probe


@experiment(revision=1, timed=True)
def footprint(
    run: Run, scenes: Sequence[str], models: Sequence[str], frames: int
) -> Iterator[Row]:
    """One row: a scene and a model in a process of their own (:mod:`…footprint.probe`).

    ``first_prediction_s`` since the import of torch, which took ``torch_s`` of it; ``peak_bytes``;
    the modules ``loaded`` of those watched. Arguments: configs/experiment/footprint.yaml.
    """
    environment = {**os.environ, "OMP_NUM_THREADS": str(torch.get_num_threads())}
    for scene in scenes:
        for model in models:
            run.note(f"{scene}, {model}")
            command = [sys.executable, "-m", probe.__name__, scene, model, str(frames)]
            answer = subprocess.check_output(
                command, cwd=ROOT, env=environment, text=True
            )
            yield {
                "scene": scene,
                "model": model,
                "n": frames,
                **json.loads(answer.splitlines()[-1]),
            }
