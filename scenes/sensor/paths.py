"""Scattering paths through the layer and how their lengths answer to a displacement.

A path runs from the fibre to the camera in straight legs between V scattering vertices. If vertex v
moves by u_v, the path of direction ŝ_in before it and ŝ_out after it becomes longer by
(ŝ_in − ŝ_out)·u_v, to first order in u; the phase grows by k0·n·q_s times that. The factor q_s < 1
stands for forward scattering, which bends light by less than the polyline does. Sampling paths
instead of solving for the field: Bar et al., ACM Trans. Graph. 38 (2019) 37.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from hdc.parameters import check_integer
from scenes.sensor.elastomer import Layer, RadialTable
from scenes.validate import require, require_number

KEY = "scene.sensor.paths"


@dataclass(frozen=True)
class Paths:
    """The geometry of the paths. Coordinates: x away from fibre and camera, y from one to the
    other, z up.

    Args:
        wavelength: λ in m, of a red laser diode (assumed).
        index: refractive index of silicone at that wavelength (assumed; 1.41 to 1.43 in tables).
        vertices: scattering vertices per path (assumed).
        forward: q_s (fitted: crosstalk of touches).
        reach: l_x in m, mean of the exponential distribution of the largest x of a path (fitted).
        length: L_x in m: no light beyond it (fitted: 51 mm of positions need light).
        width: L_y in m (assumed).
        spread: standard deviation of y about the straight line, in m (assumed).
        surface: share of the vertices that lie on the free surface (assumed).
        fibre, camera: (x, y) in m of both ends, at half the thickness (assumed).
    """

    wavelength: float = 0.66e-6
    index: float = 1.41
    vertices: int = 6
    forward: float = 0.25
    reach: float = 22e-3
    length: float = 90e-3
    width: float = 40e-3
    spread: float = 6e-3
    surface: float = 0.30
    fibre: tuple[float, float] = (0.0, -8e-3)
    camera: tuple[float, float] = (0.0, 8e-3)

    def __post_init__(self) -> None:
        for name in ("wavelength", "index", "reach", "length", "width", "spread"):
            require_number(f"{KEY}.{name}", getattr(self, name), 0, strict=True)
        check_integer(f"{KEY}.vertices", self.vertices, 1)
        require_number(f"{KEY}.forward", self.forward, 0)
        require(
            0 <= self.surface <= 1, f"{KEY}.surface", self.surface, "a share in [0, 1]"
        )
        for name in ("fibre", "camera"):
            position = tuple(getattr(self, name))
            object.__setattr__(self, name, position)
            self.require_inside(f"{KEY}.{name}", position)

    @property
    def wavenumber(self) -> float:
        """k0·n·q_s in rad/m: phase per metre of lengthening."""
        return 2 * math.pi / self.wavelength * self.index * self.forward

    def require_inside(self, key: str, position: tuple[float, float]) -> None:
        """Raise unless the position lies on the sensor."""
        x, y = position
        inside = 0 <= x <= self.length and abs(y) <= self.width / 2
        surface = f"x in [0, {self.length:g}] m and |y| <= {self.width / 2:g} m"
        require(inside, key, position, f"{surface} (the sensor's surface)")

    def draw(
        self,
        count: int,
        layer: Layer,
        rng: np.random.Generator,
        device: torch.device,
    ) -> PathSet:
        """``count`` independent paths."""
        v, shape = self.vertices, (self.vertices, count)
        t = np.arange(1, v + 1)[:, None] / (v + 1)  # share of the way
        outermost = rng.exponential(self.reach, count)
        outermost = np.minimum(outermost, self.length)
        scatter = 1 + 0.15 * rng.standard_normal(shape)
        x = outermost * np.sin(np.pi * t) ** 0.7 * scatter
        x = np.clip(x, 0, self.length)
        start_y, end_y = self.fibre[1], self.camera[1]
        line = start_y + t * (end_y - start_y)
        y = line + self.spread * rng.standard_normal(shape)
        y = np.clip(y, -self.width / 2, self.width / 2)
        inner = np.cumsum(layer.weights).searchsorted(rng.random(shape))
        inner = np.minimum(inner, layer.levels - 1)
        on_surface = rng.random(shape) < self.surface
        level = np.where(on_surface, layer.levels, inner)

        def point(vertex: int) -> np.ndarray:
            z = layer.heights[level[vertex]]
            return np.stack([x[vertex], y[vertex], z], axis=-1)

        # Leg by leg, so that little more than the result is in memory.
        start = np.array([*self.fibre, layer.thickness / 2])
        end = np.array([*self.camera, layer.thickness / 2])
        bend = np.empty((3, *shape), dtype=np.float32)
        here = point(0)
        before = _direction(start, here)
        for vertex in range(v):
            following = np.broadcast_to(end, (count, 3))
            if vertex + 1 < v:
                following = point(vertex + 1)
            after = _direction(here, following)
            bend[:, vertex] = (before - after).T
            here, before = following, after

        def tensor(array: np.ndarray) -> Tensor:
            return torch.from_numpy(array).to(device, torch.float32)

        levels = torch.from_numpy(level).to(device)
        return PathSet(tensor(x), tensor(y), tensor(bend), levels)


def _direction(start: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """Unit vectors [P, 3]; zero where the points coincide."""
    leg = stop - start
    length = np.linalg.norm(leg, axis=-1, keepdims=True)
    return leg / np.maximum(length, 1e-12)


@dataclass(frozen=True)
class PathSet:
    """P paths of V vertices.

    Attributes:
        x, y: float32 [V, P] in m.
        bend: float32 [3, V, P], ŝ_in − ŝ_out.
        level: int64 [V, P], index into ``Layer.heights``.
    """

    x: Tensor
    y: Tensor
    bend: Tensor
    level: Tensor

    def __len__(self) -> int:
        return self.x.shape[1]

    def lengthening(self, table: Table, centre: tuple[float, float]) -> Tensor:
        """Σ_v (ŝ_in − ŝ_out)·u [P] per metre of indentation at ``centre`` (x, y) in m, in the
        precision of the table."""
        dtype = table.rows.dtype
        total = torch.zeros(
            len(self),
            dtype=dtype,
            device=self.x.device,
        )
        # One vertex of all paths at a time: the temporaries stay in the cache.
        for v in range(self.x.shape[0]):
            dx = (self.x[v] - centre[0]).to(dtype)
            dy = (self.y[v] - centre[1]).to(dtype)
            radius = (dx * dx + dy * dy).sqrt_()
            outward, down = table.look_up(radius, self.level[v])
            bend_x, bend_y, bend_z = self.bend[:, v]
            along = bend_x * dx + bend_y * dy
            total += along * outward
            total += bend_z * down
        return total


class Table:
    """A :class:`RadialTable` on the device, with the cubic evaluated at many vertices at once."""

    def __init__(
        self, table: RadialTable, dtype: torch.dtype, device: torch.device
    ) -> None:
        rows = torch.from_numpy(table.coefficients).to(device, dtype)
        self.rows = rows.reshape(-1, 8)
        self._table = table

    def look_up(self, r: Tensor, level: Tensor) -> tuple[Tensor, Tensor]:
        """(u_r/r, u_z) at radii r [P] in m and levels int64 [P]; zero beyond the table's reach."""
        n = self._table.coefficients.shape[1]
        position = r / (r + self._table.stretch)
        position *= 1 / self._table.step
        interval = position.to(torch.int64).clamp_(max=n - 1)
        fraction = (position - interval).clamp_(max=1.0)
        rows = self.rows.index_select(0, level * n + interval)
        outward = _cubic(rows[:, :4], fraction)
        down = _cubic(rows[:, 4:], fraction)
        inside = r <= self._table.reach
        return outward * inside, down * inside


def _cubic(coefficients: Tensor, x: Tensor) -> Tensor:
    """Σ c_k·x^k [P] by Horner's rule, from coefficients [P, 4], lowest power first."""
    value = coefficients[:, 3] * x + coefficients[:, 2]
    value = value * x + coefficients[:, 1]
    return value * x + coefficients[:, 0]
