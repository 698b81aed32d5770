"""Lines of the experiments that claims are judged by."""

from __future__ import annotations

import pandas as pd

from experiments.records.results import of_scenes
from experiments.reporting.measured import place_of
from experiments.studies.recordings.values import Accuracies, accuracies_of


class Evidence:
    """Lines of experiments, by scene.

    Args:
        frame: of :meth:`experiments.records.results.Results.frame`.
    """

    def __init__(self, frame: pd.DataFrame) -> None:
        self.frame = frame

    def scenes(self, experiment: str) -> dict[str, pd.DataFrame]:
        """The lines of one experiment, in the order of the scenes' places."""
        found = of_scenes(self.frame, experiment)
        ordered = sorted(found, key=lambda scene: (place_of(scene), scene))
        return {scene: found[scene] for scene in ordered}

    def accuracies(self, experiment: str) -> dict[str, Accuracies]:
        """Accuracies on each recording by the split that counts."""
        return accuracies_of(self.scenes(experiment))
