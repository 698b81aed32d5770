"""A grainy object: the pressure of a press, carried by grains instead of a smooth surface.

The press's Hertz pressure is replaced by point forces on a jittered lattice of spacing s inside the
contact, f_g ∝ p_Hertz(x_g)·w_g with w_g ~ Gamma(mean 1, variance c), with the same total force;
every touch meets another patch of grains. Relative to the smooth press,
with unit total force,

    δF(k) = Σ_g f_g·e^{−ik·x_g} − 3Φ(ka)·e^{−ik·x_c}

    ũ_z = −(C/k)·P(k, z)·δF,   ũ_∥ = −i(k/k)·(C/k)·Q(k, z)·δF,   C = (2π/3)·δ/w0

with P, Q, Φ, w0 of ``elastomer`` (an incompressible half-space sinks by F/(4πμr) under a point
force, and Hertz relates F/μ to the depth δ). On a periodic grid this is one transform forward, and
three inverse ones per height. At a depth d below the surface the field has nothing finer than
about d, so its cell is up to d/5. Reading the fields at the vertices (bilinear) and projecting them
on the paths is one fixed sparse matrix.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from scenes.sensor.contact import BoundContact, Press, Touch
from scenes.sensor.elastomer import hertz_transform, layer_response
from scenes.sensor.sensor import Sensor
from scenes.validate import require, require_number

KEY = "scene.contact"
CELL = 0.1e-3
"""m, the finest grid cell. A grain's force is spread over one cell, so this is also the size of the
spot that it presses on (a point force would sink without bound)."""
SIDE = 256  # grid points a side
FINEST = 1 / 5  # cells are up to so many times their depth


@dataclass(frozen=True)
class TexturedPress(Press):
    """A press with a grainy face.

    Args:
        spacing: s in m, the distance of grains.
        variance: c of the grains' share of the load (0: all alike).
        offset: what this object adds to the depth, in m (a thicker sheet under a press that stops
            at a position).
    """

    spacing: float = 0.5e-3
    variance: float = 0.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_number(f"{KEY}.spacing", self.spacing, 0, strict=True)
        require_number(f"{KEY}.variance", self.variance, 0)
        require_number(f"{KEY}.offset", self.offset, -self.depth)
        largest = SIDE * CELL / 2.5
        fits = self.radius <= largest
        require(fits, f"{KEY}.radius", self.radius, f"{largest:g} m or less of grains")

    def draw(self, normals: np.ndarray) -> dict[str, np.ndarray]:
        drawn = super().draw(normals)
        return {**drawn, "depth": drawn["depth"] + self.offset}

    def bind(self, sensor: Sensor) -> BoundContact:
        deeper = replace(self, depth=self.depth + self.offset)
        return GrainyPress(self, sensor, Press.bind(deeper, sensor))


class GrainyPress:
    """The smooth press plus what its grains change."""

    def __init__(
        self, press: TexturedPress, sensor: Sensor, smooth: BoundContact
    ) -> None:
        self._press, self._smooth = press, smooth
        self._patch = _patch(sensor, press.position, press.radius)

    def __call__(self, touch: Touch) -> Tensor:
        grainy = self._patch.phases(*self.grains(touch), touch)
        return self._smooth(touch).add_(grainy)

    def grains(self, touch: Touch) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions in m about the target and forces (sum 1) of a new patch's grains."""
        press, rng = self._press, touch.random
        assert rng is not None
        n = math.ceil(press.radius / press.spacing) + 1
        lattice = np.arange(-n, n + 1)
        origin_x, origin_y = rng.uniform(-0.5, 0.5, 2)
        shape = (2, lattice.size, lattice.size)
        jitter_x, jitter_y = rng.uniform(-0.25, 0.25, shape)
        across = press.spacing * (lattice + origin_x + jitter_x)
        along = press.spacing * (lattice[:, None] + origin_y + jitter_y)
        inside = across**2 + along**2 < press.radius**2
        across, along = across[inside], along[inside]
        square = across**2 + along**2
        force = np.sqrt(1 - square / press.radius**2)
        if press.variance > 0:
            # Mean 1: the product of shape and scale.
            evenness = 1 / press.variance
            force *= rng.gamma(evenness, press.variance, force.size)
        x = across + touch.x - press.position[0]
        y = along + touch.y - press.position[1]
        return x, y, force / force.sum()


