"""The study of promises, with which its tables and figures are registered."""

from experiments.reporting.study import Study

STUDY = Study(
    "promises",
    "Promises",
    "How near do the same hypervectors come in mm, µm or refractive index? How often do the "
    "library's intervals, label sets, rejection and probabilities hold what they promise?",
    order=2.8,
)
