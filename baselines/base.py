"""What all competitors share: hyperparameters as fields, checked input, prediction in batches."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

import numpy as np
import torch
from torch import Tensor


class FrameSource(Protocol):
    """Frames uint8 or uint16 [N, H, W], indexable by a slice or an index tensor."""

    @property
    def shape(self) -> Any: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: Any) -> Tensor: ...


@dataclass(kw_only=True, eq=False)
class Classifier(ABC):
    """A classifier of frames with scikit-learn's conventions.

    A subclass is a dataclass whose fields are its hyperparameters; it writes ``train``, ``scores``
    and ``state_tensors``. ``train`` begins with ``start``, which checks the input and sets

    Attributes:
        classes_: int64 [L], the labels present in training, ascending.
        shape_: (H, W) of the training frames.
        frame_dtype_: ``torch.uint8`` or ``torch.uint16``.
    """

    device: str = "cpu"

    # Frames scored at a time: bounds the memory of predict, whatever the number of queries.
    prediction_batch: ClassVar[int] = 50

    @abstractmethod
    def train(self, frames: FrameSource, labels: np.ndarray) -> Iterator[Mapping[str, float]]:
        """Start anew and yield whenever the model can predict."""

    @abstractmethod
    def scores(self, batch: Tensor) -> Tensor:
        """One score for each class, larger is better: [n, H, W] on ``device`` → [n, L]."""

    @abstractmethod
    def state_tensors(self) -> dict[str, Tensor]:
        """What has to be stored to predict, sharing memory with the model; each contiguous."""

    def fit(self, frames: FrameSource, labels: np.ndarray) -> Self:
        """Run ``train`` to its end."""
        for _ in self.train(frames, labels):
            pass
        return self

    def predict(self, frames: FrameSource) -> np.ndarray:
        """Labels int64 [Q] of frames [Q, H, W]; among equal scores the lowest label.

        Raises:
            RuntimeError: before ``train``.
            ValueError: if the frames differ in size or type from those of the training.
        """
        self.check_queries(frames)
        best = []
        with torch.inference_mode():
            for start in range(0, len(frames), self.prediction_batch):
                batch = self.load(frames, slice(start, start + self.prediction_batch))
                best.append(self.scores(batch).argmax(dim=1).cpu())
        return self.classes_[torch.cat(best).numpy()] if best else np.empty(0, dtype=np.int64)

    def start(self, frames: FrameSource, labels: np.ndarray) -> Tensor:
        """Check the training set, remember its classes and frame size; class indices int64 [N].

        Raises:
            ValueError: naming what was found and what was expected.
        """
        shape, labels = tuple(frames.shape), np.asarray(labels)
        if len(shape) != 3 or min(shape[1:]) < 1:
            raise ValueError(f"frames: expected shape [N, H, W], found {list(shape)}")
        if len(frames) == 0:
            raise ValueError("frames: expected at least one, found none")
        if labels.shape != (len(frames),):
            raise ValueError(
                f"labels: expected {len(frames)} (one a frame), found shape {list(labels.shape)}"
            )
        if not np.issubdtype(labels.dtype, np.integer):
            raise ValueError(f"labels: expected integers, found {labels.dtype}")
        classes, indices = np.unique(labels, return_inverse=True)
        if len(classes) < 2:
            raise ValueError(f"labels: expected at least two classes, found only {classes[0]}")
        self.classes_ = classes.astype(np.int64)
        self.shape_: tuple[int, int] = (int(shape[1]), int(shape[2]))
        self.frame_dtype_ = pixel_type(frames[0:1])
        return torch.from_numpy(indices.astype(np.int64)).to(self.device)

    def check_queries(self, frames: FrameSource) -> None:
        """Raise unless the model is trained and the frames have the size it was trained on."""
        if not hasattr(self, "classes_"):
            raise RuntimeError(f"{type(self).__name__}: predict needs train or fit first")
        if len(frames.shape) != 3 or tuple(frames.shape[1:]) != self.shape_:
            raise ValueError(
                f"frames: expected shape [Q, {self.shape_[0]}, {self.shape_[1]}] as in training, "
                f"found {list(frames.shape)}"
            )

    def load(self, frames: FrameSource, index: slice | Tensor) -> Tensor:
        """The frames at ``index`` on ``device``: uint8, or int32 for 16-bit frames."""
        batch = frames[index]
        if pixel_type(batch) != self.frame_dtype_:
            raise ValueError(
                f"frames: expected {self.frame_dtype_} as in training, found {batch.dtype}"
            )
        batch = batch.to(self.device)
        # torch has next to no arithmetic on uint16.
        return batch if batch.dtype == torch.uint8 else batch.to(torch.int32)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Hyperparameters by name, as ``sklearn.base.clone`` asks for them."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    def set_params(self, **params: Any) -> Self:
        """Set hyperparameters by name."""
        unknown = params.keys() - self.get_params().keys()
        if unknown:
            raise ValueError(
                f"{type(self).__name__}: unknown {sorted(unknown)}, "
                f"expected some of {sorted(self.get_params())}"
            )
        for name, value in params.items():
            setattr(self, name, value)
        return self


def pixel_type(batch: Tensor) -> torch.dtype:
    """The dtype of a batch of frames, which has to be that of a camera."""
    if batch.dtype in (torch.uint8, torch.uint16):
        return batch.dtype
    found = str(batch.dtype)
    if batch.is_floating_point() and not batch.isfinite().all():
        found += " with NaN or infinite pixels"
    raise ValueError(f"frames: expected uint8 or uint16, found {found}")


def in_memory_order(tensor: Tensor) -> Tensor:
    """The same memory with its dimensions in the order they lie there, which is contiguous for any
    layout such as channels last: so that ``view(-1)`` needs no copy."""
    return tensor.permute(sorted(range(tensor.ndim), key=lambda k: -tensor.stride()[k]))


def choose(name: str, value: str, options: Mapping[str, Any]) -> Any:
    """``options[value]``, or an error that lists the valid ones."""
    if value not in options:
        raise ValueError(f"{name}: expected one of {', '.join(options)}, found {value!r}")
    return options[value]
