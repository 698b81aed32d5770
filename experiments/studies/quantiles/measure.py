"""Which quantile of a frame is the best threshold: a prediction, and then the accuracy of each.

The prediction (:func:`hdc.theory.best_quantile`) comes from the brightness of a few training frames
alone: which pixels are dark, how much the others vary within a class and between classes. Only then
are frames classified, at that quantile and at others. The law for correlations of bits at any
quantile (:func:`quantile_correlation`) is tested on the same frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.optimize import nnls

from experiments.protocol.draws import draw_split, nested
from experiments.protocol.evaluate import bank_of, evaluate
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.model import models_of
from experiments.records.rows import pack_labels
from hdc import theory
from hdc.bank import Bank
from hdc.theory import Light

Floats = NDArray[np.float64]

PREDICTED, LAW, ACCURACY = "predicted", "law", "accuracy"  # kinds of rows


@experiment(revision=1, uses=("hdc.HDCClassifier",))
def quantile_theory(
    run: Run,
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    model: Mapping[str, Any],
    quantiles: Sequence[str],
    n_per_class: Sequence[int],
    seeds: Sequence[int],
    sample: int = 5,
    dark_below: float = 0.1,
    tolerance: float = 0.03,
    most_test: int = 200,
) -> Iterator[Row]:
    """Rows of three kinds for each seed, in this order:

    - ``predicted``: the :class:`hdc.theory.Light` of `sample` training frames a class, and ``at``,
      the quantile that follows from it, rounded to hundredths;
    - ``law``: for each quantile ``at``, the mean correlation ``measured`` within a class of the
      bits of these frames, the one ``expected`` from their medians, and ``error``, the mean
      absolute difference over all pairs of classes, beside that of the correlations at the median
      as they are (``error_unchanged``);
    - ``accuracy``: what the model ``predicted`` of ``n_test`` frames after each ``n`` frames of
      every class, at each quantile ``at`` and at the predicted one; lists, as of recordings.

    Arguments: configs/experiment/quantiles.yaml.
    """
    for seed, recording in run.scenes(scene, seeds):
        pool, test = draw_split(recording, split, (seed, 0), most_test)
        order, sizes = nested(pool, recording.labels, n_per_class, (seed, 0))
        most = max(sample, *sizes)
        train = [of_class[:most] for of_class in order]
        bank = bank_of(recording, np.concatenate([*train, test]))
        # From here on a frame is a row of the bank, where training frames come class by class.
        ends = np.cumsum([len(of_class) for of_class in train])
        *rows, queries = np.split(np.arange(len(bank)), ends)
        few = np.concatenate([of_class[:sample] for of_class in rows])
        at_quantile = partial(_at_quantile, model)
        place = {"origin": recording.origin, "seed": seed}

        light = light_of(bank.frames[few].numpy(), bank.labels[few], dark_below)
        stated = f"{theory.best_quantile(light):.2f}"
        yield {**place, "kind": PREDICTED, **light._asdict(), "at": float(stated)}
        for row in _tested_law(bank, few, at_quantile, quantiles):
            yield {**place, "kind": LAW, **row}
        asked = dict.fromkeys([*quantiles, stated])
        for row in _accuracies(bank, rows, queries, at_quantile, asked, sizes):
            yield {**place, "kind": ACCURACY, **row}
        run.note(f"seed {seed}")


def _accuracies(
    bank: Bank,
    rows: Sequence[NDArray[np.int64]],
    queries: NDArray[np.int64],
    at_quantile: Callable[[str], Any],
    quantiles: Iterable[str],
    sizes: Sequence[int],
) -> Iterator[Row]:
    """What the model says at each quantile; the first row has the true classes in ``labels``."""
    labels = {"labels": pack_labels(bank.labels[queries])}
    for at in quantiles:
        predicted = []
        for n in sizes:
            train = np.concatenate([of_class[:n] for of_class in rows])
            said = evaluate(at_quantile(at), bank, train, queries)
            predicted.append(pack_labels(said))
        yield {
            "at": float(Fraction(at)),
            "n_test": len(queries),
            "n": list(sizes),
            "predicted": predicted,
            **labels,
        }
        labels = {}


def quantile_correlation(rho: Floats | float, share: float) -> Floats:
    """Correlation of the bits of two Gaussian numbers, of which a share are ones.

    With the threshold t, of which P(z > t) = p is the share, and Owen's function T,

        C = (P(both > t) − p²)/(p·(1 − p)) = 1 − 2·T(t, √((1 − ρ)/(1 + ρ)))/(p·(1 − p)),

    which is the arcsine law C = (2/π)·asin ρ at the median (Owen, Ann. Math. Stat. 27, 1956).

    Args:
        rho: correlations of the Gaussians, in (−1, 1].
        share: of ones, in (0, 1): 1 − q at the quantile q.
    """
    if not 0 < share < 1:
        raise ValueError(f"share: expected a number in (0, 1), found {share}")
    threshold = special.ndtri(1 - share)
    slope = np.sqrt((1 - np.asarray(rho)) / (1 + np.asarray(rho)))
    one_of_two = 2 * special.owens_t(threshold, slope)
    return 1 - one_of_two / (share * (1 - share))


def light_of(frames: Any, labels: NDArray[np.int64], dark_below: float) -> Light:
    """What the brightness of a few frames says of their light.

    Grey values are in units of the mean of the lit pixels. A line is laid through the variances of
    the pixels within a class over their means; what two classes differ by is half of the mean
    square difference of their mean frames, less the noise of these, over the mean.

    Args:
        frames: grey values [N, H, W].
        labels: classes [N], of at least two frames each.
        dark_below: pixels below this share of the mean of all count as dark, but for as many as
            fully developed speckle has.
    """
    pixels = np.asarray(frames, np.float64).reshape(len(frames), -1)
    mean = pixels.mean(0)
    limit = dark_below * mean.mean()
    lit = mean >= limit
    of_lit = pixels[:, lit] / mean[lit].mean()
    # Speckle has dark spots of its own: a share of the pixels that light reaches is bright.
    bright = np.exp(-limit / mean[lit].mean())
    dark = max(0.0, 1 - lit.mean() / bright)
    members = [of_lit[labels == label] for label in np.unique(labels)]
    means = [own.mean(0) for own in members]
    variances = [own.var(0, ddof=1) for own in members]
    photon, read = _noise(np.concatenate(means), np.concatenate(variances))
    changes = []
    for one, other in combinations(range(len(members)), 2):
        square = (means[one] - means[other]) ** 2
        noise = variances[one] / len(members[one])
        noise_of_other = variances[other] / len(members[other])
        square -= noise + noise_of_other
        changes.append(square.mean() / (means[one] + means[other]).mean())
    change = max(float(np.mean(changes)), 1e-6)
    return Light(float(dark), photon, read, change)


def _noise(mean: Floats, variance: Floats) -> tuple[float, float]:
    """(photon, read) of variance = photon·mean + read, neither below zero.

    Each pixel counts by the size of its variance, which is known to a share of itself.
    """
    seen = mean > 0
    inverse = 1 / mean[seen]
    parts = np.stack([np.ones_like(inverse), inverse], axis=1)
    (photon, read), _ = nnls(parts, variance[seen] * inverse)
    return float(photon), float(read)


def _at_quantile(model: Mapping[str, Any], at: str) -> Any:
    """The model of a config with another quantile in its encoder."""
    encoder = {**model["model"]["encoder"], "at": at}
    config = {**model, "model": {**model["model"], "encoder": encoder}}
    return models_of({"model": config})["model"]


def _tested_law(
    bank: Bank,
    rows: NDArray[np.int64],
    at_quantile: Callable[[str], Any],
    quantiles: Iterable[str],
) -> Iterator[Row]:
    """Correlations of bits at each quantile, and those that follow from the bits at the median."""
    labels = bank.labels[rows]

    def between_classes(at: str) -> Floats:
        words = bank.words(at_quantile(at).encoder)[rows]
        pairs = theory.bit_correlations(words, bank.dimension)
        return theory.correlations(pairs, labels).mean

    at_median = between_classes("1/2")
    rho = np.sin(np.pi / 2 * at_median)
    for at in quantiles:
        share = 1 - float(Fraction(at))
        expected = quantile_correlation(rho, share)
        measured = between_classes(at)
        yield {
            "at": 1 - share,
            "measured": float(np.diag(measured).mean()),
            "expected": float(np.diag(expected).mean()),
            "error": float(np.abs(measured - expected).mean()),
            "error_unchanged": float(np.abs(measured - at_median).mean()),
        }
