import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from scenes.sensor.contact import ExactPress, ExpandedPress, Press, Touch


def test_phase_is_the_change_of_the_optical_path(small):
    """Move every vertex by a tiny touch: the polyline's length changes by what is predicted."""
    sensor = small
    paths, layer = sensor.path_set, sensor.layer
    depth, centre, radius = 1e-8, (20e-3, 3e-3), 2.45e-3
    x, y = paths.x.double().numpy(), paths.y.double().numpy()
    z = layer.heights[paths.level.numpy()]
    dx, dy = x - centre[0], y - centre[1]
    r = np.hypot(dx, dy)
    u = np.zeros((3, *x.shape))
    for level in range(len(layer.heights)):
        mine = paths.level.numpy() == level
        u_r, u_z = layer.displacement(r[mine], layer.heights[level], radius)
        u[0][mine], u[1][mine] = u_r[:, 0] * (dx / r)[mine], u_r[:, 0] * (dy / r)[mine]
        u[2][mine] = u_z[:, 0]

    def length(scale):
        moved = np.stack([x, y, z], -1) + scale * np.moveaxis(u, 0, -1)
        ends = [(*sensor.paths.fibre, 2.5e-3), (*sensor.paths.camera, 2.5e-3)]
        start, stop = (np.broadcast_to(e, (1, x.shape[1], 3)) for e in ends)
        return np.linalg.norm(
            np.diff(np.concatenate([start, moved, stop]), axis=0), axis=-1
        ).sum(0)

    growth = (length(depth) - length(-depth)) / (2 * depth)
    found = paths.lengthening(sensor.table(radius, torch.float64), centre).numpy()
    assert np.abs(found - growth).max() < 1e-3
    assert np.abs(growth).max() > 0.5


def test_paths_lie_in_the_layer(small):
    paths = small.path_set
    assert paths.x.min() >= 0
    assert paths.x.max() <= small.paths.length
    assert paths.y.abs().max() <= small.paths.width / 2
    share = (paths.level == small.layer.levels).double().mean().item()
    assert share == pytest.approx(0.30, abs=4 * math.sqrt(0.21 / paths.level.numel()))
    assert torch.linalg.vector_norm(paths.bend, dim=0).max() <= 2 + 1e-5
    mean = torch.exp(1j * small.phase).mean().abs()  # of phases anywhere in the circle
    assert mean < 4 / math.sqrt(small.phase.numel())


def test_float32_tables_are_exact_enough_for_a_deep_touch(small):
    """1.8 mm are 6,000 rad: the same paths with everything in float64."""
    paths, touch = small.path_set, Touch(1.8e-3, 28e-3, 8e-3)
    double = replace(
        paths, x=paths.x.double(), y=paths.y.double(), bend=paths.bend.double()
    )
    exact = double.lengthening(small.table(2.45e-3, torch.float64), (touch.x, touch.y))
    found = ExactPress(Press((28e-3, 8e-3), 2.45e-3, 1.8e-3), small)(touch)
    assert (found - exact * small.paths.wavenumber * touch.depth).abs().max() < 0.01


def test_expansion_about_the_target_is_exact_enough(small):
    """A robot's touch: what the expansion neglects stays in the noise."""
    press = Press((28e-3, 8e-3), 2.45e-3, 1.8e-3, 0.01, 0.02e-3)
    assert isinstance(press.bind(small), ExpandedPress)
    touch = Touch(1.8e-3, 28.03e-3, 7.96e-3)
    near, exact = press.bind(small)(touch), ExactPress(press, small)(touch)
    assert (near - exact).abs().max() < 0.05
    assert (near - exact).square().mean().sqrt() < 5e-3
    centred = ExactPress(press, small)(Touch(1.8e-3, 28e-3, 8e-3))
    assert (centred - exact).square().mean().sqrt() > 1  # the miss itself matters
