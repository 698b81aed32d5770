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


@experiment
def footprint(run: Run, scenes: Sequence[str], models: Sequence[str], frames: int) -> Iterator[Row]:
    """One row: a scene and a model in a process of their own (:mod:`…footprint.probe`).

    ``first_prediction_s`` since the import of torch, which took ``torch_s`` of it; ``frame_s``;
    ``peak_bytes`` and ``torch_bytes``, the peak after that import; ``modules``; those ``loaded`` of
    the ones watched. Arguments: configs/experiment/footprint.yaml.

    Raises:
        RuntimeError: with the end of its complaint, if a process failed.
    """
    environment = {**os.environ, "OMP_NUM_THREADS": str(torch.get_num_threads())}
    for scene in scenes:
        for model in models:
            run.note(f"{scene}, {model}")
            command = [sys.executable, "-m", probe.__name__, scene, model, str(frames)]
            done = subprocess.run(
                command, cwd=ROOT, env=environment, capture_output=True, text=True
            )
            if done.returncode:
                raise RuntimeError(f"footprint of {scene}, {model}: {done.stderr.strip()[-500:]}")
            answer = json.loads(done.stdout.splitlines()[-1])
            yield {"scene": scene, "model": model, "n": frames, **answer}
