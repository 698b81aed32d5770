"""How hard is a multimode fibre pressed? Frames computed from measured transmission matrices.

For an input field a, one complex amplitude a mode, the field at the output is

    E_p(x, y) = Σ_m  m_m(x, y) · (T·a)_{p,m},        p = two polarisations,

and a camera sees |E_p|². The matrices T and the modes m are measured; the frames are computed, with
noise added. Three fibres are public:

- ``wavefrontshaping/article_MMF_disorder`` (MIT): 52 matrices of all 110 input modes; Matthès et
  al., "Learning and Avoiding Disorder in Multimode Fibers", Phys. Rev. X 11, 021060 (2021).
- ``wavefrontshaping/article_RME_2023``: two more fibres of the same kind, 25 matrices each, of the
  55 input modes of one polarisation. The mode images of the first repository stand in for theirs.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import torch
from torch import Tensor

from scenes.frames import level_classes, row_numbers
from scenes.source import Source
from scenes.validate import require, require_integer, require_number

DATA = "FIBRE_DATA"
"""Environment variable that names a copy of :data:`PRESSED`."""
PRESSED = Source(
    repository="wavefrontshaping/article_MMF_disorder",
    commit="273faaa7161f23c22a7d97d99e922e930eaccd8a",
    cite="M. W. Matthès, Y. Bromberg, J. de Rosny, S. M. Popoff, Phys. Rev. X 11, 021060 (2021)",
    licence="MIT",
)
BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data" / "mmf_disorder"
CONTACT = 5.04e-3  # position of the actuator (m) at which it starts to press


class FibreScene:
    """Classes of press depth of a graded-index fibre.

    Sample i belongs to class i mod L. Its actuator position is drawn uniformly among the measured
    positions of the class. Its input field is a + ε·z: a is one random field shared by all samples,
    z an independent one of the same power. A generator seeded by (sampling_seed, i) draws all that
    sample i needs.

    Args:
        path: a copy of :data:`PRESSED`; default: the one that :data:`DATA` names, a checkout in
            ``MEASURED_DATA``, or :data:`BESIDE` the checkout of this project.
        depth_edges: upper press depths Δx (m) of the classes, increasing.
        samples_per_class: N / L.
        perturbation: ε ≥ 0.
        photons: mean photons a pixel (Poisson); 0 means no noise.
        saturation: 8-bit frames reach 255 at this multiple of the mean intensity. The exposure is
            fixed: the mean is taken over all positions and perturbations, not a frame.
        side: pixels a side of each polarisation's image; above the 41 of the stored modes the
            *field* is interpolated by a Fourier series (the modes are dark at the rim).
        seed: of the input fields.
        sampling_seed: of positions, perturbations and photons.
        n_fields: K input fields, one after the other into the same fibre; their images lie side by
            side, so a frame has K times the pixels.
        source: repository of another fibre, arguments of :class:`scenes.source.Source`.
        file: array [P, 110, inputs] of its matrices in that repository.
        step: press depth between one matrix and the next, from 0 on (m).

    Attributes:
        shape: (side, 2·side·K), both polarisations side by side.
        samples: ``depth`` is Δx in m; for others see :class:`scenes.frames.Scene`.
        source, sha256: where the matrices come from, and the digest of their files.

    Raises:
        FileNotFoundError: a repository is not there.
        ValueError: a file or a parameter is not as described.
    """

    origin = "computed"
    value_names, units = ("depth",), ("µm",)

    def __init__(
        self,
        path: str | Path | None = None,
        depth_edges: Sequence[float] = (0.0, 20e-6, 40e-6, 60e-6, 80e-6),
        samples_per_class: int = 100,
        perturbation: float = 0.3,
        photons: float = 50.0,
        saturation: float = 10.0,
        side: int = 41,
        seed: int = 0,
        sampling_seed: int = 0,
        n_fields: int = 1,
        source: Mapping[str, Any] | None = None,
        file: str | None = None,
        step: float | None = None,
    ) -> None:
        require_integer("scene.samples_per_class", samples_per_class, 1)
        require_integer("scene.n_fields", n_fields, 1)
        require_number("scene.perturbation", perturbation, 0)
        require_number("scene.photons", photons, 0)
        require_number("scene.saturation", saturation, 0, strict=True)
        data = _locate(path)
        self._modes = _array(data / "modes_out_after_correction.npy", (None, None))
        self._grid = math.isqrt(self._modes.shape[1])
        require_integer("scene.side", side, self._grid)
        self.source = PRESSED
        if source is None:
            depths, self._matrices = _pressed(data, 2 * len(self._modes))
            files = [file.name for file in data.glob("TM_modes_*.npz")]
            self.sha256 = PRESSED.check(
                data, [*files, "modes_out_after_correction.npy"]
            )
        else:
            self.source = Source(**source)
            if not file or not step:
                raise ValueError(
                    "scene.file, scene.step: expected with scene.source, found none"
                )
            depths, self._matrices = _stepped(
                self.source, file, step, 2 * len(self._modes)
            )
            self.sha256 = self.source.check(self.source.folder(), [str(file)])
        self.classes, class_of = level_classes(
            depths, depth_edges, "µm", key="scene.depth_edges", scale=1e6
        )
        members = [np.flatnonzero(class_of == c) for c in range(len(self.classes))]
        for name, positions in zip(self.classes, members, strict=True):
            expected = f"some of the {len(depths)} measured depths in class {name}"
            require(len(positions) > 0, "scene.depth_edges", depth_edges, expected)

        n = len(self.classes) * samples_per_class
        self.labels = np.arange(n) % len(self.classes)
        self.shape = (side, 2 * side * n_fields)
        self._perturbation, self._photons = float(perturbation), float(photons)
        self._sampling_seed = sampling_seed
        self._position = np.array(
            [self._draw(i).choice(members[c]) for i, c in enumerate(self.labels)]
        )
        depth = depths[self._position]
        self.samples: Mapping[str, np.ndarray] = {"order": np.arange(n), "depth": depth}
        self.values = depth[:, None] * 1e6
        self.cacheable = self.source.licence != "none stated"
        self._inputs = self._matrices.shape[2]
        fields = _complex_normal(np.random.default_rng(seed), n_fields * self._inputs)
        self._fields = fields.reshape(n_fields, self._inputs)
        used = self._matrices[np.concatenate(members)]
        means = [
            _mean_intensity(used, self._modes, f, self._perturbation)
            for f in self._fields
        ]
        self._mean = float(np.mean(means))
        self._full_scale = float(saturation) * self._mean
        self._interpolate = _dirichlet(side, self._grid) if side > self._grid else None
        edges, noise = (
            tuple(np.asarray(depth_edges, float)),
            (self._perturbation, self._photons),
        )
        last = (
            (seed, sampling_seed, n_fields) if n_fields > 1 else (seed, sampling_seed)
        )
        self._settings = (
            edges,
            samples_per_class,
            *noise,
            float(saturation),
            side,
            *last,
        )

    def __len__(self) -> int:
        return len(self.labels)

    def frames(self, indices: Sequence[int] | np.ndarray | Tensor) -> Tensor:
        """Frames uint8 [len(indices), side, 2·side·K]; an IndexError for one outside [0, N)."""
        frames = [self._frame(i) for i in row_numbers(indices, len(self)).tolist()]
        return torch.from_numpy(np.array(frames, np.uint8).reshape(-1, *self.shape))

    def fingerprint(self) -> str:
        """SHA-256 over the measured arrays and every parameter but the path."""
        digest = hashlib.sha256(repr(("fibre", self._settings)).encode())
        for array in (self._matrices, self._modes, self.samples["depth"]):
            digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()

    def _draw(self, i: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence([self._sampling_seed, i]))

    def _frame(self, i: int) -> np.ndarray:
        # In a batched product the last bit of the intensity, and so a photon count, would depend on
        # the batch.
        rng = self._draw(i)
        rng.choice(1)  # the position, drawn in __init__
        matrix = self._matrices[self._position[i]]
        intensity = np.hstack(
            [self._intensity(matrix, field, rng) for field in self._fields]
        )
        return np.clip(np.rint(intensity * (255 / self._full_scale)), 0, 255).astype(
            np.uint8
        )

    def _intensity(
        self, matrix: np.ndarray, field: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """|E|² [side, 2·side] of one perturbed input field, photons counted."""
        field = field + self._perturbation * _complex_normal(rng, self._inputs)
        amplitudes = (matrix @ field).reshape(2, -1)
        image = (amplitudes @ self._modes).reshape(2, self._grid, self._grid)
        if self._interpolate is not None:
            image = self._interpolate @ image @ self._interpolate.T
        intensity = np.hstack(list(image.real**2 + image.imag**2))
        if not self._photons:
            return intensity
        counted = rng.poisson(intensity * (self._photons / self._mean))
        return np.asarray(counted * (self._mean / self._photons))


def _locate(path: str | Path | None) -> Path:
    """Find folder ``Data`` of a copy of :data:`PRESSED`."""
    folder = (
        Path(path or os.environ.get(DATA) or PRESSED.find() or BESIDE).expanduser()
        / "Data"
    )
    if not folder.is_dir():
        raise FileNotFoundError(
            f"scene.path: expected a copy of github.com/{PRESSED.repository}, found no folder "
            f"{folder}; get it by: {PRESSED.command()}"
        )
    return folder


def _pressed(data: Path, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Press depths [P] (m, increasing) and matrices complex128 [P, size, size] of PRESSED."""
    # Rounded to a nanometre: 5.06 − 5.04 is not 0.02 in floating point, and it is an edge.
    files = {
        round(float(file.stem.removeprefix("TM_modes_")) * 1e-3 - CONTACT, 9): file
        for file in data.glob("TM_modes_*.npz")
    }
    arrays = [_array(files[d], (size, size), "TM_corr_modes") for d in sorted(files)]
    return np.array(sorted(files)), np.stack(arrays)


