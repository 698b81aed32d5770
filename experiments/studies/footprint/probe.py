"""One scene and one model in a process of their own.

``python -m …probe SCENE MODEL FRAMES [MODULES]``; the modules are loaded first. Nothing but the
standard library is imported before the clock runs. The answer is a line of JSON.
"""

from __future__ import annotations

import importlib
import json
import sys
import time

# Loaded by some part of the project, needed by few.
WATCHED = (
    "cv2",
    "sklearn",
    "pandas",
    "matplotlib",
    "scipy",
    "scipy.stats",
    "hdc.encoders.reference",
    "hdc.readouts.lda",
    "baselines.cnn",
    "scenes.sensor.texture",
    "scenes.fibre",
    "scenes.recorded",
)


def main(scene_name: str, model_name: str, frames: str, *modules: str) -> None:
    """Load modules, make some frames, learn them, and predict one; print what it took."""
    begin = time.perf_counter()
    importlib.import_module("torch")
    torch_s = time.perf_counter() - begin
    for name in modules:
        importlib.import_module(name)

    import numpy as np
    from hydra import compose, initialize_config_dir

    from baselines import library
    from experiments.protocol.machine import peak_bytes
    from experiments.protocol.model import instantiate
    from experiments.protocol.settings import resolved
    from experiments.records.configs import CONFIGS

    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("config", [f"scene={scene_name}", f"model={model_name}"])
    try:
        config = resolved(cfg)
        scene = instantiate(config["scene"], "scene")
    except (ValueError, OSError) as error:
        print(json.dumps({"status": f"skipped: {error}"}))
        return
    model = instantiate(config["model"], "model")
    # Spread over all sessions and classes.
    indices = np.linspace(0, len(scene.labels) - 1, int(frames)).astype(int)
    images = scene.frames(indices)
    next(iter(library.train(model, images, scene.labels[indices])))
    model.predict(images[:1])
    row = {
        "torch_s": torch_s,
        "first_prediction_s": time.perf_counter() - begin,
        "peak_bytes": peak_bytes(),
        "status": "ok",
        "origin": scene.origin,
        "loaded": " ".join(name for name in WATCHED if name in sys.modules),
    }
    print(json.dumps(row))


if __name__ == "__main__":
    main(*sys.argv[1:])
