"""The elastic layer, thin and thick; references are mpmath and closed forms of elasticity."""

from __future__ import annotations

from functools import partial
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray
from scipy import special

from experiments.studies.stability.case import Forms, case
from scenes.sensor.elastomer import Layer, hertz_transform, layer_response

Array = NDArray[np.float64]
A = 2.45e-3  # m, radius of the robot's contact

layer_case = partial(case, "layer")


def profile(s: Any, big_h: Any, lib: Any) -> Any:
    """P = w̄·U of the layer as the formulas stand: s = kz, H = kh, functions of `lib`."""

    def numerator(x: Any) -> Any:
        sinh, cosh = lib.sinh(big_h), lib.cosh(big_h)
        return big_h * cosh * x * lib.sinh(x) + (cosh + big_h * sinh) * (
            lib.sinh(x) - x * lib.cosh(x)
        )

    stiffness = (lib.sinh(2 * big_h) - 2 * big_h) / (lib.cosh(2 * big_h) + 1 + 2 * big_h**2)
    return stiffness * numerator(s) / numerator(big_h)


def profiles(big_h: Array, share: Array) -> Forms:
    """P at wavenumbers H of a layer of thickness one, at heights that are a share of it."""
    with mpmath.workdps(60):
        points = [[mpmath.mpf(x) for x in pair] for pair in zip(big_h, share, strict=True)]
        exact = np.array([float(profile(h * z, h, mpmath)) for h, z in points])
    return Forms(
        lambda: profile(big_h * share, big_h, np),
        lambda: layer_response(big_h, share, 1.0)[0],
        lambda values: float(np.abs(values / exact - 1).max()),
    )


profile_case = partial(
    layer_case,
    naive="sinh and cosh as the formula stands",
    ours="elastomer.layer_response",
    unit="relative",
    tolerance=1e-10,
)


@profile_case(extreme="kh from 10 to 2000: cosh 2kh overflows above 355, ∞/∞ is NaN")
def a_layer_thick_for_its_waves() -> Forms:
    big_h = np.geomspace(10, 2000, 40)
    return profiles(big_h, 1 - 1 / big_h)  # one over k below the surface


@profile_case(extreme="kh from 0.0001 to 0.05: sinh 2kh − 2kh cancels as (kh)^-2")
def a_layer_thin_for_its_waves() -> Forms:
    return profiles(np.geomspace(1e-4, 0.05, 40), np.full(40, 0.5))


def trapezoid(thickness: float, r: Array) -> Array:
    """∫ J0(kr) Φ(ka) w̄(kh) dk up to 200/a by the trapezoidal rule, the formula as it stands."""
    k = np.linspace(1e-9, 200 / A, 20_001)
    big_h = k * thickness
    surface = (np.sinh(2 * big_h) - 2 * big_h) / (np.cosh(2 * big_h) + 1 + 2 * big_h**2)
    return np.trapezoid(special.j0(np.outer(r, k)) * hertz_transform(k * A) * surface, k)


@layer_case(
    extreme="10 µm under a contact of 2.45 mm: ten million times as stiff as a half-space. "
    "Reference: the lubrication limit, 4h³/(3a⁴)·(1 + 7.2 h²/a²)",
    naive="trapezoidal rule to k = 200/a",
    ours="Layer.compliance",
    unit="relative",
    tolerance=1e-4,
)
def a_layer_ten_micrometres_thick() -> Forms:
    h = 1e-5
    # P = (2/3)H³(1 − 9H²/5 + …) at the surface, and k² acts as −∇² on the pressure √(1 − r²/a²).
    exact = 4 * h**3 / (3 * A**4) * (1 + 7.2 * (h / A) ** 2)
    return Forms(
        lambda: float(trapezoid(h, np.zeros(1))[0]),
        lambda: Layer(thickness=h).compliance(A),
        lambda w0: abs(w0 / exact - 1),
    )


def sunk(layer: Layer, r: Array) -> Array:
    """How far the surface sinks at radii r, per indentation."""
    return -layer.displacement(r, np.array([layer.thickness]), A)[1][:, 0]


def hertz(r: Array) -> Array:
    """Surface of a half-space under a Hertz contact, per indentation (Johnson, Eqs. 3.41, 3.42)."""
    outer = np.maximum(r, A)
    tail = (2 * A**2 - outer**2) * np.arcsin(A / outer) + A * np.sqrt(outer**2 - A**2)
    return np.where(r <= A, 1 - r**2 / (2 * A**2), tail / (np.pi * A**2))


@layer_case(
    extreme="a layer of 1 km: the half-space of Hertz, out to 20 contact radii; cosh overflows",
    naive="trapezoidal rule to k = 200/a",
    ours="Layer.displacement",
    unit="of the indentation",
    tolerance=1e-5,
)
def a_layer_a_kilometre_thick() -> Forms:
    r = np.array([0.0, 0.5, 1.0, 2.0, 20.0]) * A

    def naive() -> Array:
        surface = trapezoid(1e3, r)
        return surface / surface[0]

    return Forms(
        naive, lambda: sunk(Layer(thickness=1e3), r), lambda w: float(np.abs(w - hertz(r)).max())
    )


@layer_case(
    extreme="incompressible (ν = 1/2): the volume pressed in comes out elsewhere; a half-space "
    "lets it go to infinity",
    naive="Hertz's half-space for a layer of 5 mm",
    ours="Layer.displacement",
    unit="of the volume moved",
    tolerance=1e-4,
)
def volume_of_the_layer() -> Forms:
    r = np.linspace(0, 0.12, 6001)
    return Forms(
        lambda: hertz(r),
        lambda: sunk(Layer(thickness=5e-3), r),
        lambda u: abs(np.trapezoid(u * r, r)) / np.trapezoid(np.abs(u) * r, r),
    )
