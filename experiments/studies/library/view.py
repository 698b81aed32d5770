"""The library beside other implementations of the same read-outs."""

from __future__ import annotations

import pandas as pd

from experiments.records.results import Results
from experiments.reporting.columns import Column
from experiments.reporting.measured import by_scene
from experiments.reporting.study import RUN, Study
from experiments.reporting.text import number

STUDY = Study(
    "library",
    "The library's read-outs",
    "Do the library's read-outs give the answers of other implementations, and in what time?",
    4.2,
)


def _ms(seconds: float) -> str:
    return number(1000 * seconds, 2)


@STUDY.table(
    "library",
    title="The library's read-outs beside other implementations",
    columns={
        "recording": Column("Frames"),
        "readout": Column("Read-out"),
        "peer": Column("Beside"),
        "same": Column("Same answers"),
        "fit_s": Column("Training, ms", _ms),
        "peer_fit_s": Column("… beside", _ms),
        "predict_s": Column("One prediction, ms", _ms),
        "peer_predict_s": Column("… beside", _ms),
    },
    note="From frames to answers, on as many threads, each time the shortest of three; a "
    "prediction is of one frame, the median over ten. Prototypes are exact. Ridge: the library "
    "keeps weights of 8 bits, so an answer between two classes may differ; a nearest neighbour may "
    "differ where two are equally near.",
    folded=True,
)
def library(results: Results) -> pd.DataFrame | None:
    """A row for each kind of frames, read-out and implementation, over all seeds."""
    table = []
    for scene, measured in by_scene(results, "library").items():
        for (readout, peer), rows in measured.frame.groupby(
            ["readout", "peer"], sort=False
        ):
            times = ("fit_s", "peer_fit_s", "predict_s", "peer_predict_s")
            table.append(
                {
                    "recording": scene,
                    "readout": readout,
                    "peer": peer,
                    "same": f"{rows.same.sum()} of {rows.n_test.sum()}",
                    **{name: rows[name].median() for name in times},
                }
            )
    if not table:
        return None
    data = pd.DataFrame(table)
    data.attrs["commands"] = [
        f"{RUN}library scene={name}" for name in data.recording.unique()
    ]
    return data
