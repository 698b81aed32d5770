"""Hyperdimensional classifier with the conventional record-based encoding.

Each pixel position i has a random hypervector P_i, each grey level v a hypervector L_v, and a frame
is the majority of its bound pairs (Ge and Parhi, IEEE Circuits Syst. Mag. 20, 30 (2020)), in ±1

    V[d] = sign Σᵢ P_i[d]·L_{x_i}[d].

Level hypervectors are close to their neighbours and orthogonal end to end: from L_0 to L_{n−1} the
first half of the coordinates flips in n − 1 equal blocks and the other half never does (positions
are random, so which coordinates flip is of no consequence).

Encoding N frames of m pixels costs N·m·D bind-and-add operations, and the position codebook m·D
bits: 10¹² and 312 MB for 400 frames of 250,000 pixels at D = 10,000. The optical encoding avoids
both. The sums below are exact, but cheaper than they look: in the block that flips at level τ,

    Σᵢ P_i[d]·L_{x_i}[d] = L_0[d]·Σᵢ P_i[d]·s_i,        s_i = +1 where x_i < τ, else −1,

which is an integer matrix product of two-level images with the bits of the positions. The half that
never flips is the same for every frame and is summed once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from baselines.base import Classifier, FrameSource
from baselines.integer import integer_product

POSITIONS = 8192  # rows of the codebook handled at a time; also the unit of its random streams


@dataclass(kw_only=True, eq=False)
class RecordHDC(Classifier):
    """Record-based encoding, majority prototypes, nearest by Hamming distance.

    Ties of either majority go to the bits of L_0, a fixed random hypervector.

    Args:
        dimension: D, a multiple of 16; the literature uses 1,000–10,000.
        levels: n, grey levels told apart, 2…256; ours, the literature uses 10–100.
        seed: of positions and levels.

    Attributes:
        prototypes_: uint8 [L, D/8].
        base_: L_0, uint8 [1, D/8].
        positions_: P, uint8 [m, D/8].
        fixed_: the half of V that is the same for every frame, uint8 [1, D/16].
    """

    dimension: int = 10_000
    levels: int = 16
    seed: int = 0

    prediction_batch: ClassVar[int] = 500  # each batch unpacks the whole codebook once

    def train(self, frames: FrameSource, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """Make the codebooks, encode and bundle; yields once, with samples_seen = N."""
        targets = self.start(frames, labels)
        if self.dimension < 16 or self.dimension % 16:
            raise ValueError(f"dimension: expected a multiple of 16, found {self.dimension}")
        if not 2 <= self.levels <= 256:
            raise ValueError(f"levels: expected 2 to 256, found {self.levels}")
        m, half = self.shape_[0] * self.shape_[1], self.dimension // 2
        self.base_ = self._random_bytes(-1, 1)
        starts = range(0, m, POSITIONS)
        blocks = [self._random_bytes(start, min(POSITIONS, m - start)) for start in starts]
        self.positions_ = torch.cat(blocks)
        ones = torch.stack([unpack(block[:, half // 8 :]).sum(dim=0) for block in blocks]).sum(0)
        base = signs(self.base_)[0]
        self.fixed_ = pack(majority((2 * ones - m)[None], base[half:]))
        encoded = self.encode(self.read(frames, slice(0, len(frames))))
        counters = F.one_hot(targets, len(self.classes_)).float().T @ encoded
        self.prototypes_ = pack(torch.where(counters == 0, base, counters) > 0)
        yield {"samples_seen": len(frames)}

    def encode(self, batch: Tensor) -> Tensor:
        """Hypervectors V of frames uint8 or int32 [n, H, W] as ±1, float32 [n, D]."""
        half, n = self.dimension // 2, len(batch)
        bits = 8 if batch.dtype == torch.uint8 else 16
        images = torch.stack([(frame.int() * self.levels >> bits).byte() for frame in batch])
        images = images.flatten(1)
        edges = np.linspace(0, half, self.levels).round().astype(int).tolist()
        # With bits B = (1 + P)/2 and t = (1 + s)/2:  Σ P·s = 4 Σ B·t − 2 Σ B − 2 Σ t + m.
        sums = torch.full((n, half), float(images.shape[1]), device=self.device)
        for start in range(0, images.shape[1], POSITIONS):
            positions = unpack(self.positions_[start : start + POSITIONS, : half // 8])
            chunk = images[:, start : start + POSITIONS]
            sums -= 2 * positions.sum(dim=0)
            for level in range(1, self.levels):
                block = slice(edges[level - 1], edges[level])
                t = (chunk < level).to(torch.int8)
                sums[:, block] += 4 * integer_product(t, positions[:, block])
                sums[:, block] -= 2 * t.sum(dim=1, keepdim=True)
        varying = majority(sums, signs(self.base_)[0, :half])
        half_signs = [2.0 * varying - 1, signs(self.fixed_).expand(n, -1)]
        return torch.cat(half_signs, dim=1)

    def scores(self, batch: Tensor) -> Tensor:
        """D − 2·(Hamming distance) to each prototype, float32 [n, L]."""
        return self.encode(batch) @ signs(self.prototypes_).T

    def state_tensors(self) -> dict[str, Tensor]:
        """prototypes [L, D/8], base [1, D/8], fixed [1, D/16] and positions [m, D/8]."""
        names = ("prototypes", "base", "fixed", "positions")
        return {name: getattr(self, f"{name}_") for name in names}

    def _random_bytes(self, start: int, rows: int) -> Tensor:
        """Random hypervectors [rows, D/8], a pure function of the seed and the first row."""
        random = np.random.Generator(np.random.Philox(key=[self.seed, start + 1]))
        drawn = bytearray(random.bytes(rows * self.dimension // 8))
        return torch.frombuffer(drawn, dtype=torch.uint8).view(rows, -1).to(self.device)


def majority(sums: Tensor, base: Tensor) -> Tensor:
    """Bits of Σ P·L = L_0·Σ P·s, bool: L_0 decides a tie."""
    return torch.where(sums == 0, base, sums * base) > 0


def pack(mask: Tensor) -> Tensor:
    """bool [n, D] → uint8 [n, ⌈D/8⌉], first bit highest, zeros at the end."""
    return torch.from_numpy(np.packbits(mask.numpy(force=True), axis=1)).to(mask.device)


def unpack(packed: Tensor) -> Tensor:
    """uint8 [n, B] → int8 0 or 1, [n, 8B]."""
    ones = np.unpackbits(packed.numpy(force=True), axis=1)
    return torch.from_numpy(ones.view(np.int8)).to(packed.device)


def signs(packed: Tensor) -> Tensor:
    """uint8 [n, B] → ±1, float32 [n, 8B]."""
    return 2.0 * unpack(packed) - 1
