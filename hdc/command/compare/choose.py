"""``hdc train --choose``: the best combination of the library for a recording, and a line on it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from hdc.selection import (
    Combination,
    Frames,
    Scores,
    combinations,
    folds,
    published,
    race,
)


def choose(frames: Frames) -> tuple[Combination, str]:
    """The best combination of the library by cross-validation of all frames, and a line on it."""
    rows = np.arange(len(frames.bank))
    learns_values = frames.values is not None
    tried = combinations((), (), learns_values)
    made, how = folds(frames, rows)
    scores = Scores()
    with progress("Choosing", len(tried)) as step:
        for _ in race(tried, frames, made, scores):
            step()
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
