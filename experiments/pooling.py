"""Which records may stand in one row together: those of the same code and the same frames."""

from __future__ import annotations

import collections
import functools
import json
from collections.abc import Iterable
from typing import TYPE_CHECKING

import hydra

from experiments.sources import outdated

if TYPE_CHECKING:
    from experiments.selection import Run


def of_one_frames_and_code(runs: list[Run]) -> tuple[list[Run], list[Run]]:
    """Runs that may be pooled, and the rest: today's frames and code go first, then the most."""
    alike: dict[tuple[bool, str], list[Run]] = {}
    for run in runs:
        alike.setdefault((run.other_frames, run.record["environment"]["code"]), []).append(run)

    def rank(same: list[Run]) -> tuple[bool, bool, int, str]:
        environment = same[0].record["environment"]
        current = not outdated(environment["sources"])
        return not same[0].other_frames, current, len(same), environment["code"]

    kept = max(alike.values(), key=rank)
    return kept, [run for run in runs if run not in kept]


@functools.cache
def fingerprint(scene: str) -> str | None:
    """Of the frames that a scene, given as JSON, has today; None where it cannot be had."""
    try:
        return hydra.utils.instantiate(json.loads(scene), _convert_="all").fingerprint()
    except (hydra.errors.InstantiationException, ValueError, OSError):
        return None  # a recording that lies on another machine


def mark_disputed(runs: Iterable[Run]) -> None:
    """Mark runs whose test samples are not those of most runs that should have the same."""
    alike: dict[str, list[Run]] = {}
    for run in runs:
        config = run.record["config"]
        split = {key: value for key, value in config["split"].items() if key != "n_train"}
        same = [config["scene"], config["seed"], split, config["data"]]
        alike.setdefault(json.dumps(same, sort_keys=True), []).append(run)
    for group in alike.values():
        digests = collections.Counter(run.record["data_sha256"]["test"] for run in group)
        most = max(digests.values())
        usual = [digest for digest, n in digests.items() if n == most]
        for run in group:
            run.disputed = [run.record["data_sha256"]["test"]] != usual
