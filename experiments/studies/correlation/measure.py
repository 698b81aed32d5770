"""Correlations within and between classes (Figs. 4 and 7(a)): speckle, hypervectors, prototypes.

Eqs. 4 to 6 of the paper for every pair of classes and every seed. The paper takes 100 samples a
class, 80 of which make its prototype, and does not say with which of them Eq. 6 compares it: here
with those, with the others (``held-out``), and with ``all``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from torch import Tensor

from experiments.protocol import data
from experiments.protocol.scenes import scenes
from experiments.records.measurement import Row, folder_of, measure
from experiments.studies.correlation.kinds import KINDS, REDUCED
from experiments.studies.correlation.sums import CorrelationSums
from hdc import bits
from hdc.encode import encode
from hdc.prototypes import Counters
from scenes.frames import Scene

PARTS = ("training", "held-out")
SAMPLES = (*PARTS, "all")

Sums = dict[str, dict[str, CorrelationSums]]  # by what is correlated and by part


def run(
    name: str,
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    seeds: Sequence[int],
    kinds: Sequence[str] = KINDS,
    samples: Sequence[str] = SAMPLES,
    crop: Sequence[int] | None = None,
    device: str = "cpu",
    cache: bool = True,
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/NAME/``: rows.csv and, with `crop`, PNGs of the first seed.

    Args:
        name: of the measurement.
        scene, split: configurations; the training samples make the prototypes.
        seeds: of scene and split.
        kinds: which of ``speckle`` (C^s), ``hypervector`` (C^b), ``prototype`` (C^p).
        samples: which of ``training``, ``held-out``, ``all``.
        crop: top, left and edge in pixels of the part that the pictures show; null for none.
        device: where frames are made.
        cache: keep made frames in the results' cache.
        force: measure again.

    Returns:
        Path: the folder. The columns of its rows: ``origin`` of the frames; ``seed``; ``kind`` and
        ``samples`` as above; ``class_i`` (of the prototype, where there is one) and ``class_j``;
        ``value``, C_ij; ``n``, samples a class; ``undefined``, how many of the two classes' samples
        are constant.
    """
    for key, values, known in (("kinds", kinds, KINDS), ("samples", samples, SAMPLES)):
        if unknown := [value for value in values if value not in known]:
            raise ValueError(f"task.{key}: expected among {', '.join(known)}, found {unknown[0]!r}")
    console = Console(highlight=False)
    config = {
        "_target_": f"{__name__}.run",
        "name": name,
        "scene": scene,
        "split": split,
        "seeds": seeds,
        "kinds": kinds,
        "samples": samples,
        "crop": crop,
    }

    def compute() -> Iterator[Row]:
        for seed, made in scenes(scene, seeds, cache, console):
            members = members_of(made, split, seed)
            sums, prototypes = add_up(made, members, kinds, samples)
            for row in rows(made.classes, sums, prototypes, kinds, samples):
                yield {"origin": made.origin, "seed": seed, **row}
            if crop and seed == seeds[0]:
                first = members["training"][:, 0]
                write_images(made, first, prototypes, crop, folder_of(name, config))

    return measure(name, config, compute, device=device, force=force, console=console)


def members_of(scene: Scene, split: Mapping[str, Any], seed: int) -> dict[str, np.ndarray]:
    """Sample indices [L, N_s] of the training and of the held-out part.

    Raises:
        ValueError: if classes have different numbers of samples, for which Eq. 4 is not defined.
    """
    found = {}
    for part, chosen in zip(PARTS, data.choose(scene, split, seed), strict=True):
        by_class = [chosen[scene.labels[chosen] == c] for c in range(len(scene.classes))]
        counts = sorted({len(members) for members in by_class})
        if len(counts) > 1:
            raise ValueError(
                f"scene: expected as many {part} samples of every class, found {counts}"
            )
        found[part] = np.stack(by_class)
    return found


