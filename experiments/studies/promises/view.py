"""Values, label sets, probabilities and rejection: what is promised, and what holds."""

from experiments.reporting.study import Study
from experiments.studies.promises.rejection import view as rejection
from experiments.studies.promises.values import view as values

STUDY = Study(
    "promises",
    "Calibration and coverage",
    "How accurate are predicted numbers, in mm, µm or refractive index? How often do "
    "intervals, label sets, rejection and probabilities keep their promise?",
    order=2.8,
    tables=[*values.TABLES, rejection.TABLE],
    figures=values.FIGURES,
)
