"""``hdc compare``: the classifier beside others, on frames of one's own.

Test frames are drawn as by ``hdc train --test-fraction``, anew for each seed. Of the training
frames every method learns from a half, a quarter … of each class, too, always the same ones for
all: the learning curve. A test frame that several seeds drew counts once in an interval, as the
mean of how often it was told right: n is the number of different frames tested.
"""

from __future__ import annotations

import json
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

import hdc
from hdc.command.accuracy import wilson
from hdc.command.methods import METHODS, Method
from hdc.command.work import split
from hdc.readers import Recording
from hdc.readers.files import shown

HALVINGS, FEWEST = 4, 2  # of the learning curve; frames of the smallest class at its beginning
TIMED = 50  # predictions, one frame each, after as many that warm up as WARM
WARM = 3


@dataclass(frozen=True)
class Share:
    """Test accuracy after some number of training frames, with its 95 % interval."""

    frames: int
    accuracy: float
    low: float
    high: float


@dataclass(frozen=True)
class Result:
    """What a method reached.

    Attributes:
        curve: over the number of training frames, rising; the last is of all of them.
        training_s: median over the seeds, of all training frames.
        prediction_ms: median over single frames and the seeds.
        bytes: what a prediction needs of what was learnt.
        confusion: int [L, L] of all seeds, a row a true class.
    """

    name: str
    settings: str
    curve: list[Share]
    training_s: float
    prediction_ms: float
    bytes: int
    confusion: list[list[int]]

    @property
    def final(self) -> Share:
        return self.curve[-1]


@dataclass(frozen=True)
class Comparison:
    """All methods on one recording."""

    recording: str
    frames: int
    shape: tuple[int, int]
    classes: list[str]
    test_fraction: float
    seeds: int
    threads: int
    hdc: str
    methods: list[Result]

    def best(self) -> Result:
        """The most accurate besides HDC; of equally accurate ones the one trained fastest."""
        others = [result for result in self.methods if result.name != "HDC"]
        return max(others, key=lambda result: (result.final.accuracy, -result.training_s))

    def json(self) -> str:
        return json.dumps(asdict(self), ensure_ascii=False)


def compare(recording: Recording, path: Path, fraction: float, seeds: int) -> Comparison:
    """Train and test every method.

    Raises:
        ValueError: a class has one frame, or all frames are alike.
    """
    met, labels = np.unique(recording.labels, return_inverse=True)  # some classes may be empty
    names = [recording.classes[c] for c in met]
    every = [names[c] for c in labels]
    splits = [_Split(*split(every, fraction, seed), labels, seed) for seed in range(seeds)]
    frames = recording.frames(np.arange(len(recording)))
    work = sum(len(some) for s in splits for some in s.portions) * len(METHODS)
    results = []
    with _progress(work) as advance:
        for name, (_, settings) in METHODS.items():
            results.append(_result(name, settings, frames, labels, splits, advance))
    return Comparison(
        shown(path), len(frames), recording.shape, [shown(name) for name in names], fraction, seeds,
        torch.get_num_threads(), hdc.__version__, results,
    )  # fmt: skip


class _Split:
    """One seed's test frames, and ever larger portions of its training frames, as indices."""

    def __init__(
        self, training: np.ndarray, test: np.ndarray, labels: np.ndarray, seed: int
    ) -> None:
        self.test, self.seed = test, seed
        rng = np.random.default_rng([seed, 1])
        members = [rng.permutation(training[labels[training] == c]) for c in np.unique(labels)]
        self.portions = [
            np.sort(np.concatenate([some[: max(1, len(some) >> k)] for some in members]))
            for k in range(HALVINGS, -1, -1)
            if not k or min(map(len, members)) >> k >= FEWEST
        ]


def _result(
    name: str,
    settings: str,
    frames: np.ndarray,
    labels: np.ndarray,
    splits: Sequence[_Split],
    advance: Any,
) -> Result:
    n_classes = int(labels.max()) + 1
    confusion = np.zeros((n_classes, n_classes), int)
    training, prediction = [], []
    curve = []
    for k in range(len(splits[0].portions)):
        right: dict[int, list[bool]] = defaultdict(list)
        for s in splits:
            method, portion = METHODS[name][0](s.seed), s.portions[k]
            begin = time.perf_counter()
            method.fit(frames[portion], labels[portion])
            seconds = time.perf_counter() - begin
            predicted = np.asarray(method.predict(frames[s.test]))
            for i, is_right in zip(s.test, predicted == labels[s.test], strict=True):
                right[int(i)].append(bool(is_right))
            if k == len(s.portions) - 1:
                training.append(seconds)
                prediction.append(_milliseconds(method, frames[s.test]))
                np.add.at(confusion, (labels[s.test], predicted), 1)
            advance(name, len(portion))
        shares = [float(np.mean(answers)) for answers in right.values()]
        low, high = wilson(sum(shares), len(shares))
        curve.append(Share(len(splits[0].portions[k]), float(np.mean(shares)), low, high))
    return Result(
        name, settings, curve, float(np.median(training)), float(np.median(prediction)),
        method.bytes, confusion.tolist(),
    )  # fmt: skip


def _milliseconds(method: Method, frames: np.ndarray) -> float:
    """Of the prediction of one frame, as a control loop asks for it: the median."""
    times = []
    for i in range(WARM + TIMED):
        one = frames[i % len(frames)][None]
        begin = time.perf_counter()
        method.predict(one)
        times.append(1e3 * (time.perf_counter() - begin))
    return float(np.median(times[WARM:]))


@contextmanager
def _progress(total: int) -> Iterator[Any]:
    """Called with what was trained and on how many frames; a bar, while there is a terminal."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    bar = Progress(
        *columns, console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()
    )
    with bar:
        task = bar.add_task("Comparing", total=total)
        yield lambda name, n: bar.update(task, description=name, advance=n)


# In words ----------------------------------------------------------------------------------------

HEADS = (
    "Method", "Test accuracy [95 %]", "Training, s", "Prediction, ms a frame", "Learnt, bytes",
)  # fmt: skip


def rows(comparison: Comparison) -> list[tuple[str, ...]]:
    """Cells below :data:`HEADS`."""
    return [
        (
            result.name,
            f"{result.final.accuracy:.1%} [{result.final.low:.1%}, {result.final.high:.1%}]",
            f"{result.training_s:.3g}",
            f"{result.prediction_ms:.3g}",
            f"{result.bytes:,}",
        )
        for result in comparison.methods
    ]


def conditions(comparison: Comparison) -> str:
    """What was compared on what."""
    c = comparison
    height, width = c.shape
    return (
        f"{c.frames} frames of {len(c.classes)} classes, {width} × {height} pixels; "
        f"{c.test_fraction:.0%} of each class held out at random, {c.seeds} "
        f"seed{'s' * (c.seeds > 1)}, {c.threads} thread{'s' * (c.threads > 1)}"
    )


def text(comparison: Comparison) -> str:
    """The table for a terminal."""
    table = Table(box=None, pad_edge=False)
    for k, head in enumerate(HEADS):
        table.add_column(head, justify="right" if k else "left", no_wrap=k == 1)
    for row in rows(comparison):
        table.add_row(*row)
    console = Console(width=None if sys.stdout.isatty() else 100)
    with console.capture() as captured:
        console.print(table)
    return f"{conditions(comparison)}\n\n{captured.get().rstrip()}"
