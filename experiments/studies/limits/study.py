"""The study of numbers at their limits, with which its tables and figures are registered."""

from experiments.reporting.study import Study

STUDY = Study(
    "limits",
    "Numbers at their limits",
    "Where do the obvious formulas lose their digits, and do ours keep them? What would another "
    "digit cost? Which learning rates are stable?",
    order=9,
)
