"""The classifier of the paper on recordings that others measured.

Every model is trained on n frames of each class and asked about held-out frames, for several n,
draws and ways to split. A split by time, session or group keeps near copies of a test frame out of
the training; a random one does not. All frames are multiplied with each other once, and models are
then trained in sample space (:class:`baselines.dual.Products`); models that only learn by steps are
trained on the frames themselves, in fewer draws.

Each recording is one sensor: draws vary the frames, not the sensor.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import torch
from omegaconf import OmegaConf
from torch import Tensor

from baselines.dual import Products
from experiments.protocol import data, trial
from experiments.protocol.data import at_seed
from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.crossing.measure import bit_correlations
from hdc import HDCClassifier, bits, theory
from hdc.encode import encode
from hdc.prototypes import Counters
from scenes.frames import Scene

_BATCH = 64  # frames encoded at a time


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
    direct = {name: _build(part, 0) for name, part in models.items()}
    stepwise = StepModels(by_steps or {}, stop, steps_draws, steps_n)
    for seed, recording in run.scenes(scene, seeds):
        subsets = Subsets(recording)
        for split, config in splits.items():
            draw = partial(
                _draw,
                subsets,
                recording,
                config,
                direct,
                stepwise,
                n_per_class,
                most_test,
            )
            for k in range(draws):
                place = {"seed": seed, "split": split, "draw": k}
                for row in run.part(place, partial(draw, (seed, k))):
                    yield {"origin": recording.origin, **place, **row}


def _draw(
    subsets: Subsets,
    recording: Scene,
    split: Mapping[str, Any],
    direct: Mapping[str, Any],
    stepwise: StepModels,
    n_per_class: Sequence[int],
    most_test: int,
    seed: tuple[int, int],
) -> Iterator[Row]:
    """The rows of one draw, a row per model."""
    pool, test = draw_split(recording, split, seed, most_test)
    order, sizes = nested(pool, recording.labels, n_per_class, seed)
    trained = {n: np.concatenate([of_class[:n] for of_class in order]) for n in sizes}
    for name, model in direct.items():
        answers = (subsets.predict(model, trained[n], test) for n in sizes)
        right = [subsets.right(answer, test) for answer in answers]
        yield {"model": name, "n_test": len(test), "n": sizes, "right": right}
    if seed[1] < stepwise.draws:
        few = [n for n in sizes if n in stepwise.sizes]
        for name, part in stepwise.models.items():
            right = [stepwise.right(part, recording, trained[n], test) for n in few]
            yield {"model": name, "n_test": len(test), "n": few, "right": right}


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
        words = torch.cat(
            [encode(recording.frames(c)) for c in np.array_split(chosen, 16)]
        )
        dimension = recording.shape[0] * recording.shape[1]
        distances = bits.hamming(words, words).numpy() / dimension
        upper = np.triu_indices(len(words), 1)
        same = np.equal.outer(recording.labels[chosen], recording.labels[chosen])[upper]
        for kind, values in (
            ("intra", distances[upper][same]),
            ("inter", distances[upper][~same]),
        ):
            counts, edges = np.histogram(values, bins, (0.0, 0.6))
            moments = {"mean": float(values.mean()), "variance": float(values.var())}
            for count, low, high in zip(counts, edges, edges[1:], strict=False):
                yield {
                    "origin": recording.origin, "seed": seed, "kind": kind, "pairs": len(values),
                    "low": float(low), "high": float(high), "count": int(count), **moments,
                }  # fmt: skip


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
        subsets, n_classes = Subsets(recording), len(recording.classes)
        every = np.arange(len(subsets.labels))
        for k in range(draws):
            order, _ = nested(every, subsets.labels, (), (seed, k))
            few = np.concatenate([of_class[:sample] for of_class in order])
            labels = subsets.labels[few]
            of_bits = theory.correlations(
                bit_correlations(subsets.words[few], subsets.dimension), labels
            )
            inside, _ = subsets.products.kernel(few, few[:0], "standardised")
            of_frames = theory.correlations(inside.numpy() / subsets.dimension, labels)
            for n in n_per_class:
                yield {
                    "origin": recording.origin, "seed": seed, "draw": k, "n": n,
                    "hdc": theory.hdc_accuracy(of_bits, n * n_classes, subsets.dimension),
                    "mean_image": theory.mean_image_accuracy(of_frames, n * n_classes),
                }  # fmt: skip
        run.note(f"seed {seed}")


class Subsets:
    """Models trained on subsets of the frames of one recording.

    Args:
        scene: its frames, read once.

    Attributes:
        labels: int64 [N].
        words: hypervectors int64 [N, W].
        products: inner products of all frames.
    """

    def __init__(self, scene: Scene):
        self.labels, n_classes = scene.labels, len(scene.classes)
        every = np.arange(len(self.labels))
        frames = torch.cat(
            [scene.frames(part).cpu() for part in np.split(every, every[::_BATCH])]
        )
        self.dimension = frames[0].numel()
        self.words = torch.cat([encode(part) for part in frames.split(_BATCH)])
        self.products = Products(frames, self.labels, n_classes)

    def right(self, predicted: np.ndarray, test: np.ndarray) -> int:
        """Number of right predictions of these samples."""
        return int((predicted == self.labels[test]).sum())

    def predict(self, model: Any, train: np.ndarray, test: np.ndarray) -> np.ndarray:
        """Labels of the test samples by a model of the training samples."""
        if not isinstance(model, HDCClassifier):
            return self.products.scores(model, train, test).argmax(1).numpy()
        if model.prototype == "integer":
            return self._counts(train, test).argmax(1).numpy()
        counters = Counters(self.products.n_classes, self.dimension)
        counters.add(self.words[train], torch.from_numpy(self.labels[train]))
        prototypes = counters.majority(model.ties, model.seed)
        return bits.hamming(self.words[test], prototypes).argmin(1).numpy()

    def _counts(self, train: np.ndarray, test: np.ndarray) -> Tensor:
        """Cosine between bipolar queries and the sums of bipolar hypervectors of each class."""
        inside, across = self.products.kernel(train, test, "bits")
        member = torch.nn.functional.one_hot(
            self.products.labels[train], self.products.n_classes
        ).double()
        length = torch.einsum("kc,kj,jc->c", member, inside, member).sqrt()
        return across @ member / length.clamp(min=1.0)


def draw_split(
    scene: Scene, split: Mapping[str, Any], seed: tuple[int, int], most_test: int
) -> tuple[np.ndarray, np.ndarray]:
    """(pool, test) of one draw: frames that may train, and at most so many that test."""
    drawn = int(np.random.default_rng(seed).integers(2**31))
    with warnings.catch_warnings(
        action="ignore"
    ):  # a random split of a recording leaks on purpose
        pool, test = data.choose(
            scene, {"group": None, **split, "n_train": None}, drawn
        )
    if len(test) > most_test:
        test = np.sort(np.random.default_rng(drawn).permutation(test)[:most_test])
    return pool, test


def nested(
    pool: np.ndarray, labels: np.ndarray, sizes: Sequence[int], seed: tuple[int, int]
) -> tuple[list[np.ndarray], list[int]]:
    """Frames of each class in random order, and the sizes that every class can fill."""
    shuffled = np.random.default_rng((*seed, 1)).permutation(pool)
    order = [shuffled[labels[shuffled] == c] for c in np.unique(labels[pool])]
    least = min(map(len, order))
    return order, [n for n in sizes if n <= least]


class StepModels(NamedTuple):
    """Models that only learn by steps, asked in fewer draws and at fewer sizes."""

    models: Mapping[str, Any]
    stop: Mapping[str, Any] | None
    draws: int
    sizes: Sequence[int]

    def right(
        self, part: Any, scene: Scene, train: np.ndarray, test: np.ndarray
    ) -> int:
        """Test samples that a model has right after training until the stopping rule ends it."""
        model = _build(part, 0)
        rule = trial.stop_rule(OmegaConf.create(dict(self.stop or {})))
        trial.train_until(model, rule, scene, train)
        return int((model.predict(scene.frames(test)) == scene.labels[test]).sum())


def _build(part: Any, seed: int) -> Any:
    return trial.instantiate(OmegaConf.create(at_seed(part["model"], seed)), "model")
