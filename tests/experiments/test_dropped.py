"""Whatever is missing from the records, the report is made whole: no view expects a model.

Each model, and each measurement, is taken out of the committed records in turn.
"""

from __future__ import annotations

import copy

import pytest
from matplotlib import pyplot as plt
from msgspec.structs import replace

from experiments import studies
from experiments.records.files import REFERENCE
from experiments.records.results import Results
from experiments.records.rows import Rows
from experiments.reporting.study import studies as studies_of

# Draws that are kept of each measurement: enough to be shown, quick to be summed.
FEW = 3
RESULTS = Results(REFERENCE)


def few_draws(measured):
    rows = measured.rows.dicts()
    return replace(measured, rows=Rows.of(r for r in rows if r.get("draw", 0) < FEW))


MEASUREMENTS = [few_draws(measured) for measured in RESULTS.measurements]
MODELS = sorted(
    {run.choices.model for run in RESULTS.runs}
    | {
        str(row["model"])
        for m in MEASUREMENTS
        for row in m.rows.dicts()
        if "model" in row
    }
)
EVERYWHERE = (
    "hdc",
    "softmax_dual",
    "mean_image",
)  # the others are slow to take out one by one
NAMES = sorted({measured.name for measured in MEASUREMENTS})


def reduced(runs, measurements):
    """The committed results with these runs and measurements alone."""
    results = copy.copy(RESULTS)
    results.__dict__ |= {"runs": runs, "measurements": measurements, "_frames": {}}
    return results


def rows_without(rows, model):
    """Rows of the other models; the true classes of a draw move to its next row."""
    kept, moved = [], {}
    for row in rows:
        if row.get("model") != model:
            kept.append({**row, **moved})
            moved = {}
        elif row.get("labels") is not None:
            moved = {key: row[key] for key in ("labels", "n_classes") if key in row}
    return kept


def without_model(model):
    runs = [run for run in RESULTS.runs if run.choices.model != model]
    measurements = []
    for measured in MEASUREMENTS:
        rows = rows_without(measured.rows.dicts(), model)
        if rows:
            measurements.append(replace(measured, rows=Rows.of(rows)))
    return reduced(runs, measurements)


def made_whole(results):
    """Every table, figure and number of every study is made; the names of the tables."""
    failures, names = [], []
    for study in studies_of(studies):
        names += [
            table.csv() and table.name for table in study.tables_of(results, failures)
        ]
        list(study.quantities_of(results, failures))
        for plot in study.plots_of(results, failures):
            plot.draw()
            plt.close("all")
    assert [str(failure) for failure in failures] == []
    return names


def slowly(names, quick):
    """The names as parameters of a test, slow but for the quick ones."""
    return [n if n in quick else pytest.param(n, marks=pytest.mark.slow) for n in names]


@pytest.mark.parametrize("model", slowly(MODELS, EVERYWHERE))
def test_a_model_that_is_missing_ends_nothing(model):
    names = made_whole(without_model(model))
    assert {"table1", "recordings", "drift"} <= set(names)


@pytest.mark.parametrize("name", slowly(NAMES, ("benchmark", "recordings")))
def test_a_measurement_that_is_missing_costs_its_own_tables(name):
    left = [measured for measured in MEASUREMENTS if measured.name != name]
    assert "table1" in made_whole(reduced(RESULTS.runs, left))
