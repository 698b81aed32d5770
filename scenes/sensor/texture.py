"""A grainy object: the pressure of a press, carried by grains instead of a smooth surface.

The press's Hertz pressure is replaced by point forces on a jittered lattice of spacing s inside the
contact, f_g ∝ p_Hertz(x_g)·w_g with w_g ~ Gamma(mean 1, variance c), total force kept; every touch
meets another patch, or always the same one. Relative to the smooth press, with unit total force,

    δF(k) = Σ_g f_g·e^{−ik·x_g} − 3Φ(ka)·e^{−ik·x_c}

    ũ_z = −(C/k)·P(k, z)·δF,   ũ_∥ = −i(k/k)·(C/k)·Q(k, z)·δF,   C = (2π/3)·δ/w0

with P, Q, Φ, w0 of ``elastomer`` (an incompressible half-space sinks by F/(4πμr) under a point
force, and Hertz relates F/μ to the depth δ). On a periodic grid this is one transform forward, and
three inverse ones a height. A height d below the surface holds nothing finer than about d, so its
cell is up to d/5. Reading the fields at the vertices (bilinear) and projecting them on the paths is
one fixed sparse matrix.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch
from scipy import sparse
from torch import Tensor

from scenes.sensor.contact import BoundContact, Press, Touch
from scenes.sensor.elastomer import hertz_transform, layer_response
from scenes.sensor.sensor import Sensor
from scenes.validate import require, require_number

KEY = "scene.contact"


@dataclass(frozen=True)
class TexturedPress(Press):
    """A press with a grainy face.

    Args:
        spacing: s in m, the distance of grains; ``None`` for a smooth face, no texture is built.
        variance: c of the grains' share of the load (0: all alike).
        offset: what this object adds to the depth, in m (a thicker sheet under a press that stops
            at a position).
        fresh: a new patch of the object every touch; ``False`` if the press returns to the same
            place of an object that lies still.
        cell: finest grid cell in m. A grain's force is spread over one cell, so this is also the
            size of the spot that it presses on (a point force would sink without bound).
        side: grid points a side; a power of two.
    """

    spacing: float | None = None
    variance: float = 0.0
    offset: float = 0.0
    fresh: bool = True
    cell: float = 0.1e-3
    side: int = 256

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.spacing is not None:
            require_number(f"{KEY}.spacing", self.spacing, 0, strict=True)
        require_number(f"{KEY}.variance", self.variance, 0)
        require_number(f"{KEY}.offset", self.offset, -self.depth)
        power = (
            self.side & (self.side - 1) == 0
            and 2.5 * self.radius <= self.side * self.cell
        )
        require(
            power,
            f"{KEY}.side",
            self.side,
            "a power of two, 2.5 contact radii wide or more",
        )

    def draw(self, normals: np.ndarray) -> dict[str, np.ndarray]:
        drawn = super().draw(normals)
        return {**drawn, "depth": drawn["depth"] + self.offset}

    def bind(self, sensor: Sensor) -> BoundContact:
        smooth = Press.bind(replace(self, depth=self.depth + self.offset), sensor)
        return smooth if self.spacing is None else GrainyPress(self, sensor, smooth)


class GrainyPress:
    """The smooth press plus what its grains change."""

    def __init__(
        self, press: TexturedPress, sensor: Sensor, smooth: BoundContact
    ) -> None:
        self._press, self._smooth = press, smooth
        self._patch = _patch(
            sensor, press.position, press.radius, press.cell, press.side
        )

    def __call__(self, touch: Touch) -> Tensor:
        rng = touch.sample if self._press.fresh else touch.object
        assert rng is not None
        x, y, force = self.grains(touch, rng)
        return self._smooth(touch).add_(self._patch.phases(x, y, force, touch))

    def grains(
        self, touch: Touch, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions in m about the target and forces (sum 1) of a new patch's grains."""
        press = self._press
        assert press.spacing is not None
        n = math.ceil(press.radius / press.spacing) + 1
        lattice = np.arange(-n, n + 1)
        origin = rng.uniform(-0.5, 0.5, 2)
        jitter = rng.uniform(-0.25, 0.25, (2, lattice.size, lattice.size))
        across = press.spacing * (lattice + origin[0] + jitter[0])
        along = press.spacing * (lattice[:, None] + origin[1] + jitter[1])
        inside = across**2 + along**2 < press.radius**2
        across, along = across[inside], along[inside]
        force = np.sqrt(1 - (across**2 + along**2) / press.radius**2)
        if press.variance > 0:
            force *= rng.gamma(1 / press.variance, press.variance, force.size)
        x = across + touch.x - press.position[0]
        y = along + touch.y - press.position[1]
        return x, y, force / force.sum()


