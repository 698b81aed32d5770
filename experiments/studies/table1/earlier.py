"""Ratios of times as the claims of version 1 read them; the grid of times replaces them."""

from __future__ import annotations

from experiments.records.results import Group, Results
from experiments.reporting import estimates
from experiments.reporting.routes import ORDINARY, ordinary_training_s

AS_WRITTEN = "HDC as written here"
WAYS = (AS_WRITTEN, ORDINARY)  # of computing HDC


def time_ratios(results: Results, group: Group) -> dict[str, list[float]]:
    """Training time over HDC's in each run, by each way of computing HDC; by this library's the
    time of the same seed, by ordinary routes one time for all."""
    hdc = results.group(group.scene, "hdc")
    own = {}
    if group.machines == hdc.machines:
        own = _times(hdc)
    ordinary = ordinary_training_s(results, group)
    times = _times(group)
    as_written = [time / own[seeds] for seeds, time in times.items() if seeds in own]
    by_ordinary = []
    if ordinary:
        by_ordinary = [time / ordinary for time in times.values()]
    return {AS_WRITTEN: as_written, ORDINARY: by_ordinary}


def _times(group: Group) -> dict[str, float]:
    """Training times by the seeds of the run."""
    return {run.seeds: estimates.training_time(run) for run in group.runs}
