"""Numbers at their limits: extreme inputs, error against run time, stiffness."""

from experiments.reporting.study import Study
from experiments.studies.limits.stability import view as stability
from experiments.studies.limits.stiffness import view as stiffness

STUDY = Study(
    "limits",
    "Numbers at their limits",
    "Where do naive formulas lose digits, and do ours keep them? How much time does "
    "another digit cost? Which training method survives a stiff problem?",
    order=9,
    tables=[stability.TABLE, stiffness.TABLE],
    figures=[stability.FIGURE, stiffness.FIGURE],
)
