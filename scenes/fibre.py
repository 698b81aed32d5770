"""How hard is a multimode fibre pressed? Frames computed from its measured transmission matrices.

The matrices were measured by Matthès et al., "Learning and Avoiding Disorder in Multimode Fibers",
Phys. Rev. X 11, 021060 (2021), and are published in ``wavefrontshaping/article_MMF_disorder``
(MIT licence). For an input field a, one complex amplitude a mode, the field at the output is

    E_p(x, y) = Σ_m  m_m(x, y) · (T·a)_{p,m},        p = two polarisations,

and a camera sees |E_p|². T and the modes m are measured; the frames are not: they are computed, so
noise is added here. Call them "measured transmission matrices", never camera frames.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import torch
from torch import Tensor

from scenes.validate import require_integer, require_number

DATA = "FIBRE_DATA"
"""Environment variable that names a copy of the repository."""
REPOSITORY = "wavefrontshaping/article_MMF_disorder"
CHECKOUT = Path(__file__).resolve().parents[1]
CANDIDATES = (
    CHECKOUT / "data" / "article_MMF_disorder",
    CHECKOUT.parent / "shared" / "data" / "mmf_disorder",
)
CONTACT = 5.04e-3
"""Position of the actuator (m) at which it starts to press; measured from there, as published."""
MODES, SIDE = 55, 41
"""Guided modes a polarisation, and pixels a side of the grid on which their fields are stored."""


class FibreScene:
    """Five classes of press depth of a graded-index fibre: "measured transmission matrices".

    Sample i belongs to class i mod L. Its actuator position is drawn uniformly among the measured
    positions of the class, so training and test samples share positions, and the finer steps below
    a class edge are no easier than they were in the laboratory. Its input field is a + ε·z: a is
    one random field shared by all samples, z an independent one of the same power. Everything
    drawn for sample i comes from its own generator, seeded by (sampling_seed, i): it is the same
    in any batch, order or number of samples.

    Args:
        path: a copy of the public repository; default: what the environment variable
            :data:`DATA` names, or the first of :data:`CANDIDATES` there is.
        depth_edges: upper press depths Δx (m) of the classes, increasing: the first class has
            Δx ≤ edges[0], the next edges[0] < Δx ≤ edges[1], ...
        samples_per_class: N / L.
        perturbation: ε ≥ 0.
        photons: mean photons a pixel (Poisson); 0 means no noise.
        saturation: 8-bit frames reach 255 at this multiple of the mean intensity. The exposure is
            fixed: the mean is taken over all positions and perturbations, not a frame.
        side: pixels a side of each polarisation's image; above 41 the *field* is interpolated,
            band-limited (zero-padded Fourier series: the modes are dark at the rim of the grid
            and sampled 1.5 times faster than their spectrum needs).
        seed: of the input field.
        sampling_seed: of positions, perturbations and photons.

    Attributes:
        labels, classes, shape, samples, origin: see :class:`scenes.frames.Scene`; shape is
            (side, 2·side), both polarisations side by side. ``samples["depth"]`` is Δx in metres.

    Raises:
        FileNotFoundError: no copy of the repository is at ``path``.
        ValueError: a file or a parameter is not as described.
    """

    origin = "measured"

    def __init__(
        self,
        path: str | Path | None = None,
        depth_edges: Sequence[float] = (0.0, 20e-6, 40e-6, 60e-6, 80e-6),
        samples_per_class: int = 100,
        perturbation: float = 0.3,
        photons: float = 50.0,
        saturation: float = 10.0,
        side: int = SIDE,
        seed: int = 0,
        sampling_seed: int = 0,
    ) -> None:
        edges = _edges(depth_edges)
        require_integer("scene.samples_per_class", samples_per_class, 1)
        require_number("scene.perturbation", perturbation, 0)
        require_number("scene.photons", photons, 0)
        require_number("scene.saturation", saturation, 0, strict=True)
        require_integer("scene.side", side, SIDE, 4096)
        require_integer("scene.seed", seed, 0)
        require_integer("scene.sampling_seed", sampling_seed, 0)

        depths, self._matrices, self._modes = _load(_locate(path))
        class_of = np.searchsorted(edges, depths)  # Δx ≤ edges[0] → 0; deeper than all → L
        members = [np.flatnonzero(class_of == c) for c in range(len(edges))]
        for c, positions in enumerate(members):
            if not len(positions):
                raise ValueError(
                    f"scene.depth_edges: class {c} ({_class_name(edges, c)}) holds none of the "
                    f"{len(depths)} measured depths ({depths[0]:g} … {depths[-1]:g} m)"
                )

        n = len(edges) * samples_per_class
        self.classes = tuple(_class_name(edges, c) for c in range(len(edges)))
        self.labels = np.arange(n) % len(edges)
        self.shape = (side, 2 * side)
        self._perturbation, self._photons = float(perturbation), float(photons)
        self._sampling_seed = sampling_seed
        self._position = np.array(
            [self._draw(i).choice(members[c]) for i, c in enumerate(self.labels)]
        )
        self.samples: Mapping[str, np.ndarray] = {
            "order": np.arange(n),
            "depth": depths[self._position],
        }

        self._field = _complex_normal(np.random.default_rng(seed), 2 * MODES)
        used = self._matrices[np.concatenate(members)]
        self._mean = _mean_intensity(used, self._modes, self._field, self._perturbation)
        self._full_scale = float(saturation) * self._mean
        self._interpolate = _dirichlet(side) if side > SIDE else None
        settings = (tuple(edges), samples_per_class, self._perturbation, self._photons)
        self._settings = (*settings, float(saturation), side, seed, sampling_seed)

    def __len__(self) -> int:
        return len(self.labels)

    def frames(self, indices: Sequence[int] | np.ndarray | Tensor) -> Tensor:
        """Frames uint8 [len(indices), side, 2·side].

        Raises:
            IndexError: an index is outside [0, N).
        """
        index = np.asarray(indices, dtype=np.int64).reshape(-1)
        if len(index) and not 0 <= index.min() <= index.max() < len(self):
            raise IndexError(f"indices: expected values in [0, {len(self)}), found {index}")
        out = np.empty((len(index), *self.shape), np.uint8)
        for k, i in enumerate(index):
            out[k] = self._frame(int(i))
        return torch.from_numpy(out)

    def fingerprint(self) -> str:
        """SHA-256 over the measured arrays and every parameter but the path."""
        digest = hashlib.sha256(repr(("fibre", self._settings)).encode())
        for array in (self._matrices, self._modes, self.samples["depth"]):
            digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()

    def _draw(self, i: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence([self._sampling_seed, i]))

    def _frame(self, i: int) -> np.ndarray:
        # One sample at a time: in a batched product the last bit of the intensity would depend on
        # the batch, and a photon count with it.
        rng = self._draw(i)
        rng.choice(1)  # the position, drawn in __init__
        field = self._field + self._perturbation * _complex_normal(rng, 2 * MODES)
        amplitudes = (self._matrices[self._position[i]] @ field).reshape(2, MODES)
        image = (amplitudes @ self._modes).reshape(2, SIDE, SIDE)
        if self._interpolate is not None:
            image = self._interpolate @ image @ self._interpolate.T
        intensity = np.hstack(list(image.real**2 + image.imag**2))
        if self._photons:
            intensity = rng.poisson(intensity * (self._photons / self._mean))
            intensity = intensity * (self._mean / self._photons)
        return np.clip(np.rint(intensity * (255 / self._full_scale)), 0, 255).astype(np.uint8)


def _locate(path: str | Path | None) -> Path:
    named = [Path(folder) for folder in (path, os.environ.get(DATA)) if folder]
    tried = [named[0].expanduser()] if named else CANDIDATES
    for folder in tried:
        if (folder / "Data").is_dir():
            return folder / "Data"
    places = " and ".join(str(folder / "Data") for folder in tried)
    raise FileNotFoundError(
        f"scene.path: expected a copy of the public repository {REPOSITORY} "
        f"(github.com/{REPOSITORY}), found no folder {places}"
    )


def _load(data: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Press depths [P] (m, increasing), matrices complex128 [P, 110, 110], modes [55, 1681]."""
    found = {}
    for file in data.iterdir():
        if match := re.fullmatch(r"TM_modes_(\d+(?:\.\d+)?)\.npz", file.name):
            # Rounded to a nanometre: 5.06 − 5.04 is not 0.02 in floating point, and it is an edge.
            found[round(float(match[1]) * 1e-3 - CONTACT, 9)] = file
    if not found:
        raise FileNotFoundError(f"{data}: expected files TM_modes_X.npz, found none")
    depths = sorted(found)
    matrices = np.stack([_array(found[d], "TM_corr_modes", (2 * MODES, 2 * MODES)) for d in depths])
    modes = _array(data / "modes_out_after_correction.npy", None, (MODES, SIDE * SIDE))
    return np.array(depths), matrices, modes


