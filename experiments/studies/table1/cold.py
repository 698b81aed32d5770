"""Train one model in a process of its own: ``python -m …cold FOLDER``.

The folder has the frames, the labels and the config of the model. Whoever starts the process times
all of it.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from baselines import library
from experiments.protocol.model import instantiate

FRAMES, LABELS, TASK = "frames.npy", "labels.npy", "task.json"


def keep(
    folder: Path,
    frames: torch.Tensor,
    labels: np.ndarray,
    model: Mapping[str, Any],
    threads: int,
) -> None:
    """Write what the process reads."""
    np.save(folder / FRAMES, frames.numpy())
    np.save(folder / LABELS, labels)
    (folder / TASK).write_text(json.dumps({"model": model, "threads": threads}))


def main(folder: Path) -> None:
    """Read the frames and learn them to the end."""
    task = json.loads((folder / TASK).read_text())
    torch.set_num_threads(task["threads"])
    model = instantiate(task["model"], "model")
    frames = torch.from_numpy(np.load(folder / FRAMES))
    for _ in library.train(model, frames, np.load(folder / LABELS)):
        pass


if __name__ == "__main__":
    main(Path(sys.argv[1]))
