import numpy as np
import torch


def test_phase_is_the_change_of_the_optical_path(small):
    """Move every vertex by a tiny touch: the polyline's length changes by what is predicted."""
    paths, layer = small.path_set, small.layer
    depth, centre, radius = 1e-8, (20e-3, 3e-3), 2.45e-3
    x, y = paths.x.double().numpy(), paths.y.double().numpy()
    level = paths.level.numpy()
    dx, dy = x - centre[0], y - centre[1]
    r = np.hypot(dx, dy)
    of_levels = layer.displacement(r.ravel(), layer.heights, radius)
    chosen = np.arange(r.size), level.ravel()
    u_r_over_r, u_z = (u[chosen].reshape(r.shape) for u in of_levels)
    u = np.stack([u_r_over_r * dx, u_r_over_r * dy, u_z], -1)
    ends = [(*small.paths.fibre, 2.5e-3), (*small.paths.camera, 2.5e-3)]
    start, stop = (np.broadcast_to(end, (1, x.shape[1], 3)) for end in ends)

    def length(scale):
        moved = np.stack([x, y, layer.heights[level]], -1) + scale * u
        legs = np.diff(np.concatenate([start, moved, stop]), axis=0)
        return np.linalg.norm(legs, axis=-1).sum(0)

    growth = (length(depth) - length(-depth)) / (2 * depth)
    found = paths.lengthening(small.table(radius, torch.float64), centre).numpy()
    assert np.abs(found - growth).max() < 1e-3
    assert np.abs(growth).max() > 0.5
