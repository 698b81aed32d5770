"""The classifier of the paper on recordings that others measured.

Every model is trained on n frames of each class and asked about held-out frames, for several n,
draws and ways to split. A split by time, session or group keeps near copies of a test frame out of
the training; a random one does not. Models that only learn by steps are asked in fewer draws.

Each recording is one sensor: draws vary the frames, not the sensor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from omegaconf import OmegaConf

from experiments.protocol.data import at_seed
from experiments.protocol.draws import draw_split, nested
from experiments.protocol.evaluate import bank_of, evaluate
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.model import Model, models_of
from experiments.protocol.stop import StopRule
from experiments.protocol.trial import stop_rule
from hdc import bits, theory
from hdc.bank import Bank


class Asked(NamedTuple):
    """A model, in how many draws and at which sizes it is asked (None: at all), and its rule."""

    model: Model
    draws: int
    sizes: Sequence[int] | None = None
    stop: StopRule | None = None


@experiment(revision=1, uses=("hdc.HDCClassifier",))
def recordings(
    run: Run,
    scene: Mapping[str, Any],
    splits: Mapping[str, Mapping[str, Any]],
    models: Mapping[str, Any],
    n_per_class: Sequence[int],
    draws: int = 20,
    seeds: Sequence[int] = (0,),
    most_test: int = 400,
    by_steps: Mapping[str, Any] | None = None,
    stop: Mapping[str, Any] | None = None,
    steps_draws: int = 3,
    steps_n: Sequence[int] = (),
) -> Iterator[Row]:
    """One row: one model in one draw of one split; ``right`` of ``n_test`` frames after each ``n``
    frames of every class.

    ``n`` and ``right`` are lists. Arguments: configs/experiment/recordings.yaml.

    Raises:
        ValueError: naming the key that is wrong.
    """
    asked = {
        name: Asked(model, draws)
        for name, model in models_of(at_seed(models, 0)).items()
    }
    rule = stop_rule(OmegaConf.create(dict(stop or {})))
    for name, model in models_of(at_seed(by_steps or {}, 0)).items():
        asked[name] = Asked(model, min(steps_draws, draws), steps_n, rule)
    for seed, recording in run.scenes(scene, seeds):
        bank = bank_of(recording)
        for split, config in splits.items():
            pool_of = partial(draw_split, recording, config, most_test=most_test)
            draw = partial(_draw, bank, pool_of, asked, n_per_class)
            for k in range(draws):
                place = {"seed": seed, "split": split, "draw": k}
                for row in run.part(place, partial(draw, (seed, k))):
                    yield {"origin": recording.origin, **place, **row}


def _draw(
    bank: Bank,
    pool_of: Any,
    models: Mapping[str, Asked],
    n_per_class: Sequence[int],
    seed: tuple[int, int],
) -> Iterator[Row]:
    """The rows of one draw, a row per model."""
    pool, test = pool_of(seed=seed)
    order, sizes = nested(pool, bank.labels, n_per_class, seed)
    for name, asked in models.items():
        if seed[1] >= asked.draws:
            continue
        chosen = [n for n in sizes if asked.sizes is None or n in asked.sizes]
        right = []
        for n in chosen:
            train = np.concatenate([of_class[:n] for of_class in order])
            predicted = evaluate(asked.model, bank, train, test, asked.stop)
            right.append(int((predicted == bank.labels[test]).sum()))
        yield {"model": name, "n_test": len(test), "n": chosen, "right": right}


@experiment(revision=1, uses=("hdc.HDCClassifier",))
def recording_distances(
    run: Run,
    scene: Mapping[str, Any],
    seeds: Sequence[int] = (0,),
    bins: int = 100,
    most: int = 1000,
) -> Iterator[Row]:
    """One row: pairs of frames of one class (``intra``) or of two (``inter``) whose hypervectors
    differ in a share of bits between ``low`` and ``high``; with their mean and variance.

    Arguments: configs/experiment/recording_distances.yaml.
    """
    for seed, recording in run.scenes(scene, seeds):
        chosen = np.arange(len(recording.labels))
        if len(chosen) > most:
            chosen = np.sort(np.random.default_rng(seed).permutation(chosen)[:most])
        bank = bank_of(recording, chosen)
        distances = bits.hamming(bank.words(), bank.words()).numpy() / bank.dimension
        upper = np.triu_indices(len(chosen), 1)
        same = np.equal.outer(bank.labels, bank.labels)[upper]
        pairs = distances[upper]
        for kind, values in (("intra", pairs[same]), ("inter", pairs[~same])):
            counts, edges = np.histogram(values, bins, (0.0, 0.6))
            moments = {"mean": float(values.mean()), "variance": float(values.var())}
            for count, low, high in zip(counts, edges, edges[1:], strict=False):
                yield {
                    "origin": recording.origin,
                    "seed": seed,
                    "kind": kind,
                    "pairs": len(values),
                    "low": float(low),
                    "high": float(high),
                    "count": int(count),
                    **moments,
                }


@experiment(revision=1, uses=("hdc.HDCClassifier",))
def recording_theory(
    run: Run,
    scene: Mapping[str, Any],
    n_per_class: Sequence[int],
    seeds: Sequence[int] = (0,),
    draws: int = 20,
    sample: int = 10,
) -> Iterator[Row]:
    """One row: accuracies that theory expects of ``hdc`` and of the mean image (``mean_image``)
    after ``n`` frames of every class, from the pairs of only ``sample`` frames of every class.

    No frame is classified. See :mod:`hdc.theory`.
    Arguments: configs/experiment/recording_theory.yaml.
    """
    for seed, recording in run.scenes(scene, seeds):
        bank = bank_of(recording)
        every = np.arange(len(bank))
        for k in range(draws):
            order, _ = nested(every, bank.labels, (), (seed, k))
            few = np.concatenate([of_class[:sample] for of_class in order])
            of_bits, of_greys = theory.correlations_of(bank, few)
            for n in n_per_class:
                total = n * bank.n_classes
                yield {
                    "origin": recording.origin,
                    "seed": seed,
                    "draw": k,
                    "n": n,
                    "hdc": theory.hdc_accuracy(of_bits, total, bank.dimension),
                    "mean_image": theory.mean_image_accuracy(of_greys, total),
                }
        run.note(f"seed {seed}")
