"""Saved models of earlier versions, and what they said.

``python -m tests.hdc.net.models VERSION`` writes those of one version. It was run once with each,
2.0.0 at its commit; the files stay as they are.
"""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from tests.hdc.net.frames import frames_of

FOLDER = Path(__file__).parent / "models"
FORMS = (
    ("median", "majority"),
    ("levels", "counts"),
    ("quantile", "ridge"),
    ("median", "neighbours"),
    ("levels", "lda"),
    ("deviation", "lda"),
    ("reference", "trained"),
    ("smoothed", "majority"),
    ("reference_levels", "kernel"),
)
RECALIBRATED = ("median, majority", "levels, lda", "median, neighbours")


def answers(model: Any) -> dict[str, Any]:
    """What a model says of frames that it has not seen; None of what it cannot say."""
    asked, _ = frames_of("uint8", 12, seed=1)
    found = {"predict": model.predict(asked).tolist()}
    given = {"predict_set": [0.1], "predict_proba": [], "is_known": [0.05]}
    for name, alpha in given.items():
        try:
            each = getattr(model, name)(asked, *alpha)
            found[name] = [np.asarray(one).tolist() for one in each]
        except (AttributeError, ValueError):
            found[name] = None
    return found


def write(version: str) -> None:
    from hdc import HDCClassifier, HDCRegressor
    from hdc.encoders import ENCODERS
    from hdc.readouts import READOUTS

    warnings.simplefilter("ignore")
    folder = FOLDER / version
    folder.mkdir(parents=True)
    frames, labels = frames_of("uint8", 30)
    names = np.array(["left", "middle", "right"])[labels]
    said = {}

    def keep(name: str, model: Any) -> None:
        model.save(folder / f"{name}.hdc", metadata={"made by": version})
        said[name] = answers(model)

    for encoder, readout in FORMS:
        if encoder not in ENCODERS or readout not in READOUTS:
            continue
        name = f"{encoder}, {readout}"
        model = HDCClassifier(encoder, readout, backend="numpy").fit(frames, names)
        keep(name, model)
        if name in RECALIBRATED and hasattr(model, "recalibrate"):
            keep(f"{name}, recalibrated", model.recalibrate(frames[:9] // 2, names[:9]))
    for readout in ("ridge", "neighbours"):
        numbers = HDCRegressor("median", readout, backend="numpy")
        keep(f"numbers, {readout}", numbers.fit(frames, np.sin(np.arange(30.0))))
    (folder / "answers.json").write_text(json.dumps(said))


if __name__ == "__main__":
    write(sys.argv[1])
