"""Frames of a pressed multimode fibre, computed from measured transmission matrices.

A class is a range of press depths.

For an input field a, one complex amplitude per mode, the field at the output is

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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar
from zipfile import BadZipFile

import numpy as np
import torch
from torch import Tensor

from hdc.parameters import check_integer
from scenes.frames import Indices, level_classes, row_numbers
from scenes.source import Source
from scenes.validate import require, require_number

PRESSED = Source(
    repository="wavefrontshaping/article_MMF_disorder",
    commit="273faaa7161f23c22a7d97d99e922e930eaccd8a",
    cite="M. W. Matthès, Y. Bromberg, J. de Rosny, S. M. Popoff, Phys. Rev. X 11, 021060 (2021)",
    licence="MIT",
)
MODES = "modes_out_after_correction.npy"  # of PRESSED: images of the modes
CONTACT = 5.04e-3  # position of the actuator (m) at which it starts to press


class FibreScene:
    """Classes of press depth of a graded-index fibre.

    Sample i belongs to class i mod L. Its actuator position is drawn uniformly among the measured
    positions of the class. Its input field is a + ε·z: a is one random field shared by all samples,
    z an independent one of the same power. A generator seeded by (sampling_seed, i) draws all
    random numbers of sample i.

    Args:
        path: a copy of :data:`PRESSED`; default: the checkout in ``MEASURED_DATA``.
        depth_edges: upper press depths Δx (m) of the classes, increasing.
        samples_per_class: N / L.
        perturbation: ε ≥ 0.
        photons: mean photons per pixel (Poisson); 0 means no noise.
        saturation: grey value 255 is this multiple of the mean intensity. The exposure is fixed:
            the mean is taken over all positions and perturbations, not over a frame.
        seed: of the input field.
        sampling_seed: of positions, perturbations and photons.
        source: repository of another fibre: arguments of :class:`scenes.source.Source`.
        file: array [P, 110, inputs] of its matrices in that repository.
        step: press depth between one matrix and the next, from 0 on (m).

    Attributes:
        shape: (41, 82), both polarisations side by side, each as large as the stored modes.
        samples: ``depth`` is Δx in m; for others see :class:`scenes.frames.Scene`.
        source, sha256: where the matrices come from, and the digest of their files.

    Raises:
        FileNotFoundError: a repository is not there.
        ValueError: a file or a parameter is not as described.
    """

    origin = "computed"
    revision: ClassVar[int] = 1
    """Raised by hand in the commit that changes the frames it makes."""
    value_names, units = ("depth",), ("µm",)

    def __init__(
        self,
        path: str | Path | None = None,
        depth_edges: Sequence[float] = (0.0, 20e-6, 40e-6, 60e-6, 80e-6),
        samples_per_class: int = 100,
        perturbation: float = 0.3,
        photons: float = 50.0,
        saturation: float = 10.0,
        seed: int = 0,
        sampling_seed: int = 0,
        source: Mapping[str, Any] | None = None,
        file: str | None = None,
        step: float | None = None,
    ) -> None:
        check_integer("scene.samples_per_class", samples_per_class, 1)
        require_number("scene.perturbation", perturbation, 0)
        require_number("scene.photons", photons, 0)
        require_number("scene.saturation", saturation, 0, strict=True)
        data = _locate(path)
        self._modes = _array(data / MODES, (None, None))
        self._side = math.isqrt(self._modes.shape[1])
        outputs = 2 * len(self._modes)
        if source is None:
            measured = _pressed(data, outputs)
        else:
            measured = _stepped(Source(**source), file, step, outputs)
        self.source, self.sha256 = measured.source, measured.sha256
        self.cacheable = self.source.licence != "none stated"
        self._matrices = measured.matrices
        self.classes, class_of = level_classes(
            measured.depths, depth_edges, "µm", key="scene.depth_edges", scale=1e6
        )
        members = []  # of each class, the measured positions
        for c, name in enumerate(self.classes):
            members.append(np.flatnonzero(class_of == c))
            known = len(measured.depths)
            expected = f"some of the {known} measured depths in class {name}"
            require(len(members[c]) > 0, "scene.depth_edges", depth_edges, expected)

        n = len(self.classes) * samples_per_class
        self.labels = np.arange(n) % len(self.classes)
        self.shape = (self._side, 2 * self._side)
        self._perturbation, self._photons = float(perturbation), float(photons)
        self._sampling_seed = sampling_seed
        positions = []
        for i, label in enumerate(self.labels):
            positions.append(self._draw(i).choice(members[label]))
        self._position = np.array(positions)
        depth = measured.depths[self._position]
        self.samples: Mapping[str, np.ndarray] = {"order": np.arange(n), "depth": depth}
        self.values = depth[:, None] * 1e6

        self._inputs = self._matrices.shape[2]
        rng = np.random.default_rng(seed)
        self._field = _complex_normal(rng, self._inputs)
        used = self._matrices[np.concatenate(members)]
        self._mean = _mean_intensity(used, self._modes, self._field, self._perturbation)
        self._full_scale = float(saturation) * self._mean
        self._settings: tuple[Any, ...] = (
            tuple(np.asarray(depth_edges, float)),
            samples_per_class,
            self._perturbation,
            self._photons,
            float(saturation),
            self._side,
            seed,
            sampling_seed,
        )

    def __len__(self) -> int:
        return len(self.labels)

    def frames(self, indices: Indices) -> Tensor:
        """Frames uint8 [len(indices), 41, 82]; an IndexError for one outside [0, N)."""
        rows = row_numbers(indices, len(self)).tolist()
        frames = np.empty((len(rows), *self.shape), np.uint8)
        for k, row in enumerate(rows):
            frames[k] = self._frame(row)
        return torch.from_numpy(frames)

    def fingerprint(self) -> str:
        """SHA-256 over the measured arrays and every parameter but the path."""
        settings = repr(("fibre", self._settings))
        digest = hashlib.sha256(settings.encode())
        for array in (self._matrices, self._modes, self.samples["depth"]):
            digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()

    def _draw(self, i: int) -> np.random.Generator:
        address = np.random.SeedSequence([self._sampling_seed, i])
        return np.random.default_rng(address)

    def _frame(self, i: int) -> np.ndarray:
        # In a batched product the last bit of the intensity, and so a photon count, would depend on
        # the batch.
        rng = self._draw(i)
        rng.choice(1)  # the position, drawn in __init__
        intensity = self._intensity(self._matrices[self._position[i]], rng)
        grey = np.rint(intensity * (255 / self._full_scale))
        return np.clip(grey, 0, 255).astype(np.uint8)

    def _intensity(self, matrix: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """|E|² [41, 82] of a perturbed input field, photons counted."""
        change = self._perturbation * _complex_normal(rng, self._inputs)
        amplitudes = (matrix @ (self._field + change)).reshape(2, -1)
        image = amplitudes @ self._modes
        image = image.reshape(2, self._side, self._side)
        horizontal, vertical = image.real**2 + image.imag**2
        intensity = np.hstack([horizontal, vertical])
        if not self._photons:
            return intensity
        counted = rng.poisson(intensity * (self._photons / self._mean))
        return np.asarray(counted * (self._mean / self._photons))


@dataclass(frozen=True)
class _Measured:
    """Matrices complex128 [P, outputs, inputs] at press depths [P] (m, increasing), and the
    repository and digest of their files."""

    depths: np.ndarray
    matrices: np.ndarray
    source: Source
    sha256: str


def _locate(path: str | Path | None) -> Path:
    """Folder ``Data`` of a copy of :data:`PRESSED`."""
    copy = PRESSED.folder() if path is None else Path(path).expanduser()
    return copy / "Data"


def _pressed(data: Path, outputs: int) -> _Measured:
    """The fibre of :data:`PRESSED`, one file per position of the actuator."""
    files = {}
    for file in data.glob("TM_modes_*.npz"):
        position = float(file.stem.removeprefix("TM_modes_")) * 1e-3
        # Rounded to a nanometre: 5.06 − 5.04 is not 0.02 in floating point, and it is an edge.
        files[round(position - CONTACT, 9)] = file
    require(bool(files), "scene.path", str(data), "a folder with TM_modes_*.npz")
    depths = sorted(files)
    shape = (outputs, outputs)
    arrays = [_array(files[depth], shape, "TM_corr_modes") for depth in depths]
    names = [file.name for file in files.values()]
    sha256 = PRESSED.check(data, [*names, MODES])
    matrices = np.stack(arrays)
    return _Measured(np.array(depths), matrices, PRESSED, sha256)


def _stepped(
    source: Source,
    file: str | None,
    step: float | None,
    outputs: int,
) -> _Measured:
    """A fibre whose matrices lie one press step apart in one array."""
    if not file or not step:
        raise ValueError("scene.source: expected scene.file and scene.step with it")
    folder = source.folder()
    matrices = _array(folder / file, (None, outputs, None))
    depths = np.round(np.arange(len(matrices)) * step, 9)
    sha256 = source.check(folder, [file])
    return _Measured(depths, matrices, source, sha256)


def _array(
    file: Path,
    shape: tuple[int | None, ...],
    key: str | None = None,
) -> np.ndarray:
    """A finite complex array from .npz[key] or .npy, None any length; nothing is unpickled."""
    try:
        loaded = np.load(file, allow_pickle=False)
        array = np.asarray(loaded[key] if key else loaded)
    except (OSError, EOFError, IndexError, KeyError, ValueError, BadZipFile) as error:
        raise ValueError(
            f"{file}: expected a complex array {shape}, found: {error}"
        ) from error
    lengths = zip(shape, array.shape, strict=False)
    fits = array.ndim == len(shape) and all(n in (None, found) for n, found in lengths)
    if not fits or array.dtype.kind != "c" or not np.isfinite(array).all():
        raise ValueError(
            f"{file}: expected a finite complex array {shape}, found {array.dtype} {array.shape}"
        )
    return array.astype(np.complex128)


def _mean_intensity(
    matrices: np.ndarray,
    modes: np.ndarray,
    field: np.ndarray,
    perturbation: float,
) -> float:
    """Mean of |E|² over pixels, positions [P] and perturbations: |M·a|² + ε²·‖M‖², M = modes·T.

    The sum over pixels is the quadratic form of the modes' Gram matrix, so no image is made.
    """
    gram = modes.conj() @ modes.T
    perturbations = perturbation * np.eye(len(field))
    inputs = np.concatenate([field[:, None], perturbations], axis=1)
    out = matrices @ inputs
    out = out.reshape(len(matrices), 2, len(modes), -1)
    sums = "pqms,mn,pqns->"
    power = np.einsum(sums, out.conj(), gram, out, optimize=True).real
    n_pixels = 2 * modes.shape[1]
    return float(power / (len(matrices) * n_pixels))


def _complex_normal(rng: np.random.Generator, n: int) -> np.ndarray:
    """n circular complex numbers of mean square 1."""
    parts = rng.standard_normal((n, 2))
    return parts.view(np.complex128)[:, 0] / np.sqrt(2)
