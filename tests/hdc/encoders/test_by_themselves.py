"""Every encoder encodes a frame by itself, by numpy and by the kernels."""

import pytest
import torch

from hdc.encoders import (
    Deviation,
    Levels,
    Median,
    Quantile,
    Reference,
    ReferenceLevels,
    Smoothed,
)
from tests.hdc.own import BACKENDS, by

ENCODERS = [
    Median(),
    Quantile(0.1),
    Levels(2),
    Levels(3, lit=0.5),
    Reference(Quantile("1/9")),
    ReferenceLevels(),
    Deviation([-1000, "-1/3", 0.1, 999_999]),
    Smoothed("levels"),
]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("encoder", ENCODERS, ids=repr)
@pytest.mark.parametrize("backend", BACKENDS)
def test_frames_are_encoded_by_themselves(backend, encoder, dtype, kinds_of_frames):
    """Whatever comes before or with them, however they lie in memory; no frame is no word."""
    frames = torch.from_numpy(kinds_of_frames(21 * 13, dtype)).view(-1, 21, 13)
    encoder = encoder.unlearned().fit(frames)
    expected = encoder.encode(frames)
    assert expected.shape[1] == -(-encoder.dimension(273) // 64)
    assert torch.equal(by(backend, encoder.encode, frames), expected)
    flat = frames.flatten(1).T.contiguous().T
    assert torch.equal(by(backend, encoder.encode, flat), expected)
    reverse = by(backend, encoder.encode, frames.flip(0)[::2])
    assert torch.equal(reverse, expected.flip(0)[::2])
    none = by(backend, encoder.encode, frames[:0])
    assert none.shape == expected[:0].shape
