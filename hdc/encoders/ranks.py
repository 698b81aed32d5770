"""Thresholds by rank: for each quantile q, the ⌊(1 − q)·D⌋ largest of D pixels become ones.

The paper thresholds a speckle pattern so that 0 and 1 appear with the same probability: q = ½.
Ones are the pixels above the threshold m, and of those equal to m the first by the encoder's order
of ties (:mod:`hdc.encoders.ties`). Hypervectors of several thresholds stand one after another,
bit t·D + j for pixel j and threshold t.
How m is found is up to :mod:`hdc.encoders.thresholds`, or :mod:`hdc.compiled`; every way gives the
same bits.
"""

from __future__ import annotations

import math
import warnings
from abc import abstractmethod
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from hdc import backends, bits
from hdc.encoders.base import Encoder
from hdc.encoders.thresholds import Level, route_of
from hdc.encoders.ties import TIES
from hdc.parameters import check_choice


class RankEncoder(Encoder):
    """Thresholds a frame at quantiles of its own pixels.

    A subclass has the parameter ``ties`` (one of :data:`hdc.encoders.ties.TIES`) and says which
    `quantiles`, and above which share of ties a frame is warned of.
    """

    ties: str
    tied_share = 0.1
    """Share of the pixels that may tie at a threshold before a warning says so, once."""
    _warned = False

    @property
    @abstractmethod
    def quantiles(self) -> tuple[Fraction, ...]:
        """q₁ < q₂ < …, in (0, 1)."""

    def check(self) -> None:
        check_choice("ties", self.ties, TIES)
        _ = self.quantiles

    def dimension(self, n_pixels: int) -> int:
        return len(self.quantiles) * n_pixels

    def encode(
        self,
        frames: Tensor,
        first: int = 0,
        backend: str = "numpy",
        out: Tensor | None = None,
    ) -> Tensor:
        """Hypervectors of frames [N, H, W] or [N, D] of any real or integer dtype: int64 [N, W].

        A constant frame carries no information; it gets its ones by the order of pixels alone, and
        a warning names it. Besides the result, memory is needed for one frame (or 2^20 pixels).

        Args:
            frames: on any device.
            first: number of the first frame, in warnings and errors.
            backend: ``"compiled"`` encodes 8-bit frames on the CPU by :mod:`hdc.compiled`.
            out: words [≥ N, W] to be overwritten and returned; allocating is slow.

        Raises:
            ValueError: for another shape, no pixels, pixels that are not finite, or a backend that
                is not to be had (:func:`hdc.backends.kernels`).
            TypeError: for a dtype that has no order (bool, complex).
        """
        words, ties = encode_ranks(
            frames, self.quantiles, self.ties, first, backend, out
        )
        self.warn(ties, frames.shape[1:].numel(), first)
        return words

    def ones(self, n_pixels: int) -> list[int]:
        """How many of so many pixels become ones, for each quantile."""
        return count_ones(self.quantiles, n_pixels)

    def warn(self, ties: Ties, n_pixels: int, first: int) -> None:
        """Warn of constant frames, by number, and once of frames with many ties."""
        warn_of_constant(ties.constant, first)
        share = ties.most / n_pixels
        if share <= self.tied_share or self._warned:
            return
        self._warned = True
        warnings.warn(
            f"{share:.0%} of the pixels of a frame equal its threshold: which of them become ones "
            f"is decided by the order of pixels (ties={self.ties!r}), not by light",
            stacklevel=4,
        )


class Ties(NamedTuple):
    """Ties and constant frames that a call of :func:`encode_ranks` met.

    Attributes:
        constant: frames of which all pixels are equal.
        most: largest number of pixels of a frame that equal a threshold and are not all ones, nor
            all zeros; constant frames aside.
    """

    constant: list[int]
    most: int


def exact_quantile(name: str, value: Any) -> Fraction:
    """A quantile as the fraction that is written: ``"3/4"``, ``0.9`` or a Fraction.

    Through its text, since ⌊(1 − .9)·250000⌋ is 24999 in floating point.

    Raises:
        ValueError: naming the argument, for what is not a number in (0, 1).
    """
    try:
        quantile = Fraction(str(value))
    except (ValueError, ZeroDivisionError):
        quantile = Fraction(0)
    if not 0 < quantile < 1:
        raise ValueError(f"{name}: expected a quantile in (0, 1), found {value!r}")
    return quantile


