"""Test vectors beside a header: frames by a formula, and what Python answers to them."""

from __future__ import annotations

import warnings

import numpy as np
import torch

from hdc.classifier import HDCClassifier
from hdc.export.header import filled
from hdc.export.plan import Plan
from hdc.hypervectors import Hypervectors

_START, _PRIME = 0xCBF29CE484222325, 0x100000001B3  # of FNV-1a with 64 bits


def test_vectors(
    plan: Plan, model: HDCClassifier, header: str, file: str, n: int
) -> str:
    """A program of C that compares a header with the model on n frames.

    Args:
        plan: what the header was made of.
        model: the model.
        header: name of the header.
        file: name of the program.
        n: how many frames, at least one.
    """
    digests, scores, labels, known = [], [], [], []
    for number in range(n):
        words, row = answer(plan, model, frame(plan, number))
        digests.append(f"0x{digest(words):016x}")
        scores.append(row)
        labels.append(str(int(row.argmax())))
        known.append(str(int(is_known(plan, words))))
    return filled(
        "vectors.c.j2",
        plan,
        file=file,
        header=header,
        digests=digests,
        scores=np.stack(scores),
        labels=labels,
        known=known,
    )


def frame(plan: Plan, number: int) -> np.ndarray:
    """A frame [1, D] of the formula that the program has, too."""
    places = np.arange(plan.sizes.pixels, dtype=np.uint64)
    low = np.uint64(0xFFFFFFFF)
    x = (places * np.uint64(0x9E3779B1) + np.uint64(number * 0x85EBCA6B)) & low
    x ^= x >> np.uint64(16)
    x = (x * np.uint64(0x7FEB352D)) & low
    x ^= x >> np.uint64(15)
    x = (x * np.uint64(0x846CA68B)) & low
    x ^= x >> np.uint64(16)
    kind = number % 4
    if kind == 0:
        pixels = x >> np.uint64(32 - plan.sizes.pixel_bits)
    elif kind == 1:
        pixels = 100 + x % np.uint64(5)
    elif kind == 2:
        pixels = np.where(x % np.uint64(8) < 1 + number // 4 % 7, 150, 50)
    else:
        pixels = np.full_like(x, number)
    return pixels.astype(f"uint{plan.sizes.pixel_bits}")[None]


def answer(
    plan: Plan, model: HDCClassifier, pixels: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Answer of the model to a frame [1, D]: words uint64 [W], scores int64 [L]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of constant frames and ties, which are wanted
        words = plan.encoder.encode(torch.from_numpy(pixels).to(model.device))
    asked = Hypervectors(words, plan.encoder.dimension(pixels.shape[1]))
    scores = plan.readout.scores(plan.state, asked)[0, list(plan.rows)]
    return words.numpy(force=True).view(np.uint64)[0], scores.numpy(force=True)


def is_known(plan: Plan, words: np.ndarray) -> bool:
    """Whether words uint64 [W] are near enough to some class."""
    if plan.alpha is None:
        return True
    table = plan.tables["majority" if "majority" in plan.tables else "prototypes"]
    distances = np.bitwise_count(words ^ table).sum(1, dtype=np.int64)
    return bool(distances.min() <= plan.farthest)


def digest(words: np.ndarray) -> int:
    """FNV-1a over words."""
    found = _START
    for word in words.tolist():
        found = (found ^ word) * _PRIME % 2**64
    return found
