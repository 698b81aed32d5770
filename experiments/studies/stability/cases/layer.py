"""The elastic layer, thin and thick; references are mpmath and closed forms of elasticity."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray
from scipy import special

from experiments.studies.stability.case import case, relative
from scenes.sensor.elastomer import Layer, hertz_transform, layer_response

Array = NDArray[np.float64]
A = 2.45e-3  # m, radius of the robot's contact


def layer_case(extreme: str, naive: str, ours: str, unit: str = "relative", **rest: Any) -> Any:
    return case("layer", extreme, naive, ours, unit, **rest)


def surface_response(big_h: Any, lib: Any) -> Any:
    """w̄ of the layer at its surface as the formula stands, H = kh."""
    return (lib.sinh(2 * big_h) - 2 * big_h) / (lib.cosh(2 * big_h) + 1 + 2 * big_h**2)


def profile(s: Any, big_h: Any, lib: Any) -> Any:
    """P = w̄·U of the layer as the formulas stand: s = kz, H = kh, functions of `lib`."""

    def numerator(x: Any) -> Any:
        sinh, cosh = lib.sinh(big_h), lib.cosh(big_h)
        return big_h * cosh * x * lib.sinh(x) + (cosh + big_h * sinh) * (
            lib.sinh(x) - x * lib.cosh(x)
        )

    return surface_response(big_h, lib) * numerator(s) / numerator(big_h)


def profiles(big_h: Array, share: Array) -> Any:
    """P at wavenumbers H of a layer of thickness one, at heights that are a share of it."""
    with mpmath.workdps(60):
        points = [[mpmath.mpf(x) for x in pair] for pair in zip(big_h, share, strict=True)]
        exact = [float(profile(h * z, h, mpmath)) for h, z in points]
    return (
        lambda: profile(big_h * share, big_h, np),
        lambda: layer_response(big_h, share, 1.0)[0],
        exact,
    )


def profile_case(extreme: str) -> Any:
    texts = extreme, "sinh and cosh as the formula stands", "elastomer.layer_response"
    return layer_case(*texts, error=relative, tolerance=1e-10)


@profile_case("kh from 10 to 2000: cosh 2kh overflows above 355, ∞/∞ is NaN")
def a_layer_thick_for_its_waves() -> Any:
    big_h = np.geomspace(10, 2000, 40)
    return profiles(big_h, 1 - 1 / big_h)  # one over k below the surface


@profile_case("kh from 0.0001 to 0.05: sinh 2kh − 2kh cancels as (kh)^-2")
def a_layer_thin_for_its_waves() -> Any:
    return profiles(np.geomspace(1e-4, 0.05, 40), np.full(40, 0.5))


def trapezoid(thickness: float, r: Array) -> Array:
    """∫ J0(kr) Φ(ka) w̄(kh) dk up to 200/a by the trapezoidal rule, the formula as it stands."""
    k = np.linspace(1e-9, 200 / A, 20_001)
    waves = special.j0(np.outer(r, k)) * hertz_transform(k * A)
    return np.trapezoid(waves * surface_response(k * thickness, np), k)


@layer_case(
    "10 µm under a contact of 2.45 mm: ten million times as stiff as a half-space. "
    "Reference: the lubrication limit, 4h³/(3a⁴)·(1 + 7.2 h²/a²)",
    "trapezoidal rule to k = 200/a", "Layer.compliance", error=relative, tolerance=1e-4,
)  # fmt: skip
def a_layer_ten_micrometres_thick() -> Any:
    h = 1e-5
    # P = (2/3)H³(1 − 9H²/5 + …) at the surface, and k² acts as −∇² on the pressure √(1 − r²/a²).
    exact = 4 * h**3 / (3 * A**4) * (1 + 7.2 * (h / A) ** 2)
    return lambda: trapezoid(h, np.zeros(1)), lambda: Layer(thickness=h).compliance(A), exact


def displaced(layer: Layer, r: Array) -> Array:
    """How far the surface sinks at radii r, per indentation."""
    return -layer.displacement(r, np.array([layer.thickness]), A)[1][:, 0]


def hertz(r: Array) -> Array:
    """Surface of a half-space under a Hertz contact, per indentation (Johnson, Eqs. 3.41, 3.42)."""
    outer = np.maximum(r, A)
    tail = (2 * A**2 - outer**2) * np.arcsin(A / outer) + A * np.sqrt(outer**2 - A**2)
    return np.where(r <= A, 1 - r**2 / (2 * A**2), tail / (np.pi * A**2))


@layer_case(
    "a layer of 1 km: the half-space of Hertz, out to 20 contact radii; cosh overflows",
    "trapezoidal rule to k = 200/a", "Layer.displacement", "of the indentation", tolerance=1e-5,
)  # fmt: skip
def a_layer_a_kilometre_thick() -> Any:
    r = np.array([0.0, 0.5, 1.0, 2.0, 20.0]) * A

    def naive() -> Array:
        surface = trapezoid(1e3, r)
        return surface / surface[0]

    return naive, lambda: displaced(Layer(thickness=1e3), r), hertz(r)


@layer_case(
    "incompressible (ν = 1/2): the volume pressed in comes out elsewhere; a half-space "
    "lets it go to infinity",
    "Hertz's half-space for a layer of 5 mm", "Layer.displacement", "of the volume moved",
    tolerance=1e-4,
)  # fmt: skip
def volume_of_the_layer() -> Any:
    r = np.linspace(0, 0.12, 6001)

    def moved(u: Array) -> float:
        return float(np.trapezoid(u * r, r) / np.trapezoid(np.abs(u) * r, r))

    return lambda: moved(hertz(r)), lambda: moved(displaced(Layer(thickness=5e-3), r)), 0
