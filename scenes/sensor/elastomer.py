"""Displacement of an incompressible elastic layer, bonded to a rigid base, under a round contact.

The layer fills 0 ≤ z ≤ h; u_z and u_r under a Hertz pressure (Johnson, *Contact Mechanics*, 1985,
Eq. 3.39) are Hankel integrals of Φ(ka) and P, Q (docs/sensor.md; derived as by Dhaliwal & Rau, Int.
J. Eng. Sci. 8 (1970) 843), in metres per metre of indentation. Their sinh 2H − 2H cancels for thin
layers and cosh 2H overflows for thick ones. Neither appears here: the code integrates the
difference from the half-space, P∞ = (1 + kd)·e^{−kd}, Q∞ = kd·e^{−kd}, d = h − z, whose terms are
all of order e^{−2kz} and smaller and are formed without cancellation. The half-space is a closed
form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from hdc.parameters import check_integer
from scenes.validate import require_number

Array = NDArray[np.float64]

TAIL = 40.0  # the integrand is dropped where e^{−kh} < e^{−40}
INTERVALS = 400  # of a table
NODES_PER_PERIOD = 8  # Gauss-Legendre nodes a period of the fastest oscillation


def hertz_transform(x: Array) -> Array:
    """Φ(x) = (sin x − x·cos x)/x³ for x ≥ 0. Below 1, where the difference cancels, it is the power
    series Σ 2(n + 1)/(2n + 3)!·(−x²)ⁿ."""
    near, far = np.minimum(x, 1.0), np.maximum(x, 1.0)
    terms = [2 * (n + 1) / math.factorial(2 * n + 3) for n in range(10)]
    series = polynomial.polyval(-near * near, terms)
    closed = (np.sin(far) - far * np.cos(far)) / far**3
    return np.where(x < 1, series, closed)


def bessel(order: int, x: Array) -> Array:
    """J0 or J1 of x ≥ 0, to 1e-15.

    Below 25 it is the mean over an angle θ of cos(x·sin θ) or sin θ·sin(x·sin θ), beyond it
    Hankel's expansion √(2/πx)·Re[e^{iχ}·Σ a_k·(i/x)^k] with χ = x − (order + ½)·π/2 (Abramowitz
    and Stegun 9.1.18 and 9.2.5). SciPy has both, but a scene would load 66 modules for them.
    """
    found = np.zeros_like(x)
    is_near = x < 25
    near, far = x[is_near], x[~is_near]
    for sine in np.sin(np.pi * (np.arange(16) + 0.5) / 32):
        angle = near * sine
        found[is_near] += np.sin(angle) * sine if order else np.cos(angle)
    found[is_near] /= 16
    term = np.ones_like(far, dtype=complex)
    total = term.copy()
    for k in range(1, 21):
        term *= 1j * (4 * order**2 - (2 * k - 1) ** 2) / (8 * k) / far
        total += term
    wave = np.exp(1j * (far - (order + 0.5) * np.pi / 2))
    found[~is_near] = np.sqrt(2 / (np.pi * far)) * (wave * total).real
    return found


def layer_response(
    k: Array,
    z: Array,
    thickness: float,
) -> tuple[Array, Array]:
    """(P, Q) at wavenumbers k [1/m] and heights z [m], broadcast; nothing overflows."""
    near, far = _excess(k, z, thickness)
    kd = k * (thickness - z)
    p = near + (1 + kd) * np.exp(-kd)
    q = far + kd * np.exp(-kd)
    return p, q


def _excess(
    k: Array,
    z: Array,
    h: float,
) -> tuple[Array, Array]:
    """(P − P∞, Q − Q∞). From U's numerator N, with every sinh and cosh of s and H written out:

    P = −e^{−kd}·M/D,
    M = −kd(1 + e_s e_H) + (s + H)(e_s + e_H) − (1 − e_s)(1 + e_H) + 2sH(e_s − e_H)
    Q = −e^{−kd}·R/D,  R = −kd(1 − e_s)(1 + e_H) − 2sH(e_s + e_H)
    D = 1 + e_H² + 2 e_H (1 + 2H²),  e_s = e^{−2s},  e_H = e^{−2H}

    In a half-space M is −(1 + kd), R is −kd and D is 1.
    """
    big_h, s, kd = k * h, k * z, k * (h - z)
    es = np.exp(-2 * s)
    eh = np.exp(-2 * big_h)
    rest = eh**2 + 2 * eh * (1 + 2 * big_h**2)  # D − 1
    scale = -np.exp(-kd) / (1 + rest)
    p = (es - eh) * (1 + 2 * s * big_h)
    p = p + es * eh * (1 - kd)
    p = p + (s + big_h) * (es + eh)
    p = p + (1 + kd) * rest
    q = kd * (es - eh + es * eh + rest)
    q = q - 2 * s * big_h * (es + eh)
    return scale * p, scale * q


def half_space(
    r: Array,
    d: Array,
    a: float,
) -> tuple[Array, Array]:
    """∫ J0(kr) Φ(ka) P∞ dk and ∫ J1(kr) Φ(ka) Q∞ dk / r at depth d below the surface.

    Φ(ka) = ½∫₀¹ (1 − t²) cos(kat) dt turns them into ∫ (1 − t²)·f(ζ) dt along ζ = d + iat, where
    the integrals over k are powers of R = √(r² + ζ²) and those over t are elementary.
    """
    r = np.maximum(np.asarray(r, dtype=np.float64), 1e-9 * a)
    r, d = np.broadcast_arrays(r, np.asarray(d, dtype=np.float64))
    # 1 − t² = c0 + c1·ζ + c2·ζ²
    c0 = 1 + (d / a) ** 2
    c1 = -2 * d / a**2
    c2 = 1 / a**2

    def primitives(zeta: NDArray[Any]) -> tuple[NDArray[Any], ...]:
        root = np.sqrt(r * r + zeta * zeta)
        log = np.log(zeta + root)
        even = c0 * log + c1 * root
        even = even + c2 * (zeta * root - r * r * log) / 2
        # Only even counts on the surface, and R is 0 at r = a.
        root = np.where(d > 0, root, 1.0)
        bent = log - zeta / root
        slope = -c0 / root + c1 * bent
        slope = slope + c2 * (root + r * r / root)
        radial = -c0 / (root * (zeta + root))
        radial = radial - c1 / root + c2 * bent
        return even, slope, radial

    integrals = []
    ends = primitives(d + 1j * a), primitives(d + 0j)
    for upper, lower in zip(*ends, strict=True):
        integrals.append(np.real((upper - lower) / (1j * a)) / 2)
    even, slope, radial = integrals
    return even + d * slope, d * radial


@dataclass(frozen=True)
class RadialTable:
    """Cubic pieces of u_r/r [1/m] and u_z [1] in the stretched radius t = r/(r + c).

    ``coefficients`` [levels, intervals, 8]: four of u_r/r, four of u_z, lowest power first, in the
    fraction of an interval of width ``step``. Beyond ``reach`` the displacement is taken as zero.
    """

    coefficients: Array
    stretch: float
    reach: float

    @property
    def step(self) -> float:
        last = self.reach / (self.reach + self.stretch)
        return last / self.coefficients.shape[1]


@dataclass(frozen=True)
class Layer:
    """The silicone.

    Args:
        thickness: h in m (assumed: the published text gives no dimension).
        levels: number of heights inside the layer at which scattering happens, so that every table
            is a function of r alone. They are the nodes of the Gauss-Legendre rule on (0, h), drawn
            with its weights: the mean over paths of a polynomial in z up to degree 2·levels − 1 is
            that of uniform heights.
    """

    thickness: float = 5e-3
    levels: int = 16

    def __post_init__(self) -> None:
        require_number("scene.sensor.layer.thickness", self.thickness, 0, strict=True)
        check_integer("scene.sensor.layer.levels", self.levels, 1)

    @cached_property
    def heights(self) -> Array:
        """z of the levels [levels + 1] in m; the last is the free surface."""
        nodes, _ = np.polynomial.legendre.leggauss(self.levels)
        return np.append(self.thickness * (1 + nodes) / 2, self.thickness)

    @cached_property
    def weights(self) -> Array:
        """Probability of each inner level [levels]."""
        _, weights = np.polynomial.legendre.leggauss(self.levels)
        return weights / 2

    def displacement(
        self,
        r: Array,
        z: Array,
        radius: float,
    ) -> tuple[Array, Array]:
        """(u_r/r [1/m], u_z [1]) at radii [R] and heights [Z], each [R, Z], per metre of
        indentation by a contact of this radius: u_z(0, h) = −1."""
        u_r_over_r, sunk = _unscaled(r, z, radius, self.thickness)
        w0 = self.compliance(radius)
        return u_r_over_r / w0, -sunk / w0

    def compliance(self, radius: float) -> float:
        """w0 in 1/m: the dimensionless surface compliance ∫ Φ(ka) P(k, h) dk of a Hertz contact."""
        axis, surface = np.zeros(1), np.array([self.thickness])
        _, sunk = _unscaled(axis, surface, radius, self.thickness)
        return float(sunk[0, 0])


@lru_cache(maxsize=32)
def radial_table(layer: Layer, radius: float, extent: float) -> RadialTable:
    """Tabulated displacement at the levels; ``extent`` is the largest distance asked for."""
    # The tail falls by e in 1.15 h.
    reach = min(extent, radius + 30 * layer.thickness)
    stretch = 4 * radius  # steps near the contact about a/60, at r = 100 mm about h/2
    t = np.linspace(0, reach / (reach + stretch), INTERVALS + 1)
    r = stretch * t / (1 - t)
    pieces = []
    for values in layer.displacement(r, layer.heights, radius):
        pieces += _cubic_pieces(values)
    coefficients = np.stack(pieces, axis=-1).swapaxes(0, 1)
    return RadialTable(coefficients.copy(), stretch, reach)


def _cubic_pieces(values: Array) -> list[Array]:
    """Coefficients, lowest power first, of the cubic spline through values [n + 1, levels] one unit
    apart: four [n, levels]. Its slope is zero at the first, for a function that is even there, and
    its third derivative does not jump at the last but one."""
    n = len(values)
    system = np.eye(n, k=-1) + 4 * np.eye(n) + np.eye(n, k=1)
    right = np.zeros_like(values)
    right[1:-1] = 3 * (values[2:] - values[:-2])
    system[0, :2] = 1, 0
    system[-1, -2:] = 2, 1
    steps = np.diff(values, axis=0)
    right[-1] = (5 * steps[-1] + steps[-2]) / 2
    slopes = np.linalg.solve(system, right)
    first, last = slopes[:-1], slopes[1:]
    square = 3 * steps - 2 * first - last
    return [values[:-1], first, square, first + last - 2 * steps]


def _unscaled(
    r: Array,
    z: Array,
    radius: float,
    h: float,
) -> tuple[Array, Array]:
    """u_r/r and u_z before the division by w0, [len(r), len(z)]."""
    k, weight = _nodes(TAIL / h, float(r.max()) + radius)
    p, q = _excess(k[:, None], z, h)
    weight = weight * hertz_transform(k * radius)
    weight = weight[:, None]
    r = r[:, None]
    kr = r * k
    # J1(x)/x → 1/2 on the axis.
    off_axis = bessel(1, kr) / np.maximum(r, 1e-300)
    j1_over_r = np.where(kr > 1e-8, off_axis, k / 2)
    space_z, space_r = half_space(r, h - z, radius)
    u_r_over_r = space_r + j1_over_r @ (weight * q)
    sunk = space_z + bessel(0, kr) @ (weight * p)
    return u_r_over_r, sunk


def _nodes(k_max: float, length: float) -> tuple[Array, Array]:
    """Composite Gauss-Legendre nodes and weights on (0, k_max) for oscillations e^{ik·length}."""
    periods = k_max * length / (2 * math.pi)
    panels = 16 + math.ceil(periods * NODES_PER_PERIOD / 16)
    x, w = np.polynomial.legendre.leggauss(16)
    edges = np.linspace(0, k_max, panels + 1)
    half = (edges[1] - edges[0]) / 2
    nodes = edges[:-1, None] + half * (1 + x)
    return nodes.ravel(), np.tile(half * w, panels)
