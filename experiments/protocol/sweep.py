"""How far a sweep has come: which of how many runs this is, and about how long the others take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser


def size(
    params: Mapping[str, Any] | None,
    words: Sequence[str],
) -> int:
    """Number of runs of a sweep.

    Args:
        params: ``hydra.sweeper.params``, of an experiment.
        words: of the command line, which have the last word on a key.
    """
    texts = [f"{key}={value}" for key, value in (params or {}).items()]
    for word in words:
        is_override = "=" in word and not word.startswith("-")
        if is_override and not word.lstrip("+~").startswith("hydra"):
            texts.append(word)
    parsed = OverridesParser.create().parse_overrides(texts)
    (runs,) = BasicSweeper.split_arguments(parsed, None)
    return len(runs)


def span(seconds: float) -> str:
    """A length of time as one would say it."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 90 * 60:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


class Progress:
    """The runs of a sweep that this process carries out one after another.

    Args:
        runs: their number.
    """

    def __init__(self, runs: int):
        self.runs, self.begun = runs, 0
        self._seconds: list[float] = []  # of runs that were not found finished

    def next(self, words: Sequence[str]) -> str:
        """Begin a run: ``3 of 12: model=hdc seed.run=2; about 4 min left``."""
        self.begun += 1
        text = f"{self.begun} of {self.runs}: {' '.join(words)}"
        if not self._seconds:
            return text
        mean = sum(self._seconds) / len(self._seconds)
        return f"{text}; about {span(mean * (self.runs - self.begun + 1))} left"

    def took(self, seconds: float) -> None:
        """Count the time of a run that was not found finished."""
        self._seconds.append(seconds)
