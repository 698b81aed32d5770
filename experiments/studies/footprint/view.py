"""What each scene and model load, build and hold."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from experiments.records.results import Results
from experiments.reporting.measured import machine
from experiments.reporting.study import Study
from experiments.reporting.table import Table, frame, number

_INTEGERS = ("n", "modules", "peak_bytes", "torch_bytes", "above_torch_bytes")
NOTE = (
    "Every row is a process of its own. First prediction: from the start of the process, scene and "
    "model built, frames made and learnt. Watched: cv2, sklearn, pandas, matplotlib, scipy, "
    "scipy.stats, baselines.cnn and the parts of other scenes. build: a few frames; stream: frames "
    "made, predicted and learnt as they come; run: the whole command line, which holds the frames "
    "of a run in memory. everything: texture, two sessions, drift and creep. The sensor is "
    "simulated, the transmission matrices of the fibre are measured."
)


def tables(results: Results) -> Iterator[Table]:
    """One table, a row a process."""
    measured = results.measured("footprint")
    if measured is None:
        return
    yield Table(
        "footprint",
        f"What each scene and model load, build and hold. {machine(measured)}.",
        frame(map(_typed, measured.rows)),
        {
            "Scene": lambda row: row.get("scene") or "–",
            "Model": lambda row: row.get("model") or "–",
            "What": lambda row: row["what"] + (f", N = {row['n']}" if row["n"] else ""),
            "First prediction, s": _scaled("first_prediction_s"),
            "of it importing torch, s": _scaled("torch_s"),
            "A frame, ms": _scaled("frame_s", 1e3),
            "Peak, MB": _scaled("peak_bytes", 1e-6),
            "above torch's, MB": _scaled("above_torch_bytes", 1e-6),
            "Modules": _scaled("modules"),
            "Loaded of those watched": lambda row: row.get("loaded") or "–",
            "Parts built": lambda row: row.get("parts") or "–",
            "Status": lambda row: row["status"],
        },
        NOTE,
        [measured.record.command],
    )


def _typed(row: Mapping[str, str]) -> dict[str, Any]:
    """Numbers as numbers."""
    return {
        key: int(text) if key in _INTEGERS else float(text) if key.endswith("_s") else text
        for key, text in row.items()
    }


def _scaled(key: str, factor: float = 1) -> Callable[[Mapping[str, Any]], str]:
    return lambda row: number(None if row.get(key) is None else row[key] * factor)


STUDY = Study(
    "footprint",
    "Footprint",
    "What does each scene and model load, build and hold, and is what it does not need left out?",
    13,
    tables,
)
