"""Temperature, and its effect on the phase of a path; docs/sensor.md has the equations.

A thermostat keeps the room within bounds, so a slow Gaussian process is mapped to a uniform
distribution; a fast small part is added. The sensitivity of a path is heavy-tailed, as path
lengths in a scattering medium are. The correlation of the field before and after a step of T is
E cos(S·T), and that of the intensity its square (the Siegert relation).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from scenes.validate import require_number

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Thermal:
    """Distribution of S over paths.

    Args:
        scale: k0·β·L in rad/K, β the thermo-optic coefficient plus expansion (dn/dT ≈ −5e-4 /K for
            PDMS), L a typical length (fitted: same-class correlation, accuracy at few samples).
        spread: σ of the logarithm (fitted with it; the median of ``|S|`` is then 68 rad/K).
        limit: rad/K above which the lognormal tail is unphysical: metres of path. Those paths get a
            magnitude uniform between 0.3·limit and limit; one common value would keep them
            coherent with each other.
    """

    scale: float = 124.0
    spread: float = 2.8
    limit: float = 1000.0

    def __post_init__(self) -> None:
        for name in ("scale", "spread"):
            require_number(f"scene.sensor.thermal.{name}", getattr(self, name), 0)
        require_number("scene.sensor.thermal.limit", self.limit, 0, strict=True)

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """S [count] in rad/K."""
        g = rng.standard_normal(count)
        logarithm = self.spread * rng.standard_normal(count)
        s = self.scale * g * np.exp(logarithm)
        share = rng.uniform(0.3, 1.0, count)
        replacement = np.sign(g) * self.limit * share
        return np.where(np.abs(s) > self.limit, replacement, s)


@dataclass(frozen=True)
class Room:
    """One session's temperature, as an offset from the first day's set point.

    Args:
        offset: T0 in K.
        slow: half-width of the slow variation in K; with ``fast`` the published ±0.2 °C.
        slow_time: τ of the slow part in samples (assumed).
        fast: standard deviation of the fast part in K.
        fast_time: τ of the fast part in samples (assumed).
    """

    offset: float = 0.0
    slow: float = 0.18
    slow_time: float = 40.0
    fast: float = 0.03
    fast_time: float = 3.0

    def __post_init__(self) -> None:
        require_number("scene.sessions.offset", self.offset, -np.inf)
        for name in ("slow", "fast", "slow_time", "fast_time"):
            number, strict = getattr(self, name), name.endswith("time")
            require_number(f"scene.sessions.{name}", number, 0, strict=strict)

    def temperatures(self, count: int, rng: np.random.Generator) -> Array:
        """T [count] in K at consecutive samples; the first m do not depend on ``count``."""
        x, y = rng.standard_normal((count, 2)).T
        normal = torch.from_numpy(_ornstein_uhlenbeck(x, self.slow_time))
        # Uniform in [−1, 1]: 2Φ(x) − 1 of the normal distribution function Φ.
        slow = self.slow * torch.erf(normal / math.sqrt(2)).numpy()
        fast = self.fast * _ornstein_uhlenbeck(y, self.fast_time)
        return self.offset + slow + fast


def _ornstein_uhlenbeck(noise: Array, time: float) -> Array:
    """Exact discretisation: x₀ = ξ₀, x_m = ρ·x_{m−1} + √(1 − ρ²)·ξ_m, ρ = e^{−1/τ}."""
    rho = np.exp(-1 / time)
    drive = noise * np.sqrt(1 - rho * rho)
    drive[:1] = noise[:1]
    series, x = np.empty_like(drive), 0.0
    for m, step in enumerate(drive):
        x = rho * x + step
        series[m] = x
    return series