class Patch:
    """Displacement by grains on a periodic grid about one position, read by the paths.

    Levels are grouped by the grid they need: cells up to ``finest`` times their depth. ``_groups``:
    (points a side, response complex64 [levels·3, n, n/2 + 1]); ``_read``: sparse float32 [P, grid].
    """

    def __init__(
        self,
        sensor: Sensor,
        position: tuple[float, float],
        radius: float,
        cell: float,
        side: int,
        finest: float = 1 / 5,
    ) -> None:
        self._sensor, self._position, self._cell, self._side = (
            sensor,
            position,
            cell,
            side,
        )
        self._half = side * cell / 2
        layer, place = sensor.layer, sensor.place
        kx = 2 * np.pi * np.fft.rfftfreq(side, cell)
        ky = 2 * np.pi * np.fft.fftfreq(side, cell)[:, None]
        k = np.hypot(kx, ky)
        self._kx, self._ky, self._hertz = kx, ky, 3 * hertz_transform(k * radius)
        grids: dict[int, list[int]] = {}
        for level, z in enumerate(layer.heights):
            coarser = finest * (layer.thickness - z) / cell
            doublings = int(math.log2(coarser)) if coarser > 2 else 0
            grids.setdefault(max(side >> doublings, 8), []).append(level)
        safe = np.where(k > 0, k, 1.0)
        strength = 2 * np.pi / 3 / layer.compliance(radius) / safe * (k > 0)
        self._groups = []
        offset, columns, rows, weights = 0, [], [], []
        for n, levels in grids.items():
            p, q = layer_response(
                k, layer.heights[levels][:, None, None], layer.thickness
            )
            horizontal = -1j * strength * q / safe
            response = np.stack(
                [horizontal * kx, horizontal * ky, -strength * p], axis=1
            )
            whole = response.reshape(-1, side, side // 2 + 1)
            cropped = _coarsen(whole, n) / (side * cell / n) ** 2
            self._groups.append(
                (n, torch.from_numpy(cropped.astype(np.complex64)).to(place))
            )
            for level in levels:
                column, row, weight = self._readings(level, n)
                columns.append(column + offset)
                rows.append(row)
                weights.append(weight)
                offset += 3 * n * n
        shape = (len(sensor.path_set), offset)
        coordinates = (np.concatenate(rows), np.concatenate(columns))
        read = sparse.csr_matrix((np.concatenate(weights), coordinates), shape=shape)
        starts, indices, values = map(
            torch.from_numpy, (read.indptr, read.indices, read.data)
        )
        with warnings.catch_warnings(
            action="ignore"
        ):  # support of sparse tensors is in beta
            self._read = torch.sparse_csr_tensor(starts, indices, values, shape).to(
                place
            )

    def _readings(
        self, level: int, n: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(grid index, path, weight) of the vertices at one level inside the grid; 12 a vertex."""
        paths, position, cell = (
            self._sensor.path_set,
            self._position,
            self._half * 2 / n,
        )
        chosen = (paths.level == level).cpu().numpy()
        across = ((paths.x.cpu().numpy()[chosen] - position[0]) + self._half) / cell
        along = ((paths.y.cpu().numpy()[chosen] - position[1]) + self._half) / cell
        inside = (across >= 0) & (across < n - 1) & (along >= 0) & (along < n - 1)
        path = np.broadcast_to(np.arange(len(paths)), chosen.shape)[chosen][inside]
        bend = paths.bend.cpu().numpy()[:, chosen][:, inside]
        i, j = along[inside].astype(np.int64), across[inside].astype(np.int64)
        v, u = along[inside] - i, across[inside] - j
        index, weight = [], []
        for component in range(3):
            for down, right, w in _corners(u, v):
                index.append(component * n * n + (i + down) * n + j + right)
                weight.append(w * bend[component])
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
        n = self._side
        across, along = (x + self._half) / self._cell, (y + self._half) / self._cell
        j, i = across.astype(np.int64), along.astype(np.int64)
        u, v = across - j, along - i
        grid = np.zeros(n * n)
        for down, right, share in _corners(u, v):
            grid += np.bincount(
                (i + down) * n + j + right, force * share, minlength=n * n
            )
        cx, cy = centre[0] + self._half, centre[1] + self._half
        phase = np.exp(-1j * self._kx * cx) * np.exp(-1j * self._ky * cy)
        return np.fft.rfft2(grid.reshape(n, n)) - self._hertz * phase

    def phases(
        self, x: np.ndarray, y: np.ndarray, force: np.ndarray, touch: Touch
    ) -> Tensor:
        """Change of phase float64 [P] in rad by grains at (x, y) about the target."""
        centre = touch.x - self._position[0], touch.y - self._position[1]
        delta = self.spectrum(x, y, force, centre)
        fields = []
        for n, response in self._groups:
            part = torch.from_numpy(_coarsen(delta[None], n).astype(np.complex64))
            spectra = response * part.to(response.device)
            # One by one: with several threads a batch of small transforms has other last digits.
            fields += [torch.fft.irfft2(one, s=(n, n)).flatten() for one in spectra]
        scale = self._sensor.paths.wavenumber * touch.depth
        return (self._read @ torch.cat(fields)).to(torch.float64).mul_(scale)


def _corners(u: np.ndarray, v: np.ndarray) -> list[tuple[int, int, np.ndarray]]:
    """Bilinear weights of the four grid points (down, right) around a point at fraction (u, v)."""
    shares = (1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u
    return [(k // 2, k % 2, share) for k, share in enumerate(shares)]


def _coarsen(spectrum: np.ndarray, n: int) -> np.ndarray:
    """The part of a spectrum [.., N, N/2 + 1] that n points a side hold, without Nyquist's."""
    if spectrum.shape[-2] == n:
        return spectrum
    half = n // 2
    cut = np.concatenate([spectrum[:, :half], spectrum[:, -half:]], axis=1)[
        ..., : half + 1
    ].copy()
    cut[:, half], cut[..., half] = 0, 0
    return cut


@lru_cache(maxsize=1)
def _patch(
    sensor: Sensor, position: tuple[float, float], radius: float, cell: float, side: int
) -> Patch:
    """Objects that touch at the same place share one patch."""
    return Patch(sensor, position, radius, cell, side)
