"""The study of public recordings, with which its tables and figures are registered."""

from experiments.reporting.study import Study

STUDY = Study(
    "recordings",
    "Public recordings",
    "On frames of optical sensors of several kinds, captured or computed by others: does HDC "
    "recognise better than its rivals, and what wins back what it loses?",
    0.5,
    front=True,
)
