"""Correlations within and between classes (Figs. 4 and 7(a)): speckle, hypervectors, prototypes.

The paper takes 100 samples per class, 80 of which make its prototype, and does not say which of
them Eq. 6 compares with the prototype. Here it is compared with the samples that made it
(``training``), with the others (``held-out``), and with ``all``.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from experiments.protocol.settings import Split
from experiments.protocol.splits import choose
from experiments.protocol.task import Context, Row, Task
from experiments.studies.correlation.pairs import CorrelationSums
from hdc import bits
from hdc.encoders import Median
from hdc.prototypes import Counters
from scenes.frames import Scene

# Kinds of Eqs. 4, 5 and 6, and what they correlate: Eq. 6 a prototype with hypervectors.
KINDS = {
    "speckle": "speckle",
    "hypervector": "hypervector",
    "prototype": "hypervector",
}
PARTS = ("training", "held-out")
SAMPLES = (*PARTS, "all")

# By what is correlated and by part.
Sums = Mapping[tuple[str, str], CorrelationSums]


class Correlation(Task, frozen=True):
    """One row: mean correlation of two classes, C_ij of Eq. 4, 5 or 6, on one sensor.

    ``class_i`` is the class of the prototype in Eq. 6; ``n`` counts the samples of a class, and
    ``undefined`` the constant samples of both.
    Arguments: configs/experiment/correlation.yaml.
    """

    revision: ClassVar = 2
    uses: ClassVar = ("hdc.HDCClassifier",)

    scene: Mapping[str, Any]
    split: Split
    seeds: Sequence[int]
    kinds: Sequence[str]
    samples: Sequence[str]

    def rows(self, context: Context) -> Iterator[Row]:
        if set(self.kinds) - set(KINDS):
            raise ValueError(
                f"task.kinds: expected among {', '.join(KINDS)}, found {list(self.kinds)}"
            )
        for seed, sensor in context.scenes(self.scene, self.seeds):
            for row in correlations(sensor, self.split, seed):
                if row["kind"] in self.kinds and row["samples"] in self.samples:
                    yield {"origin": sensor.origin, "seed": seed, **row}
            context.note(f"seed {seed}")


def correlations(scene: Scene, split: Split, seed: int) -> Iterator[Row]:
    """Every C_ij of a scene, a row each; see :class:`Correlation`."""
    sums, prototypes = add_up(scene, members_of(scene, split, seed))
    for kind, what in KINDS.items():
        training, held_out = (sums[what, part] for part in PARTS)
        of_samples = (training, held_out, training + held_out)
        for name, total in zip(SAMPLES, of_samples, strict=True):
            if kind == "prototype":
                means = total.means_with(prototypes.numpy())
            else:
                means = total.pair_means()
            for i, j in np.ndindex(means.shape):
                yield {
                    "kind": kind,
                    "samples": name,
                    "class_i": scene.classes[i],
                    "class_j": scene.classes[j],
                    "value": float(means[i, j]),
                    "n": total.n,
                    "undefined": int(total.undefined[np.unique([i, j])].sum()),
                }


def members_of(scene: Scene, split: Split, seed: int) -> dict[str, np.ndarray]:
    """Sample indices [L, N_s] of the training and of the held-out part.

    Raises:
        ValueError: if classes have different numbers of samples, for which Eq. 4 is not defined.
    """
    members = {}
    of_parts = choose(scene, split, seed)
    for part, chosen in zip(PARTS, of_parts, strict=True):
        labels = scene.labels[chosen]
        by_class = [chosen[labels == c] for c in range(len(scene.classes))]
        counts = sorted({len(indices) for indices in by_class})
        if len(counts) > 1:
            raise ValueError(
                f"scene: expected as many {part} samples of every class, found {counts}"
            )
        members[part] = np.stack(by_class)
    return members


def add_up(scene: Scene, members: Mapping[str, np.ndarray]) -> tuple[Sums, Tensor]:
    """The sums of parts of the samples, and the prototypes bool [L, D]; each frame is read once."""
    n_classes, dimension = len(scene.classes), math.prod(scene.shape)
    sums = defaultdict[tuple[str, str], CorrelationSums](CorrelationSums)
    counters = Counters(n_classes, dimension)
    for part, indices in members.items():
        for sample_of_each in indices.T:
            frames = scene.frames(sample_of_each).cpu()
            words = Median().encode(frames)
            if part == "training":
                counters.add(words, torch.arange(n_classes))
            ones = bits.unpack(words, dimension)
            sums["speckle", part] += CorrelationSums.of(frames.flatten(1))
            sums["hypervector", part] += CorrelationSums.of(ones)
    return sums, bits.unpack(counters.majority(), dimension)
