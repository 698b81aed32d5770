"""Whatever is missing from the records, the report is made whole: no view expects a model.

Each model, and each measurement, is taken out of the committed records in turn. What takes none of
the records that have it is what it was, and not made again.
"""

from __future__ import annotations

import copy
import dataclasses

import pytest
from matplotlib import pyplot as plt
from msgspec.structs import replace

from experiments import studies
from experiments.records.files import REFERENCE
from experiments.records.results import RUNS, Results
from experiments.records.rows import Rows
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import experiments_of

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
    """The committed results without a model, and the experiments that had it."""
    runs = [run for run in RESULTS.runs if run.choices.model != model]
    touched = {RUNS} if len(runs) < len(RESULTS.runs) else set()
    measurements = []
    for measured in MEASUREMENTS:
        every = measured.rows.dicts()
        rows = rows_without(every, model)
        if len(rows) == len(every):
            measurements.append(measured)
            continue
        touched.add(measured.name)
        if rows:
            measurements.append(replace(measured, rows=Rows.of(rows)))
    return reduced(runs, measurements), touched


def made_whole(results, touched):
    """Every table, figure and number that takes one of these experiments is made; the names of the
    tables."""

    def takes(asked):
        return [one for one in asked if not touched.isdisjoint(experiments_of(one.of))]

    failures, names = [], []
    for study in studies_of(studies):
        kinds = ("tables", "figures", "numbers")
        part = dataclasses.replace(
            study, **{kind: takes(getattr(study, kind)) for kind in kinds}
        )
        names += [
            table.csv() and table.name for table in part.tables_of(results, failures)
        ]
        list(part.quantities_of(results, failures))
        for plot in part.plots_of(results, failures):
            plot.draw()
            plt.close("all")
    assert [str(failure) for failure in failures] == []
    return names


def slowly(names, quick):
    """The names as parameters of a test, slow but for the quick ones."""
    return [n if n in quick else pytest.param(n, marks=pytest.mark.slow) for n in names]


@pytest.mark.parametrize("model", slowly(MODELS, EVERYWHERE))
def test_a_model_that_is_missing_ends_nothing(model):
    names = made_whole(*without_model(model))
    assert names
    if model in ("hdc", "softmax_dual"):  # which are everywhere
        assert {"table1", "recordings", "drift"} <= set(names)


@pytest.mark.parametrize("name", slowly(NAMES, ("benchmark", "recordings")))
def test_a_measurement_that_is_missing_costs_its_own_tables(name):
    left = [measured for measured in MEASUREMENTS if measured.name != name]
    made = made_whole(reduced(RESULTS.runs, left), {name})
    own = {
        table.name
        for study in studies_of(studies)
        for table in study.tables
        if experiments_of(table.of) == (name,)
    }
    assert own.isdisjoint(made)
