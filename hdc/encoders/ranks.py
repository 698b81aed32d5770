"""Thresholds by rank: for each quantile q, the ⌊(1 − q)·D⌋ largest of D pixels become ones.

The paper thresholds a speckle pattern so that 0 and 1 appear with the same probability: q = ½.
The ones are the pixels above the threshold m, and the first of the pixels equal to m, by one order
of pixels (:mod:`hdc.encoders.ties`). The bits of several thresholds follow one another: bit t·D + j
is pixel j at threshold t. Small frames are thresholded many at once, and large ones on the CPU one
after another. :mod:`hdc.compiled` gives equal results.
"""

from __future__ import annotations

import functools
import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import backends, bits, inputs
from hdc.encoders.base import Encoder
from hdc.encoders.ties import count_ones, first_ties, in_order
from hdc.warning import warn

# Pixels of several frames ordered at once, at up to 30 bytes each; a GPU needs more to be busy.
_STEP, _STEP_ON_GPU = 2**20, 2**25
_SMALL = 4096
"""Pixels per frame up to which several frames are ordered at once."""
_STRIDE = 64  # one pixel of so many is in the sample
COMPILED = (torch.uint8, torch.uint16, torch.int32)
"""Types that the kernels take."""
Route = Callable[[Tensor, Sequence[int]], tuple[Any, Any, Any]]


class RankEncoder(Encoder):
    """Thresholds a frame at quantiles of its own pixels.

    A subclass sets the `quantiles`, and the share of ties above which a warning appears. `ties` is
    always ``"spread"`` (:mod:`hdc.encoders.ties`).
    """

    numbered = True
    ties: str
    quantiles: tuple[Fraction, ...]
    """q₁ < q₂ < …, in (0, 1)."""
    tied_share = 0.1
    """Share of pixels that may equal a threshold before a warning appears, once."""
    _warned = False

    def __init__(self, ties: str = "spread"):
        self.ties = ties

    def check(self) -> None:
        if self.ties != "spread":
            raise ValueError(
                f"ties: expected 'spread', the only order of ties, found {self.ties!r}"
            )
        _ = self.quantiles

    def dimension(self, n_pixels: int) -> int:
        return len(self.quantiles) * n_pixels

    def encode(self, frames: Tensor, first: int = 0) -> Tensor:
        """Hypervectors of frames [N, H, W] or [N, D] of any real or integer dtype: int64 [N, W].

        A constant frame carries no information: its ones follow from the order of pixels alone, and
        a warning names it. `first` is the index of the first frame, for warnings and errors.

        Raises:
            ValueError: for another shape, no pixels, or pixels that are not finite.
            TypeError: for a dtype that has no order (bool, complex).
        """
        inputs.check_frames(frames)
        n_pixels = frames.shape[1:].numel()
        words, n_equal, split = encode_ranks(frames, self.ones(n_pixels), first)
        constant = n_equal[:, 0] == n_pixels
        if constant.any():
            warn_of_constant(np.flatnonzero(constant).tolist(), first)
        tied = n_equal[split & ~constant[:, None]]
        self._warn_of_ties(tied.max(initial=0) / n_pixels)
        return words

    def ones(self, n_pixels: int) -> list[int]:
        """How many of n_pixels become ones, ⌊(1 − q)·D⌋ for each quantile q."""
        return [
            (q.denominator - q.numerator) * n_pixels // q.denominator
            for q in self.quantiles
        ]

    def _warn_of_ties(self, share: float) -> None:
        """Warn once of a frame that has this share of its pixels on both sides of a cut."""
        if share <= self.tied_share or self._warned:
            return
        self._warned = True
        warn(
            f"{100 * share:.0f} % of the pixels of a frame equal its threshold: which of them "
            "become ones is decided by the order of pixels, not by light",
        )


