"""Shared by all baselines: hyperparameters as fields, checked input, prediction in batches."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
from hdc.inputs import FrameSource

FRAME_TYPES = {torch.uint8: 255, torch.uint16: 65535}  # and their largest value
# Rounding of sums of 10⁵ products in float32, in units of the size of their parts.
ROUNDING = 2e-6


@dataclass(kw_only=True, eq=False)
class Classifier(ABC):
    """A classifier of frames with ``fit`` and ``predict`` as in scikit-learn.

    A subclass is a dataclass whose fields are its hyperparameters; it writes ``train``, ``scores``
    and ``state_tensors``. ``train`` begins with ``start``, which checks the input, and gets its
    frames by ``read``.

    Attributes:
        classes_: [L], the labels present in training, sorted.
        shape_: (H, W) of the training frames; (1, D) where they were given as [N, D].
        frame_dtype_: ``torch.uint8`` or ``torch.uint16``.

    A subclass that is computed from products of frames also writes ``predict_from``, which is
    described at :func:`experiments.protocol.evaluate.evaluate`.
    """

    device: str = "cpu"

    # Code version of each baseline; raised by hand in the commit that changes its numbers.
    revision: ClassVar[int]

    # Frames scored at a time: bounds the memory of predict, whatever the number of queries.
    prediction_batch: ClassVar[int] = 50

    @abstractmethod
    def train(
        self,
        frames: FrameSource,
        labels: Any,
    ) -> Iterator[Mapping[str, float]]:
        """Start anew and yield whenever the model can predict."""

    @abstractmethod
    def scores(self, batch: Tensor) -> Tensor:
        """One score for each class, larger is better: [n, H, W] on ``device`` → [n, L]."""

    @abstractmethod
    def state_tensors(self) -> dict[str, Tensor] | None:
        """The tensors that a prediction needs, sharing memory with the model; each contiguous.

        None where a model of another library keeps its state in objects of its own.
        """

    def fit(self, frames: Any, labels: Any) -> Self:
        """Learn from frames (array, tensor, list of either, or a :class:`FrameSource`) and labels
        (array, tensor or list of integers or text); raises as :meth:`start` does."""
        for _ in self.train(inputs.indexable(frames), labels):
            pass
        return self

    @property
    def scale_(self) -> float | None:
        """Size of the terms whose rounded sums are the scores; None where scores are exact, or
        where the size follows from the frames alone."""
        return None

    def predict(self, frames: Any) -> np.ndarray:
        """Labels [Q] of frames [Q, H, W], of the kind trained with; among equal scores the first.

        Raises:
            RuntimeError: before ``train``.
            ValueError: if the frames differ in size or type from the training frames.
        """
        frames = self.queries(frames)
        best = []
        with torch.inference_mode():
            for start in range(0, len(frames), self.prediction_batch):
                rows = slice(start, start + self.prediction_batch)
                scores = self.scores(self.read(frames, rows))
                best.append(first_of_the_best(scores, self.scale_).cpu())
        if not best:
            return self.classes_[:0]
        return self.classes_[torch.cat(best).numpy()]

    def queries(self, frames: Any) -> FrameSource:
        """Frames to classify, as an object that is indexed; raises as :meth:`predict` does."""
        if not hasattr(self, "classes_"):
            raise RuntimeError(
                f"{type(self).__name__}: predict needs train or fit first"
            )
        frames = inputs.indexable(frames, self.shape_)
        inputs.check_shape(frames.shape[1:], self.shape_)
        return frames

    def start(self, frames: FrameSource, labels: Any) -> Tensor:
        """Check the training set, remember its classes and frame size; class indices int64 [N].

        Raises:
            ValueError: naming what was expected and what was found.
        """
        shape = tuple(frames.shape)
        if len(shape) not in (2, 3) or min(shape) < 1:
            raise ValueError(
                f"frames: expected shape [N, H, W] or [N, D], found {list(shape)}"
            )
        labels = inputs.label_array(labels, len(frames))
        classes, indices = np.unique(labels, return_inverse=True)
        if len(classes) == 1:
            found = classes.tolist()[0]
            raise ValueError(
                f"labels: expected at least two classes, found one class, {found!r}"
            )
        self.classes_ = classes
        height = 1 if len(shape) == 2 else int(shape[1])
        self.shape_: tuple[int, int] = (height, int(shape[-1]))
        self.frame_dtype_ = inputs.tensor(frames[0:1]).dtype
        if self.frame_dtype_ not in FRAME_TYPES:
            raise ValueError(
                f"frames: expected uint8 or uint16, found {self.frame_dtype_}"
            )
        return torch.from_numpy(indices.astype(np.int64)).to(self.device)

    def read(self, frames: FrameSource, index: slice | Tensor) -> Tensor:
        """The frames at ``index`` as [n, H, W] on ``device``: uint8, or int32 for 16-bit frames."""
        return arithmetic(self.take(frames, index))

    def take(self, frames: FrameSource, index: slice | Tensor) -> Tensor:
        """:meth:`read` in the type of the training frames."""
        batch = inputs.tensor(frames[index])
        if batch.dtype != self.frame_dtype_:
            raise ValueError(
                f"frames: expected {self.frame_dtype_} as in training, found {batch.dtype}"
            )
        return batch.to(self.device).reshape(-1, *self.shape_)


def arithmetic(batch: Tensor) -> Tensor:
    """16-bit frames as int32, because torch has hardly any arithmetic on uint16."""
    return batch if batch.dtype == torch.uint8 else batch.to(torch.int32)


def first_of_the_best(scores: Tensor, scale: float | None) -> Tensor:
    """The first class among those with the largest score: [n, L] → int64 [n].

    Sums in float32 are rounded, and differently in batches of another size. With a `scale`, the
    size of the terms, scores that differ from the largest by no more than rounding count as equal,
    so that the first class wins a tie however it is computed. None is for exact scores.
    """
    best = scores.argmax(dim=1)
    if scale is None:
        return best
    largest = scores.gather(1, best[:, None])
    equal = scores >= largest - ROUNDING * scale
    first = equal.int().argmax(dim=1)
    return torch.where(largest[:, 0].isfinite(), first, best)


def in_memory_order(tensor: Tensor) -> Tensor:
    """A view of the same memory with the dimensions in the order of their strides. It is contiguous
    for any layout, such as channels last, so that ``view(-1)`` needs no copy."""
    strides = tensor.stride()
    order = sorted(
        range(tensor.ndim),
        key=lambda k: strides[k],
        reverse=True,
    )
    return tensor.permute(order)