def encode_ranks(
    frames: Tensor,
    quantiles: Sequence[Fraction],
    rule: str = "spread",
    first: int = 0,
    backend: str = "numpy",
    out: Tensor | None = None,
) -> tuple[Tensor, Ties]:
    """Hypervectors of frames, int64 [N, ⌈T·D/64⌉] for T quantiles, and what ties there were.

    Arguments and errors as of :meth:`RankEncoder.encode`; `rule` is one of
    :data:`hdc.encoders.ties.TIES`.
    """
    check_frames(frames)
    check_choice("ties", rule, TIES)
    kernels = backends.kernels(backend, frames.device)
    n = len(frames)
    n_pixels = frames.shape[1:].numel()
    ones = count_ones(quantiles, n_pixels)
    width = bits.words_for(len(ones) * n_pixels)
    if out is None:
        words = torch.empty(n, width, dtype=torch.int64, device=frames.device)
    else:
        words = out[:n]
    if kernels and frames.dtype == torch.uint8 and n_pixels > 1:
        images = frames.reshape(n, n_pixels).numpy()
        equal, split = kernels.encode_uint8(images, words.numpy(), ones, rule)
        return words, ties_of(equal, split, n_pixels)
    if n == 0:
        return words, Ties([], 0)
    step, route = route_of(frames, n_pixels)
    equals, splits = [], []
    for start in range(0, n, step):
        chosen = slice(start, start + step)
        pixels = _pixels(frames[chosen], first + start)
        levels = route(pixels, ones, rule)
        counted = _encode_block(levels, n_pixels, words[chosen])
        equals.append(counted[0])
        splits.append(counted[1])
    equal, split = (torch.cat(part).numpy(force=True) for part in (equals, splits))
    return words, ties_of(equal, split, n_pixels)


def count_ones(quantiles: Sequence[Fraction], n_pixels: int) -> list[int]:
    """⌊(1 − q)·D⌋ for each quantile q."""
    return [
        (q.denominator - q.numerator) * n_pixels // q.denominator for q in quantiles
    ]


def check_frames(frames: Tensor) -> None:
    """Raise ValueError for frames of another shape or no pixels, TypeError for bool or complex, and
    for what is no tensor."""
    if not isinstance(frames, Tensor):
        found = type(frames).__name__
        raise TypeError(f"frames: expected a torch tensor, found {found}")
    if frames.ndim not in (2, 3) or 0 in frames.shape[1:]:
        found = tuple(frames.shape)
        raise ValueError(
            f"frames: expected shape [N, H, W] or [N, D] with pixels, found {found}"
        )
    if frames.dtype == torch.bool or frames.is_complex():
        raise TypeError(
            f"frames: expected real or integer pixels, found {frames.dtype}"
        )


def warn_of_constant(constant: Sequence[int], first: int) -> None:
    """Warn of frames, counted from number `first`, of which all pixels are equal; if there are."""
    if not constant:
        return
    listed = [str(first + i) for i in constant[:10]]
    if len(constant) > len(listed):
        listed.append("…")
    reason = "every pixel is equal, so the hypervector carries no information"
    warnings.warn(
        f"{len(constant)} constant frame(s), at index {', '.join(listed)}: {reason}",
        stacklevel=5,
    )


def ties_of(equal: np.ndarray, split: np.ndarray, n_pixels: int) -> Ties:
    """Make it from counts of pixels equal to a threshold, [N, T], and whether some became ones."""
    constant = equal[:, 0] == n_pixels
    counted = equal[split & ~constant[:, None]]
    most = int(counted.max(initial=0))
    return Ties(np.flatnonzero(constant).tolist(), most)


def _pixels(frames: Tensor, first: int) -> Tensor:
    """Pixels [B, D] of a few frames, known to be finite, in a type that numpy can compare."""
    pixels = frames.detach().reshape(len(frames), -1)
    if not pixels.is_floating_point():
        return pixels
    if pixels.dtype not in (torch.float32, torch.float64):
        pixels = pixels.float()  # exact
    check_finite(pixels, first)
    return pixels


def check_finite(pixels: Tensor, first: int) -> None:
    """Raise ValueError for floats [B, D] that are not finite, naming the frame."""
    # On the CPU without torch's threads: waiting for a busy core takes longer than the frame.
    values = pixels.detach().numpy() if pixels.device.type == "cpu" else pixels
    if math.isfinite(values.min()) and math.isfinite(values.max()):  # NaN is both
        return
    finite = pixels.isfinite()
    index = int((~finite.all(1)).nonzero()[0])
    value = pixels[index][~finite[index]][0].item()
    found = "NaN" if math.isnan(value) else value
    raise ValueError(f"frames[{first + index}]: expected finite pixels, found {found}")


def _encode_block(
    levels: Sequence[Level], n_pixels: int, rows: Tensor
) -> tuple[Tensor, Tensor]:
    """Fill rows int64 [B, ⌈T·D/64⌉] from T levels of D pixels.

    Returns:
        How many pixels equal each threshold, [B, T], and whether only some of them became ones.
    """
    if len(levels) == 1:
        rows[:] = levels[0].words
    else:
        rows.zero_()
        for t, level in enumerate(levels):
            _put(level.words, rows, t * n_pixels)
    counts = [level.n_equal for level in levels]
    splits = [level.split for level in levels]
    return torch.stack(counts, 1), torch.stack(splits, 1)


def _put(words: Tensor, rows: Tensor, start: int) -> None:
    """Put the bits of words [B, W] into rows [B, W′], which are zero there, from bit `start` on."""
    place, shift = divmod(start, bits.WORD)
    width = words.shape[1]
    rows[:, place : place + width] |= words << shift
    if shift:
        low_bits = (1 << shift) - 1
        above = (words >> (bits.WORD - shift)) & low_bits
        following = place + 1
        room = min(width, rows.shape[1] - following)
        rows[:, following : following + room] |= above[:, :room]