def encode_ranks(
    frames: Tensor, ones: Sequence[int], first: int = 0
) -> tuple[Tensor, np.ndarray, np.ndarray]:
    """Hypervectors of frames, for T numbers of pixels that become ones.

    Arguments and errors as in :meth:`RankEncoder.encode`.

    Returns:
        Words int64 [N, ⌈T·D/64⌉], how many pixels equal each threshold, int64 [N, T], and whether
        only some of them became ones.
    """
    n = len(frames)
    n_pixels = frames.shape[1:].numel()
    kernels = backends.in_use.get()
    if kernels and frames.dtype in COMPILED:
        width = bits.words_for(len(ones) * n_pixels)
        packed = torch.empty(n, width, dtype=torch.int64)
        images = frames.reshape(n, n_pixels).numpy()
        return packed, *kernels.encode(images, packed.numpy(), ones)
    step, route = route_of(frames, n_pixels)
    found = []
    for start in range(0, max(1, n), step):
        pixels = _pixels(frames[start : start + step], first + start)
        found.append(map(torch.as_tensor, route(pixels, ones)))
    words, n_equal, split = (torch.cat(part) for part in zip(*found, strict=True))
    return words, n_equal.numpy(force=True), split.numpy(force=True)


def warn_of_constant(constant: Sequence[int], first: int) -> None:
    """Warn of constant frames; the frame at place 0 has the index `first`."""
    listed = [str(first + i) for i in constant[:10]]
    if len(constant) > len(listed):
        listed.append("…")
    reason = "every pixel is equal, so the hypervector carries no information"
    warn(
        f"{len(constant)} constant frame(s), at index {', '.join(listed)}: {reason}",
    )


