"""Shared by both estimators: how frames become hypervectors, and scikit-learn's conventions.

scikit-learn is not imported: it takes as long as torch, and 100 MB.
"""

from __future__ import annotations

import sys
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from math import prod
from typing import Any, ClassVar, Self

import numpy as np
import torch

from hdc import backends, bits, inputs
from hdc.described import describe
from hdc.encoders import ENCODERS, Encoder
from hdc.hypervectors import Hypervectors
from hdc.parameters import Named, Parametrised

CHUNK = 256  # frames encoded at a time: 8 MB of packed bits at D = 250,000


class Estimator(Parametrised):
    """Parameters by name, tags, chunks of frames, and how an untrained model is refused."""

    _estimator_type: str
    _known: ClassVar[Mapping[str, Named]]
    """Our own classes of each part."""
    encoder: Any
    readout: Any
    device: str
    backend: str
    encoder_: Encoder
    backend_: str
    """``"numpy"`` or ``"compiled"``, as was decided at fit or load."""
    frame_shape_: tuple[int, ...]
    n_features_in_: int
    dimension_: int
    _columns: list[str | int] | None = None
    """Columns of the data frame that the model learned from."""
    _used: dict[str, Any]
    """The parameters of the training."""

    # Encoding ------------------------------------------------------------------------------------

    def encode(self, frames: Any) -> Hypervectors:
        """Hypervectors of frames, which every method takes in place of them.

        A frame that is asked for its label, its set and its probabilities is then encoded once.

        Raises:
            ValueError: for a model that is not trained, frames of another shape, pixels that are
                not finite, or hypervectors of another encoder.
        """
        self._check_is_trained()
        with self._computing():
            return joined(self._encoded(frames))

    def _encoded(self, frames: Any) -> Iterator[Hypervectors]:
        """Hypervectors of frames by the trained encoder, a chunk at a time."""
        if not isinstance(frames, Hypervectors):
            self._check_columns(inputs.columns_of(frames))
            frames = inputs.indexable(frames, self.frame_shape_)
        elif frames.encoder is not self.encoder_:
            self._check_words(frames)
        return self._batches(frames, self.encoder_, self.frame_shape_)

    def _batches(
        self, frames: Any, encoder: Encoder, shape: tuple[int, ...]
    ) -> Iterator[Hypervectors]:
        """Hypervectors of frames with a shape, a chunk at a time; hypervectors as they are."""
        if isinstance(frames, Hypervectors):
            yield frames
            return
        dimension = encoder.dimension(prod(shape))
        for start in range(0, max(1, len(frames)), CHUNK):
            part = inputs.tensor(frames[start : start + CHUNK]).to(self.device)
            if len(part):
                inputs.check_shape(part.shape[1:], shape, type(self).__name__)
            given = (part, start) if encoder.numbered else (part,)
            yield Hypervectors(encoder.encode(*given), dimension, encoder, shape)

    def _check_words(self, words: Hypervectors) -> None:
        """Raise ValueError for hypervectors that the encoder of this model does not make."""
        bits.check_width(words.packed, words.dimension)
        if words.dimension != self.dimension_:
            raise ValueError(
                f"hypervectors: expected D = {self.dimension_}, found {words.dimension}"
            )
        if words.encoder is not None:
            check_alike(self.encoder_, words.encoder, "hypervectors")

    def _learned_encoder(
        self, encoder: Encoder, frames: Any
    ) -> tuple[Encoder, tuple[int, ...]]:
        """An untrained encoder, or that of hypervectors, which has learned; shape of a frame."""
        if not isinstance(frames, Hypervectors):
            if encoder.learns:
                encoder.fit(frames)
            return encoder, tuple(frames.shape[1:])
        bits.check_width(frames.packed, frames.dimension)
        given = frames.encoder
        if given is None:
            raise ValueError("hypervectors: expected those of encode, found bits alone")
        if describe(encoder, self._known["encoder"]) != _described(given):
            raise ValueError(
                f"hypervectors: expected those of {encoder!r}, found those of {given!r}"
            )
        return given, frames.frame_shape

    def _computing(self) -> AbstractContextManager[None]:
        """By the backend that was decided for."""
        return backends.computing(self.backend_)

    # Training ------------------------------------------------------------------------------------

    def _given(self, frames: Any) -> tuple[Any, list[str | int] | None]:
        """:func:`hdc.inputs.source`, of frames like those of training where there was one."""
        found = inputs.source(frames, getattr(self, "frame_shape_", None))
        self._check_columns(found[1])
        return found

    def _decided(self, frames: Any) -> str:
        """The backend to fit frames with."""
        n_pixels = 0 if isinstance(frames, Hypervectors) else prod(frames.shape)
        return backends.choose_backend(self.backend, self.device, n_pixels)

    def _begin(self, encoder: Encoder, shape: Sequence[int], backend: str) -> None:
        """Encode so from now on; the parameters of now are those of training."""
        for name in [name for name in vars(self) if name.endswith("_")]:
            delattr(self, name)
        self.encoder_ = encoder
        self.backend_ = backend
        self.frame_shape_ = tuple(shape)
        self.n_features_in_ = prod(shape)
        self.dimension_ = encoder.dimension(self.n_features_in_)
        self._used = self.get_params(deep=False)

    def _check_parameters(self) -> None:
        for name in self.parts:
            self._part(name).check()
        backends.check_device(self.device)

    def _part(self, name: str) -> Any:
        """The part that a parameter gives by its name, or as an object."""
        given = getattr(self, name)
        return self.parts[name](given)

    def _check_is_trained(self) -> None:
        """Raise for a model that has learned nothing, or whose parameters were set since."""
        if not hasattr(self, "dimension_"):
            # scikit-learn's kind of error where it is loaded
            module = sys.modules.get("sklearn.exceptions")
            kind = getattr(module, "NotFittedError", ValueError)
            raise kind(
                f"{type(self).__name__}: expected a trained model; call fit first"
            )
        for name, used in self._used.items():
            now = getattr(self, name)
            if now is used or (isinstance(now, str | float) and now == used):
                continue
            if name == "backend":
                self.backend_ = backends.choose_backend(self.backend, self.device)
                self._used[name] = now
                continue
            advice = "; to(device) moves it" if name == "device" else ""
            raise ValueError(f"{name}: changed after training; call fit again{advice}")

    @property
    def feature_names_in_(self) -> np.ndarray:
        """Names of the columns of training, object [D], where all are text."""
        names = self._columns or [0]
        if not all(isinstance(name, str) for name in names):
            raise AttributeError(
                f"{type(self).__name__}: expected training on a data frame with names, found none"
            )
        return np.array(names, dtype=object)

    def _check_columns(self, columns: list[str | int] | None) -> None:
        """Raise ValueError for other columns than those of training, in their order."""
        if None not in (columns, self._columns) and columns != self._columns:
            raise ValueError(
                "frames: expected the columns of training in its order, found others"
            )

    # Devices and pickles -------------------------------------------------------------------------

    def to(self, device: str) -> Self:
        """Move what was learned to the memory of a device, and encode there from now on.

        Raises:
            ValueError: for a device that this machine has not.
        """
        self._check_is_trained()
        backend = backends.choose_backend(self.backend, device)
        encoder = self.encoder_.unlearned()
        state = {name: x.to(device) for name, x in self.encoder_.state().items()}
        encoder.restore(state, self.n_features_in_)
        self._move(device)
        self.encoder_, self.backend_ = encoder, backend
        self.device = self._used["device"] = device
        return self

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """From a pickle, as from a file: the backend is decided for on the machine that reads."""
        vars(self).update(state)
        if hasattr(self, "backend_"):
            self.backend_ = backends.choose_backend(self.backend, self.device)

    @abstractmethod
    def _move(self, device: str) -> None:
        """Move what the read-out has learned to the memory of a device."""

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import (
            ClassifierTags,
            InputTags,
            RegressorTags,
            Tags,
            TargetTags,
        )

        # A median threshold leaves one bit of two features: a blob and its mirror are alike.
        classifier = self._estimator_type == "classifier"
        return Tags(
            estimator_type=self._estimator_type,
            target_tags=TargetTags(required=True, multi_output=not classifier),
            classifier_tags=ClassifierTags(poor_score=True) if classifier else None,
            regressor_tags=None if classifier else RegressorTags(poor_score=True),
            input_tags=InputTags(two_d_array=True, three_d_array=True),
        )


def joined(parts: Iterable[Hypervectors]) -> Hypervectors:
    """Hypervectors of one encoder, one after another; at least one part."""
    first, *others = parts
    if not others:
        return first
    packed = torch.cat([first.packed, *(part.packed for part in others)])
    return replace(first, packed=packed)


def check_alike(
    mine: Encoder, theirs: Encoder, what: str, learned: bool = True
) -> None:
    """Raise ValueError for encoders of other parameters, or that have learned other things."""
    if _described(mine) != _described(theirs):
        raise ValueError(f"{what}: expected the encoder {mine!r}, found {theirs!r}")
    if not learned:
        return
    other = theirs.state()
    for name, tensor in mine.state().items():
        if not torch.equal(tensor, other[name]):
            raise ValueError(
                f"{what}: expected two encoders {mine!r} that have learned the same, found two "
                "that have learned of different frames; fit anew on all of them"
            )


def _described(encoder: Encoder) -> dict[str, Any]:
    return describe(encoder, ENCODERS)
