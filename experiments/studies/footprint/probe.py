"""One scene and one model in a process of their own, and what each package costs to import.

``python -m …probe SCENE MODEL FRAMES``. Nothing but the standard library is imported before the
clock runs. The answer is a line of JSON.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

PYTHON = "python"  # stands for the standard library
_STATM = Path("/proc/self/statm")


class Accounts:
    """Modules, seconds and bytes of imports by top-level package, without what they import of
    others. It is a finder, first in ``sys.meta_path``."""

    def __init__(self) -> None:
        self.of: dict[str, Counter[str]] = defaultdict(Counter)
        # Of the modules that the present one has imported.
        self._nested = Counter[str]()

    def find_spec(self, name: str, *place: Any) -> ModuleSpec | None:
        """The specification of a module, whose execution will be measured."""
        others = (finder for finder in sys.meta_path if finder is not self)
        found = (finder.find_spec(name, *place) for finder in others)
        spec = next(filter(None, found), None)
        loader: Any = spec and spec.loader
        # A namespace has no loader, and that of what is built in is a class.
        if hasattr(loader, "exec_module") and not isinstance(loader, type):
            package = name.partition(".")[0]
            if package in sys.stdlib_module_names or package.startswith("_"):
                package = PYTHON
            loader.exec_module = self._measured(package, loader.exec_module)
        return spec

    def _measured(
        self, package: str, execute: Callable[[Any], None]
    ) -> Callable[[Any], None]:
        def measured(module: Any) -> None:
            outside, self._nested = self._nested, Counter()
            took = Counter[str]()
            took.subtract(_used())
            try:
                execute(module)
            finally:
                took.update(_used())
                self.of[package].update(took, modules=1)
                self.of[package].subtract(self._nested)
                outside.update(took)
                self._nested = outside

        return measured


def _used() -> Mapping[str, Any]:
    """Seconds until now, and bytes that this process holds; 0 where the system does not say so."""
    pages = int(_STATM.read_text().split()[1]) if _STATM.exists() else 0
    held = pages * os.sysconf("SC_PAGE_SIZE")
    return {"package_s": time.perf_counter(), "package_bytes": held}


def main(scene_name: str, model_name: str, frames: str) -> None:
    """Make some frames, learn them, predict one, and print what it took."""
    accounts = Accounts()
    sys.meta_path.insert(0, accounts)  # type: ignore[arg-type]
    begin = time.perf_counter()

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
    row: dict[str, Any] = {
        "first_prediction_s": time.perf_counter() - begin,
        "peak_bytes": peak_bytes(),
        "status": "ok",
        "origin": scene.origin,
        "package": list(accounts.of),
    }
    for name in ("modules", "package_s", "package_bytes"):
        row[name] = [each[name] for each in accounts.of.values()]
    print(json.dumps(row))


if __name__ == "__main__":
    main(*sys.argv[1:])
