"""The elastic layer, thin and thick; references are mpmath and closed forms of elasticity."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from functools import partial
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray
from scipy import special

from experiments.studies.stability.case import Trial, case
from scenes.sensor.elastomer import Layer, hertz_transform, layer_response

Array = NDArray[np.float64]
A = 2.45e-3  # m, radius of the robot's contact

sensor_case = partial(case, "sensor")


def profile(s: Any, big_h: Any, lib: Any) -> Any:
    """P = w̄·U of the layer as the formulas stand: s = kz, H = kh, functions of `lib`."""

    def numerator(x: Any) -> Any:
        sinh, cosh = lib.sinh(big_h), lib.cosh(big_h)
        return big_h * cosh * x * lib.sinh(x) + (cosh + big_h * sinh) * (
            lib.sinh(x) - x * lib.cosh(x)
        )

    stiffness = (lib.sinh(2 * big_h) - 2 * big_h) / (lib.cosh(2 * big_h) + 1 + 2 * big_h**2)
    return stiffness * numerator(s) / numerator(big_h)


def profiles(big_h: Array, share: Array) -> Trial:
    """P at wavenumbers H of a layer of thickness one, at heights that are a share of it."""
    with mpmath.workdps(60):
        exact = np.array(
            [
                float(profile(mpmath.mpf(h) * mpmath.mpf(z), mpmath.mpf(h), mpmath))
                for h, z in zip(big_h.tolist(), share.tolist(), strict=True)
            ]
        )

    def naive() -> Array:
        with np.errstate(all="ignore"):
            return profile(big_h * share, big_h, np)

    return Trial(
        naive=naive,
        ours=lambda: layer_response(big_h, share, 1.0)[0],
        error=lambda found: float(np.abs(found / exact - 1).max()),
    )


PROFILE: dict[str, Any] = {
    "reference": "mpmath, 60 digits",
    "unit": "relative",
    "naive": "sinh and cosh as the formula stands",
    "ours": "elastomer.layer_response",
}


@sensor_case(
    extreme="kh from 10 to 2000: cosh 2kh overflows above 355",
    expected="10 digits; ∞/∞ is NaN",
    tolerance=1e-10,
    **PROFILE,
)
def a_layer_thick_for_its_waves() -> Trial:
    big_h = np.geomspace(10, 2000, 40)
    return profiles(big_h, 1 - 1 / big_h)  # one over k below the surface


@sensor_case(
    extreme="kh from 0.0001 to 0.05: sinh 2kh − 2kh cancels",
    expected="10 digits; the formula as it stands keeps eight, its rounding grows as (kh)^-2",
    tolerance=1e-10,
    **PROFILE,
)
def a_layer_thin_for_its_waves() -> Trial:
    big_h = np.geomspace(1e-4, 0.05, 40)
    return profiles(big_h, np.full(40, 0.5))


def layers(thickness: float) -> Iterator[Layer]:
    """Layers that differ by nothing: one keeps what it has computed, and each call is timed."""
    for i in itertools.count():
        yield Layer(thickness=thickness * (1 + 1e-13 * i))


def trapezoid(thickness: float, r: Array) -> Array:
    """∫ J0(kr) Φ(ka) w̄(kh) dk up to 200/a by the trapezoidal rule, the formula as it stands."""
    k = np.linspace(1e-9, 200 / A, 20_001)
    big_h = k * thickness
    with np.errstate(all="ignore"):
        surface = (np.sinh(2 * big_h) - 2 * big_h) / (np.cosh(2 * big_h) + 1 + 2 * big_h**2)
    return np.trapezoid(special.j0(np.outer(r, k)) * hertz_transform(k * A) * surface, k)


@sensor_case(
    extreme="10 µm under a contact of 2.45 mm: ten million times as stiff as a half-space",
    expected="w0 = 4h³/(3a⁴)·(1 + 7.2 h²/a²), the lubrication limit, to four digits",
    reference="series of the closed form in h/a",
    unit="relative",
    naive="trapezoidal rule to k = 200/a",
    ours="Layer.compliance",
    tolerance=1e-4,
)
def a_layer_ten_micrometres_thick() -> Trial:
    h, fresh = 1e-5, layers(1e-5)
    # P = (2/3)H³(1 − 9H²/5 + …) at the surface, and k² acts as −∇² on the pressure √(1 − r²/a²).
    exact = 4 * h**3 / (3 * A**4) * (1 + 7.2 * (h / A) ** 2)
    return Trial(
        naive=lambda: float(trapezoid(h, np.zeros(1))[0]),
        ours=lambda: next(fresh).compliance(A),
        error=lambda w0: abs(w0 / exact - 1),
    )


def sunk(layer: Layer, r: Array) -> Array:
    """How far the surface sinks at radii r, per indentation."""
    return -layer.displacement(r, np.array([layer.thickness]), A)[1][:, 0]


def hertz(r: Array) -> Array:
    """Surface of a half-space under a Hertz contact, per indentation (Johnson, Eqs. 3.41, 3.42)."""
    outer = np.maximum(r, A)
    tail = (2 * A**2 - outer**2) * np.arcsin(A / outer) + A * np.sqrt(outer**2 - A**2)
    return np.where(r <= A, 1 - r**2 / (2 * A**2), tail / (np.pi * A**2))


@sensor_case(
    extreme="a layer of 1 km: the half-space of Hertz and Boussinesq",
    expected="five digits out to 20 contact radii; cosh overflows",
    reference="Hertz's closed form",
    unit="of the indentation",
    naive="trapezoidal rule to k = 200/a",
    ours="Layer.displacement",
    tolerance=1e-5,
)
def a_layer_a_kilometre_thick() -> Trial:
    fresh, r = layers(1e3), np.array([0.0, 0.5, 1.0, 2.0, 20.0]) * A

    def naive() -> Array:
        surface = trapezoid(1e3, r)
        return surface / surface[0]

    return Trial(
        naive=naive,
        ours=lambda: sunk(next(fresh), r),
        error=lambda found: float(np.abs(found - hertz(r)).max()),
    )


@sensor_case(
    extreme="exactly incompressible (ν = 1/2 is built in): what is pressed in comes out elsewhere",
    expected="no change of volume to 10^-4 of what moves; a half-space lets it go to infinity",
    reference="zero",
    unit="of the volume moved",
    naive="Hertz's half-space for a layer of 5 mm",
    ours="Layer.displacement",
    tolerance=1e-4,
)
def volume_of_the_layer() -> Trial:
    fresh, r = layers(5e-3), np.linspace(0, 0.12, 6001)
    return Trial(
        naive=lambda: hertz(r),
        ours=lambda: sunk(next(fresh), r),
        error=lambda u: abs(np.trapezoid(u * r, r)) / np.trapezoid(np.abs(u) * r, r),
    )
