"""Time and memory of each scene and model, by package: is what a scene does not need left out?"""

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

    ``first_prediction_s`` from the first import on; ``peak_bytes``; and for each top-level
    ``package`` that was imported, its ``modules``, ``package_s`` and ``package_bytes``. ``status``:
    ``ok``, or the packages that are loaded though ``needed`` does not name them for this scene or
    model.
    Arguments: configs/experiment/footprint.yaml.
    """

    revision: ClassVar[int] = 3
    timed: ClassVar[bool] = True

    scenes: Sequence[str]
    models: Sequence[str]
    frames: int
    repetitions: int
    needed: Mapping[str, Sequence[str]]

    def rows(self, context: Context) -> Iterator[Row]:
        # What a scene loads and what a model loads add up: each model is run on the first scene,
        # and each other scene with the first model.
        of_models = [(self.scenes[0], model) for model in self.models]
        of_scenes = [(scene, self.models[0]) for scene in self.scenes[1:]]
        for scene, model in of_models + of_scenes:
            for repetition in range(self.repetitions):
                context.note(f"{scene}, {model}, {repetition + 1}")
                row = probed(scene, model, str(self.frames))
                needed = {
                    n for key in ("all", scene, model) for n in self.needed.get(key, ())
                }
                others = sorted(set(row.get("package", ())) - needed)
                if others:
                    row["status"] = f"fails: loads {', '.join(others)}"
                about = {"scene": scene, "model": model, "n": self.frames}
                yield {**about, "repetition": repetition, **row}
                if "package" not in row:
                    break  # it is skipped, whatever the repetition


def probed(*arguments: str) -> Row:
    """The row that a process prints."""
    environment = {**os.environ, "OMP_NUM_THREADS": str(torch.get_num_threads())}
    command = [sys.executable, "-m", probe.__name__, *arguments]
    answer = subprocess.check_output(command, cwd=ROOT, env=environment, text=True)
    row: Row = json.loads(answer.splitlines()[-1])
    return row
