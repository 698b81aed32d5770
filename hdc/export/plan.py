"""Exported parts of a model: its tables and numbers, or why it cannot be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from torch import Tensor

from hdc import bits
from hdc.classifier import HDCClassifier
from hdc.encoders import Deviation, Levels, Median, Quantile
from hdc.encoders.ranks import RankEncoder
from hdc.export.sizes import Sizes
from hdc.readers import Window
from hdc.readouts import LDA, Majority, Trained

ENCODERS = (Median, Quantile, Levels, Deviation)
READOUTS = (Majority, Trained, LDA)
PLANES = 4
"""Hypervectors that hold the weights of a class of LDA."""
_WEIGHT_OFFSET = 8  # the weights of a state of LDA are q + 8
_MOST_LIGHT = 2**37  # pixels times grey values: sums that 64 bits hold 65536 times


@dataclass(frozen=True)
class Plan:
    """Contents of a header; :meth:`of` a model.

    Attributes:
        name: beginning of all names in the header.
        encoder, readout, state: the parts of the model, and what the read-out has learned.
        classes: names of the L classes that have training frames, in the order of the model.
        rows: their rows in the model.
        empty: names of the others, which no frame can be of.
        frame_shape: (H, W) or (D,) of the frames.
        window: how training frames were cut out of images.
        tables: by name, uint64 [L, W] (weights [L, 4, W], lit [W]) of hypervectors, int64 [L] or
            [T] of numbers.
        alpha: share of frames of known classes that may be refused; None without rejection.
        farthest: the largest distance at which a frame is known.
        left_out: what was left out to find it, of :data:`hdc.rejection.UNITS`.
        sizes: what it takes.
    """

    name: str
    encoder: RankEncoder | Deviation
    readout: Majority | Trained | LDA
    state: Any
    classes: tuple[str, ...]
    rows: tuple[int, ...]
    empty: tuple[str, ...]
    frame_shape: tuple[int, ...]
    window: Window
    tables: dict[str, np.ndarray]
    alpha: float | None
    farthest: int
    left_out: str
    sizes: Sizes

    @property
    def is_cut(self) -> bool:
        """Whether frames are cut out of images by a function of the header."""
        cut = self.window.crop is not None or self.window.subsample > 1
        return cut and len(self.frame_shape) == 2

    @classmethod
    def of(
        cls,
        model: Any,
        name: str,
        pixel_bits: int = 8,
        alpha: float | None = None,
        window: Window | None = None,
    ) -> Self:
        """The plan of a trained model.

        Args:
            model: an :class:`hdc.HDCClassifier`.
            name: beginning of all names in the header, an identifier of C.
            pixel_bits: of the frames, 8 or 16.
            alpha: share of frames of known classes that may be refused, in (0, 1); None exports
                no rejection.
            window: how training frames were cut out of images.

        Raises:
            ValueError: for a model, an encoder or a read-out that is not exported.
        """
        _check_exportable(model)
        encoder, readout = model.encoder_, model.readout_
        known = model.counts_ > 0
        rows = np.flatnonzero(known).tolist()
        names = np.array([str(label) for label in model.classes_.tolist()])
        farthest, unit = 0, ""
        relative = isinstance(encoder, Deviation)
        if relative:
            _check_size(model.n_features_in_, pixel_bits)
        tables = _encoding(encoder, model.n_features_in_)
        tables |= _classes(readout, model.state_, rows, model.dimension_)
        if alpha is not None:
            rejection = model._head.rejection
            farthest, unit = rejection.threshold(alpha), rejection.unit
            tables |= _majorities(model, rows, rejection.prototypes)
        sizes = Sizes(
            pixels=model.n_features_in_,
            ranked=_ranked(encoder, model.n_features_in_),
            pixel_bits=pixel_bits,
            thresholds=_thresholds(encoder),
            classes=len(rows),
            planes=PLANES if "weights" in tables else 1,
            extra=int("majority" in tables),
            relative=relative,
        )
        return cls(
            name=name,
            encoder=encoder,
            readout=readout,
            state=model.state_,
            classes=tuple(names[known].tolist()),
            rows=tuple(rows),
            empty=tuple(names[~known].tolist()),
            frame_shape=tuple(model.frame_shape_),
            window=window or Window(),
            tables=tables,
            alpha=alpha,
            farthest=farthest,
            left_out=unit,
            sizes=sizes,
        )


def exports(encoder: object, readout: object) -> bool:
    """Whether a model of these parts can be written as a header."""
    return type(encoder) in ENCODERS and type(readout) in READOUTS


def _check_exportable(model: Any) -> None:
    if not isinstance(model, HDCClassifier):
        raise ValueError(
            f"export: expected a classifier, found {type(model).__name__}, whose values need "
            "floating point"
        )
    model._check_is_trained()
    if type(model.encoder_) not in ENCODERS:
        raise ValueError(
            "export: expected the encoder median, quantile, levels or deviation, found "
            f"{model.encoder_!r}"
        )
    if type(model.readout_) not in READOUTS:
        raise ValueError(
            "export: expected the read-out majority, trained or lda, found "
            f"{model.readout_!r}"
        )


def _check_size(n_pixels: int, pixel_bits: int) -> None:
    """Refuse frames of which sums do not fit into 64 bits, or Python rounds quotients."""
    if n_pixels << pixel_bits > _MOST_LIGHT:
        raise ValueError(
            f"export: expected at most {_MOST_LIGHT >> pixel_bits} pixels of {pixel_bits} bits "
            f"with the encoder deviation, found {n_pixels}"
        )


def _thresholds(encoder: RankEncoder | Deviation) -> int:
    if isinstance(encoder, Deviation):
        return len(encoder.thresholds)
    return len(encoder.quantiles)


def _ranked(encoder: RankEncoder | Deviation, n_pixels: int) -> int:
    return encoder.dimension(n_pixels) // _thresholds(encoder)


def _encoding(encoder: RankEncoder | Deviation, n_pixels: int) -> dict[str, np.ndarray]:
    """Tables of the encoder."""
    if isinstance(encoder, Deviation):
        thresholds = encoder.fractions()
        return {
            "reference": encoder.reference_.long().numpy(force=True),
            "numerators": np.array([t.numerator for t in thresholds]),
            "denominators": np.array([t.denominator for t in thresholds]),
        }
    ranked = _ranked(encoder, n_pixels)
    tables = {"ones": np.array(encoder.ones(ranked), np.int64)}
    if isinstance(encoder, Levels) and ranked < n_pixels:
        tables["lit"] = _unsigned(bits.pack(encoder.lit_.cpu()))
    return tables


def _classes(
    readout: Majority | Trained | LDA, state: Any, rows: list[int], dimension: int
) -> dict[str, np.ndarray]:
    """Tables of the read-out."""
    if isinstance(readout, LDA):
        return _weights(state, rows, dimension)
    return {"prototypes": _unsigned(state.prototypes[rows])}


def _unsigned(words: Tensor) -> np.ndarray:
    return words.numpy(force=True).view(np.uint64)


def _weights(state: Any, rows: list[int], dimension: int) -> dict[str, np.ndarray]:
    """Weights, and the scales and biases of the sum Σ (q + 8)·v − 8·|v| over the bits v.

    With bits of ±1, q·x = 2·(Σ (q + 8)·v − 8·|v|) − Σ (q + 8) + 8·D.
    """
    weights = state.weights[rows]
    ones = bits.count_ones(weights).tolist()
    scales = state.scales[rows].tolist()
    offsets = state.offsets[rows].tolist()
    biases = []
    for of_planes, scale, offset in zip(ones, scales, offsets, strict=True):
        total = sum(n << plane for plane, n in enumerate(of_planes))
        biases.append(offset + scale * (_WEIGHT_OFFSET * dimension - total))
    return {
        "weights": _unsigned(weights),
        "scales": np.array(scales, np.int64),
        "biases": np.array(biases, np.int64),
    }


def _majorities(
    model: HDCClassifier, rows: list[int], prototypes: Tensor
) -> dict[str, np.ndarray]:
    """The prototypes of rejection where the scores are of others: lda, trained, thinned ones."""
    counts = isinstance(model.readout_, Majority)
    if counts and prototypes.equal(model.prototypes_[rows]):
        return {}
    return {"majority": _unsigned(prototypes)}
