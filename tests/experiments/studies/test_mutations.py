"""Studies of limits can fail: each case notices the mistake that it is there to notice."""

from dataclasses import replace

import numpy as np
import pytest

from baselines.softmax_dual import DualSoftmaxRegression
from experiments.studies.limits.numerics import measure as numerics
from experiments.studies.limits.stability.measure import CASES
from hdc import bits, prototypes
from hdc.encoders import Levels, Median, deviation, relative, smoothed
from hdc.prototypes import Counters
from hdc.readouts import discriminant, kernel, lda, least_squares
from hdc.readouts.discriminant import Problem
from scenes.sensor.camera import MountedCamera

pytestmark = pytest.mark.usefixtures("one_thread")
BY_NAME = {case.case: case for case in CASES}


def after(change):
    """A change of what a function returns."""
    return lambda true: lambda *given: change(true(*given))


def before(change):
    """A change of the arguments of a function."""
    return lambda true: lambda *given: true(*change(*given))


def constant(value):
    return lambda true: value


class Accepted(float):
    """An objective that is never too large: the line search takes every full step."""

    def __le__(self, other):
        return True


def fewer_levels(true):
    return property(lambda levels: true.fget(levels)[:-1])


def inverted(true):
    """Ones where the pixels are dark."""

    def encode(self, frames, *_, **__):
        d = frames[0].numel()
        return bits.pack(~bits.unpack(true(self, frames), d).bool())

    return encode


def with_n_minus_1(true):
    return lambda differences: [int(s) for s in differences.double().std(1)]


def upper_median(true):
    return lambda distances: float(np.median(distances[np.triu_indices(12, 1)] + 0.5))


# Name of a mutant: where it is, the mutant, the case that notices it.
MUTANTS = {
    # Those of which six once passed.
    "deviation with n − 1": (
        deviation, "deviations_of", with_n_minus_1, "Deviation, 65 pixels"),
    "deviation with ≥": (
        deviation, "_level", after(lambda level: level - 1), "Deviation, pixels on a threshold"),
    "upper median": (
        kernel, "median_of_pairs", upper_median, "Kernel, queries"),
    "ridge × 10": (
        least_squares, "_penalties_to_try", after(lambda found: [10 * one for one in found]),
        "Ridge, frames left out, few frames"),
    "Ledoit–Wolf halved": (
        lda, "closed_form", after(lambda share: share / 2), "LDA, frames left out, few frames"),
    "a clip at 90 %": (lda, "_CLIPPED", constant(0.9), "LDA, weights"),
    "votes of four bits": (prototypes, "_VOTE_BITS", constant(4), "repeated merges"),
    "worst kernel factors": (kernel, "min", constant(max), "Kernel, its factors"),
    "a sign in leave-one-out": (
        discriminant, "discriminants",
        before(lambda products, rows: (replace(products, left=-products.left), rows)),
        "Kernel, frames left out, few frames"),
    # Others.
    "dark pixels are ones": (Median, "encode", inverted, "Median, 16-bit pixels of 4,097"),
    "one bit more": (
        Median, "ones", after(lambda ones: [n + 1 for n in ones]),
        "Median, a rising frame of 4,097"),
    "a level less": (Levels, "quantiles", fewer_levels, "Levels, a rising frame of 65"),
    "without the sign": (relative, "standardised", after(abs), "Reference, 65 pixels"),
    "edges repeated, not mirrored": (
        smoothed.np, "pad", before(lambda places, reach, _: (places, reach, "symmetric")),
        "Smoothed image of 5 × 13 pixels"),
    "a word left out": (
        bits, "hamming", before(lambda a, b, *rest: (a[..., 1:], b[..., 1:], *rest)),
        "distances above 255"),
    "a frame left out": (
        Counters, "add", before(lambda self, words, rows: (self, words[1:], rows[1:])),
        "unequal classes"),
    "weights of five steps": (lda, "_LEVELS", constant(2), "LDA, weights"),
    "a Gaussian kernel": (
        kernel, "likeness", after(lambda near: near**2), "Kernel, queries"),
    "no offsets": (Problem, "_offsets", after(lambda b: 0 * b), "Kernel, queries"),
    "another unit of the penalty": (
        Problem, "trace", constant(property(lambda problem: 1.0)), "Kernel, queries"),
    "full steps of Newton": (
        DualSoftmaxRegression, "_objective", after(Accepted), "steps that overshoot"),
}  # fmt: skip


@pytest.mark.parametrize("mutant", MUTANTS)
def test_a_mutant_is_dead(monkeypatch, mutant):
    owner, name, make, noticed_by = MUTANTS[mutant]
    changed = make(getattr(owner, name, None))
    monkeypatch.setattr(owner, name, changed, raising=name != "min")
    assert BY_NAME[noticed_by].row()["verdict"] == "fails"


def test_a_camera_with_phases_in_float32_fails_in_numerics(monkeypatch):
    def failing():
        rows = [way.row() for way in numerics.phases()]
        return [row["method"] for row in rows if row["verdict"] == "fails"]

    assert failing() == []
    in_float32 = before(lambda camera, phases: (camera, phases.float().double()))
    monkeypatch.setattr(MountedCamera, "intensity", in_float32(MountedCamera.intensity))
    assert "to 1e+07 rad" in failing()
