"""Arithmetic and words of the claims, written anew from docs/claims.md with numpy alone."""

from __future__ import annotations

import math

import numpy as np


def student(df: int) -> float:
    """The 97.5 % quantile of Student's t, by integrating its density."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    scale = math.exp(math.lgamma((df + 1) / 2) - math.lgamma(df / 2))
    scale /= math.sqrt(df * math.pi)

    def below(t: float) -> float:
        x = t / 2 * (nodes + 1)
        density = scale * (1 + x**2 / df) ** (-(df + 1) / 2)
        return 0.5 + float(t / 2 * weights @ density)

    low, high = 0.0, 20.0
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if below(middle) < 0.975 else (low, middle)
    return low


def paule_mandel(y: np.ndarray, v: np.ndarray) -> tuple[float, float]:
    """Mean and variance between, by bisection."""

    def mean_at(tau2: float) -> float:
        w = 1 / (v + tau2)
        return float((w * y).sum() / w.sum())

    def q_at(tau2: float) -> float:
        return float(((y - mean_at(tau2)) ** 2 / (v + tau2)).sum())

    if q_at(0.0) <= len(y) - 1:
        return mean_at(0.0), 0.0
    low, high = 0.0, 1.0
    while q_at(high) > len(y) - 1:
        high *= 2
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if q_at(middle) > len(y) - 1 else (low, middle)
    return mean_at(low), low


def pooled(values: list[float], variances: list[float]) -> dict[str, float]:
    """The five numbers of a row, and how many units."""
    y, v = np.array(values), np.array(variances)
    k = len(y)
    if k == 1:
        half = 1.959963984540054 * math.sqrt(v[0])
        return numbers(y[0], half, math.nan, 1)
    mean, tau2 = paule_mandel(y, v)
    w = 1 / (v + tau2)
    q = float((w * (y - mean) ** 2).sum()) / (k - 1)
    squared = max(1.0, q) / float(w.sum())
    half = student(k - 1) * math.sqrt(squared)
    around = student(k - 2) * math.sqrt(tau2 + squared) if k > 2 else math.nan
    return numbers(mean, half, around, k)


def numbers(mean: float, half: float, around: float, units: int) -> dict[str, float]:
    return {
        "mean": mean,
        "mean_low": mean - half,
        "mean_high": mean + half,
        "predicted_low": mean - around,
        "predicted_high": mean + around,
        "units": units,
    }


def by_laboratory(evidence: list[tuple[str, float, float]]) -> dict[str, float]:
    """Pooled over laboratories, of (laboratory, value, variance) a sensor."""
    labs: dict[str, list[tuple[float, float]]] = {}
    for lab, value, variance in evidence:
        labs.setdefault(lab, []).append((value, variance))
    values, variances = [], []
    for sensors in labs.values():
        each, within = np.array(sensors).T
        k = len(each)
        between = each.var(ddof=1) / k if k > 1 else 0.0
        values.append(float(each.mean()))
        variances.append(float(max(within.mean() / k, between)))
    return {**pooled(values, variances), **equal_weights(values)}


def equal_weights(values: list[float]) -> dict[str, float]:
    """The mean of laboratories, each of which weighs the same."""
    low, high = of_mean(np.array(values))
    return {"equal": float(np.mean(values)), "equal_low": low, "equal_high": high}


def spread(values: np.ndarray, n_test: float, seeds: bool) -> float:
    """Variance of the number of one sensor."""
    if len(values) < 2:
        return math.nan
    mean = abs(float(values.mean()))
    least = (n_test * mean + 1) / (n_test + 2) / n_test
    one = max(float(values.var(ddof=1)), least)
    return one / len(values) if seeds else one


def contrast(matrix: dict[tuple[str, str], float]) -> float:
    """The largest difference from a class's correlation with itself, in its row."""
    return max(abs(matrix[i, i] - value) for (i, _), value in matrix.items())


def of_mean(values: np.ndarray) -> tuple[float, float]:
    """Student's interval of a mean."""
    if len(values) < 2:
        return math.nan, math.nan
    half = student(len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values))
    return values.mean() - half, values.mean() + half


def above(low: float, high: float, limit: float) -> str:
    if low > limit:
        return "yes"
    return "no" if high < limit else "undecided"


def word_of(rule: str, found: dict, rules: dict, claim: dict) -> str:
    """The word of an interval across sensors."""
    if found["units"] < claim.get("least_units", 1):
        return "undecided"
    mean, low, high = found["mean"], found["mean_low"], found["mean_high"]
    margin = rules["margin"]
    limit = {"more_accurate": margin, "at_least_as_accurate": -margin}
    bound = limit.get(rule, claim.get("share"))
    if found["units"] < rules["few_units"] and low <= bound <= high:
        return "undecided"
    if rule == "more_accurate":
        if mean >= margin and low > 0:
            return "yes"
        return "no" if high < margin else "undecided"
    if rule == "at_least_as_accurate":
        if mean <= -margin and high < 0:
            return "no"
        return "yes" if low > -margin else "undecided"
    return above(low, high, bound)
