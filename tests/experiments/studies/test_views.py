"""Every figure of a study can be drawn, and no view knows a model or another study."""

import ast

import pytest
from matplotlib import pyplot as plt

from experiments.records.files import ROOT
from experiments.reporting.table import MOST_COLUMNS

STUDIES = (
    "limits", "benchmark", "robustness", "correlation", "drift", "footprint",
)  # fmt: skip


@pytest.mark.parametrize("study", STUDIES)
@pytest.mark.filterwarnings("error")
def test_every_figure_of_the_reference_fits_a_column_or_two(study, committed):
    for table in committed.tables[study]:
        assert len(table.heads) <= MOST_COLUMNS
    for plot in committed.plots[study]:
        figure = plot.draw()
        figure.draw_without_rendering()
        box = figure.get_tightbbox(figure.canvas.get_renderer())
        width = figure.get_figwidth()
        assert width in (3.4, 7.0)  # one column of a journal, or two
        assert 0 <= box.x0 < box.x1 <= width + 0.02  # a hair of a label may stand over
    plt.close("all")


def test_no_view_lists_a_model_or_a_recording_and_only_claims_look_at_other_studies():
    names = {"ridge", "linear_bits", "nearest_neighbour", "thumbnail"}
    names |= {"diffuser", "fibre_grouped", "gelsight", "tactip", "spr"}
    for path in (ROOT / "experiments" / "studies").glob("*/view.py"):
        tree, study = ast.parse(path.read_text(encoding="utf-8")), path.parent.name
        keys = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Tuple | ast.List):
                keys |= {e.value for e in node.elts if isinstance(e, ast.Constant)}
            if isinstance(node, ast.ImportFrom) and study != "claims":
                other = (node.module or "").removeprefix("experiments.studies.")
                if other != node.module:
                    assert other.partition(".")[0] == study, f"{study} imports {other}"
        if study not in (
            "claims",
            "values",
        ):  # which name their evidence, their methods
            assert not keys & names, study