def _array(file: Path, key: str | None, shape: tuple[int, int]) -> np.ndarray:
    """One finite complex array of the given shape from .npz[key] or .npy; nothing is unpickled."""
    what = f"{file}[{key}]" if key else str(file)
    try:
        loaded = np.load(file, allow_pickle=False)
        if isinstance(loaded, np.lib.npyio.NpzFile) != (key is not None):
            raise ValueError(f"not the format that {file.suffix} promises")
        array = loaded[key] if key else loaded
    except (OSError, EOFError, KeyError, ValueError, BadZipFile) as error:
        raise ValueError(f"{what}: expected a complex array {shape}, found: {error}") from error
    if array.shape != shape or array.dtype.kind != "c":
        raise ValueError(
            f"{what}: expected a complex array {shape}, found {array.dtype} {array.shape}"
        )
    if not np.isfinite(array).all():
        raise ValueError(f"{what}: expected finite values, found NaN or infinity")
    return array.astype(np.complex128)


def _mean_intensity(
    matrices: np.ndarray, modes: np.ndarray, field: np.ndarray, perturbation: float
) -> float:
    """Mean of |E|² over pixels, positions [P] and perturbations: |M·a|² + ε²·‖M‖², M = modes·T.

    The sum over pixels is the quadratic form of the modes' Gram matrix, so no image is made.
    """
    gram = modes.conj() @ modes.T
    sources = np.concatenate([field[:, None], perturbation * np.eye(len(field))], axis=1)
    out = (matrices @ sources).reshape(len(matrices), 2, MODES, -1)
    power = np.einsum("pqms,mn,pqns->", out.conj(), gram, out, optimize=True).real
    return float(power / (len(matrices) * 2 * modes.shape[1]))