def _stepped(
    source: Source, file: str, step: float, size: int
) -> tuple[np.ndarray, np.ndarray]:
    """Press depths [P] (m) and matrices complex128 [P, size, inputs] of one array."""
    matrices = _array(source.folder() / file, (None, size, None))
    return np.round(np.arange(len(matrices)) * step, 9), matrices


def _array(
    file: Path, shape: tuple[int | None, ...], key: str | None = None
) -> np.ndarray:
    """A finite complex array from .npz[key] or .npy, None any length; nothing is unpickled."""
    try:
        loaded = np.load(file, allow_pickle=False)
        array = np.asarray(loaded[key] if key else loaded)
    except (OSError, EOFError, IndexError, KeyError, ValueError, BadZipFile) as error:
        raise ValueError(
            f"{file}: expected a complex array {shape}, found: {error}"
        ) from error
    fits = array.ndim == len(shape) and all(
        map(lambda n, m: n in (None, m), shape, array.shape)
    )
    if not fits or array.dtype.kind != "c" or not np.isfinite(array).all():
        found = f"{array.dtype} {array.shape}" + ", not all finite" * (
            array.dtype.kind == "c"
        )
        raise ValueError(
            f"{file}: expected a finite complex array {shape}, found {found}"
        )
    return array.astype(np.complex128)


