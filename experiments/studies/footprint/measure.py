"""Time, memory and modules of each scene and model: is what a scene does not need left out?"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

import torch

from experiments.protocol.task import Context, Row, Task
from experiments.records.files import ROOT
from experiments.studies.footprint import probe


class Footprint(Task, frozen=True):
    """One row: a scene and a model in a process of their own (:mod:`…footprint.probe`).

    ``first_prediction_s`` since the import of torch, which took ``torch_s`` of it; ``peak_bytes``;
    the modules ``loaded`` of those watched; ``every_s`` and ``every_bytes`` of a process that loads
    all of them first. ``status``: ``ok``, or which module is loaded that is not among those
    ``needed`` by the scene or the model. Arguments: configs/experiment/footprint.yaml.
    """

    revision: ClassVar = 2
    timed: ClassVar = True

    scenes: Sequence[str]
    models: Sequence[str]
    frames: int
    needed: Mapping[str, Sequence[str]]

    def rows(self, context: Context) -> Iterator[Row]:
        for scene in self.scenes:
            for model in self.models:
                context.note(f"{scene}, {model}")
                row = probed(scene, model, str(self.frames))
                if "loaded" in row:
                    allowed = {*self.needed.get(scene, ()), *self.needed.get(model, ())}
                    others = [
                        name for name in row["loaded"].split() if name not in allowed
                    ]
                    if others:
                        row["status"] = f"fails: loads {', '.join(others)}"
                    every = probed(scene, model, str(self.frames), *probe.WATCHED)
                    row["every_s"] = every["first_prediction_s"]
                    row["every_bytes"] = every["peak_bytes"]
                yield {"scene": scene, "model": model, "n": self.frames, **row}


def probed(*arguments: str) -> Row:
    """What a process says of itself."""
    environment = {**os.environ, "OMP_NUM_THREADS": str(torch.get_num_threads())}
    command = [sys.executable, "-m", probe.__name__, *arguments]
    answer = subprocess.check_output(command, cwd=ROOT, env=environment, text=True)
    row: Row = json.loads(answer.splitlines()[-1])
    return row
