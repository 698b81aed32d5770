"""The layer against closed forms, its differential equation and its limits."""

import numpy as np
import pytest
from scipy import special

from scenes.sensor.elastomer import (
    Layer,
    bessel,
    half_space,
    hertz_transform,
    layer_response,
)

A = 2.45e-3


@pytest.mark.parametrize("k", [0.3, 1.5, 6.0])
def test_response_is_in_equilibrium_under_a_pressure(k):
    """U⁗ − 2U″ + U = 0 in s = kz without body forces (Stokes); bonded below, and at the surface no
    shear, U″ + U = 0, and a pressure of one, U‴ − 3U′ = −2."""
    s = k * (1 - np.cos(np.pi * np.linspace(0, 1, 30))) / 2
    found_p, found_q = layer_response(np.array(k), s / k, 1.0)
    p = np.polynomial.Chebyshev.fit(s, found_p, 22)
    first, second, third, fourth = (p.deriv(n) for n in (1, 2, 3, 4))
    assert np.allclose(first(s), found_q, atol=1e-10)
    inside = s[5:-5]
    assert np.abs(fourth(inside) - 2 * second(inside) + p(inside)).max() < 1e-3
    assert np.abs([p(0), first(0), second(k) + p(k)]).max() < 1e-7
    assert third(k) - 3 * first(k) == pytest.approx(-2, abs=1e-4)


def test_a_thin_layer_sinks_by_the_cube_of_its_thickness_and_a_thick_one_as_half_a_space():
    thin, thick = np.array([1e-3, 1e-2]), np.array([300, 1e4])
    sunk, _ = layer_response(thin, np.array(1.0), 1.0)
    assert sunk[1] == pytest.approx(1e3 * sunk[0], rel=1e-3)
    sunk, along = layer_response(thick, np.array(1.0), 1.0)
    assert np.allclose(sunk, 1, rtol=1e-12)
    assert np.abs(along).max() < 1e-12
    below, _ = layer_response(thick, np.array(0.99), 1.0)
    depth = thick * 0.01
    assert np.allclose(below, (1 + depth) * np.exp(-depth), rtol=1e-9)


def test_bessel_functions_and_the_transform_are_those_of_scipy():
    x = np.concatenate([np.linspace(0, 2000, 40_001), [1e-8, 0.99, 1, 24.99, 25, 1e4]])
    assert np.allclose(bessel(0, x), special.j0(x), rtol=0, atol=2e-14)
    assert np.allclose(bessel(1, x), special.j1(x), rtol=0, atol=2e-14)
    spherical = special.spherical_jn(1, x[1:]) / x[1:]
    assert np.allclose(hertz_transform(x[1:]), spherical, rtol=1e-11, atol=1e-16)
    assert hertz_transform(np.zeros(1)) == pytest.approx(1 / 3)


def test_half_space_surface_is_hertz():
    # Johnson, Contact Mechanics (1985), Eq. 3.42; inside the contact a paraboloid. The surface
    # sinks by pi/4 of the integral's unit, 1/a.
    r = np.array([0.0, 0.5, 1.0, 1.001, 2.0, 50.0]) * A
    outer = np.maximum(r, A)
    tail = (2 * A**2 - outer**2) * np.arcsin(A / outer) + A * np.sqrt(outer**2 - A**2)
    closed = np.where(r <= A, 1 - r**2 / (2 * A**2), tail / (np.pi * A**2))
    sunk, _ = half_space(r, np.array(0.0), A)
    assert np.allclose(sunk / sunk[0], closed, atol=2e-9)


@pytest.mark.parametrize("thickness", [1e-5, 1e-3, 5e-3, 0.1])
def test_base_is_fixed_surface_sinks_by_one(thickness):
    layer = Layer(thickness=thickness)
    r = np.linspace(0, 4 * A, 9)
    u_r_over_r, u_z = layer.displacement(r, np.array([0.0, thickness]), A)
    # Ten micrometres under a contact of 2.45 mm lose seven digits to the half-space part.
    tolerance = 1e-12 * max(1.0, (A / thickness) ** 3)
    assert np.abs([u_r_over_r[:, 0] * r, u_z[:, 0]]).max() < tolerance
    assert u_z[0, 1] == pytest.approx(-1, abs=tolerance)