class Patch:
    """Displacement by grains on a periodic grid about one position, read by the paths.

    Levels are grouped by the grid they need: cells up to ``FINEST`` times their depth. ``_groups``:
    (points a side, response complex64 [levels·3, n, n/2 + 1]); ``_read``: sparse float32 [P, grid].
    """

    def __init__(
        self,
        sensor: Sensor,
        position: tuple[float, float],
        radius: float,
    ) -> None:
        self._sensor = sensor
        self._position = position
        self._half = SIDE * CELL / 2
        self._kx = 2 * np.pi * np.fft.rfftfreq(SIDE, CELL)
        along = np.fft.fftfreq(SIDE, CELL)
        self._ky = 2 * np.pi * along[:, None]
        self._k = np.hypot(self._kx, self._ky)
        self._hertz = 3 * hertz_transform(self._k * radius)
        self._groups = []
        offset, columns, rows, weights = 0, [], [], []
        for n, levels in self._grids().items():
            response = self._response(levels, n, radius)
            self._groups.append((n, torch.from_numpy(response).to(sensor.place)))
            for level in levels:
                column, row, weight = self._readings(level, n)
                columns.append(column + offset)
                rows.append(row)
                weights.append(weight)
                offset += 3 * n * n
        places = torch.from_numpy(
            np.stack([np.concatenate(rows), np.concatenate(columns)])
        )
        values = torch.from_numpy(np.concatenate(weights))
        shape = (len(sensor.path_set), offset)
        # Support of compressed rows is in beta.
        with warnings.catch_warnings(action="ignore"):
            entries = torch.sparse_coo_tensor(places, values, shape)
            self._read = entries.to_sparse_csr().to(sensor.place)

    def _grids(self) -> dict[int, list[int]]:
        """Levels by the grid that they need, in points a side."""
        layer = self._sensor.layer
        grids: dict[int, list[int]] = {}
        for level, z in enumerate(layer.heights):
            coarser = FINEST * (layer.thickness - z) / CELL
            doublings = 0
            if coarser > 2:
                doublings = int(math.log2(coarser))
            points = max(SIDE >> doublings, 8)
            grids.setdefault(points, []).append(level)
        return grids

    def _response(
        self,
        levels: list[int],
        n: int,
        radius: float,
    ) -> np.ndarray:
        """Displacement (x, y, z) by a force, complex64 [levels·3, n, n/2 + 1]."""
        layer, k = self._sensor.layer, self._k
        heights = layer.heights[levels][:, None, None]
        p, q = layer_response(k, heights, layer.thickness)
        safe = np.where(k > 0, k, 1.0)
        strength = 2 * np.pi / 3 / layer.compliance(radius)
        strength = strength / safe * (k > 0)
        horizontal = -1j * strength * q / safe
        components = [horizontal * self._kx, horizontal * self._ky, -strength * p]
        response = np.stack(components, axis=1)
        whole = response.reshape(-1, SIDE, SIDE // 2 + 1)
        area = (SIDE * CELL / n) ** 2
        return (_coarsen(whole, n) / area).astype(np.complex64)

    def _readings(
        self, level: int, n: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(grid index, path, weight) of the vertices at one level inside the grid; 12 a vertex."""
        paths, cell = self._sensor.path_set, self._half * 2 / n
        x, y = self._position
        chosen = (paths.level == level).cpu().numpy()
        across = paths.x.cpu().numpy()[chosen] - x
        across = (across + self._half) / cell
        along = paths.y.cpu().numpy()[chosen] - y
        along = (along + self._half) / cell
        inside = (across >= 0) & (across < n - 1)
        inside &= (along >= 0) & (along < n - 1)
        numbers = np.broadcast_to(np.arange(len(paths)), chosen.shape)
        path = numbers[chosen][inside]
        bend = paths.bend.cpu().numpy()[:, chosen][:, inside]
        along, across = along[inside], across[inside]
        i, j = along.astype(np.int64), across.astype(np.int64)
        v, u = along - i, across - j
        index, weight = [], []
        for component in range(3):
            first = component * n * n
            for down, right, share in _corners(u, v):
                index.append(first + (i + down) * n + j + right)
                weight.append(share * bend[component])
        weights = np.concatenate(weight).astype(np.float32)
        return np.concatenate(index), np.tile(path, 12), weights

    def spectrum(
        self,
        x: np.ndarray,
        y: np.ndarray,
        force: np.ndarray,
        centre: tuple[float, float],
    ) -> np.ndarray:
        """δF complex [side, side/2 + 1]; each grain shared by its four nearest grid points."""
        n = SIDE
        across = (x + self._half) / CELL
        along = (y + self._half) / CELL
        j, i = across.astype(np.int64), along.astype(np.int64)
        u, v = across - j, along - i
        grid = np.zeros(n * n)
        for down, right, share in _corners(u, v):
            point = (i + down) * n + j + right
            grid += np.bincount(point, force * share, minlength=n * n)
        centre_x, centre_y = centre
        phase_x = np.exp(-1j * self._kx * (centre_x + self._half))
        phase_y = np.exp(-1j * self._ky * (centre_y + self._half))
        smooth = self._hertz * (phase_x * phase_y)
        return np.fft.rfft2(grid.reshape(n, n)) - smooth

    def phases(
        self,
        x: np.ndarray,
        y: np.ndarray,
        force: np.ndarray,
        touch: Touch,
    ) -> Tensor:
        """Change of phase float64 [P] in rad by grains at (x, y) about the target."""
        target_x, target_y = self._position
        centre = touch.x - target_x, touch.y - target_y
        delta = self.spectrum(x, y, force, centre)[None]
        fields = []
        for n, response in self._groups:
            part = _coarsen(delta, n).astype(np.complex64)
            spectra = response * torch.from_numpy(part).to(response.device)
            # One by one: with several threads a batch of small transforms has other last digits.
            for spectrum in spectra:
                field = torch.fft.irfft2(spectrum, s=(n, n))
                fields.append(field.flatten())
        lengthening = self._read @ torch.cat(fields)
        scale = self._sensor.paths.wavenumber * touch.depth
        return lengthening.to(torch.float64).mul_(scale)


def _corners(
    u: np.ndarray,
    v: np.ndarray,
) -> list[tuple[int, int, np.ndarray]]:
    """Bilinear weights of the four grid points (down, right) around a point at fraction (u, v)."""
    return [
        (0, 0, (1 - v) * (1 - u)),
        (0, 1, (1 - v) * u),
        (1, 0, v * (1 - u)),
        (1, 1, v * u),
    ]


def _coarsen(spectrum: np.ndarray, n: int) -> np.ndarray:
    """The part of a spectrum [.., N, N/2 + 1] that n points a side hold, without Nyquist's."""
    if spectrum.shape[-2] == n:
        return spectrum
    half = n // 2
    rows = [spectrum[:, :half], spectrum[:, -half:]]
    cut = np.concatenate(rows, axis=1)[..., : half + 1].copy()
    cut[:, half] = 0
    cut[..., half] = 0
    return cut


@lru_cache(maxsize=1)
def _patch(
    sensor: Sensor,
    position: tuple[float, float],
    radius: float,
) -> Patch:
    """Objects that touch at the same place share one patch."""
    return Patch(sensor, position, radius)
