"""The associative memory of a classifier: classes, their counters, and what is made of them.

Prototypes, norms and calibration are made when asked for, of the classes that have changed.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from math import inf, prod
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import bits, inputs, rejection
from hdc.cosine import Cosine
from hdc.encode import encode
from hdc.prototypes import Counters
from hdc.rejection import Calibration, Sample

PROTOTYPES = ("binary", "integer")


class _Made:
    """What was made of counters, beside the model: asking a model changes no attribute of it."""

    def __init__(self) -> None:
        self.prototypes: Tensor | None = None
        self.outdated: set[int] = set()  # rows of the prototypes
        self.lent = False  # others hold these tensors, and may have written to them
        self.cosine: Cosine | None = None
        self.calibration: Calibration | None = None


class AssociativeMemory:
    """Counters by label, and distances to their majority.

    Attributes:
        classes_, counts_, prototypes_, counters_, dimension_, n_features_in_, frame_shape_: as of
            :class:`hdc.HDCClassifier`; there from the first frame on.
    """

    ties: str
    prototype: str
    seed: int
    device: str
    backend: str
    backend_: str
    classes_: np.ndarray
    counts_: np.ndarray
    counters_: Counters
    frame_shape_: tuple[int, ...]
    _index: dict[Hashable, int]  # label → row
    _made: _Made
    _sample: Sample | None  # None where the frames that were counted are not known
    _recalibrated: bool

    @property
    def prototypes_(self) -> Tensor:
        if not hasattr(self, "counters_"):
            raise AttributeError("prototypes_: expected a trained model; call fit first")
        prototypes, self._made.lent = self._majority(), True
        return prototypes

    @prototypes_.setter
    def prototypes_(self, prototypes: Tensor) -> None:
        self._made = _Made()
        self._made.prototypes, self._made.lent = prototypes, True

    def _check_parameters(self) -> None:
        for name, value, valid in (
            ("ties", self.ties, bits.TIES),
            ("prototype", self.prototype, PROTOTYPES),
        ):
            if value not in valid:
                raise ValueError(f"{name}: expected one of {', '.join(valid)}, found {value!r}")
        bits.choose_backend(self.backend, self.device, 0)

    def _backend(self, frames: Any) -> str:
        """The backend for these frames; with "auto", what training began with."""
        n_pixels: float = prod(frames.shape)
        if self.backend == "auto" and hasattr(self, "backend_"):
            if self.backend_ == "numpy":
                return "numpy"
            n_pixels = inf  # the same again, unless this is a machine without numba
        return bits.choose_backend(self.backend, self.device, n_pixels)

    # Learning ------------------------------------------------------------------------------------

    def _start(
        self, shape: Sequence[int], counters: Counters | None = None, expected: int = 0
    ) -> None:
        """Begin with no classes, or with counters whose classes `_arrange` is told next."""
        self.frame_shape_ = tuple(shape)
        self.dimension_ = self.n_features_in_ = prod(self.frame_shape_)
        self.counters_ = counters or Counters(0, self.dimension_, self.device)
        self._index, self.classes_ = {}, np.empty(0, object)
        self._made, self._sample, self._recalibrated = _Made(), Sample(expected), False

    def _forget(self) -> None:
        """Drop whatever was learned."""
        private = [name for name in AssociativeMemory.__annotations__ if name.startswith("_")]
        for name in [name for name in vars(self) if name.endswith("_") or name in private]:
            delattr(self, name)

    def _count(self, frames: Any, labels: np.ndarray, first: int) -> None:
        """Encode one chunk of frames and add it to the counters."""
        frames = inputs.tensor(frames)
        if len(frames) == 0:
            return
        words = self._encode(frames, first, self.backend_)
        if not hasattr(self, "counters_"):
            self._start(frames.shape[1:])
        self._add(words, labels)

    def _add(self, words: Tensor, labels: np.ndarray) -> None:
        items = inputs.values(labels)
        self._know(items)
        self.counters_.backend = self.backend_
        rows = [self._index[label] for label in items]
        self._learn(words, torch.tensor(rows), items)
        self._changed(rows)

    def _learn(self, words: Tensor, rows: Tensor, labels: Sequence[Hashable]) -> None:
        self.counters_.add(words, rows)
        if self._sample is not None:
            self._sample.add(words, labels)

    def _know(self, labels: Iterable[Hashable]) -> None:
        """Make room for the labels that are new."""
        new = [label for label in dict.fromkeys(labels) if label not in self._index]
        if new:
            known = [*self._index, *new]
            self.counters_.append_classes(len(new))
            self._arrange(known, inputs.values(inputs.classes_of(inputs.object_array(known))))
            if (prototypes := self._made.prototypes) is not None:
                room = prototypes.new_zeros(len(new), prototypes.shape[1])
                self._made.prototypes = torch.cat((prototypes, room))
            self._changed([self._index[label] for label in new])

    def _arrange(self, known: list[Hashable], ordered: list[Hashable]) -> None:
        """Put the rows of the counters, of the classes `known`, in the order of classes."""
        if ordered != known:
            places = {label: i for i, label in enumerate(known)}
            self.counters_.reorder([places[label] for label in ordered])
            self._made.prototypes = None
        self._index = {label: i for i, label in enumerate(ordered)}
        self.classes_ = inputs.label_array(ordered, len(ordered))

    def _changed(self, rows: Iterable[int]) -> None:
        """Counts of these classes are others than before."""
        self.counts_ = self.counters_.n.numpy().copy()
        self._made.outdated.update(rows)
        self._made.cosine = None
        # That of a file stays, as its frames are not at hand, until there are other classes.
        known = self._made.calibration and len(self._made.calibration.means) == len(self._index)
        if self._sample is not None or not known:
            self._made.calibration = None

    # Prototypes and distances --------------------------------------------------------------------

    def _majority(self) -> Tensor:
        """The prototypes [L, W] as they are now; to be read only."""
        made = self._made
        if made.prototypes is None or (made.outdated and made.lent):
            made.prototypes, made.lent = self._prototypes_of(self.counters_), False
        else:
            for c in made.outdated:
                if self.counters_.n[c]:
                    made.prototypes[c] = self.counters_.prototype(c, self.ties, self.seed)
        made.outdated = set()
        return made.prototypes

    def _prototypes_of(self, counters: Counters) -> Tensor:
        prototypes = torch.zeros_like(counters.planes[:, 0])
        for c in counters.n.nonzero().flatten().tolist():
            prototypes[c] = counters.prototype(c, self.ties, self.seed)
        return prototypes

    def _encode(self, frames: Any, first: int, backend: str, out: Tensor | None = None) -> Tensor:
        tensor = inputs.tensor(frames).to(self.device)
        if hasattr(self, "frame_shape_") and len(tensor):
            inputs.check_shape(tensor.shape[1:], self.frame_shape_, type(self).__name__)
        return encode(tensor, first, backend, out)

    def _empty(self) -> Tensor | None:
        """Which classes have no samples: bool [L], or None where all have."""
        empty = self.counters_.n == 0
        return empty if empty.any() else None

    def _hamming(self, words: Tensor) -> Tensor:
        distances = bits.hamming(words, self._majority())
        if (empty := self._empty()) is not None:
            distances[:, empty] = self.dimension_ + 1
        return distances

    def _scores_of(self, words: Tensor) -> Tensor:
        """Dissimilarity [Q, L], smaller is nearer."""
        if self.prototype == "binary":
            return self._hamming(words)
        scores = self._norms().scores(words)
        if (empty := self._empty()) is not None:
            scores[:, empty] = torch.inf
        return scores

    def _norms(self) -> Cosine:
        if self._made.cosine is None or self._made.lent:
            self._made.cosine = Cosine.of(self.counters_)
        return self._made.cosine

    # Calibration ---------------------------------------------------------------------------------

    def _neighbours(self, counters: Counters, c: int, weight: int = 1) -> Any:
        """See :data:`hdc.rejection.Neighbours`, for frames that were counted `weight` times."""
        if int(counters.n[c]) <= weight:
            return None
        return tuple(counters.prototype(c, self.ties, self.seed, w) for w in (weight, -weight))

    def _calibrated_by(
        self,
        frames: Counters,
        sample: Sample | None,
        neighbours: Callable[[int], Any],
        weights: Sequence[int],
    ) -> Calibration | None:
        """Calibration by frames that were counted weights[c] times; see :mod:`hdc.rejection`."""
        if sample is None or not sample.labels:
            return None
        words = sample.words()
        own = torch.tensor([self._index[label] for label in sample.labels], device=words.device)
        scores = self._scores_of(words).numpy(force=True).astype(np.float64)
        held_out = None
        if self.prototype == "integer":
            of_own = torch.tensor(weights)[own.cpu()]
            held_out = self._norms().held_out(words, own, of_own).numpy(force=True)
        return rejection.calibration(frames, words, own, neighbours, scores, held_out)

    def _try_calibration(self) -> Calibration | None:
        """The calibration as it is now; None where there is nothing to make it from."""
        if self._made.calibration is None:
            self._made.calibration = self._calibrated_by(
                self.counters_,
                self._sample,
                lambda c: self._neighbours(self.counters_, c),
                [1] * len(self._index),
            )
        return self._made.calibration
