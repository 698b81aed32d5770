"""How far a sweep has come: which of how many runs this is, and about how long the others take."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from hydra.core.global_hydra import GlobalHydra
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
    hydra = GlobalHydra.instance()  # its configs answer a glob
    loader = hydra.config_loader() if hydra.is_initialized() else None
    runs = {}
    for override in OverridesParser.create(loader).parse_overrides(texts):
        is_swept = override.is_sweep_override()
        n = sum(1 for _ in override.sweep_iterator()) if is_swept else 1
        runs[override.get_key_element()] = n
    return math.prod(runs.values())


def span(seconds: float) -> str:
    """A length of time as one would say it."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 90 * 60:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def progress(
    number: int, runs: int, words: Sequence[str], seconds: Sequence[float]
) -> str:
    """Which run begins: ``3 of 12: model=hdc seed.run=2; about 4 min left``.

    Args:
        number: of the run, from 1.
        runs: of the sweep.
        words: of the run.
        seconds: that runs of this process took before, but for those found finished.
    """
    text = f"{number} of {runs}: {' '.join(words)}"
    if not seconds:
        return text
    mean = sum(seconds) / len(seconds)
    return f"{text}; about {span(mean * (runs - number + 1))} left"
