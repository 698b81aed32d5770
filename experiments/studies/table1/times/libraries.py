"""Models as one writes them with standard libraries alone: what a grid of times begins with."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from baselines.libraries import opencv_median
from hdc.parameters import check_choice

MEDIANS: Mapping[str, Callable[[np.ndarray], Any]] = {
    "cv2.calcHist": opencv_median,
    "numpy.median": np.median,
}
KERNEL, POOL = 5, 2  # pixels a side, as in baselines.cnn


class LibraryHDC:
    """Thresholds at the median, by a function of another library, and bitwise majority by NumPy.

    A pixel that equals the median of its frame is 0, and a bit of which as many samples are 1
    as are 0 is 0.

    Args:
        median: a key of :data:`MEDIANS`; frames are uint8.
    """

    revision: ClassVar[int] = 1

    def __init__(self, median: str):
        check_choice("median", median, MEDIANS)
        self._median = MEDIANS[median]
        self._uses_opencv = median.startswith("cv2")

    def train(self, frames: Tensor, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """Learn from frames [N, H, W]; yields once."""
        if self._uses_opencv:
            import_module("cv2").setNumThreads(torch.get_num_threads())
        ones = self._bits(frames)
        self.classes_ = np.unique(labels)
        self.prototypes_ = np.stack(
            [_majority(ones[labels == c]) for c in self.classes_]
        )
        yield {"samples_seen": len(frames)}

    def predict(self, frames: Tensor) -> np.ndarray:
        """Labels [Q] of the nearest prototypes."""
        labels = []
        for bits in self._bits(frames):
            differing = np.count_nonzero(self.prototypes_ != bits, axis=1)
            labels.append(self.classes_[differing.argmin()])
        return np.array(labels)

    def _bits(self, frames: Tensor) -> np.ndarray:
        """Pixels above the median of their frame, bool [N, D]."""
        pixels = frames.flatten(1).numpy()
        ones = np.empty(pixels.shape, np.bool_)
        for frame, row in zip(pixels, ones, strict=True):
            np.greater(frame, self._median(frame), out=row)
        return ones


def _majority(ones: np.ndarray) -> np.ndarray:
    """Bits that more than half of the samples [n, D] have."""
    counts = np.zeros(ones.shape[1], np.uint16)
    for row in ones:
        np.add(counts, row, out=counts)
    return counts > len(ones) / 2


class PlainNetwork:
    """A network trained as PyTorch's tutorials do, with its defaults.

    Recipe, first weights and batches are those of :class:`baselines.cnn.CNN`, or of
    :class:`baselines.softmax.SoftmaxRegression` without filters; how they are computed is not:
    no other memory layout, no fused optimiser, whole batches.

    Args:
        filters: number of filters of each convolution; none makes softmax regression.
        reports_per_epoch: how often in an epoch ``train`` yields.
        lr: learning rate of Adam; the published one is 1e-4.
        batch_size: frames a step.
        max_epochs: passes over the training frames after which ``train`` returns.
        seed: of the initial weights and the permutations.
    """

    revision: ClassVar[int] = 1

    def __init__(
        self,
        filters: Sequence[int],
        reports_per_epoch: int,
        lr: float = 1e-4,
        batch_size: int = 20,
        max_epochs: int = 10_000,
        seed: int = 0,
    ):
        self.filters, self.reports_per_epoch = tuple(filters), reports_per_epoch
        self.lr, self.batch_size = lr, batch_size
        self.max_epochs, self.seed = max_epochs, seed

    def build(self, shape: tuple[int, int], classes: int) -> nn.Module:
        """The network with its initial weights: float32 [n, 1, H, W] to logits [n, L]."""
        layers: list[nn.Module] = []
        (height, width), channels = shape, 1
        for filters in self.filters:
            layers.append(nn.Conv2d(channels, filters, KERNEL, padding=KERNEL // 2))
            layers += [nn.ReLU(), nn.MaxPool2d(POOL)]
            (height, width), channels = (height // POOL, width // POOL), filters
        layers += [nn.Flatten(), nn.Linear(channels * height * width, classes)]
        return nn.Sequential(*layers)

    def train(self, frames: Tensor, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """Train on frames uint8 [N, H, W] with class indices; reports as those of CNN."""
        n, targets = len(frames), torch.from_numpy(labels)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.seed)
            classes = int(labels.max()) + 1
            self.network_ = self.build((frames.shape[1], frames.shape[2]), classes)
        optimizer = torch.optim.Adam(self.network_.parameters(), lr=self.lr)
        order = torch.Generator().manual_seed(self.seed)
        steps = math.ceil(n / self.batch_size)
        parts = range(1, self.reports_per_epoch + 1)
        reports = {math.ceil(steps * part / self.reports_per_epoch) for part in parts}
        taken, seen, losses, right, asked = 0, 0, 0.0, 0, 0
        for _ in range(self.max_epochs):
            batches = torch.randperm(n, generator=order).split(self.batch_size)
            for step, batch in enumerate(batches, 1):
                logits = self.network_(_inputs(frames[batch]))
                loss = F.cross_entropy(logits, targets[batch])
                optimizer.zero_grad()
                loss.backward()
                optimizer.step()
                taken, seen, asked = taken + 1, seen + len(batch), asked + len(batch)
                losses += loss.item() * len(batch)
                right += int((logits.argmax(1) == targets[batch]).sum())
                if step in reports:
                    yield {
                        "samples_seen": seen,
                        "epoch": seen / n,
                        "steps": taken,
                        "loss": losses / asked,
                        "batch_accuracy": right / asked,
                    }
                    losses, right, asked = 0.0, 0, 0

    def predict(self, frames: Tensor) -> np.ndarray:
        """Labels [Q]."""
        with torch.inference_mode():
            batches = [
                self.network_(_inputs(batch)).argmax(1)
                for batch in frames.split(self.batch_size)
            ]
        return torch.cat(batches).numpy()


def _inputs(batch: Tensor) -> Tensor:
    """Frames uint8 [n, H, W] as float32 [n, 1, H, W] in 0…1."""
    return batch[:, None].float() / 255
