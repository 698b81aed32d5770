"""What each scene and model load, build and hold: is what a scene does not need left out?

Every row comes from a process of its own (:mod:`experiments.studies.footprint.probe`): a few frames
are made, learnt, and one is predicted. Peak memory is told beside that of torch's import alone in
the same process. Besides the scenes as configured, one build has everything switched on (texture,
two sessions, drift and creep); hyperdimensional computing also learns streams of hundreds and
thousands of frames, and goes through the runner, which holds the frames of a run in memory.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from omegaconf import OmegaConf

from experiments.records.configs import CONFIGS
from experiments.records.files import ROOT
from experiments.records.measurement import Row, measure
from experiments.studies.footprint import probe

EVERYTHING = "everything"  # name of the build with every part


def run(
    scenes: Sequence[str],
    models: Sequence[str],
    everything: Sequence[str],
    frames: int,
    stream: Sequence[int],
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/footprint/``.

    Args:
        scenes, models: names of files of ``configs/scene`` and ``configs/model``.
        everything: overrides that switch on every part of the simulated sensor.
        frames: number of frames made and learnt in each row.
        stream: numbers of frames that the first model learns from a stream of the first scene.
        force: measure again.

    Returns:
        Path: the folder. The columns of its rows: ``scene``, ``model``, ``what`` was done with
        ``n`` frames, ``status``; ``parts`` built; ``first_prediction_s`` since the start, of it
        ``torch_s`` for importing torch; ``frame_s``; ``peak_bytes``, ``torch_bytes`` after that
        import, ``above_torch_bytes``; ``modules``, ``packages`` and, of those watched, ``loaded``;
        ``origin`` of the frames.
    """
    config = {
        "_target_": f"{__name__}.run",
        "scenes": {name: _file("scene", name) for name in scenes},
        "models": {name: _file("model", name)["model"] for name in models},
        "everything": list(everything),
        "frames": frames,
        "stream": list(stream),
    }

    def compute() -> Iterator[Row]:
        builds = {name: [f"scene={name}"] for name in scenes} | {EVERYTHING: list(everything)}
        return rows(builds, models, frames, stream)

    return measure("footprint", config, compute, force=force)


def rows(
    builds: Mapping[str, Sequence[str]], models: Sequence[str], frames: int, stream: Sequence[int]
) -> Iterator[Row]:
    """One row a process.

    Args:
        builds: overrides of the scene by name.
        models: names.
        frames: as in :func:`run`.
        stream: as in :func:`run`, for the first build and model.
    """
    yield {"scene": "", "model": "", "what": "import torch", **ask(do="torch")}
    for name, overrides in builds.items():
        for model in models:
            answer = ask(do="build", overrides=[*overrides, f"model={model}"], frames=frames)
            yield {"scene": name, "model": model, "what": "build", "n": frames, **answer}
    name, overrides = next(iter(builds.items()))
    chosen = [*overrides, f"model={models[0]}"]
    for n in stream:
        answer = ask(do="stream", overrides=chosen, frames=frames, n=n)
        yield {"scene": name, "model": models[0], "what": "stream", "n": n, **answer}
    # The cores are this measurement's already; a run that waited for them would wait for ever.
    answer = ask(do="run", overrides=[*chosen, "exclusive=false"])
    yield {"scene": name, "model": models[0], "what": "run", **answer}


def ask(**request: Any) -> Row:
    """What a process of its own answers to the request, as the cells of a row.

    Raises:
        RuntimeError: with what the process complained of, if it failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        # A run of the probe writes its record and frames where they are forgotten.
        words = json.dumps({**request, "threads": torch.get_num_threads(), "started": time.time()})
        done = subprocess.run(
            [sys.executable, "-m", probe.__name__, words],
            cwd=ROOT,
            env={**os.environ, "RESULTS_DIR": folder},
            capture_output=True,
            text=True,
        )
    if done.returncode:
        raise RuntimeError(f"footprint of {request}: {done.stderr.strip()}")
    answer = json.loads(done.stdout.splitlines()[-1])
    return {
        "status": answer.get("status", "ok"),
        "parts": " ".join(answer.get("parts", ())),
        "first_prediction_s": answer.get("first_prediction_s"),
        "torch_s": answer["torch_s"],
        "frame_s": answer.get("frame_s"),
        "peak_bytes": answer["peak_bytes"],
        "torch_bytes": answer["torch_bytes"],
        "above_torch_bytes": answer["peak_bytes"] - answer["torch_bytes"],
        "modules": answer["modules"],
        "packages": " ".join(f"{name}:{count}" for name, count in answer["packages"].items()),
        "loaded": " ".join(answer["loaded"]),
        "origin": answer.get("origin"),
    }


def _file(group: str, name: str) -> Any:
    """What a file of ``configs/`` holds, its references as they are."""
    return OmegaConf.to_container(OmegaConf.load(CONFIGS / group / f"{name}.yaml"))
