"""What one scene and one model load, build and hold, seen from inside a process of their own.

``python -m experiments.studies.footprint.probe REQUEST``, request and answer in JSON; started by
:mod:`experiments.studies.footprint.measure`. Nothing but the standard library is imported before
the clock runs.
"""

from __future__ import annotations

import contextlib
import json
import os
import runpy
import sys
import time
from collections import Counter
from typing import Any

# Loaded by somebody, needed by few.
WATCHED = (
    "cv2",
    "sklearn",
    "pandas",
    "matplotlib",
    "scipy",
    "scipy.stats",
    "baselines.cnn",
    "scenes.sensor.texture",
    "scenes.sensor.creep",
    "scenes.fibre",
    "scenes.recorded",
)


def main() -> None:
    """Answer the request.

    ``started`` is the time at which this process was (s), ``threads`` those of torch. What is
    done: ``torch``, nothing but its import; ``build``, ``frames`` frames of the scene that
    ``overrides`` choose are made and learnt, and one of them predicted; ``stream``, the same one by
    one, and ``n`` more are made, predicted and learnt as they come (the scene's, from the first
    again after the last); ``run``, the runner carries out the run of these overrides.
    """
    request = json.loads(sys.argv[1])
    before = time.perf_counter()
    import torch

    answer: dict[str, Any] = {"torch_s": time.perf_counter() - before}

    from experiments.protocol.machine import peak_bytes

    answer["torch_bytes"] = peak_bytes()
    torch.set_num_threads(request["threads"])
    if request["do"] == "run":
        answer |= _run(request["overrides"])
    elif request["do"] != "torch":
        answer |= _build(request)
    packages = Counter(name.partition(".")[0] for name in sys.modules)
    answer.setdefault("peak_bytes", peak_bytes())
    answer |= {
        "modules": len(sys.modules),
        "packages": {name: count for name, count in packages.most_common() if count > 1},
        "loaded": [name for name in WATCHED if name in sys.modules],
    }
    print(json.dumps(answer))


def _build(request: dict[str, Any]) -> dict[str, Any]:
    """Scene and model as a run builds them, up to the first prediction, and on if asked."""
    import hydra
    import numpy as np

    from experiments.protocol.machine import peak_bytes
    from experiments.protocol.trial import instantiate
    from experiments.records.configs import CONFIGS

    with hydra.initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = hydra.compose("config", request["overrides"])
    try:
        scene = instantiate(cfg.scene, "scene")
    except (ValueError, OSError) as error:
        return {"status": f"skipped: {error}"}
    model = instantiate(cfg.model, "model")
    # Spread over all sessions and classes.
    indices = np.linspace(0, len(scene.labels) - 1, request["frames"]).astype(int)
    answer: dict[str, Any] = {}
    if request["do"] == "stream":
        for index in indices:
            model.partial_fit(scene.frames([index]), scene.labels[[index]])
        model.predict(scene.frames(indices[:1]))
        answer["first_prediction_s"] = time.time() - request["started"]
        for index in np.resize(np.arange(len(scene.labels)), request["n"]):
            frame = scene.frames([index])
            model.predict(frame)
            model.partial_fit(frame, scene.labels[[index]])
    else:
        frames = scene.frames(indices)
        next(iter(model.train(frames, scene.labels[indices])))
        model.predict(frames[:1])
        answer |= {
            "first_prediction_s": time.time() - request["started"],
            "peak_bytes": peak_bytes(),  # the clock's own repeats are not what a user does
        }
        spent = []
        for _ in range(3):
            before = time.perf_counter()
            scene.frames(indices)
            spent.append((time.perf_counter() - before) / len(indices))
        answer["frame_s"] = min(spent)
    return answer | {"parts": sorted(parts(scene)), "origin": scene.origin}


def _run(overrides: list[str]) -> dict[str, Any]:
    """The runner's whole command line, its output kept away from the answer."""
    sys.argv[1:] = overrides
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        try:
            runpy.run_module("experiments.run", run_name="__main__")
        except SystemExit as end:
            if end.code:
                raise RuntimeError(f"experiments.run {' '.join(overrides)} failed") from end
    return {}


def parts(root: Any) -> set[str]:
    """Classes of the project's objects that are reachable from this one: what was built."""
    names: set[str] = set()
    seen: set[int] = set()
    waiting = [root]
    while waiting:
        found = waiting.pop()
        if id(found) in seen:
            continue
        seen.add(id(found))
        if isinstance(found, dict):
            waiting += found.values()
        elif isinstance(found, list | tuple):
            waiting += found
        elif type(found).__module__.startswith("scenes."):
            names.add(type(found).__name__)
            waiting += getattr(found, "__dict__", {}).values()
    return names


if __name__ == "__main__":
    main()
