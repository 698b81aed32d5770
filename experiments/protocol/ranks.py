"""Training on more frames than one machine has: each rank counts its own, and the counts are added.

A prototype depends on its class's frames through sums alone: how many there are, and for each pixel
in how many it is above the median. Ranks therefore train apart, and one all-reduce of L·D integers
gives all of them the prototypes of all frames, bit for bit those that one machine would have made,
whoever has which frames.

    torchrun --nproc-per-node=2 -m experiments.run scene=touch model=hdc
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
import torch.distributed as dist
from torch import Tensor

from hdc import HDCClassifier
from hdc.prototypes import Counters

_INTEGERS = (torch.uint8, torch.int32, torch.int64)  # what gloo and NCCL both add


def launched() -> bool:
    """Whether torchrun started this process."""
    return dist.is_available() and dist.is_torchelastic_launched()


def join(device: str) -> None:
    """Meet the other ranks, once a process; on GPUs each rank takes the one of its number.

    Raises:
        ValueError: for the device of another rank.
    """
    if dist.is_initialized():
        return
    if device.startswith("cuda"):
        if device != "cuda":
            raise ValueError(
                f"device: expected cuda under torchrun (a rank takes its own), found {device!r}"
            )
        torch.cuda.set_device(int(os.environ["LOCAL_RANK"]))
    dist.init_process_group("cpu:gloo,cuda:nccl" if device == "cuda" else "gloo")


def leave() -> None:
    """Part from the other ranks, if they were met."""
    if dist.is_initialized():
        dist.destroy_process_group()


def ranks() -> int:
    """How many ranks there are."""
    return dist.get_world_size()


def local_ranks() -> int:
    """How many ranks torchrun started on this machine; 1 without it."""
    return int(os.environ.get("LOCAL_WORLD_SIZE", 1)) if launched() else 1


def together(lead: Callable[[Callable[[], None]], Any], follow: Callable[[], Any]) -> Any:
    """Rank 0 leads; the others follow it, once it has found that there is something to do.

    Args:
        lead: called on rank 0 with a function that it calls when the others are to start.
        follow: called on the others then, and not at all if rank 0 ends without.

    Returns:
        What `lead` returned, on rank 0; None on the others.
    """
    started = False

    def start() -> None:
        nonlocal started
        dist.broadcast(torch.ones(1), 0)
        started = True

    if dist.get_rank() == 0:
        try:
            return lead(start)
        finally:
            if not started:
                dist.broadcast(torch.zeros(1), 0)
    word = torch.empty(1)
    dist.broadcast(word, 0)
    if word:
        follow()
    return None


@dataclass(eq=False)
class Sharded:
    """A model that every rank trains on its part of the frames; see :class:`hdc.HDCClassifier`.

    Args:
        model: an HDCClassifier.
        ranks: how many there are; a run on more of them is another run.

    Raises:
        ValueError: for a model whose training is no sum of counts, or other ranks than there are.
    """

    model: HDCClassifier
    ranks: int

    def __post_init__(self) -> None:
        if not isinstance(self.model, HDCClassifier):
            raise ValueError(
                "expected a model whose training is a sum of counts under torchrun "
                f"(hdc, hdc_random_ties, hdc_integer), found {type(self.model).__name__}"
            )
        if self.ranks != dist.get_world_size():
            raise ValueError(f"ranks: expected {dist.get_world_size()}, found {self.ranks}")

    def train(self, frames: Any, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """Train on this rank's part of the frames; yields once, with all prototypes."""
        part = shard(len(labels), self.ranks, dist.get_rank())
        self.model, _ = fit(self.model, frames[part], labels[part], tuple(frames.shape[1:]))
        yield {"samples_seen": len(labels)}

    def predict(self, frames: Any) -> np.ndarray:
        """Labels [Q], by this rank alone."""
        return self.model.predict(frames)

    def state_tensors(self) -> dict[str, Tensor]:
        """Those of the model."""
        return self.model.state_tensors()


def shard(n: int, ranks: int, rank: int) -> slice:
    """The samples of a rank: n of them in equal parts, as far as that goes."""
    return slice(n * rank // ranks, n * (rank + 1) // ranks)


def fit(
    model: HDCClassifier, frames: Any, labels: Any, shape: tuple[int, ...]
) -> tuple[HDCClassifier, int]:
    """A model of the frames of all ranks, of which each gives its own; all call this at once.

    Args:
        model: whose parameters it has.
        frames: of this rank, [n, H, W] or [n, D]; n may be zero, or classes be missing.
        labels: of them, [n], of types that JSON has.
        shape: of a frame.

    Returns:
        The model, the same on every rank, and how many bytes of counts (L·D integers) this rank
        gave to the sum.

    Raises:
        ValueError: if all ranks together have one class only.
    """
    return add(model, count(model, frames, labels), shape)


def count(model: HDCClassifier, frames: Any, labels: Any) -> HDCClassifier | None:
    """The part of :func:`fit` that a rank does alone; None for no frames."""
    if len(labels) == 0:
        return None
    return HDCClassifier(device=model.device).partial_fit(frames, labels)


def add(
    model: HDCClassifier, own: HDCClassifier | None, shape: tuple[int, ...]
) -> tuple[HDCClassifier, int]:
    """The part of :func:`fit` that the ranks do together."""
    known = own.classes_.tolist() if own else []
    classes = list(dict.fromkeys(_gathered(known, model.device)))
    if len(classes) < 2:
        raise ValueError(f"labels: expected at least two classes, found {classes}")
    total = Counters(len(classes), int(np.prod(shape)), model.device)
    if own:
        total.merge(own.counters_, [classes.index(label) for label in known])
    n = _summed(total.n.to(model.device))
    largest = int(n.max())
    dtype = next(t for t in _INTEGERS if largest <= torch.iinfo(t).max)
    counts = _summed(total.counts(dtype))
    counters = Counters.from_counts(counts, n)
    return HDCClassifier.from_counters(
        counters, classes, shape, **model.get_params()
    ), counts.nbytes


def _gathered(own: list[Any], device: str) -> list[Any]:
    """The lists of all ranks, one after the other; they travel as JSON, nothing is pickled."""
    text = torch.tensor(list(json.dumps(own).encode()), dtype=torch.uint8, device=device)
    size = torch.tensor([len(text)], device=device)
    sizes = [torch.empty_like(size) for _ in range(dist.get_world_size())]
    dist.all_gather(sizes, size)
    width = int(torch.cat(sizes).max())
    texts = [text.new_empty(width) for _ in sizes]
    dist.all_gather(texts, torch.nn.functional.pad(text, (0, width - len(text))))
    return [
        item
        for n, padded in zip(sizes, texts, strict=True)
        for item in json.loads(bytes(padded[: int(n)].tolist()))
    ]


def _summed(tensor: Tensor) -> Tensor:
    """The sum over ranks, in place."""
    dist.all_reduce(tensor)
    return tensor
