"""Base class of both estimators: encoding of frames, and the conventions of scikit-learn.

scikit-learn itself is not imported: that takes as long as importing torch, and 100 MB.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from math import prod
from typing import Any, ClassVar

import torch

from hdc import backends, inputs
from hdc.described import describe
from hdc.encoders import ENCODERS, Encoder
from hdc.hypervectors import Hypervectors
from hdc.parameters import Named, Parametrised

CHUNK = 256  # frames encoded at a time: 8 MB of packed bits at D = 250,000


class Estimator(Parametrised):
    """An estimator with an encoder and a read-out, which encodes frames in chunks."""

    _estimator_type: str
    _known: ClassVar[Mapping[str, Named]]
    """Our own classes of each part."""
    encoder: Any
    readout: Any
    device: str
    backend: str
    encoder_: Encoder
    backend_: str
    """``"numpy"`` or ``"compiled"``, as chosen at fit or load."""
    frame_shape_: tuple[int, ...]
    n_features_in_: int
    dimension_: int
    columns_: list[str] | None = None
    """Names of the columns of a table or a data frame of training, where they are known."""

    # Encoding ------------------------------------------------------------------------------------

    def encode(self, frames: Any) -> Hypervectors:
        """Hypervectors of frames, which every method but ``rezero`` accepts instead.

        To get labels, sets and probabilities of the same frames, encode them once.

        Raises:
            ValueError: for an untrained model, frames of another shape, pixels that are not finite,
                or hypervectors of another encoder.
        """
        self._check_is_trained()
        with self._computing():
            return joined(self._encoded(frames))

    def _encoded(self, frames: Any) -> Iterator[Hypervectors]:
        """Hypervectors of frames by the trained encoder, a chunk at a time."""
        self._check_columns(frames)
        if not isinstance(frames, Hypervectors):
            frames = inputs.indexable(frames, self.frame_shape_)
        elif frames.encoder is not self.encoder_:
            self._check_words(frames)
        return self._batches(frames, self.encoder_, self.frame_shape_)

    def _batches(
        self, frames: Any, encoder: Encoder, shape: tuple[int, ...]
    ) -> Iterator[Hypervectors]:
        """Hypervectors of frames, a chunk at a time; hypervectors are passed on unchanged."""
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

    def _further(self, frames: Any) -> Any:
        """More training frames, of the same columns; see :func:`hdc.inputs.source`."""
        self._check_columns(frames)
        return inputs.source(frames, getattr(self, "frame_shape_", None))

    def _check_columns(self, frames: Any) -> None:
        """Raise ValueError for a data frame of other columns, or in another order."""
        columns = inputs.columns_of(frames)
        if None not in (columns, self.columns_) and columns != self.columns_:
            raise ValueError(
                "frames: expected the columns of training in its order, found others"
            )

    def _check_words(self, words: Hypervectors) -> None:
        """Raise ValueError for hypervectors of another encoder."""
        if words.dimension != self.dimension_:
            raise ValueError(
                f"hypervectors: expected D = {self.dimension_}, found {words.dimension}"
            )
        mine, theirs = self.encoder_, words.encoder
        if theirs is None:
            return
        if _described(mine) != _described(theirs):
            raise ValueError(
                f"hypervectors: expected the encoder {mine!r}, found {theirs!r}"
            )
        other = theirs.state()
        if any(not torch.equal(x, other[name]) for name, x in mine.state().items()):
            raise ValueError(
                f"hypervectors: expected an encoder {mine!r} that learned from the same frames, "
                "found one that learned from others; use this model's encode"
            )

    def _learned_encoder(
        self, encoder: Encoder, frames: Any
    ) -> tuple[Encoder, tuple[int, ...]]:
        """The trained encoder, or that of the given hypervectors; and the shape of a frame."""
        if not isinstance(frames, Hypervectors):
            if encoder.learns:
                encoder.fit(frames)
            return encoder, tuple(frames.shape[1:])
        given = frames.encoder
        if given is None or _described(encoder) != _described(given):
            raise ValueError(
                f"hypervectors: expected encoder {encoder!r}, found {given!r}"
            )
        return given, frames.frame_shape

    def _computing(self) -> AbstractContextManager[None]:
        """Context in which this thread computes by the chosen backend."""
        return backends.computing(self.backend_)

    # Training ------------------------------------------------------------------------------------

    def _decided(self, frames: Any) -> str:
        """The backend to fit these frames with."""
        n_pixels = 0 if isinstance(frames, Hypervectors) else prod(frames.shape)
        return backends.choose_backend(self.backend, self.device, n_pixels)

    def _begin(
        self,
        encoder: Encoder,
        shape: Sequence[int],
        dimension: int,
        backend: str,
    ) -> None:
        """Set the attributes of a new training."""
        for name in ("metadata_", "columns_"):
            vars(self).pop(name, None)
        self.encoder_ = encoder
        self.backend_ = backend
        self.frame_shape_ = tuple(shape)
        self.n_features_in_ = prod(shape)
        self.dimension_ = dimension

    def _check_is_trained(self) -> None:
        """Raise for an untrained model."""
        if not hasattr(self, "dimension_"):
            # scikit-learn's kind of error where it is loaded
            module = sys.modules.get("sklearn.exceptions")
            kind = getattr(module, "NotFittedError", ValueError)
            raise kind(
                f"{type(self).__name__}: expected a trained model; call fit first"
            )

    def __sklearn_tags__(self) -> Any:
        from sklearn import utils

        # A median threshold leaves one bit of two features: a blob and its mirror are alike.
        classifier = self._estimator_type == "classifier"
        of_classifier = utils.ClassifierTags(poor_score=True) if classifier else None
        return utils.Tags(
            estimator_type=self._estimator_type,
            target_tags=utils.TargetTags(required=True, multi_output=not classifier),
            classifier_tags=of_classifier,
            regressor_tags=None if classifier else utils.RegressorTags(poor_score=True),
            input_tags=utils.InputTags(two_d_array=True, three_d_array=True),
        )


def joined(parts: Iterable[Hypervectors]) -> Hypervectors:
    """One batch of several, at least one, by the same encoder."""
    first, *others = parts
    if not others:
        return first
    packed = torch.cat([first.packed, *(part.packed for part in others)])
    return replace(first, packed=packed)


def _described(encoder: Encoder) -> dict[str, Any]:
    return describe(encoder, ENCODERS)