def route_of(frames: Tensor, n_pixels: int) -> tuple[int, Route]:
    """How many frames to take at a time, and the fastest function for them.

    The function takes pixels [B, D] and numbers of ones.
    """
    on_cpu = frames.device.type == "cpu"
    if on_cpu and n_pixels > _SMALL:
        return max(1, len(frames)), one_by_one
    step = _STEP if on_cpu else _STEP_ON_GPU
    return max(1, step // n_pixels), at_once


def _pixels(frames: Tensor, first: int) -> Tensor:
    """Pixels [B, D] of some frames, checked to be finite, in a type that numpy can compare."""
    pixels = frames.detach().flatten(1)
    if not pixels.is_floating_point():
        return pixels
    if pixels.dtype not in (torch.float32, torch.float64):
        pixels = pixels.float()  # exact
    check_finite(pixels, first)
    return pixels


def check_finite(pixels: Tensor, first: int) -> None:
    """Raise ValueError, naming the frame, for floats [B, D] that are not finite."""
    if len(pixels) == 0:
        return
    # On the CPU by numpy: waking torch's threads may take longer than the frame.
    values = pixels.detach().numpy() if pixels.device.type == "cpu" else pixels
    if math.isfinite(values.min()) and math.isfinite(values.max()):  # NaN is found, too
        return
    finite = pixels.isfinite()
    index = int((~finite.all(1)).nonzero()[0])
    value = pixels[index][~finite[index]][0].item()
    found = "NaN" if math.isnan(value) else value
    raise ValueError(f"frames[{first + index}]: expected finite pixels, found {found}")


# Many frames at once -----------------------------------------------------------------------------


def at_once(pixels: Tensor, ones: Sequence[int]) -> tuple[Any, Any, Any]:
    """Threshold pixels [B, D] on any device, so that T numbers of pixels become ones.

    Returns:
        As :func:`encode_ranks`.
    """
    if pixels.dtype == torch.uint64:  # the same order, without the wrap at 2^63
        pixels = pixels.view(torch.int64) ^ torch.iinfo(torch.int64).min
    elif not pixels.is_floating_point():
        pixels = pixels.long()  # torch does not compare all unsigned types
    n_pixels = pixels.shape[1]
    places = [n_pixels - 1 - wanted for wanted in ones]
    thresholds = _values_at(pixels, places)
    found = []
    for t, wanted in enumerate(ones):
        found.append(_ones_of(pixels, thresholds[:, t, None], wanted))
    masks, n_equal, split = (torch.stack(part, 1) for part in zip(*found, strict=True))
    return bits.pack(masks.flatten(1)), n_equal, split


def _values_at(pixels: Tensor, places: list[int]) -> Tensor:
    """Pixels of each row [B, D] at these places in rising order, [B, T]."""
    if pixels.device.type == "cpu":  # numpy selects faster
        return torch.from_numpy(np.partition(pixels.numpy(), places)[:, places])
    found = [pixels.kthvalue(place + 1, dim=1).values for place in places]
    return torch.stack(found, 1)


def _ones_of(
    pixels: Tensor, threshold: Tensor, wanted: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Mask [B, D] of the pixels that become ones, and the two other results, [B].

    Args:
        pixels, threshold: [B, D] and [B, 1].
        wanted: how many pixels of a frame become ones.
    """
    above = pixels > threshold
    equal = pixels == threshold
    n_equal = equal.sum(1)
    missing = wanted - above.sum(1)
    split = missing > 0
    if not split.any():
        return above, n_equal, split
    in_order, places = _order_on(pixels.device, pixels.shape[1])
    ties = equal[:, in_order]
    ties &= ties.cumsum(1, dtype=torch.int32) <= missing[:, None]
    return above | ties[:, places], n_equal, split


@functools.lru_cache(maxsize=4)
def _order_on(device: torch.device, n_pixels: int) -> tuple[Tensor, ...]:
    """:func:`hdc.encoders.ties.in_order` in the memory of a device."""
    return tuple(torch.from_numpy(array).to(device) for array in in_order(n_pixels))


# Large frames one after another ------------------------------------------------------------------


def one_by_one(pixels: Tensor, ones: Sequence[int]) -> tuple[Any, Any, Any]:
    """:func:`at_once` for large frames on the CPU.

    The search for a threshold begins at that of the previous frame, or of a sample of the first
    one, which does not affect the result.
    """
    images = pixels.numpy()
    n, n_pixels = images.shape
    words = np.zeros((n, bits.words_for(len(ones) * n_pixels)), np.int64)
    n_equal = np.empty((n, len(ones)), np.int64)
    missing = np.empty_like(n_equal)
    above, equal = np.zeros((2, bits.words_for(n_pixels)), np.int64)
    of_sample = [wanted // _STRIDE for wanted in ones]
    thresholds: list[Any] = []
    for i, image in enumerate(images):
        guesses = thresholds or _with_above(image[::_STRIDE], of_sample)
        thresholds = _thresholds(image, ones, guesses)
        for t, threshold in enumerate(thresholds):
            _pack(image > threshold, above)
            _pack(image == threshold, equal)
            n_equal[i, t] = count_ones(equal)
            missing[i, t] = ones[t] - count_ones(above)
            first = first_ties(equal, n_equal[i, t], missing[i, t])
            _put(above | first, words[i], t * n_pixels)
    return words, n_equal, (missing > 0) & (missing < n_equal)


def _pack(mask: np.ndarray, words: np.ndarray) -> None:
    """Write the bits of a mask to words int64 [W]; the bits beyond it stay zero."""
    packed = np.packbits(mask, bitorder="little")
    words.view(np.uint8)[: len(packed)] = packed


def _put(words: np.ndarray, row: np.ndarray, start: int) -> None:
    """Write the bits of words [W] into a row [W′] of zeros, from bit `start` on."""
    place, shift = divmod(start, bits.WORD)
    row = row[place:].view(np.uint64)
    given = words.view(np.uint64)
    row[: len(given)] |= given << np.uint64(shift)
    if shift:
        above = given >> np.uint64(bits.WORD - shift)
        room = row[1 : len(given) + 1]
        room |= above[: len(room)]


def _thresholds(
    image: np.ndarray, ones: Sequence[int], guesses: Sequence[Any]
) -> list[Any]:
    """For each number of ones, the least value with at most as many pixels [D] above it."""
    if image.itemsize > 2:
        return _with_above(image, ones)

    @functools.cache
    def n_above(value: int) -> int:
        return int(np.count_nonzero(image > value))

    # Counting a few times takes less time than ordering the pixels.
    pairs = zip(ones, guesses, strict=True)
    return [_search(n_above, wanted, guess) for wanted, guess in pairs]


def _with_above(pixels: np.ndarray, ones: Sequence[int]) -> list[Any]:
    """For each number of ones, the pixel with as many pixels [D] after it in rising order."""
    places = [len(pixels) - 1 - wanted for wanted in ones]
    return np.partition(pixels, places)[places].tolist()


def _search(n_above: Callable[[int], int], wanted: int, guess: int) -> int:
    """The least value with at most `wanted` pixels above it, fastest if it is near the guess."""
    low, high, step = guess - 1, guess, 1
    while n_above(high) > wanted:
        low, high, step = high, high + step, 2 * step
    while n_above(low) <= wanted:
        low, high, step = low - step, low, 2 * step
    values = range(low + 1, high)
    return low + 1 + bisect_left(values, -wanted, key=lambda value: -n_above(value))
