"""The layer against closed forms, against arbitrary precision and against finite elements."""

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j0

from scenes.sensor.elastomer import Layer, half_space, hertz_transform, layer_response

A = 2.45e-3


def exact_response(k, z, h):
    """P and Q as the equations read, in 60 digits."""
    with mpmath.workdps(60):
        big_h, s = mpmath.mpf(k) * h, mpmath.mpf(k) * z
        sinh, cosh = mpmath.sinh, mpmath.cosh
        w = (sinh(2 * big_h) - 2 * big_h) / (cosh(2 * big_h) + 1 + 2 * big_h**2)
        first, second = cosh(big_h) + big_h * sinh(big_h), big_h * cosh(big_h)
        below = -(sinh(2 * big_h) - 2 * big_h) / 2
        u = ((s * cosh(s) - sinh(s)) * first - s * sinh(s) * second) / below
        slope = (s * sinh(s) * first - (sinh(s) + s * cosh(s)) * second) / below
        return float(w * u), float(w * slope)


@pytest.mark.parametrize("kh", [1e-6, 1e-3, 0.05, 1.0, 20.0, 300.0, 1e4])
@pytest.mark.parametrize("height", [0.0, 0.01, 0.5, 0.999, 1.0])
def test_response_at_any_thickness_equals_the_equations(kh, height):
    found = layer_response(np.array(kh), np.array(height), 1.0)
    assert np.allclose(found, exact_response(kh, height, 1.0), rtol=0, atol=1e-15)


@pytest.mark.parametrize("kh", [1e-6, 1e-3, 0.05, 0.999, 1.001])
@pytest.mark.parametrize("height", [0.01, 0.5, 1.0])
def test_response_of_a_thin_layer_keeps_its_digits(kh, height):
    found = layer_response(np.array(kh), np.array(height), 1.0)
    assert np.allclose(found, exact_response(kh, height, 1.0), rtol=1e-10, atol=0)


def test_half_space_surface_is_hertz():
    # Johnson, Contact Mechanics (1985), Eq. 3.42; inside the contact a paraboloid. The surface
    # sinks by pi/4 of the integral's unit, 1/a.
    r = np.array([0.0, 0.5, 1.0, 1.001, 2.0, 50.0]) * A
    outer = np.maximum(r, A)
    tail = (2 * A**2 - outer**2) * np.arcsin(A / outer) + A * np.sqrt(outer**2 - A**2)
    closed = np.where(r <= A, 1 - r**2 / (2 * A**2), tail / (np.pi * A**2))
    sunk, _ = half_space(r, np.array(0.0), A)
    assert np.allclose(sunk / sunk[0], closed, atol=2e-9)


def test_half_space_inside_is_its_integral():
    for r, d in ((0.0, 1e-3), (1e-3, 2e-3), (6e-3, 0.5e-3)):
        found, _ = half_space(np.array(r), np.array(d), A)

        def integrand(k, r=r, d=d):
            return (
                j0(k * r)
                * hertz_transform(np.array(k * A))
                * (1 + k * d)
                * np.exp(-k * d)
            )

        expected, _ = quad(integrand, 0, 40 / d, limit=2000, epsabs=1e-9, epsrel=1e-11)
        assert found == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("thickness", [1e-5, 1e-3, 5e-3, 0.1])
def test_base_is_fixed_surface_sinks_by_one(thickness):
    layer = Layer(thickness=thickness)
    r = np.linspace(0, 4 * A, 9)
    u_r, u_z = layer.displacement(r, np.array([0.0, thickness]), A)
    # Ten micrometres under a contact of 2.45 mm lose seven digits to the half-space part.
    tolerance = 1e-12 * max(1.0, (A / thickness) ** 3)
    assert np.abs([u_r[:, 0], u_z[:, 0]]).max() < tolerance
    assert u_z[0, 1] == pytest.approx(-1, abs=tolerance)


def test_divergence_vanishes():
    layer, e = Layer(), 1e-6
    r, z = np.array([1e-3, 4e-3, 9e-3]), np.array([1e-3, 3e-3])
    outward = [
        layer.displacement(r + s * e, z, A)[0] * (r + s * e)[:, None] for s in (1, -1)
    ]
    upward = [layer.displacement(r, z + s * e, A)[1] for s in (1, -1)]
    terms = (
        (outward[0] - outward[1]) / (2 * e) / r[:, None],
        (upward[0] - upward[1]) / (2 * e),
    )
    assert np.abs(terms[0] + terms[1]).max() < 1e-5 * np.abs(terms[1]).max()


