"""What the benchmark's rows are called: of what is measured and of what shows it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

OPERATIONS = (
    "encode",
    "bundle",
    "hamming",
    "train",
    "predict",
    "predict_all",
    "learn_one",
    "folder",
)
OURS = "hdc"
OURS_COMPILED = "hdc, compiled"
NUMBERS = {
    **dict.fromkeys(("n", "d", "l", "samples", "peak_bytes"), int),
    **dict.fromkeys(("median_s", "min_s", "ratio_to_ours"), float),
}
READ = "one read of the bytes"
TORCHHD_BUNDLE = "torchhd.multiset"
TORCHHD_TRAIN = "torch.median, torchhd.multiset"
ORDINARY_ROUTES = (TORCHHD_TRAIN, "numpy.median, torchhd.multiset")
"""Routes from frames to prototypes that somebody takes who has numpy, torch and torchhd."""
DECODED = "OpenCV in as many threads, no more"
NUMKONG = "numkong.cdist"
SORTED, SHUFFLED = "camera, by class", "camera, shuffled"


def typed(row: Mapping[str, str]) -> dict[str, Any]:
    """A row as it was measured, of what was written of it."""
    return dict.fromkeys(NUMBERS) | {key: NUMBERS.get(key, str)(row[key]) for key in row}
