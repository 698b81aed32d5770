"""What all competitors share: hyperparameters as fields, checked input, prediction in batches."""

from __future__ import annotations

import dataclasses
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


@dataclass(kw_only=True, eq=False)
class Classifier(ABC):
    """A classifier of frames with scikit-learn's conventions.

    A subclass is a dataclass whose fields are its hyperparameters; it writes ``train``, ``scores``
    and ``state_tensors``. ``train`` begins with ``start``, which checks the input, and gets its
    frames by ``read``.

    Attributes:
        classes_: [L], the labels present in training, sorted.
        shape_: (H, W) of the training frames; (1, D) where they were given as [N, D].
        frame_dtype_: ``torch.uint8`` or ``torch.uint16``.
    """

    device: str = "cpu"

    # Frames scored at a time: bounds the memory of predict, whatever the number of queries.
    prediction_batch: ClassVar[int] = 50
    _estimator_type: ClassVar[str] = "classifier"  # what scikit-learn before 1.6 asks for

    @abstractmethod
    def train(self, frames: FrameSource, labels: Any) -> Iterator[Mapping[str, float]]:
        """Start anew and yield whenever the model can predict."""

    @abstractmethod
    def scores(self, batch: Tensor) -> Tensor:
        """One score for each class, larger is better: [n, H, W] on ``device`` → [n, L]."""

    @abstractmethod
    def state_tensors(self) -> dict[str, Tensor] | None:
        """The tensors that a prediction needs, sharing memory with the model; each contiguous.

        None where that is not known, because a model of another library keeps its state in objects
        of its own: then the model has no size, and no bit can be flipped in it.
        """

    @property
    def white(self) -> int:
        """The largest grey value of the training frames' type."""
        return FRAME_TYPES[self.frame_dtype_]

    def fit(self, frames: Any, labels: Any) -> Self:
        """Learn from frames (array, tensor, list of either, or a :class:`FrameSource`) and labels
        (array, tensor or list of integers or text); raises as :meth:`start` does."""
        for _ in self.train(inputs.indexable(frames), labels):
            pass
        return self

    def predict(self, frames: Any) -> np.ndarray:
        """Labels [Q] of frames [Q, H, W], of the kind trained with; among equal scores the first.

        Raises:
            RuntimeError: before ``train``.
            ValueError: if the frames differ in size or type from those of the training.
        """
        frames = inputs.indexable(frames)
        self.check_queries(frames)
        best = []
        with torch.inference_mode():
            for start in range(0, len(frames), self.prediction_batch):
                batch = self.read(frames, slice(start, start + self.prediction_batch))
                best.append(self.scores(batch).argmax(dim=1).cpu())
        return self.classes_[torch.cat(best).numpy()] if best else self.classes_[:0]

    def score(self, frames: Any, labels: Any) -> float:
        """Fraction of frames whose predicted label is right."""
        frames = inputs.indexable(frames)
        return float(np.mean(self.predict(frames) == inputs.label_array(labels, len(frames))))

    def start(self, frames: FrameSource, labels: Any) -> Tensor:
        """Check the training set, remember its classes and frame size; class indices int64 [N].

        Raises:
            ValueError: naming what was expected and what was found.
        """
        shape = tuple(frames.shape)
        if len(shape) not in (2, 3) or min(shape[1:]) < 1:
            raise ValueError(f"frames: expected shape [N, H, W] or [N, D], found {list(shape)}")
        if len(frames) == 0:
            raise ValueError("frames: expected at least one, found none")
        classes, indices = np.unique(inputs.label_array(labels, len(frames)), return_inverse=True)
        if len(classes) < 2:
            raise ValueError(
                f"labels: expected at least two classes, found only {classes.tolist()[0]!r}"
            )
        self.classes_ = classes
        self.shape_: tuple[int, int] = (1 if len(shape) == 2 else int(shape[1]), int(shape[-1]))
        self.frame_dtype_ = _pixel_type(inputs.tensor(frames[0:1]))
        return torch.from_numpy(indices.astype(np.int64)).to(self.device)

    def check_queries(self, frames: FrameSource) -> None:
        """Raise unless the model is trained and the frames have the size it was trained on."""
        if not hasattr(self, "classes_"):
            raise RuntimeError(f"{type(self).__name__}: predict needs train or fit first")
        shape = tuple(frames.shape)
        if shape[1:] == self.shape_ or (len(shape) == 2 and (1, *shape[1:]) == self.shape_):
            return
        size = ", ".join(map(str, self.shape_[self.shape_[0] == 1 :]))
        hint = "; one frame is frame[None]" if shape in (self.shape_, self.shape_[1:]) else ""
        raise ValueError(
            f"frames: expected shape [Q, {size}] as in training, found {list(shape)}{hint}"
        )

    def read(self, frames: FrameSource, index: slice | Tensor) -> Tensor:
        """The frames at ``index`` as [n, H, W] on ``device``: uint8, or int32 for 16-bit frames."""
        batch = inputs.tensor(frames[index])
        if _pixel_type(batch) != self.frame_dtype_:
            raise ValueError(
                f"frames: expected {self.frame_dtype_} as in training, found {batch.dtype}"
            )
        batch = batch.to(self.device)
        if batch.ndim == 2:
            batch = batch[:, None]
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
                f"{type(self).__name__}: expected some of {sorted(self.get_params())}, "
                f"found {sorted(unknown)}"
            )
        for name, value in params.items():
            setattr(self, name, value)
        return self

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import ClassifierTags, InputTags, Tags, TargetTags

        return Tags(
            estimator_type="classifier",
            target_tags=TargetTags(required=True),
            classifier_tags=ClassifierTags(),
            input_tags=InputTags(two_d_array=True, three_d_array=True),
        )


def choose(name: str, value: str, options: Mapping[str, Any]) -> Any:
    """``options[value]``, or an error that lists the valid ones."""
    if value not in options:
        raise ValueError(f"{name}: expected one of {', '.join(options)}, found {value!r}")
    return options[value]


def in_memory_order(tensor: Tensor) -> Tensor:
    """The same memory with its dimensions in the order they lie there, which is contiguous for any
    layout such as channels last: so that ``view(-1)`` needs no copy."""
    return tensor.permute(sorted(range(tensor.ndim), key=lambda k: -tensor.stride()[k]))


def _pixel_type(batch: Tensor) -> torch.dtype:
    if batch.dtype in FRAME_TYPES:
        return batch.dtype
    raise ValueError(f"frames: expected uint8 or uint16, found {batch.dtype}")
