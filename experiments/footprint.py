"""Leave out what a scene does not need: what each scene and model load, build and hold, measured.

Every row comes from a process of its own (:mod:`experiments.footprint_probe`): a few frames are
made, learnt, and one is predicted. Peak memory is told beside that of torch's import alone in the
same process. Besides the scenes as configured, one build has everything switched on (texture, two
sessions, drift and creep); hyperdimensional computing also learns streams of hundreds and thousands
of frames, and goes through the runner, which holds the frames of a run in memory.
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

from experiments import sources
from experiments.measurement import Row, measure

EVERYTHING = "everything"  # name of the build with every part


def run(
    scenes: Sequence[str],
    models: Sequence[str],
    everything: Sequence[str],
    frames: int,
    stream: Sequence[int],
    force: bool = False,
) -> Path:
    """The task of configs/experiment/footprint.yaml: results/measured/footprint/.

    Args:
        scenes, models: files of configs/scene and configs/model.
        everything: overrides that switch on every part of the simulated sensor.
        frames: made and learnt in each row.
        stream: numbers of frames that the first model learns from a stream of the first scene.
        force: measure again.
    """
    config = {
        "_target_": "experiments.footprint.run",
        "probe": {"_target_": "experiments.footprint_probe.main"},
        "scenes": {name: _file("scene", name) for name in scenes},
        "models": {name: _file("model", name) for name in models},
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
    yield {"scene": "", "model": "", "what": "import torch", **probe(do="torch")}
    for name, overrides in builds.items():
        for model in models:
            answer = probe(do="build", overrides=[*overrides, f"model={model}"], frames=frames)
            yield {"scene": name, "model": model, "what": "build", "n": frames, **answer}
    name, overrides = next(iter(builds.items()))
    chosen = [*overrides, f"model={models[0]}"]
    for n in stream:
        answer = probe(do="stream", overrides=chosen, frames=frames, n=n)
        yield {"scene": name, "model": models[0], "what": "stream", "n": n, **answer}
    # The cores are this measurement's already; a run that waited for them would wait for ever.
    answer = probe(do="run", overrides=[*chosen, "exclusive=false"])
    yield {"scene": name, "model": models[0], "what": "run", **answer}


def probe(**request: Any) -> Row:
    """What a process of its own answers to the request, as the cells of a row.

    Raises:
        RuntimeError: with what the process complained of, if it failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        # A run of the probe writes its record and frames where they are forgotten.
        words = json.dumps({**request, "threads": torch.get_num_threads(), "started": time.time()})
        done = subprocess.run(
            [sys.executable, "-m", "experiments.footprint_probe", words],
            cwd=sources.ROOT,
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
    return OmegaConf.to_container(OmegaConf.load(sources.ROOT / "configs" / group / f"{name}.yaml"))
