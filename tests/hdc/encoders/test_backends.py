"""Every encoder by numpy and by the kernels: the same bits, the same warnings, the same state."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import torch

from hdc.backends import BACKENDS
from hdc.encoders import (
    Deviation,
    Levels,
    Median,
    Quantile,
    Reference,
    ReferenceLevels,
    Smoothed,
)
from tests.hdc.own import by

ENCODERS = [
    Median(),
    Median("raster"),
    Quantile(0.1, "below"),
    Quantile("3/4"),
    Levels(),
    Levels(2, ties="raster"),
    Levels(3, lit=0.5),
    Reference(),
    Reference(Quantile("1/9", "below")),
    ReferenceLevels(),
    Deviation(),
    Deviation([-1000, "-1/3", 0.1, 999_999]),
    Smoothed("levels"),
]
DTYPES = ["uint8", "uint16", "int32", "float32"]


def frames_of(kinds_of_frames, d: int, dtype: str) -> torch.Tensor:
    """Every kind, light that changes from frame to frame, and the ends of the type."""
    rng = np.random.default_rng(d)
    frames = [kinds_of_frames(d, dtype)]
    if not dtype.startswith("float"):
        ends = np.iinfo(dtype)
        light = rng.exponential(0.1, (9, d)) * rng.uniform(0.01, 1, (9, 1))
        frames.append((light * ends.max).clip(0, ends.max))
        frames.append(rng.choice([ends.min, ends.max], (3, d)))
        frames.append(rng.integers(ends.min, ends.max, (3, d), endpoint=True))
        frames.append(np.where(rng.random((3, d)) < 2 / d, ends.max, 1))
    return torch.from_numpy(np.concatenate(frames).astype(dtype))


CASES = [
    *((e, d, kind) for e in ENCODERS for d in (64, 65, 4161) for kind in DTYPES),
    *((e, d, "uint8") for e in ENCODERS for d in (1, 2) if not getattr(e, "lit", 0)),
    *((e, 70_001, kind) for e in ENCODERS[::3] for kind in ("uint8", "int32")),
]


@pytest.mark.parametrize(("encoder", "d", "dtype"), CASES, ids=repr)
def test_kernels_make_the_same_bits(encoder, d, dtype, kinds_of_frames):
    pytest.importorskip("numba")
    frames = frames_of(kinds_of_frames, d, dtype)
    if isinstance(encoder, Smoothed):
        frames = frames.view(len(frames), 1, d)
    if d == 70_001:
        frames = frames[::4]
    said = []
    before = torch.get_num_threads()
    torch.set_num_threads(2 if d == 70_001 else 1)
    try:
        for backend in BACKENDS:
            own = encoder.unlearned()
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                by(backend, own.fit, frames[:9])
                words = by(backend, own.encode, frames, *[7] * own.numbered)
            state = {name: t.tolist() for name, t in own.state().items()}
            said.append(
                (words.numpy().tobytes(), state, [str(w.message) for w in caught])
            )
    finally:
        torch.set_num_threads(before)
    assert said[0] == said[1]


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("encoder", ENCODERS, ids=repr)
def test_frames_are_encoded_by_themselves(encoder, dtype, kinds_of_frames):
    """Whatever comes before or with them, however they lie in memory; no frame is no word."""
    pytest.importorskip("numba")
    frames = torch.from_numpy(kinds_of_frames(21 * 13, dtype)).view(-1, 21, 13)
    for backend in BACKENDS:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            encoder = encoder.unlearned().fit(frames)
            words = by(backend, encoder.encode, frames)
            assert words.shape[1] == -(-encoder.dimension(273) // 64)
            flat = frames.flatten(1).T.contiguous().T
            assert torch.equal(by(backend, encoder.encode, flat), words)
            reverse = by(backend, encoder.encode, frames.flip(0)[::2])
            assert torch.equal(reverse, words.flip(0)[::2])
            none = by(backend, encoder.encode, frames[:0])
            assert none.shape == words[:0].shape
