"""Drift and recalibration (Fig. 8): what N_new samples of a changed environment are good for.

Prototypes are learnt in the first session, N_old samples, and updated with N_new of the second.
Each way to update is tested on both sessions: the second shows what was recovered, the first what
was forgotten.

- ``replace``, p: the paper's; each bit of the stored prototype is replaced by the new one's with
  probability p. Hamming distances are sums over bits, so the distance to the mixture is
  (1 − p)·(distance to the stored) + p·(distance to the new prototype) but for a random part of
  order √D: whether a bit was decided by 80 samples to 0 or by 41 to 39 does not count.
- ``weight``, w: the majority of the counts of both sessions, the old ones weighted:
  w·(2·ones_old − n_old) + (2·ones_new − n_new) > 0. This needs the counters, not the prototypes
  alone. w = 0 is p = 1; w = 1 is counting on.
- ``balance``, r: the same with w = r·n_new/n_old, so that with r = 1 both sessions have as many
  votes, however many samples they have.
- ``both``: stored and new prototypes are kept and the nearest of all decides; twice the memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from torch import Tensor

from experiments.protocol import data
from experiments.protocol.scenes import scenes
from experiments.records.measurement import Row, measure
from hdc import bits
from hdc.encode import encode
from hdc.prototypes import Counters, recalibrate
from scenes.frames import Scene
from scenes.split import by_session, learning_curve_subsets, split

_BATCH = 50


def run(
    scene: Mapping[str, Any],
    old_split: Mapping[str, Any],
    seeds: Sequence[int],
    n_test: int,
    n_new: Sequence[int],
    p: Sequence[float],
    weight: Sequence[float],
    balance: Sequence[float],
    draws: int = 1,
    device: str = "cpu",
    cache: bool = False,
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/drift/``.

    Args:
        scene: configuration of a scene of two sessions.
        old_split: configuration of the split of the first session; its training samples are N_old.
        seeds: of scene, splits and masks.
        n_test: test samples of the second session; all its others may recalibrate.
        n_new: numbers of samples to recalibrate with.
        p, weight, balance: parameters of ``replace``, ``weight`` and ``balance``.
        draws: choices of the recalibrating samples for every seed.
        device: where frames are made.
        cache: keep made frames in the results' cache.
        force: measure again.

    Returns:
        Path: the folder. The columns of its rows: ``origin`` of the frames; ``seed``, ``draw``;
        ``method`` (``stored`` before any update, else as above) and ``parameter``; ``n_old``,
        ``n_new``; of the second session ``right_new`` of ``n_test_new``, of the first
        ``right_old`` of ``n_test_old``.
    """
    console = Console(highlight=False)
    config = {
        "_target_": f"{__name__}.run",
        "scene": scene,
        "old_split": old_split,
        "seeds": seeds,
        "n_test": n_test,
        "n_new": n_new,
        "p": p,
        "weight": weight,
        "balance": balance,
        "draws": draws,
    }

    def compute() -> Iterator[Row]:
        for seed, made in scenes(scene, seeds, cache, console):
            sessions = Sessions(made, old_split, n_test, seed)
            of = {"origin": made.origin, "seed": seed}
            yield {**of, "method": "stored", "n_new": 0, **sessions.score(sessions.stored)}
            for draw in range(draws):
                for n, chosen in sessions.subsets(n_new, draw).items():
                    new = sessions.count(chosen)
                    for row in updates(sessions, new, p, weight, balance, draw):
                        yield {**of, "draw": draw, "n_new": n, **row}

    return measure("drift", config, compute, device=device, force=force, console=console)


