"""What may change in frames without changing an answer, exactly."""

from __future__ import annotations

import functools
import os
import subprocess
import sys

import numpy as np
import pytest
import torch
from numpy._core import _multiarray_umath as of_numpy

from hdc import HDCClassifier, bits
from hdc.encoders import make_encoder

pytestmark = pytest.mark.usefixtures("one_thread")
RANKS = ("median", "quantile", "levels")
RELATIVE = ("reference", "reference_levels", "deviation")
READOUTS = ("majority", "counts", "neighbours", "lda", "ridge", "kernel")
RANDOM = np.random.default_rng(0)
LABELS = np.arange(24) % 3
ORDER = RANDOM.permutation(24)
NEW_CLASS = np.array([2, 0, 1])


def frames_of(d):
    """Frames uint16 [32, D] of three classes; no two pixels of a frame are equal."""
    noise = (
        RANDOM.normal(size=(32, d))
        + 0.7 * RANDOM.normal(size=(3, d))[np.arange(32) % 3]
    )
    return noise.argsort(1).argsort(1).astype(np.uint16)


FRAMES = {d: frames_of(d) for d in (65, 4097)}
PIXELS = {d: RANDOM.permutation(d) for d in FRAMES}


def encoded(encoder, frames):
    """Bits [N, T, D] of frames [N, D]."""
    given = torch.from_numpy(frames)
    made = make_encoder(encoder).fit(given)
    words = made.encode(given)
    d = frames.shape[1]
    return bits.unpack(words, made.dimension(d)).numpy().reshape(len(frames), -1, d)


def monotone(frames):
    """Strictly rising in grey."""
    return (frames.astype(float) / 100) ** 3 - 1e6


@pytest.mark.parametrize("d", FRAMES)
@pytest.mark.parametrize(
    ("encoder", "dtype", "change"),
    [
        *((encoder, np.uint16, monotone) for encoder in RANKS),
        *((encoder, np.float64, lambda x: x * 2.0**-300) for encoder in RELATIVE),
    ],
)
def test_bits_know_no_scale(encoder, dtype, change, d):
    frames = FRAMES[d].astype(dtype)
    assert (encoded(encoder, change(frames)) == encoded(encoder, frames)).all()


# Differences from a reference may tie, and ties go by the order of pixels.
@pytest.mark.parametrize("d", FRAMES)
@pytest.mark.parametrize("encoder", [*RANKS, "deviation"])
def test_bits_follow_pixels(encoder, d):
    frames, order = FRAMES[d], PIXELS[d]
    expected = encoded(encoder, frames)[..., order]
    assert (encoded(encoder, frames[:, order]) == expected).all()


def answers(readout, train, labels, queries):
    return HDCClassifier(readout=readout).fit(train, labels).predict(queries)


@pytest.mark.parametrize("readout", READOUTS)
def test_answers_know_no_order_of_pixels_frames_and_classes(readout):
    train, queries = FRAMES[65][:24], FRAMES[65][24:]
    expected = answers(readout, train, LABELS, queries)
    assert len(set(expected)) == 3
    chosen = PIXELS[65]
    permuted = answers(readout, train[:, chosen], LABELS, queries[:, chosen])
    assert (permuted == expected).all()
    assert (answers(readout, train[ORDER], LABELS[ORDER], queries) == expected).all()
    renamed = answers(readout, train, NEW_CLASS[LABELS], queries)
    assert (renamed == NEW_CLASS[expected]).all()
    if readout in ("majority", "counts"):
        twice = answers(readout, train.repeat(2, 0), LABELS.repeat(2), queries)
        assert (twice == expected).all()


SAID = """
import hashlib, numpy as np, torch
from hdc import HDCClassifier
from tests.experiments.studies.test_metamorphic import *
digest = hashlib.sha256()
for encoder in RANKS + RELATIVE:
    for d, frames in FRAMES.items():
        digest.update(encoded(encoder, frames).tobytes())
        model = HDCClassifier(encoder=encoder).fit(frames[:24], LABELS)
        digest.update(np.asarray(model.decision_function(frames[24:])).tobytes())
print(digest.hexdigest())
"""


@functools.cache
def said(**environment):
    """What a process of this environment says of its bits."""
    return subprocess.check_output(
        [sys.executable, "-W", "ignore", "-c", SAID],
        env={**os.environ, "OMP_NUM_THREADS": "1", **environment},
        text=True,
    )


AVAILABLE = [f for f in of_numpy.__cpu_dispatch__ if of_numpy.__cpu_features__[f]]


@pytest.mark.parametrize(
    "environment",
    [{"NPY_DISABLE_CPU_FEATURES": " ".join(AVAILABLE)}, {"OMP_NUM_THREADS": "2"}],
    ids=lambda given: next(iter(given)),
)
def test_bits_know_no_processor_and_no_threads(environment):
    assert said(**environment) == said()