@pytest.mark.parametrize(("intervals", "finer"), [(50, 100), (100, 200)])
def test_table_is_fourth_order(intervals, finer):
    """Away from the rim of the contact a cubic spline's error falls with the fourth power."""
    layer = Layer()
    r = np.random.default_rng(0).uniform(1.5 * A, 30e-3, 400)
    exact = layer.displacement(r, layer.heights, A)[1]

    def error(n):
        table = layer.table(A, n)
        position = r / (r + table.stretch) / table.step
        index = np.minimum(position.astype(int), n - 1)
        powers = (position - index)[:, None] ** np.arange(4)
        rows = table.coefficients[:, index, 4:]
        return np.abs(np.einsum("lrp,rp->rl", rows, powers) - exact).max()

    assert error(intervals) / error(finer) > 10
    assert error(400) < 3e-6


def test_heights_stand_for_a_uniform_distribution():
    layer = Layer()
    inner = layer.heights[:-1] / layer.thickness
    for power in (1, 2, 9, 31):
        assert layer.weights @ inner**power == pytest.approx(1 / (power + 1), rel=1e-12)
    assert layer.heights[-1] == layer.thickness


@pytest.mark.slow
def test_layer_against_finite_elements():
    """Axisymmetric Taylor-Hood elements: the same displacement to a per cent of the indentation."""
    import skfem as fem

    h, wide = 5e-3, 60e-3
    r_nodes = np.concatenate(
        [np.linspace(0, 8e-3, 65), np.geomspace(8e-3, wide, 60)[1:]]
    )
    mesh = fem.MeshTri.init_tensor(r_nodes, np.linspace(0, h, 33))
    displacement = fem.Basis(mesh, fem.ElementVector(fem.ElementTriP2()), intorder=6)
    pressure = displacement.with_element(fem.ElementTriP1())

    @fem.BilinearForm
    def stiffness(u, v, w):
        r = w.x[0]
        strain = [
            [(u.grad[i][j] + u.grad[j][i]) / 2 for j in range(2)] for i in range(2)
        ]
        twist = [
            [(v.grad[i][j] + v.grad[j][i]) / 2 for j in range(2)] for i in range(2)
        ]
        planar = sum(strain[i][j] * twist[i][j] for i in range(2) for j in range(2))
        return 2 * (planar + u[0] * v[0] / r**2) * r

    @fem.BilinearForm
    def divergence(u, q, w):
        r = w.x[0]
        return -q * (u.grad[0][0] + u[0] / r + u.grad[1][1]) * r

    @fem.LinearForm
    def load(v, w):
        r = w.x[0]
        return -np.sqrt(np.maximum(1 - (r / A) ** 2, 0)) * v[1] * r

    surface = mesh.facets_satisfying(lambda x: np.isclose(x[1], h))
    quadratic = fem.ElementVector(fem.ElementTriP2())
    top = fem.FacetBasis(mesh, quadratic, facets=surface, intorder=6)
    k = stiffness.assemble(displacement)
    b = divergence.assemble(displacement, pressure)
    system = fem.bmat([[k, b.T], [b, None]], "csr")
    force = np.concatenate([load.assemble(top), np.zeros(pressure.N)])
    base = displacement.get_dofs(lambda x: np.isclose(x[1], 0)).all()
    far = displacement.get_dofs(lambda x: np.isclose(x[0], wide)).all()
    axis = displacement.get_dofs(lambda x: np.isclose(x[0], 0)).all(["u^1"])
    fixed = np.unique(np.concatenate([base, far, axis]))
    solution = fem.solve(*fem.condense(system, force, D=fixed))[: displacement.N]

    r = np.array([0.0, 1e-3, 2e-3, 4e-3, 6e-3, 10e-3])
    z = np.array([1e-3, 2.5e-3, 4e-3, 5e-3])
    points = np.stack(
        np.meshgrid(np.maximum(r, 1e-9), np.minimum(z, h - 1e-9), indexing="ij")
    )
    found = (displacement.probes(points.reshape(2, -1)) @ solution).reshape(
        2, len(r), len(z)
    )
    found /= -found[1, 0, -1]
    expected = np.stack(Layer().displacement(r, z, A))
    assert np.abs(found - expected).max() < 0.01