class Sessions:
    """The hypervectors of both sessions and who of them trains, recalibrates and tests.

    Args:
        scene: with sessions 0 and 1.
        old_split: of the first session.
        n_test: test samples of the second session, stratified.
        seed: of both splits.

    Attributes:
        words: hypervectors int64 [N, W].
        labels: int64 [N].
        old: counters of the training samples of the first session.
        stored: their prototypes int64 [L, W].
        pool, tests: sample indices: those that may recalibrate, and the test samples by session.
    """

    def __init__(self, scene: Scene, old_split: Mapping[str, Any], n_test: int, seed: int):
        self.dimension = scene.shape[0] * scene.shape[1]
        self.labels, self.n_classes, self.seed = scene.labels, len(scene.classes), seed
        only = np.zeros(len(self.labels), np.int64)
        _, second = by_session(scene.samples.get("session", only))
        if not 0 < n_test < len(second):
            raise ValueError(
                f"task.n_test: expected 1 to {len(second) - 1} of the second session's samples, "
                f"found {n_test}"
            )
        train, test_old = data.choose(scene, old_split, seed)
        pool, test_new = split(self.labels[second], n_test=n_test, seed=seed)
        self.pool = second[pool]
        self.tests = {"new": second[test_new], "old": test_old}
        self.words = torch.cat([
            encode(scene.frames(np.arange(start, min(start + _BATCH, len(scene.labels)))).cpu())
            for start in range(0, len(scene.labels), _BATCH)
        ])  # fmt: skip
        self.old = self.count(train)
        self.stored = self.old.majority()

    def count(self, chosen: np.ndarray) -> Counters:
        """Counters of these samples."""
        counters = Counters(self.n_classes, self.dimension)
        counters.add(self.words[chosen], torch.from_numpy(self.labels[chosen]))
        return counters

    def subsets(self, sizes: Sequence[int], draw: int) -> dict[int, np.ndarray]:
        """n of the samples that may recalibrate for each n, stratified and nested."""
        rng = np.random.default_rng((self.seed, draw))
        return learning_curve_subsets(self.pool, self.labels, sizes, int(rng.integers(2**31)))

    def score(self, prototypes: Tensor) -> Row:
        """Right predictions in both sessions; prototype i of [k·L, W] is of class i mod L."""
        row: Row = {"n_old": int(self.old.n.sum())}
        for session, chosen in self.tests.items():
            nearest = bits.hamming(self.words[chosen], prototypes).argmin(1).numpy()
            row[f"right_{session}"] = int((nearest % self.n_classes == self.labels[chosen]).sum())
            row[f"n_test_{session}"] = len(chosen)
        return row


def updates(
    sessions: Sessions,
    new: Counters,
    p: Sequence[float],
    weight: Sequence[float],
    balance: Sequence[float],
    draw: int = 0,
) -> Iterator[Row]:
    """Every way to update with the same samples, scored.

    Args:
        sessions: what is known before.
        new: counters of the samples of the second session to update with.
        p, weight, balance: parameters.
        draw: with the seed of the sessions and the number of samples, seed of the replacement.
    """
    fresh = new.majority()
    seed = int(np.random.default_rng((sessions.seed, draw, int(new.n.sum()))).integers(2**31))
    for value in p:
        mixed = recalibrate(sessions.stored, fresh, sessions.dimension, value, seed)
        yield {"method": "replace", "parameter": value, **sessions.score(mixed)}
    # A parameter is the decimal fraction it is written as: no rounding decides a tie.
    counts = [Fraction(b, a) for a, b in zip(sessions.old.n.tolist(), new.n.tolist(), strict=True)]
    for method, values, unit in (("weight", weight, [Fraction(1)] * len(counts)),
                                 ("balance", balance, counts)):  # fmt: skip
        for value in values:
            weights = [Fraction(str(value)) * one for one in unit]
            merged = weighted_majority(sessions.old, new, weights)
            yield {"method": method, "parameter": value, **sessions.score(merged)}
    yield {"method": "both", **sessions.score(torch.cat((sessions.stored, fresh)))}


def weighted_majority(old: Counters, new: Counters, weights: Sequence[Fraction]) -> Tensor:
    """Prototypes int64 [L, W]: ones where w·(votes of old) + (votes of new) > 0, in integers.

    With w = 0 these are the prototypes of the new samples, with w = 1 those of all, ties included.

    Args:
        old, new: counters of L classes.
        weights: w for each class.

    Raises:
        ValueError: for a negative weight.
    """
    if min(weights) < 0:
        raise ValueError(f"weight: expected numbers from 0, found {min(weights)}")
    both = old.scaled([w.numerator for w in weights])
    both.merge(new.scaled([w.denominator for w in weights]))
    return both.majority()
