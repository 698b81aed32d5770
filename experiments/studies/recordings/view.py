"""Every model on public recordings.

Accuracies and costs are two measurements with tables of their own (``tables``); ``figures`` has a
panel each, and all of them joined.
"""

from experiments.reporting.study import Study
from experiments.studies.recordings import figures, tables

STUDY = Study(
    "recordings",
    "Public data sets",
    "Is HDC more accurate than the baselines on public frames of several optical sensors, and "
    "which changes win back its losses?",
    0.5,
    front=True,
    tables=tables.TABLES,
    figures=figures.FIGURES,
)
