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
        # What a scene loads and what a model loads add up: each scene is run with the first model
        # alone, and each model on the first scene.
        with_first = ((scene, self.models[0]) for scene in self.scenes[1:])
        pairs = [*((self.scenes[0], model) for model in self.models), *with_first]
        for scene, model in pairs:
            for repetition in range(self.repetitions):
                context.note(f"{scene}, {model}, {repetition + 1}")
                row = probed(scene, model, str(self.frames))
                others = self._not_needed(scene, model, row)
                if others:
                    row["status"] = f"fails: loads {', '.join(others)}"
                about = {"scene": scene, "model": model, "n": self.frames}
                yield {**about, "repetition": repetition, **row}
                if "package" not in row:
                    break  # it is skipped, whatever the repetition

    def _not_needed(self, scene: str, model: str, row: Row) -> list[str]:
        keys = ("all", scene, model)
        needed = {name for key in keys for name in self.needed.get(key, ())}
        loaded = row.get("package", ())
        return sorted(name for name in loaded if name not in needed)


def probed(*arguments: str) -> Row:
    """The row that a process prints."""
    environment = {**os.environ, "OMP_NUM_THREADS": str(torch.get_num_threads())}
    command = [sys.executable, "-m", probe.__name__, *arguments]
    answer = subprocess.check_output(command, cwd=ROOT, env=environment, text=True)
    row: Row = json.loads(answer.splitlines()[-1])
    return row
