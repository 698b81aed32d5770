"""Error against run time: what is measured obeys the laws of its method, and is drawn."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from experiments.records.results import Results
from experiments.reporting.plot import save
from experiments.studies.numerics import measure as numerics
from experiments.studies.numerics.view import PANELS, STUDY
from experiments.studies.stability.cases.correlations import exact_mean


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RESULTS_DIR", str(folder))
        numerics.run(samples=4, pixels=5000, intervals=[25, 100, 400], repeats=1)
    return folder


@pytest.fixture
def errors(measured):
    """errors(problem, input) → error by method."""
    rows = Results(measured).measured("numerics").rows

    def select(problem, chosen):
        return {
            row["method"]: float(row["error"])
            for row in rows
            if (row["problem"], row["input"]) == (problem, chosen)
        }

    return select


def test_every_row_has_a_time_a_tolerance_and_a_reference(measured):
    rows = Results(measured).measured("numerics").rows
    assert {row["problem"] for row in rows} == set(PANELS)
    assert len(rows) == 9 + 14 + 6
    assert all(float(row["time_s"]) >= 0 and float(row["tolerance"]) > 0 for row in rows)
    assert all(row["reference"] for row in rows)


def test_float32_loses_a_digit_of_the_phase_for_each_of_the_path(errors):
    found = [errors("phases", f"1e+0{n} rad") for n in (5, 6, 7)]
    growth = [b["float32"] / a["float32"] for a, b in itertools.pairwise(found)]
    assert all(5 < g < 20 for g in growth)
    assert all(row["mixed"] < 1e-6 and row["float64"] < 1e-7 for row in found)


def test_a_mean_far_above_the_deviation_costs_digits_in_float32(errors):
    plain, hard = (
        errors("correlations", "8-bit speckle"),
        errors("correlations", "mean 10⁶ × deviation"),
    )
    assert hard["double sum, float32"] > 100 * plain["double sum, float32"]
    for form in ("double sum", "Gram matrix", "class sum"):
        assert plain[f"{form}, float64"] < 1e-12
        assert hard[f"{form}, float64"] < 1e-10
    assert hard["class sum, compensated"] < 1e-5 < hard["Gram matrix, float32"]


def test_a_finer_table_is_more_exact(errors):
    found = [errors("layer", n) for n in ("25", "100", "400")]
    for method in ("largest", "root mean square"):
        values = [row[method] for row in found]
        assert values == sorted(values, reverse=True)
        assert values[-1] < values[0] / 100
    assert all(row["root mean square"] < row["largest"] for row in found)


def test_the_exact_mean_is_that_of_numpy_and_refuses_what_it_could_not_hold():
    frames = np.random.default_rng(0).integers(0, 256, (5, 300))
    among = np.corrcoef(frames)[np.triu_indices(5, 1)]
    assert exact_mean(frames) == pytest.approx(among.mean(), abs=1e-14)
    assert exact_mean(frames + 10**12) == exact_mean(frames)
    with pytest.raises(ValueError, match=r"below 2\^63"):
        exact_mean(frames * 10**8)


def test_the_figure_has_a_panel_a_problem(measured):
    (plot,) = STUDY.plots(Results(measured))
    figure = plot.draw()
    assert len(figure.axes) == len(PANELS)
    for axes in figure.axes:
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        assert axes.get_xlabel() == "CPU time (ms)"
        assert any("tolerance" in text.get_text() for text in axes.texts)
    assert "samples=4" in figure.get_suptitle()
    assert save(figure, "svg") == save(plot.draw(), "svg")
