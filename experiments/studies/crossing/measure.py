"""How many samples are enough, asked as the paper asked: one experiment at a time (Fig. 5(b)).

An experiment is one random split of a sensor's frames and one order of its training samples, asked
after the first n of that order, for every n. As in the paper, n counts the samples of all L classes
together (N_s = n/L of each); where it is no multiple of L, some classes have one more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from experiments.protocol.evaluate import bank_of, evaluate
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.model import models_of
from hdc import theory
from scenes.split import learning_curve_subsets, split


@experiment(revision=1, uses=("hdc.HDCClassifier",))
def crossing(
    run: Run,
    scene: Mapping[str, Any],
    models: Mapping[str, Any],
    seeds: Sequence[int],
    draws: int = 20,
    n_train: Sequence[int] = (5, 60),
    n_test: int = 100,
) -> Iterator[Row]:
    """One row: one model in one experiment; ``right`` of ``n_test`` test samples after each ``n``.

    ``n`` and ``right`` are lists; ``rows.explode(["n", "right"])`` makes them tidy.
    Arguments: configs/experiment/crossing.yaml.
    """
    sizes, built = _sizes(n_train), models_of(models)
    for seed, sensor in run.scenes(scene, seeds):
        bank = bank_of(sensor)
        for draw in range(draws):
            random = np.random.default_rng((seed, draw))
            drawn = int(random.integers(2**31))
            pool, test = split(bank.labels, n_test=n_test, seed=drawn)
            most = sizes[-1]
            order = learning_curve_subsets(pool, bank.labels, [most], drawn)[most]
            for name, model in built.items():
                right = []
                for n in sizes:
                    predicted = evaluate(model, bank, order[:n], test)
                    right.append(int((predicted == bank.labels[test]).sum()))
                yield {
                    "origin": sensor.origin,
                    "seed": seed,
                    "draw": draw,
                    "model": name,
                    "n_classes": len(sensor.classes),
                    "n_test": n_test,
                    "n": list(sizes),
                    "right": right,
                }
        run.note(f"seed {seed}")


@experiment(revision=1, uses=("hdc.HDCClassifier",))
def crossing_theory(
    run: Run,
    scene: Mapping[str, Any],
    seeds: Sequence[int],
    n_train: Sequence[int] = (5, 60),
) -> Iterator[Row]:
    """One row: accuracies that theory expects after ``n`` samples of the classes of one sensor.

    ``hdc`` has the measured skewness of single correlations, ``hdc_gaussian`` none; ``mean_image``
    correlates a frame with the mean frames of the classes. See :mod:`hdc.theory`.
    Arguments: configs/experiment/crossing_theory.yaml.
    """
    sizes = _sizes(n_train)
    for seed, sensor in run.scenes(scene, seeds):
        bank = bank_of(sensor)
        of_bits, of_greys = theory.correlations_of(bank, np.arange(len(bank)))
        gaussian = of_bits._replace(skew=np.zeros_like(of_bits.skew))
        for n in sizes:
            yield {
                "origin": sensor.origin,
                "seed": seed,
                "n_classes": len(sensor.classes),
                "n": n,
                "hdc": theory.hdc_accuracy(of_bits, n, bank.dimension),
                "hdc_gaussian": theory.hdc_accuracy(gaussian, n, bank.dimension),
                "mean_image": theory.mean_image_accuracy(of_greys, n),
            }
        run.note(f"seed {seed}")


def _sizes(n_train: Sequence[int]) -> range:
    if len(n_train) != 2 or not 0 < n_train[0] <= n_train[1]:
        raise ValueError(
            f"task.n_train: expected first and last n, found {list(n_train)}"
        )
    return range(n_train[0], n_train[1] + 1)
