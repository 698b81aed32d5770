"""What tables say of a measurement besides its rows: whose frames, which machine."""

from __future__ import annotations

from collections.abc import Iterator

from experiments.records.measurement import Measured
from experiments.records.results import Results


def with_places(results: Results, name: str) -> Iterator[tuple[str, Measured]]:
    """The measurement on the experiment's own frames, then those on others, each with what the
    names of its tables and figures end in."""
    if (own := results.measured(name)) is not None:
        yield "", own
    for other in results.measured_elsewhere(name):
        yield f"_{other.folder.name.removeprefix(name)[1:]}", other


def machine(measured: Measured) -> str:
    """``AMD EPYC, 2 threads``, after an accelerator if there is one."""
    made = measured.record.environment
    accelerator = [made.device] if made.device not in (None, "cpu") else []
    return ", ".join([*accelerator, made.cpu, f"{made.threads} thread{'s' * (made.threads != 1)}"])