def _dirichlet(side: int) -> np.ndarray:
    """Matrix [side, 41] of trigonometric interpolation, pixel centres spread over the same width.

    It is the zero-padded FFT written as a sum: Σ_k exp(2πi·k·x/41)/41 over the 41 frequencies.
    """
    x = (np.arange(side) + 0.5) * SIDE / side - 0.5
    k = np.arange(-(SIDE // 2), SIDE // 2 + 1)
    offsets = x[:, None, None] - np.arange(SIDE)[None, :, None]
    return np.cos(2 * np.pi * k * offsets / SIDE).sum(-1) / SIDE


def _complex_normal(rng: np.random.Generator, n: int) -> np.ndarray:
    """n circular complex numbers of mean square 1."""
    return rng.standard_normal((n, 2)).view(np.complex128)[:, 0] / np.sqrt(2)


def _edges(depth_edges: Sequence[float]) -> np.ndarray:
    try:
        edges = np.asarray(depth_edges, dtype=np.float64)
    except (TypeError, ValueError):
        edges = np.empty(0)
    if edges.ndim != 1 or len(edges) < 2 or not (np.diff(edges) > 0).all():
        raise ValueError(
            f"scene.depth_edges: expected two or more increasing depths in metres, "
            f"found {depth_edges!r}"
        )
    return edges


def _class_name(edges: np.ndarray, c: int) -> str:
    um = [f"{edge * 1e6:g}" for edge in edges]
    return f"≤ {um[0]} µm" if c == 0 else f"{um[c - 1]}–{um[c]} µm"
