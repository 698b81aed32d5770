"""Exported parts of a model: its tables and numbers, or why it cannot be."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Any, Self

import numpy as np
from torch import Tensor

from hdc import bits
from hdc.classifier import HDCClassifier
from hdc.encoders import Deviation, Levels, Median, Quantile
from hdc.encoders.ranks import RankEncoder
from hdc.readers import Window
from hdc.readouts import LDA, Majority, Trained

ENCODERS = (Median, Quantile, Levels, Deviation)
READOUTS = (Majority, Trained, LDA)
_WEIGHT_OFFSET = 8  # the weights of a state of LDA are q + 8
_MOST_LIGHT = 2**37  # pixels times grey values: sums that 64 bits hold 65536 times
_COUNTS = 256 * 4  # bytes of a count of each value of a byte
_TURNS = 64 * 4  # bytes of a count of each turn of the order "spread"


@dataclass(frozen=True)
class Plan:
    """Contents of a header; :meth:`of` a model.

    Attributes:
        name: beginning of all names in the header.
        encoder, readout: the parts of the model.
        classes: names of the L classes.
        frame_shape: (H, W) or (D,) of the frames.
        pixel_bits: of the frames, 8 or 16.
        dimension: bits of a hypervector.
        window: how training frames were cut out of images.
        tables: by name, as wide as in the header: hypervectors uint64 [L, W] (weights [L, 4, W],
            lit [W]), and numbers [L], [T] or [D].
        alpha: share of frames of known classes that may be refused; None without rejection.
        farthest: the largest distance at which a frame is known.
        left_out: what was left out to find it: ``"frame"`` or ``"group"``.
    """

    name: str
    encoder: RankEncoder | Deviation
    readout: Majority | Trained | LDA
    classes: tuple[str, ...]
    frame_shape: tuple[int, ...]
    pixel_bits: int
    dimension: int
    window: Window
    tables: dict[str, np.ndarray]
    alpha: float | None
    farthest: int
    left_out: str

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
            ValueError: for a model, an encoder or a read-out that is not exported, or a class
                without training frames.
        """
        _check_exportable(model, pixel_bits)
        tables = _encoding(model.encoder_, model.n_features_in_) | _classes(model)
        farthest, unit = 0, ""
        if alpha is not None:
            rejection = model._head.rejection
            farthest, unit = rejection.threshold(alpha), rejection.unit
            majority = _unsigned(rejection.prototypes)
            # The scores of lda, of trained and of thinned classes are of others.
            if not np.array_equal(majority, tables.get("prototypes", ())):
                tables["majority"] = majority
        return cls(
            name=name,
            encoder=model.encoder_,
            readout=model.readout_,
            classes=tuple(map(str, model.classes_.tolist())),
            frame_shape=tuple(model.frame_shape_),
            pixel_bits=pixel_bits,
            dimension=model.dimension_,
            window=window or Window(),
            tables=tables,
            alpha=alpha,
            farthest=farthest,
            left_out=unit,
        )

    @property
    def is_cut(self) -> bool:
        """Whether frames are cut out of images by a function of the header."""
        cut = self.window.crop is not None or self.window.subsample > 1
        return cut and len(self.frame_shape) == 2

    @property
    def pixels(self) -> int:
        """Pixels of a frame."""
        return prod(self.frame_shape)

    @property
    def thresholds(self) -> int:
        """Bits per pixel."""
        key = "ones" if "ones" in self.tables else "numerators"
        return len(self.tables[key])

    @property
    def ranked(self) -> int:
        """Pixels that become bits; fewer than all where an encoder uses lit ones only."""
        return self.dimension // self.thresholds

    @property
    def words(self) -> int:
        """Words of a hypervector."""
        return bits.words_for(self.dimension)

    @property
    def frame_bytes(self) -> int:
        """Bytes of a frame, which the caller holds."""
        return self.pixels * self.pixel_bits // 8

    @property
    def constant_bytes(self) -> int:
        """Bytes of all tables; the names of the classes come on top."""
        return sum(table.nbytes for table in self.tables.values())

    @property
    def scratch_bytes(self) -> int:
        """Bytes of the structure that a prediction works with."""
        total = 8 * (self.words + len(self.classes))
        if "reference" in self.tables:
            return total + 8 * self.thresholds
        total += _COUNTS * self.pixel_bits // 8 + _TURNS
        if "lit" in self.tables:
            total += self.ranked * self.pixel_bits // 8
        return -(-total // 8) * 8  # a structure ends where its widest member may begin


def exports(model: object) -> bool:
    """Whether a model of these parts, trained or not, can be written as a header."""
    return (
        isinstance(model, HDCClassifier)
        and type(model.fresh("encoder")) in ENCODERS
        and type(model.fresh("readout")) in READOUTS
    )


def _check_exportable(model: Any, pixel_bits: int) -> None:
    """Refuse what is not exported, and frames of which sums do not fit into 64 bits, or Python
    rounds quotients."""
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
    if not model.counts_.all():
        empty = model.classes_[model.counts_ == 0].tolist()
        raise ValueError(
            f"export: expected frames of each class, found none of {empty[0]!r}"
        )
    n_pixels, most = model.n_features_in_, _MOST_LIGHT >> pixel_bits
    if isinstance(model.encoder_, Deviation) and n_pixels > most:
        raise ValueError(
            f"export: expected at most {most} pixels of {pixel_bits} bits with the encoder "
            f"deviation, found {n_pixels}"
        )


def _encoding(encoder: RankEncoder | Deviation, n_pixels: int) -> dict[str, np.ndarray]:
    """Tables of the encoder."""
    if isinstance(encoder, Deviation):
        thresholds = encoder.fractions()
        return {
            "reference": encoder.reference_.numpy(force=True).astype(np.int32),
            "numerators": np.array([t.numerator for t in thresholds], np.int32),
            "denominators": np.array([t.denominator for t in thresholds], np.int32),
        }
    ranked = encoder.dimension(n_pixels) // len(encoder.quantiles)
    tables = {"ones": np.array(encoder.ones(ranked), np.uint32)}
    if isinstance(encoder, Levels) and ranked < n_pixels:
        tables["lit"] = _unsigned(bits.pack(encoder.lit_.cpu()))
    return tables


def _unsigned(words: Tensor) -> np.ndarray:
    return words.numpy(force=True).view(np.uint64)


def _classes(model: HDCClassifier) -> dict[str, np.ndarray]:
    """Tables of the read-out: prototypes, or weights, and the scales and biases of the sum
    Σ (q + 8)·v − 8·|v| over the bits v.

    With bits of ±1, q·x = 2·(Σ (q + 8)·v − 8·|v|) − Σ (q + 8) + 8·D.
    """
    state = model.state_
    if not isinstance(model.readout_, LDA):
        return {"prototypes": _unsigned(state.prototypes)}
    places = 2 ** np.arange(state.weights.shape[1])
    total = bits.count_ones(state.weights).numpy(force=True) @ places
    scales, offsets = (part.numpy(force=True) for part in (state.scales, state.offsets))
    return {
        "weights": _unsigned(state.weights),
        "scales": scales,
        "biases": offsets + scales * (_WEIGHT_OFFSET * model.dimension_ - total),
    }