def add_up(
    scene: Scene,
    members: Mapping[str, np.ndarray],
    kinds: Sequence[str] = KINDS,
    samples: Sequence[str] = SAMPLES,
) -> tuple[Sums, Tensor]:
    """The sums that these rows need, and the prototypes bool [L, D]; each frame is read once."""
    n_classes, dimension = len(scene.classes), math.prod(scene.shape)
    parts = PARTS if "all" in samples else samples
    sums = {
        kind: {part: CorrelationSums(n_classes, dimension) for part in parts}
        for kind in {"hypervector" if kind == "prototype" else kind for kind in kinds}
    }
    counters = Counters(n_classes, dimension)
    for part, indices in members.items():
        for one_of_each in indices.T:
            frames = scene.frames(one_of_each).cpu()
            words = encode(frames)
            if part == "training":
                counters.add(words, torch.arange(n_classes))
            for kind, by_part in sums.items():
                if part in by_part:
                    ones = kind == "hypervector"
                    by_part[part].add(bits.unpack(words, dimension) if ones else frames.flatten(1))
    return sums, bits.unpack(counters.majority(), dimension)


def rows(
    classes: Sequence[str],
    sums: Sums,
    prototypes: Tensor,
    kinds: Sequence[str] = KINDS,
    samples: Sequence[str] = SAMPLES,
) -> Iterator[Row]:
    """Every C_ij, a row each."""
    for kind in kinds:
        parts = sums["hypervector" if kind == "prototype" else kind]
        for which in samples:
            found = parts["training"] + parts["held-out"] if which == "all" else parts[which]
            means = (
                found.means_with(prototypes.numpy()) if kind == "prototype" else found.pair_means()
            )
            for i, j in np.ndindex(means.shape):
                yield {
                    "kind": kind,
                    "samples": which,
                    "class_i": classes[i],
                    "class_j": classes[j],
                    "value": f"{means[i, j]:.6g}",
                    "n": found.n,
                    "undefined": int(found.undefined[list({i, j})].sum()),
                }


def write_images(
    scene: Scene, examples: np.ndarray, prototypes: Tensor, crop: Sequence[int], folder: Path
) -> list[Path]:
    """``CLASS-speckle.png``, ``CLASS-hypervector.png`` and ``CLASS-prototype.png``, cropped, and
    ``CLASS-whole.png``, the prototype of the whole frame, reduced by :data:`REDUCED`.

    Args:
        scene: where the frames come from.
        examples: a sample of each class [L].
        prototypes: bool [L, D].
        crop: top, left, edge in pixels.
        folder: of the files.
    """
    import cv2

    top, left, edge = check_crop(crop, scene.shape)
    frames = scene.frames(examples).cpu()
    ones = bits.unpack(encode(frames), prototypes.shape[1])
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {}
    for what, images in (
        ("speckle", frames),
        ("hypervector", 255 * ones.view(frames.shape).byte()),
        ("prototype", 255 * prototypes.view(frames.shape).byte()),
    ):
        for name, image in zip(scene.classes, images.numpy(), strict=True):
            part = np.ascontiguousarray(image[top : top + edge, left : left + edge])
            pictures[f"{name}-{what}.png"] = part
            if what == "prototype":
                size = (image.shape[1] // REDUCED, image.shape[0] // REDUCED)
                pictures[f"{name}-whole.png"] = cv2.resize(
                    image, size, interpolation=cv2.INTER_AREA
                )
    for name, picture in pictures.items():
        if not cv2.imwrite(str(folder / name), picture):
            raise OSError(f"{folder / name}: could not be written")
    return [folder / name for name in pictures]


def check_crop(crop: Sequence[int], shape: tuple[int, int]) -> tuple[int, int, int]:
    """Top, left, edge of a square within a frame.

    Raises:
        ValueError: if it is none.
    """
    if len(crop) != 3 or min(crop) < 0 or any(crop[i] + crop[2] > shape[i] for i in (0, 1)):
        raise ValueError(
            f"task.crop: expected top, left and edge of a square within {shape[0]} × {shape[1]} "
            f"pixels, found {list(crop)}"
        )
    top, left, edge = crop
    return top, left, edge
