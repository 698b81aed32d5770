"""Whatever is missing from the records, the report is made whole: no view expects a model.

Each model, and each measurement, is taken out of the committed records in turn. What takes none of
the records that have it is what it was, and not made again.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import msgspec
import pytest
from matplotlib import pyplot as plt

from experiments import studies
from experiments.records.files import REFERENCE
from experiments.records.results import CHECKPOINTS, RUNS, Results
from experiments.records.rows import Rows
from experiments.reporting.answers import Answers
from experiments.reporting.study import studies as studies_of

FEW = 3  # draws that are kept of each measurement: enough to be shown
RESULTS = Results(REFERENCE)
ROWS = {measured.id: measured.rows.dicts() for measured in RESULTS.measurements}
MODELS = {run.model.name for run in RESULTS.runs}
MODELS |= {row["model"] for rows in ROWS.values() for row in rows if "model" in row}
# Two that are everywhere, and one of a single study; the others are slow to take out one by one.
QUICK = ("hdc", "softmax_dual", "regressor")
NAMES = {measured.experiment for measured in RESULTS.measurements}


def rows_without(rows, model):
    """A few rows of the other models; the true classes of a draw move to its next row."""
    kept, moved = [], {}
    for row in rows:
        if row.get("draw", 0) >= FEW:
            continue
        if row.get("model") != model:
            kept.append({**row, **moved})
            moved = {}
        elif row.get("labels") is not None:
            moved = {key: row[key] for key in ("labels", "n_classes") if key in row}
    return kept


def reduced(model=None, name=None):
    """The committed results without a model or a measurement, and the experiments that had it."""
    results, touched = copy.copy(RESULTS), {name}
    results._frames = {}
    results.runs = [run for run in RESULTS.runs if run.model.name != model]
    if len(results.runs) < len(RESULTS.runs):
        touched |= {RUNS, CHECKPOINTS}
    results.measurements = []
    for measured in RESULTS.measurements:
        rows = ROWS[measured.id]
        if any(row.get("model") == model for row in rows if model):
            touched.add(measured.experiment)
        kept = rows_without(rows, model)
        if kept and measured.experiment != name:
            fewer = msgspec.structs.replace(measured, rows=Rows.of(kept))
            results.measurements.append(fewer)
    return results, touched


def made_whole(results, touched):
    """Every table, figure and number that takes one of these experiments is made; the names of the
    tables."""
    names = []
    for study in studies_of(studies):
        tables = [t for t in study.tables if not touched.isdisjoint(t.experiments)]
        figures = [
            f for f in study.figures if not touched.isdisjoint(f.table.experiments)
        ]
        numbers = {n: make for n, make in study.numbers.items() if n in touched}
        part = replace(study, tables=tables, figures=figures, numbers=numbers)
        answers = Answers("reference", results, [part])
        names += [table.name for table in answers.tables(part) if table.csv()]
        for figure in answers.figures(part):
            figure.draw(figure.table.data)
        assert all(table.csv() for table in answers.every_table())
        assert answers.failures == []
        plt.close("all")
    return names


def slowly(names, quick):
    """The names as parameters of a test, slow but for the quick ones."""
    every = sorted(map(str, names))
    return [n if n in quick else pytest.param(n, marks=pytest.mark.slow) for n in every]


@pytest.mark.parametrize("model", slowly(MODELS, QUICK))
def test_a_model_that_is_missing_ends_nothing(model):
    names = made_whole(*reduced(model=model))
    assert names
    if model in ("hdc", "softmax_dual"):  # which are everywhere
        assert {"table1", "recordings", "drift"} <= set(names)


@pytest.mark.parametrize("name", slowly(NAMES, ("footprint", "recordings")))
def test_a_measurement_that_is_missing_costs_its_own_tables(name):
    made = made_whole(*reduced(name=name))
    of_it_alone = {
        table.name
        for study in studies_of(studies)
        for table in study.tables
        if table.experiments == (name,)
    }
    assert of_it_alone.isdisjoint(made)
