"""The study of Table I, with which its tables and figures are registered."""

from experiments.reporting.study import Study

STUDY = Study(
    "table1",
    "Table I",
    "Does HDC recognise touches better than softmax regression and convolutional networks, and "
    "train in a hundredth of their time? Five labels, N = 400.",
    1,
    front=True,
)
