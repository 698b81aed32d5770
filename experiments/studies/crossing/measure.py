"""How many samples are enough, asked as the paper asked: one experiment at a time (Fig. 5(b)).

An experiment is one random split of a sensor's frames and one order of its training samples; it is
asked at every N, the first N of that order, so that it sees its accuracy rise as who reads a curve
does. N is, as in the paper, the number of samples of all L classes together (N_s = N/L of each);
where it is no multiple of L, some classes have one more. Frames are encoded once, counters grow by
one sample from N to N + 1, and the linear models are solved in the space of samples
(protocol.subsets).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from torch import Tensor

from experiments.protocol.scenes import scenes
from experiments.protocol.subsets import Products, models_of
from experiments.records.measurement import Row, measure
from experiments.studies.crossing import theory
from hdc import HDCClassifier, bits
from hdc.encode import encode
from hdc.prototypes import Counters
from scenes.split import learning_curve_subsets, split

MOMENTS = ("correlation", "scatter_sample", "scatter_query", "skewness")  # theory.Correlations
THEORY = ("theory", "theory_gaussian")  # with the measured skewness, and without any


def run(
    scene: Mapping[str, Any],
    models: Mapping[str, Any],
    seeds: Sequence[int],
    draws: int,
    n_train: Sequence[int],
    n_test: int,
    device: str = "cpu",
    cache: bool = True,
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/crossing/``.

    Args:
        scene: configuration.
        models: by name, what a file of ``configs/model`` holds; only its part ``model`` counts.
        seeds: of the scene: sensors.
        draws: experiments with every sensor.
        n_train: first and last N.
        n_test: test samples of an experiment.
        device: where frames are made.
        cache: keep made frames in the results' cache.
        force: measure again.

    Returns:
        Path: the folder. Its rows have ``origin`` of the frames and ``seed``, and are of three
        kinds: ``draw``, ``n``, ``n_test`` and, by the name of a model, how many test samples it has
        right; ``class_i`` of queries, ``class_j`` of samples and, of all frames of the sensor, what
        :mod:`.theory` needs, :data:`MOMENTS` and ``dimension``; ``n`` and the accuracies that it
        expects of HDC, :data:`THEORY`.

    Raises:
        ValueError: naming the key that is wrong.
    """
    made_models = models_of(models)
    if len(n_train) != 2 or not 0 < n_train[0] <= n_train[1]:
        raise ValueError(f"task.n_train: expected first and last N, found {list(n_train)}")
    console = Console(highlight=False)
    config = {
        "_target_": f"{__name__}.run",
        "scene": scene,
        "models": {name: {"model": part["model"]} for name, part in models.items()},
        "seeds": seeds,
        "draws": draws,
        "n_train": n_train,
        "n_test": n_test,
    }
    sizes = range(n_train[0], n_train[1] + 1)

    def compute() -> Iterator[Row]:
        for seed, made in scenes(scene, seeds, cache, console):
            of = {"origin": made.origin, "seed": seed}
            frames = made.frames(np.arange(len(made.labels))).cpu()
            words, dimension = encode(frames), frames[0].numel()
            found = theory.correlations(pair_correlations(words, dimension), made.labels)
            for i, j in np.ndindex(found.mean.shape):
                values = zip(MOMENTS, found, strict=True)
                yield {**of, "class_i": made.classes[i], "class_j": made.classes[j],
                       "dimension": dimension,
                       **{key: f"{value[i, j]:.6g}" for key, value in values}}  # fmt: skip
            plain = found._replace(skew=np.zeros_like(found.skew))
            for n in sizes:
                said = {name: theory.accuracy(given, n, dimension)
                        for name, given in zip(THEORY, (found, plain), strict=True)}  # fmt: skip
                yield {**of, "n": n, **said}
            products = Products(frames, made.labels, len(made.classes))
            for draw in range(draws):
                chosen = int(np.random.default_rng((seed, draw)).integers(2**31))
                train, test = split(made.labels, n_test=n_test, seed=chosen)
                order = learning_curve_subsets(train, made.labels, [sizes[-1]], chosen)[sizes[-1]]
                right = {
                    name: hdc_right(words, made.labels, order, test, sizes, model, dimension)
                    if isinstance(model, HDCClassifier)
                    else [
                        int((products.scores(model, order[:n], test).argmax(1).numpy()
                             == made.labels[test]).sum())
                        for n in sizes
                    ]
                    for name, model in made_models.items()
                }  # fmt: skip
                for k, n in enumerate(sizes):
                    counts = {name: values[k] for name, values in right.items()}
                    yield {**of, "draw": draw, "n": n, "n_test": n_test, **counts}
            console.print(f"[dim]crossing: seed {seed}[/dim]")

    return measure("crossing", config, compute, device=device, force=force, console=console)


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

    A further sample changes one class only: its counters, its prototype, its distances.

    Args:
        words: hypervectors int64 [N, W].
        labels: int64 [N].
        order: training indices; the first sizes[0] have every class.
        test: test indices.
        sizes: increasing by one.
        model: whose rule of ties decides.
        dimension: D.
    """
    counters = Counters(int(labels.max()) + 1, dimension)
    distances = np.empty((len(test), len(counters.n)), np.int64)
    targets, right = torch.from_numpy(labels[order]), []
    for k in range(sizes[-1]):
        counters.add(words[order[k : k + 1]], targets[k : k + 1])
        c = int(targets[k])
        prototype = counters.prototype(c, model.ties, model.seed)
        distances[:, c] = bits.hamming(words[test], prototype[None])[:, 0]
        if k + 1 in sizes:
            right.append(int((distances.argmin(1) == labels[test]).sum()))
    return right


def pair_correlations(words: Tensor, dimension: int) -> np.ndarray:
    """Correlation coefficients of the bits of all pairs of hypervectors, float64 [N, N]."""
    ones = bits.count_ones(words).numpy() / dimension
    both = (ones[:, None] + ones - bits.hamming(words, words).numpy() / dimension) / 2
    deviation = np.sqrt(ones * (1 - ones))
    return (both - np.outer(ones, ones)) / np.outer(deviation, deviation)
