"""Intervals written anew, with numpy alone."""

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


def mean_share(name: str, shares: list[float], n: float) -> dict[str, float]:
    """Mean of shares of n samples, one per seed, with Student's interval; two right and two wrong
    more make their least variance. Of one seed Wilson's interval."""
    if not shares:
        return {name: math.nan}
    mean, seeds = float(np.mean(shares)), len(shares)
    if seeds == 1:
        z = 1.959963984540054
        centre = (mean + z**2 / (2 * n)) / (1 + z**2 / n)
        half = (
            z * math.sqrt(mean * (1 - mean) / n + (z / (2 * n)) ** 2) / (1 + z**2 / n)
        )
        low, high = centre - half, centre + half
    else:
        p = (sum(shares) * n + 2) / (seeds * n + 4)
        variance = max(float(np.var(shares, ddof=1)), p * (1 - p) / n)
        half = student(seeds - 1) * math.sqrt(variance / seeds)
        low, high = mean - half, mean + half
    return {name: mean, f"{name}_low": max(0.0, low), f"{name}_high": min(1.0, high)}


def median_range(name: str, values: list[float]) -> dict[str, float]:
    """Median with its order-statistic interval of 95 %; of too few values least and most."""
    ordered, n = sorted(values), len(values)
    found = {name: float(np.median(ordered))}
    if n == 1:
        return found
    chance = [math.comb(n, j) / 2**n for j in range(n + 1)]
    inner = 0
    while inner < n // 2 and sum(chance[: inner + 1]) <= 0.025:
        inner += 1
    inner = max(inner, 1)
    return found | {
        f"{name}_low": ordered[inner - 1],
        f"{name}_high": ordered[n - inner],
    }