def _mean_intensity(
    matrices: np.ndarray, modes: np.ndarray, field: np.ndarray, perturbation: float
) -> float:
    """Mean of |E|² over pixels, positions [P] and perturbations: |M·a|² + ε²·‖M‖², M = modes·T.

    The sum over pixels is the quadratic form of the modes' Gram matrix, so no image is made.
    """
    gram = modes.conj() @ modes.T
    sources = np.concatenate(
        [field[:, None], perturbation * np.eye(len(field))], axis=1
    )
    out = (matrices @ sources).reshape(len(matrices), 2, len(modes), -1)
    power = np.einsum("pqms,mn,pqns->", out.conj(), gram, out, optimize=True).real
    return float(power / (len(matrices) * 2 * modes.shape[1]))


def _dirichlet(side: int, grid: int) -> np.ndarray:
    """Matrix [side, grid] of trigonometric interpolation, pixel centres spread over the same width:
    Σ_k exp(2πi·k·x/grid)/grid over the frequencies k of an odd number of points."""
    x = (np.arange(side) + 0.5) * grid / side - 0.5
    k = np.arange(-(grid // 2), grid // 2 + 1)
    offsets = x[:, None, None] - np.arange(grid)[None, :, None]
    return np.cos(2 * np.pi * k * offsets / grid).sum(-1) / grid


def _complex_normal(rng: np.random.Generator, n: int) -> np.ndarray:
    """n circular complex numbers of mean square 1."""
    return rng.standard_normal((n, 2)).view(np.complex128)[:, 0] / np.sqrt(2)
