"""One class has a few frames more than the others: what becomes of each model.

A majority of n hypervectors whose bits correlate by c correlates with any other frame by

    C^p = g(n)·C^b,    g(n) ≈ √(2/π)·√(m/(1 + (m − 1)·c)),    m = n for odd n, n − 1 for even n:

the n bits of a pixel share a Gaussian, and g is the slope of the sign of their sum; for c = 0 it is
m·binom(m − 1, (m − 1)/2)/2^(m − 1). Where n is even, ties carry no vote: an even frame adds
nothing, and the next adds two. g multiplies what all frames have in common, too. For equal classes
it cancels; a class l of n + k frames takes a query of class q where g(n + k)/g(n) > C^b_qq/C^b_ql.
It is a lot for few frames of small c, nothing for c = 1, and falls as 1/(n²·c).

Integer prototypes, compared by the cosine, have √(n/(1 + (n − 1)·c)), so without the parity. The
mean image of more frames has less noise, and so is nearer to every frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import torch

from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.trial import instantiate
from experiments.studies.recordings.measure import Subsets, draw_split, nested
from hdc import HDCClassifier, bits
from hdc.prototypes import Counters


@experiment(revision=1)
def unequal(
    run: Run,
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    models: Mapping[str, Any],
    seeds: Sequence[int],
    n_per_class: Sequence[int],
    extra: Sequence[int] = (0, 1, 3),
    draws: int = 4,
    most_test: int = 200,
) -> Iterator[Row]:
    """One row: one model in one draw, trained on n frames of each class and ``extra`` more of one;
    ``right`` of ``n_test`` test frames, and ``to_larger`` of them that it puts into that class.

    ``n``, ``right`` and ``to_larger`` are lists. The larger class changes with the draw; the frames
    of a smaller n are among those of a larger one. Arguments: configs/experiment/unequal.yaml.

    Raises:
        ValueError: naming the key that is wrong.
    """
    built = {name: instantiate(part["model"], "model") for name, part in models.items()}
    for seed, recording in run.scenes(scene, seeds):
        subsets, n_classes = Subsets(recording), len(recording.classes)
        for draw in range(draws):
            pool, test = draw_split(recording, split, (seed, draw), most_test)
            order, _ = nested(pool, recording.labels, [], (seed, draw))
            room = min(map(len, order)) - max(extra)
            sizes = [n for n in n_per_class if n <= room]
            larger = draw % n_classes
            for more in extra:
                train = {n: _train(order, n, larger, more) for n in sizes}
                for name, model in built.items():
                    answers = [_predict(subsets, model, train[n], test) for n in sizes]
                    yield {
                        "origin": recording.origin, "seed": seed, "draw": draw, "model": name,
                        "n_classes": n_classes, "n_test": len(test), "extra": more, "n": sizes,
                        "right": [subsets.right(answer, test) for answer in answers],
                        "to_larger": [int((answer == larger).sum()) for answer in answers],
                    }  # fmt: skip
        run.note(f"seed {seed}")


def _train(order: Sequence[np.ndarray], n: int, larger: int, more: int) -> np.ndarray:
    """The first n frames of each class, and so many more of one."""
    return np.concatenate(
        [of[: n + more * (c == larger)] for c, of in enumerate(order)]
    )


def _predict(
    subsets: Subsets, model: Any, train: np.ndarray, test: np.ndarray
) -> np.ndarray:
    """Labels by a model of these frames; HDC with its own rule for unequal classes."""
    if not isinstance(model, HDCClassifier) or not model.balance:
        return subsets.predict(model, train, test)
    counters = Counters(subsets.products.n_classes, subsets.dimension)
    counters.add(subsets.words[train], torch.from_numpy(subsets.labels[train]))
    prototypes = counters.prototypes(model.ties, model.seed, int(counters.n.min()))
    return bits.hamming(subsets.words[test], prototypes).argmin(1).numpy()
