"""Any order of calls: the classifier against counts and majorities in numpy."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from hdc import HDCClassifier, bits
from hdc.prototypes import Counters
from hdc.readouts import Majority
from hdc.readouts.majority import WEIGHTS

D = 77
batches = st.lists(
    st.tuples(st.sampled_from("abc"), st.integers(0, 99)), min_size=1, max_size=7
)


def frames_of(batch: list) -> tuple[np.ndarray, list[str]]:
    """Frames of few levels, and so with many ties."""
    return np.stack([frame_of(seed) for _, seed in batch]), [c for c, _ in batch]


@functools.cache
def frame_of(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 9, (7, 11), np.uint8)


@functools.cache
def hypervector(seed: int) -> np.ndarray:
    """The ⌊D/2⌋ largest pixels; equal ones by ((b + h(w)) mod 64, w) of pixel 64·w + b.

    h(0) is 0, and h(1) is 0x9E3779B1 >> 26 = 39.
    """
    keys = [
        (-int(pixel), (j % 64 + 39 * (j // 64)) % 64, j)
        for j, pixel in enumerate(frame_of(seed).ravel())
    ]
    ones = [j for *_, j in sorted(keys)[: D // 2]]
    return np.isin(np.arange(D), ones)


def majorities(classes: dict[str, list], balance: bool) -> dict[str, np.ndarray]:
    """Prototypes of hypervectors; a larger class counts as a random subset where balanced."""
    size = min(map(len, classes.values()))
    found = {}
    for c, (label, rows) in enumerate(sorted(classes.items())):
        n, counts = len(rows), np.sum(rows, 0)
        if balance and n > size:
            counters = Counters(c + 1, D)
            counters.add(bits.pack(torch.tensor(np.array(rows))), torch.full((n,), c))
            n, counts = size, counters.thinned(size).counts()[c].numpy()
        found[label] = 2 * counts > n
    return found


class Calls(RuleBasedStateMachine):
    @initialize(balance=st.booleans())
    def begin(self, balance: bool) -> None:
        self.model, self.classes, self.prototypes = (
            HDCClassifier(readout=Majority(class_weight=WEIGHTS[balance])),
            {},
            {},
        )
        self.recalibrated, self.balance = False, balance

    def learn(self, batch: list, call) -> None:
        if self.recalibrated:
            with pytest.raises(ValueError, match="not recalibrated"):
                call()
            return
        call()
        for label, seed in batch:
            self.classes.setdefault(label, []).append(hypervector(seed))
        self.prototypes = majorities(self.classes, self.balance)

    @rule(batch=batches)
    def fit(self, batch: list) -> None:
        self.classes, self.recalibrated = {}, False
        self.learn(batch, lambda: self.model.fit(*frames_of(batch)))

    @rule(batch=batches)
    def partial_fit(self, batch: list) -> None:
        self.learn(batch, lambda: self.model.partial_fit(*frames_of(batch)))

    @rule(batch=batches)
    def merge(self, batch: list) -> None:
        readout = Majority(class_weight=WEIGHTS[self.balance])
        other = HDCClassifier(readout=readout).partial_fit(*frames_of(batch))
        self.learn(batch, lambda: self.model.merge(other))

    @precondition(lambda self: len(self.prototypes) > 1)
    @rule(batch=batches)
    def recalibrate(self, batch: list) -> None:
        new: dict[str, list] = {}
        if not (batch := [pair for pair in batch if pair[0] in self.prototypes]):
            return
        for label, seed in batch:
            new.setdefault(label, []).append(hypervector(seed))
        self.model.recalibrate(*frames_of(batch), p=1)
        self.prototypes |= majorities(new, self.balance)
        self.recalibrated = True

    @precondition(lambda self: len(self.prototypes) > 1)
    @rule()
    def save_and_load(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            self.model.save(Path(folder) / "m")
            self.model = HDCClassifier.load(Path(folder) / "m")

    @precondition(lambda self: len(getattr(self, "prototypes", ())) > 1)
    @invariant()
    def predicts(self) -> None:
        names = sorted(self.prototypes)
        frames, _ = frames_of([("", seed) for seed in range(100, 105)])
        queries = np.stack([hypervector(seed) for seed in range(100, 105)])
        expected = np.stack(
            [(queries ^ self.prototypes[name]).sum(1) for name in names], 1
        )
        assert self.model.classes_.tolist() == names
        assert self.model.counts_.tolist() == [
            len(self.classes[name]) for name in names
        ]
        np.testing.assert_array_equal(self.model.distances(frames), expected)
        assert self.model.predict(frames).tolist() == [
            names[c] for c in expected.argmin(1)
        ]


def test_any_order_of_calls():
    run_state_machine_as_test(
        Calls, settings=settings(max_examples=60, stateful_step_count=15, deadline=None)
    )
