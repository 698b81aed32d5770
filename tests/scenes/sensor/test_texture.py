import numpy as np
import pytest

from scenes.sensor.contact import Press, Touch
from scenes.sensor.elastomer import Layer
from scenes.sensor.seeds import stream
from scenes.sensor.texture import TexturedPress

AT, A = (34e-3, 0.0), 5e-3


def touch():
    return Touch(0.8e-3, *AT, stream(0, "texture"))


PRESS = AT, A, 0.8e-3, 0.01, 0.05e-3


def test_many_equal_grains_are_nearly_smooth(small):
    fine = TexturedPress(*PRESS, spacing=0.1e-3, variance=0.0).bind(small)(touch())
    coarse = TexturedPress(*PRESS, spacing=0.6e-3, variance=1.0).bind(small)(touch())
    smooth = Press(*PRESS).bind(small)(touch())
    little, much = ((g - smooth).square().mean().sqrt().item() for g in (fine, coarse))
    assert little < 0.01 * smooth.square().mean().sqrt().item()
    assert much > 20 * little


def test_point_force_on_the_surface_far_away_is_boussinesq():
    """A grain on a thick layer: u_z·r is constant, and ties the constant C to Hertz's depth."""
    layer, r = Layer(thickness=50.0), np.array([10.0, 20.0]) * A
    _, u_z = layer.displacement(r, np.array([50.0]), A)
    # F/(4πμr) with F/(2μ) = (2π/3)/w0 of ``texture``.
    strength = 2 * np.pi / 3 / layer.compliance(A)
    assert -u_z[:, 0] == pytest.approx(strength / (2 * np.pi * r), rel=0.02)
