"""Cost of an exported model: bytes of constants and of memory."""

from __future__ import annotations

from dataclasses import dataclass

from hdc import bits

_COUNTS = 256 * 4  # bytes of a count of each value of a byte
_TURNS = 64 * 4  # bytes of a count of each turn of the order "spread"


@dataclass(frozen=True)
class Sizes:
    """Numbers that follow from the kind of a model and the size of its frames.

    Args:
        pixels: of a frame.
        ranked: pixels that become bits; fewer than all where an encoder uses lit ones only.
        pixel_bits: 8 or 16.
        thresholds: bits per pixel.
        classes: that have training frames.
        planes: hypervectors that the read-out has of a class: a prototype, or four of weights.
        extra: hypervectors of a class that rejection compares with, besides.
        relative: whether pixels are compared with a reference, and not ranked.
    """

    pixels: int
    ranked: int
    pixel_bits: int
    thresholds: int
    classes: int
    planes: int = 1
    extra: int = 0
    relative: bool = False

    @property
    def dimension(self) -> int:
        """Bits of a hypervector."""
        return self.thresholds * self.ranked

    @property
    def words(self) -> int:
        """Words of a hypervector."""
        return bits.words_for(self.dimension)

    @property
    def has_lit(self) -> bool:
        """Whether only some of the pixels are ranked."""
        return self.ranked < self.pixels

    @property
    def frame_bytes(self) -> int:
        """Bytes of a frame, which the caller holds."""
        return self.pixels * self.pixel_bits // 8

    @property
    def constant_bytes(self) -> int:
        """Bytes of all tables; the names of the classes come on top."""
        total = 8 * self.words * self.classes * (self.planes + self.extra)
        if self.relative:
            total += 4 * self.pixels + 2 * 4 * self.thresholds  # reference, fractions
        else:
            total += 4 * self.thresholds
        if self.planes > 1:
            total += 2 * 8 * self.classes  # a scale and a bias of each class
        if self.has_lit:
            total += 8 * bits.words_for(self.pixels)
        return total

    @property
    def scratch_bytes(self) -> int:
        """Bytes of the structure that a prediction works with."""
        total = 8 * self.words + 8 * self.classes
        if self.relative:
            return total + 8 * self.thresholds
        total += _COUNTS + _TURNS
        if self.pixel_bits == 16:
            total += _COUNTS
        if self.has_lit:
            total += self.ranked * self.pixel_bits // 8
        return -(-total // 8) * 8  # a structure ends where its widest member may begin
