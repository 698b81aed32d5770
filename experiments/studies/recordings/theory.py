"""What theory expects of a recording from ten frames of every class, beside what was found."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pandas as pd

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.columns import Column, scene_name
from experiments.reporting.measured import accuracies, over_units
from experiments.reporting.study import RUN
from experiments.reporting.text import percent, points
from experiments.studies.recordings.study import STUDY
from experiments.studies.recordings.values import recordings


@STUDY.table(
    "recording_theory",
    title="Theory from ten frames of every class, and the accuracy that was found",
    columns={
        "recording": Column("Recording", scene_name),
        "n": Column("Frames per class"),
        "hdc": Column("HDC, %", percent),
        "hdc_theory": Column("HDC by theory, %", percent),
        "mean_image": Column("Mean image, %", percent),
        "mean_image_theory": Column("Mean image by theory, %", percent),
        "cost": Column("Cost of the bit, points", points),
        "cost_theory": Column("Cost by theory, points", points),
    },
    note="Random split, because theory takes all frames of a class as alike. Theory knows the "
    "correlations of pairs among ten frames of every class and classifies none; brackets: the "
    "central 95 % of 20 choices of the ten. Mean image: compared by correlation. Cost of the bit: "
    "mean image less HDC.",
    folded=True,
)
def expected_by_theory(results: Results) -> pd.DataFrame | None:
    """A row for each recording and n of which both theory and a measurement are there."""
    table, benches = [], recordings(results)
    for scene, expected in recordings(results, "recording_theory").items():
        if scene in benches:
            table += list(_theory_beside(scene, expected, benches[scene]))
    if not table:
        return None
    data = pd.DataFrame(table)
    data.attrs["commands"] = [
        f"{RUN}recording_theory scene={name}" for name in data.recording.unique()
    ]
    return data


def _theory_beside(
    scene: str, expected: Measured, bench: Measured
) -> Iterator[dict[str, Any]]:
    """Rows of one recording; none where one of the two models of the theory was not measured."""
    pair = ["hdc", "correlation"]
    lines = accuracies(bench.frame).query("split == 'random' and model in @pair")
    means = lines.groupby(["n", "model"]).accuracy.mean()
    found = means.unstack().reindex(columns=pair).dropna()
    theory = expected.frame
    rows = theory.assign(cost=theory.mean_image - theory.hdc)
    for n, part in rows.groupby("n"):
        if n not in found.index:
            continue
        hdc, image = found.loc[n]
        line = {
            "recording": scene,
            "n": n,
            "hdc": hdc,
            "mean_image": image,
        }
        line["cost"] = image - hdc
        for name in ("hdc", "mean_image", "cost"):
            estimate = over_units(part[name].tolist(), seeds=False)
            line |= estimate.columns(f"{name}_theory")
        yield line
