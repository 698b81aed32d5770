"""Where accuracy crosses 90 %: counts, and theory against draws of its assumptions."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.studies.crossing import measure, view
from hdc import theory
from hdc.theory import Correlations

MODELS = {
    name: configs.part("model", name) for name in ("hdc", "hdc_random_ties", "ridge")
}


def test_experiments(small_scene):
    rows = pd.DataFrame(
        measure.crossing.rows(Run(), small_scene, MODELS, [0, 1], 2, [2, 5], 4)
    )
    assert len(rows) == 2 * 2 * 3
    tidy = view.tidy(rows)
    assert len(tidy) == 4 * len(rows)
    assert tidy.accuracy.between(0, 1).all()
    assert tidy.equal.tolist()[:4] == [True, False, True, False]
    expected = pd.DataFrame(
        measure.crossing_theory.rows(Run(), small_scene, [0], [2, 5])
    )
    assert expected[["hdc", "hdc_gaussian", "mean_image"]].stack().between(0, 1).all()
    with pytest.raises(ValueError, match=r"task\.n_train: .* found \[9, 5\]"):
        next(measure.crossing_theory.rows(Run(), small_scene, [0], [9, 5]))


def equal(same, other, n_classes=3):
    """Correlations of classes that are all alike, without scatter."""
    mean = np.full((n_classes, n_classes), float(other))
    np.fill_diagonal(mean, same)
    none = np.zeros_like(mean)
    return Correlations(mean, none, none, none)


def simulated(same, other, shares, dimension, repetitions):
    """Share of queries that HDC has right on bits drawn as the theory assumes, ties at random."""
    rng, right = np.random.default_rng(0), []
    rho, between = (np.sin(np.pi / 2 * c) for c in (same, other))
    for _ in range(repetitions):
        common = np.sqrt(between) * rng.standard_normal(dimension)
        means = common + np.sqrt(rho - between) * rng.standard_normal((3, dimension))

        def sample(c, means=means):
            return np.sign(means[c] + np.sqrt(1 - rho) * rng.standard_normal(dimension))

        ties = 0.1 * rng.choice([-1, 1], (3, dimension))
        sums = [sum(sample(c) for _ in range(shares[c])) for c in range(3)]
        prototypes = np.sign(np.array(sums) + ties)
        right += [(prototypes @ sample(c)).argmax() == c for c in range(3)]
    return np.mean(right)


@pytest.mark.parametrize("shares", [(1, 1, 1), (4, 4, 4), (7, 7, 7)])
def test_theory_is_the_mean_of_draws_of_its_assumptions(shares):
    right = simulated(0.2, 0.15, shares, 400, 500)
    expected = theory.hdc_accuracy(equal(0.2, 0.15), sum(shares), 400)
    assert abs(right - expected) < 3 * np.sqrt(expected * (1 - expected) / 1500) + 0.005


def test_one_sample_more_in_one_class_attracts_queries():
    expected = theory.hdc_accuracy(equal(0.12, 0.1), 7, 4000)
    assert simulated(0.12, 0.1, (3, 2, 2), 4000, 150) == pytest.approx(
        expected, abs=0.06
    )
    assert expected < 0.6 < theory.hdc_accuracy(equal(0.12, 0.1), 6, 4000)


def test_limits():
    assert theory.hdc_accuracy(equal(0.1, 0.1), 30, 1000) == pytest.approx(
        1 / 3, abs=1e-6
    )
    assert theory.hdc_accuracy(equal(1, 0), 30, 1000) == pytest.approx(1, abs=1e-6)
    # One sample: the correlation with a fresh one is that of a pair.
    single = theory.expected(equal(0.3, 0.1).mean, np.ones(3, int))[0]
    assert single == pytest.approx([0.3, 0.1, 0.1], abs=1e-6)
    # Many: the prototype is the sign of the class's own Gaussian, and E b·sign(z) = (2/π)·asin √ρ.
    many = theory.expected(equal(0.3, 0.1).mean, np.full(3, 10**7))[0, 0]
    rho = np.sin(np.pi / 2 * 0.3)
    assert many == pytest.approx(2 / np.pi * np.arcsin(np.sqrt(rho)), abs=5e-3)
    rising = [theory.hdc_accuracy(equal(0.12, 0.1), n, 10**4) for n in (3, 9, 30, 300)]
    assert rising == sorted(rising)


@pytest.mark.parametrize("skewness", [0, 4.0])
@pytest.mark.parametrize("model", ["hdc", "mean_image"])
def test_scatter_is_a_mean_of_skewed_numbers(skewness, model):
    # Small correlations: scores are means of N_s draws of a gamma distribution about C.
    scatter, n = np.full((2, 2), 0.02), 3
    moments = equal(0.03, 0.02, 2)._replace(
        sample=scatter, skew=np.full((2, 2), skewness)
    )
    noise = np.random.default_rng(1).standard_normal((2, 40_000, n))
    if skewness:
        shape = 4 / skewness**2
        draws = np.random.default_rng(1).gamma(shape, size=noise.shape)
        noise = (draws - shape) / np.sqrt(shape)
    own, other = 0.02 * noise.mean(-1) + np.array([[0.03], [0.02]])
    expected = {
        "hdc": theory.hdc_accuracy(moments, 2 * n, 1e12),
        "mean_image": theory.mean_image_accuracy(moments, 2 * n),
    }
    assert expected[model] == pytest.approx((own > other).mean(), abs=0.01)


def test_moments_are_those_of_the_pairs():
    rng, labels = np.random.default_rng(2), np.repeat([0, 1], 60)
    same = labels[:, None] == labels
    of_query = np.where(labels == 0, 0.02, 0) * rng.standard_normal(120)
    # A query of class 0 has more or less of its own class only.
    pairs = (
        0.1
        + 0.05 * same
        + 0.03 * rng.standard_normal((120, 120))
        + of_query[:, None] * same
    )
    moments = theory.correlations(pairs, labels)
    np.testing.assert_allclose(moments.mean, [[0.15, 0.1], [0.1, 0.15]], atol=0.008)
    np.testing.assert_allclose(moments.sample, 0.03, atol=0.002)
    np.testing.assert_allclose(
        moments.query[0], 0.01, atol=0.003
    )  # half is common to both
    assert moments.query[1].max() < 0.004
    with pytest.raises(
        ValueError, match="expected three samples of every class, found 2"
    ):
        theory.correlations(np.eye(5), np.array([0, 0, 0, 1, 1]))


def test_first_crossings():
    """Two sensors with two experiments each: HDC is above 90 % first at 15, 25, 25 and never."""
    n = list(range(10, 31))
    rows = pd.DataFrame([
        {"seed": seed, "draw": draw, "model": "hdc", "n_classes": 5, "n_test": 100, "n": n,
         "right": [95 if k >= first and k % 5 == 0 else 90 for k in n]}
        for seed, draw, first in ((0, 0, 15), (0, 1, 25), (1, 0, 25), (1, 1, 99))
    ])  # fmt: skip
    line = view.first(rows, {}).iloc[0]
    assert line[["first", "first_low", "first_high"]].tolist() == [25, 15, np.inf]
