"""Seconds a step, apart from how many steps there are: what an implementation costs.

The same step of the same model is timed with frames coming in three ways, as programs are written:

- ``memory``: all frames in memory, scaled, float32;
- ``dataset``: a ``DataLoader`` that scales frames of 8 bits one by one;
- ``decoded``: a ``DataLoader`` that reads each frame from its PNG in every epoch.

Each with and without both accuracies, of all training and test frames after every epoch, inside the
clock. HDC is timed in the same ways, by ordinary routes: ``numpy.median`` a frame, and the majority
of bits that take a byte each.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from rich.console import Console
from torch import Tensor, nn
from torch.nn import functional as F
from torch.utils.data import DataLoader, Dataset, Subset

from baselines.cnn import CNN
from baselines.softmax import SoftmaxRegression
from baselines.training import OPTIMIZERS
from experiments.protocol import data
from experiments.protocol.scenes import scene_at
from experiments.records.measurement import Row, measure

NAME = "table1_conditions_seconds"
PIPELINES = ("memory", "dataset", "decoded")


def run(
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    seed: int,
    pipelines: Sequence[str],
    models: Mapping[str, Mapping[str, Any]],
    rate: float,
    evaluated: int,
    cache: bool = True,
    force: bool = False,
) -> Path:
    """The task of configs/experiment/table1_conditions_seconds.yaml.

    Args:
        scene, split, seed: as in the configuration of a run.
        pipelines: of :data:`PIPELINES`.
        models: by name: ``filters`` of a convolutional network, or none of softmax regression;
            ``optimizer`` of ``baselines.training``, ``batch`` (null: all frames), and how many
            ``steps`` are timed after one that is not.
        rate: learning rate.
        evaluated: test frames on which an evaluation is timed.
        cache: keep made frames.
        force: measure again.

    Returns:
        Path: the folder. Its rows: ``pipeline``, ``model``, ``batch``, ``steps`` timed,
        ``seconds_per_step`` (their median), ``seconds_per_evaluated_frame``, ``n_train``,
        ``n_test``; of ``hdc``, which has no steps, ``seconds`` of the whole training.

    Raises:
        ValueError: naming the key that is wrong.
    """
    console = Console(highlight=False)
    if unknown := [name for name in pipelines if name not in PIPELINES]:
        expected = ", ".join(PIPELINES)
        raise ValueError(f"task.pipelines: expected some of {expected}, found {unknown[0]!r}")
    config = {
        "_target_": f"{__name__}.run",
        "scene": scene,
        "split": split,
        "seed": seed,
        "pipelines": pipelines,
        "models": models,
        "rate": rate,
        "evaluated": evaluated,
    }

    def compute() -> Iterator[Row]:
        made = scene_at(scene, seed, cache, console)
        train, test = data.choose(made, split, seed)
        frames = made.frames(np.concatenate([train, test]))
        labels = torch.from_numpy(made.labels[np.concatenate([train, test])])
        with tempfile.TemporaryDirectory() as folder:
            for name in pipelines:
                console.print(f"[dim]{NAME}: {name}[/dim]")
                source = SOURCES[name](frames, labels, Path(folder))
                yield from rows(name, source, len(train), models, rate, evaluated, seed)

    return measure(NAME, config, compute, force=force, console=console)


class Source(Dataset):
    """Frames float32 [H, W] in 0…1 and their labels.

    Args:
        frames: uint8 [N, H, W].
        labels: int64 [N].
        folder: for files.
    """

    def __init__(self, frames: Tensor, labels: Tensor, folder: Path):
        self.frames, self.labels = frames, labels

    def __len__(self) -> int:
        return len(self.labels)

    def frame(self, k: int) -> Tensor:
        """A frame as it comes in: here, of 8 bits, scaled when it is asked for."""
        return self.frames[k].float() / 255

    def __getitem__(self, k: int) -> tuple[Tensor, Tensor]:
        return self.frame(k), self.labels[k]

    def batches(self, chosen: Tensor, size: int) -> Iterator[tuple[Tensor, Tensor]]:
        """Frames [n, H, W] and labels of these indices, in their order."""
        yield from DataLoader(Subset(self, chosen.tolist()), size)


class Memory(Source):
    """Scaled once and kept."""

    def __init__(self, frames: Tensor, labels: Tensor, folder: Path):
        super().__init__(frames / 255, labels, folder)

    def frame(self, k: int) -> Tensor:
        return self.frames[k]

    def batches(self, chosen: Tensor, size: int) -> Iterator[tuple[Tensor, Tensor]]:
        return ((self.frames[part], self.labels[part]) for part in chosen.split(size))


class Decoded(Source):
    """Read from a PNG and scaled when it is asked for."""

    def __init__(self, frames: Tensor, labels: Tensor, folder: Path):
        super().__init__(frames[:0], labels, folder)
        self._paths = [str(folder / f"{k}.png") for k in range(len(labels))]
        for path, frame in zip(self._paths, frames.numpy(), strict=True):
            cv2.imwrite(path, frame)

    def frame(self, k: int) -> Tensor:
        read = cv2.imread(self._paths[k], cv2.IMREAD_GRAYSCALE)
        return torch.from_numpy(read).float() / 255


SOURCES: dict[str, Callable[[Tensor, Tensor, Path], Source]] = {
    "memory": Memory,
    "dataset": Source,
    "decoded": Decoded,
}


def rows(
    pipeline: str,
    source: Source,
    n_train: int,
    models: Mapping[str, Mapping[str, Any]],
    rate: float,
    evaluated: int,
    seed: int,
) -> Iterator[Row]:
    """The rows of one pipeline.

    Args:
        pipeline: its name.
        source: the frames, those that train first.
        n_train: how many do.
        models, rate, evaluated, seed: as in :func:`run`.
    """
    n, classes = len(source), 1 + int(source.labels.max())
    train, tested = torch.arange(n_train), torch.arange(n_train, min(n, n_train + evaluated))
    of = {"pipeline": pipeline, "n_train": n_train, "n_test": n - n_train}
    height, width = source.frame(0).shape
    for name, how in models.items():
        torch.manual_seed(seed)
        size = min(how["batch"] or n_train, n_train)
        model = CNN(filters=how["filters"]) if how["filters"] else SoftmaxRegression()
        network = model.build((height, width), classes)
        optimiser = OPTIMIZERS[how["optimizer"]](network.parameters(), rate)
        times = _steps(network, optimiser, source, train, size, how["steps"])
        start = time.perf_counter()
        with torch.no_grad():
            for frames, truth in source.batches(tested, model.prediction_batch):
                (network(frames[:, None]).argmax(dim=1) == truth).sum().item()
        yield {
            **of,
            "model": name,
            "batch": size,
            "steps": len(times),
            "seconds_per_step": float(np.median(times)),
            "seconds_per_evaluated_frame": (time.perf_counter() - start) / len(tested),
        }
    start = time.perf_counter()
    prototypes = majority(source, train, classes)
    learnt = time.perf_counter()
    for k in tested.tolist():
        (prototypes != bits_of(source.frame(k))).sum(dim=1).argmin().item()
    yield {
        **of,
        "model": "hdc",
        "seconds": learnt - start,
        "seconds_per_evaluated_frame": (time.perf_counter() - learnt) / len(tested),
    }


def _steps(
    network: nn.Module,
    optimiser: torch.optim.Optimizer,
    source: Source,
    train: Tensor,
    size: int,
    steps: int,
) -> list[float]:
    """Seconds of each step after the first."""
    times: list[float] = []
    while True:  # epoch after epoch
        start = time.perf_counter()
        for frames, truth in source.batches(train[torch.randperm(len(train))], size):
            optimiser.zero_grad(set_to_none=True)
            F.cross_entropy(network(frames[:, None]), truth).backward()
            optimiser.step()
            times.append(time.perf_counter() - start)
            if len(times) > steps:
                return times[1:]
            start = time.perf_counter()


def bits_of(frame: Tensor) -> Tensor:
    """Pixels above the median of their frame, bool [D], as one would write it."""
    pixels = frame.numpy().ravel()
    return torch.from_numpy(pixels > np.median(pixels))


def majority(source: Source, chosen: Tensor, classes: int) -> Tensor:
    """Prototypes bool [L, D] of bits that take a byte each; a tie is a zero."""
    bits: list[list[Tensor]] = [[] for _ in range(classes)]
    for k in chosen.tolist():
        bits[int(source.labels[k])].append(bits_of(source.frame(k)))
    return torch.stack([2 * torch.stack(one).sum(dim=0) > len(one) for one in bits])
