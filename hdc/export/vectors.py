"""Test vectors beside a header: frames by a formula, and what Python answers to them."""

from __future__ import annotations

import warnings

import numpy as np

from hdc.classifier import HDCClassifier
from hdc.export.header import filled
from hdc.export.plan import Plan


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
    known = np.ones(n, int)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of constant frames and ties, which are wanted
        words = model.encode(frames(plan, n))
        scores = model._head.scores(words).numpy(force=True)
        if plan.alpha is not None:
            known = model.is_known(words, plan.alpha).astype(int)
    return filled(
        "vectors.c.j2",
        plan,
        file=file,
        header=header,
        n=n,
        scores=scores,
        answers=scores.argmax(1),
        known=known,
    )


def frames(plan: Plan, n: int) -> np.ndarray:
    """Frames [n, D] of the formula that the program has, too."""
    numbers = np.arange(n, dtype=np.uint32)[:, None]
    places = np.arange(plan.pixels, dtype=np.uint32)
    x = places * np.uint32(0x9E3779B1) + numbers * np.uint32(0x85EBCA6B)
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B), (16, 1)):
        x = (x ^ x >> np.uint32(shift)) * np.uint32(factor)
    greys = np.array([2**plan.pixel_bits, 5, 2, 1], np.uint32)
    return (x % greys[numbers % 4]).astype(f"uint{plan.pixel_bits}")
