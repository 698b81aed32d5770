"""How many samples are enough, asked as the paper asked: one experiment at a time (Fig. 5(b)).

An experiment is one random split of a sensor's frames and one order of its training samples, asked
after the first n of that order, for every n. As in the paper, n counts the samples of all L classes
together (N_s = n/L of each); where it is no multiple of L, some classes have one more. Frames are
encoded once, counters grow by one sample at a time, and linear models are solved in sample space.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines.dual import Products
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.model import models_of
from hdc import HDCClassifier, bits, theory
from hdc.encode import encode
from hdc.prototypes import Counters
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
        frames, labels = (
            sensor.frames(np.arange(len(sensor.labels))).cpu(),
            sensor.labels,
        )
        words, products = encode(frames), Products(frames, labels, len(sensor.classes))
        for draw in range(draws):
            drawn = int(np.random.default_rng((seed, draw)).integers(2**31))
            train, test = split(labels, n_test=n_test, seed=drawn)
            order = learning_curve_subsets(train, labels, [sizes[-1]], drawn)[sizes[-1]]
            for name, model in built.items():
                if isinstance(model, HDCClassifier):
                    right = hdc_right(
                        words, labels, order, test, sizes, model, frames[0].numel()
                    )
                else:
                    answers = (
                        products.scores(model, order[:n], test).argmax(1) for n in sizes
                    )
                    right = [
                        int((answer.numpy() == labels[test]).sum())
                        for answer in answers
                    ]
                yield {
                    "origin": sensor.origin, "seed": seed, "draw": draw, "model": name,
                    "n_classes": len(sensor.classes), "n_test": n_test,
                    "n": list(sizes), "right": right,
                }  # fmt: skip
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
    correlates a frame with the mean frames of the classes. See :mod:`.theory`.
    Arguments: configs/experiment/crossing_theory.yaml.
    """
    sizes = _sizes(n_train)
    for seed, sensor in run.scenes(scene, seeds):
        everyone, labels = np.arange(len(sensor.labels)), sensor.labels
        frames = sensor.frames(everyone).cpu()
        dimension = frames[0].numel()
        of_bits = theory.correlations(
            bit_correlations(encode(frames), dimension), labels
        )
        products = Products(frames, labels, len(sensor.classes))
        standardised, _ = products.kernel(everyone, everyone[:0], "standardised")
        of_frames = theory.correlations(standardised.numpy() / dimension, labels)
        gaussian = of_bits._replace(skew=np.zeros_like(of_bits.skew))
        for n in sizes:
            yield {
                "origin": sensor.origin, "seed": seed, "n_classes": len(sensor.classes), "n": n,
                "hdc": theory.hdc_accuracy(of_bits, n, dimension),
                "hdc_gaussian": theory.hdc_accuracy(gaussian, n, dimension),
                "mean_image": theory.mean_image_accuracy(of_frames, n),
            }  # fmt: skip
        run.note(f"seed {seed}")


def _sizes(n_train: Sequence[int]) -> range:
    if len(n_train) != 2 or not 0 < n_train[0] <= n_train[1]:
        raise ValueError(
            f"task.n_train: expected first and last n, found {list(n_train)}"
        )
    return range(n_train[0], n_train[1] + 1)


def hdc_right(
    words: Tensor,
    labels: np.ndarray,
    order: np.ndarray,
    test: np.ndarray,
    sizes: range,
    model: HDCClassifier,
    dimension: int,
) -> list[int]:
    """Test samples that HDC has right after the first n of `order`, for each n of `sizes`.

    A further sample changes one class, or all where prototypes are balanced and the smallest class
    grew: its counters, its prototype, its distances. The first sizes[0] of `order` have every
    class; `words` are hypervectors int64 [N, W]; of the model ties and balance count.
    """
    counters = Counters(int(labels.max()) + 1, dimension)
    distances = np.empty((len(test), len(counters.n)), np.int64)
    targets, right = torch.from_numpy(labels[order]), []
    size: int | None = None
    for k in range(sizes[-1]):
        counters.add(words[order[k : k + 1]], targets[k : k + 1])
        before, size = (
            size,
            int(counters.n[counters.n > 0].min()) if model.balance else None,
        )
        changed = (
            [int(targets[k])]
            if size == before
            else counters.n.nonzero().flatten().tolist()
        )
        for c in changed:
            prototype = counters.prototype(c, model.ties, model.seed, size=size)
            distances[:, c] = bits.hamming(words[test], prototype[None])[:, 0]
        if k + 1 in sizes:
            right.append(int((distances.argmin(1) == labels[test]).sum()))
    return right


def bit_correlations(words: Tensor, dimension: int) -> np.ndarray:
    """Correlation coefficients of all pairs of hypervectors int64 [N, W], float64 [N, N]."""
    ones = bits.count_ones(words).numpy() / dimension
    both = (ones[:, None] + ones - bits.hamming(words, words).numpy() / dimension) / 2
    deviation = np.sqrt(ones * (1 - ones))
    return (both - np.outer(ones, ones)) / np.outer(deviation, deviation)
