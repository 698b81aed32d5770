"""``hdc train --choose``: the best combination of the library for a recording, and a line on it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from hdc.command.compare.budget import Budget
from hdc.selection import (
    Combination,
    Fold,
    Frames,
    Method,
    Scores,
    combinations,
    cross_validate,
    far_behind,
    folds,
    losses_of,
    published,
)

CHOOSING = 0.6
"""Share of the budget after which no further method is tried; tests take the rest."""


def choose(frames: Frames) -> tuple[Combination, str]:
    """The best combination of the library by cross-validation of all frames, and a line on it."""
    rows = np.arange(len(frames.bank))
    learns_values = frames.values is not None
    tried = combinations((), (), learns_values)
    made, how = folds(frames, rows)
    with progress("Choosing", len(made) * len(tried)) as step:
        scores = cross_validate(tried, frames, made, step)
    first = published(learns_values)
    chosen = scores.best(Combination)
    if not isinstance(chosen, Combination):
        return first, f"chosen: {first.name}, for there are too few frames of a class"
    best, before = scores.losses[chosen], scores.losses[first]
    if learns_values:
        compared = f"{best:.3g} of a guess's error, {first.name} {before:.3g}"
    else:
        compared = f"accuracy {1 - best:.1%}, the published form {1 - before:.1%}"
    line = f"{chosen.name} among {len(scores.losses)} by {len(made)} folds {how}"
    return chosen, f"chosen: {line} ({compared})"


def one_by_one(
    methods: Sequence[Method],
    frames: Frames,
    made: Sequence[Fold],
    budget: Budget,
    scores: Scores,
) -> Iterator[Method]:
    """Cross-validate one method after the other into `scores`; each is yielded when it is done.

    A method other than the first is given up after the first fold where it is far behind the best
    of its kind so far. When the budget ends, the rest is not tried.
    """
    if not made:
        return
    first_folds: dict[type, dict[Method, np.ndarray]] = {}
    for method in methods:
        if scores.losses and budget.is_spent(CHOOSING):
            scores.not_tried.append(method.name)
            continue
        own_kind = first_folds.setdefault(type(method), {})
        found = []
        for fold in made:
            losses = losses_of(method, frames, fold, scores)
            if losses is None:
                break
            found.append(losses)
            own_kind.setdefault(method, losses)
            if method != methods[0] and method in far_behind(own_kind):
                scores.given_up.append(method.name)
                break
        if found and method.name not in scores.reasons:
            scores.losses[method] = float(np.concatenate(found).mean())
        yield method


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[], None]]:
    """A function to call at every step of so many; a bar on the terminal while there is one."""
    if not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)
