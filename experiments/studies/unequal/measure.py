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

from experiments.protocol.draws import draw_split, nested
from experiments.protocol.evaluate import bank_of, evaluate
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.model import models_of


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
    built = models_of(models)
    for seed, recording in run.scenes(scene, seeds):
        bank = bank_of(recording)
        for draw in range(draws):
            pool, test = draw_split(recording, split, (seed, draw), most_test)
            order, _ = nested(pool, bank.labels, [], (seed, draw))
            room = min(map(len, order)) - max(extra)
            sizes = [n for n in n_per_class if n <= room]
            larger = draw % bank.n_classes
            for more in extra:
                training = [_training_set(order, n, larger, more) for n in sizes]
                for name, model in built.items():
                    answers = [evaluate(model, bank, train, test) for train in training]
                    right, to_larger = [], []
                    for answer in answers:
                        right.append(int((answer == bank.labels[test]).sum()))
                        to_larger.append(int((answer == larger).sum()))
                    yield {
                        "origin": recording.origin,
                        "seed": seed,
                        "draw": draw,
                        "model": name,
                        "n_classes": bank.n_classes,
                        "n_test": len(test),
                        "extra": more,
                        "n": sizes,
                        "right": right,
                        "to_larger": to_larger,
                    }
        run.note(f"seed {seed}")


def _training_set(
    order: Sequence[np.ndarray],
    n: int,
    larger: int,
    more: int,
) -> np.ndarray:
    """The first n frames of each class, and so many more of one."""
    parts = []
    for c, of_class in enumerate(order):
        size = n + more if c == larger else n
        parts.append(of_class[:size])
    return np.concatenate(parts)
