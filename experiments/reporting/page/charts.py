"""Interactive figures of the page: Vega-Lite by Altair, drawn by a library that lies beside it."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

import altair as alt
import pandas as pd
import vl_convert

from experiments.records import configs
from experiments.reporting.columns import display_name

# Markers and lines of matplotlib, as models have them, in Vega-Lite.
SHAPES = {
    "o": "circle",
    "s": "square",
    "D": "diamond",
    "d": "diamond",
    "^": "triangle-up",
    "v": "triangle-down",
    "<": "triangle-left",
    ">": "triangle-right",
    "P": "cross",
    "X": "cross",
    "*": "diamond",
}
DASHES = {"-": [1, 0], "--": [4, 2], ":": [1, 2], "-.": [4, 2, 1, 2]}


@cache
def library() -> str:
    """The script that draws charts, of Vega, Vega-Lite and vega-embed; it asks no other host."""
    return vl_convert.javascript_bundle()  # type: ignore[call-arg]  # its stub asks for more


def accuracy_chart(rows: pd.DataFrame, x: str, x_title: str) -> dict[str, Any]:
    """Accuracy against a number, a panel a scene and a line a model; a click in the legend shows
    one model alone, a pointer at a marker its numbers.

    Args:
        rows: ``scene, model, accuracy, accuracy_low, accuracy_high`` in percent, the column `x`,
            and ``command``.
        x: name of the column of the axis, drawn on a logarithmic scale.
        x_title: its title, with unit.

    Returns:
        Vega-Lite.
    """
    looks = _Looks(rows.model)
    told = [
        alt.Tooltip("model:N", title="model"),
        alt.Tooltip(f"{x}:Q", title=x_title),
        alt.Tooltip("accuracy:Q", title="accuracy, %", format=".1f"),
        alt.Tooltip("accuracy_low:Q", title="from, %", format=".1f"),
        alt.Tooltip("accuracy_high:Q", title="to, %", format=".1f"),
        alt.Tooltip("command:N", title="again"),
    ]
    axis = alt.X(f"{x}:Q", title=x_title).scale(type="log", nice=False)
    base = looks.chart(rows).encode(x=axis)
    height = alt.Y("accuracy:Q", title="test accuracy, %").scale(domain=(0, 100))
    lines = base.mark_line().encode(y=height, strokeDash=looks.dash)
    bars = base.mark_rule().encode(
        y=alt.Y("accuracy_low:Q", title="test accuracy, %"), y2="accuracy_high:Q"
    )
    points = base.mark_point(filled=True, size=40).encode(
        y=height, shape=looks.shape, tooltip=told
    )
    drawn = alt.layer(lines, bars, points).add_params(looks.chosen)
    panels = drawn.properties(width=230, height=200).facet(
        facet=alt.Facet("scene:N", title=None), columns=3
    )
    return panels.to_dict()


def time_chart(rows: pd.DataFrame) -> dict[str, Any]:
    """Test error against training time over HDC's, a line a run.

    Args:
        rows: ``model``, ``run`` (its seeds), ``ratio``, ``error`` in percent, and ``command``.

    Returns:
        Vega-Lite.
    """
    looks = _Looks(rows.model)
    told = [
        alt.Tooltip("model:N", title="model"),
        alt.Tooltip("run:N", title="seeds"),
        alt.Tooltip("ratio:Q", title="× HDC", format=".3~g"),
        alt.Tooltip("error:Q", title="test error, %", format=".1f"),
        alt.Tooltip("command:N", title="again"),
    ]
    base = looks.chart(rows).encode(
        x=alt.X("ratio:Q", title="training time, × HDC").scale(type="log"),
        y=alt.Y("error:Q", title="test error, %"),
        detail="run:N",
    )
    lines = base.mark_line().encode(strokeDash=looks.dash)
    points = base.mark_point(filled=True, size=30).encode(
        shape=looks.shape, tooltip=told
    )
    drawn = alt.layer(lines, points).add_params(looks.chosen)
    return drawn.properties(width=330, height=280).to_dict()


class _Looks:
    """Colours, lines and markers of models, as all figures have them, with a legend in which one
    can be chosen."""

    def __init__(self, models: Iterable[str]) -> None:
        every = list(dict.fromkeys(models))
        names = [display_name(model) for model in every]
        looks = [configs.display(model.partition(" (")[0]) for model in every]
        legend = alt.Legend(orient="bottom", columns=3, labelLimit=0)
        self.chosen = alt.selection_point(fields=["model"], bind="legend")
        self._colour = alt.Color("model:N", title=None, legend=legend).scale(
            domain=names, range=[look["colour"] for look in looks]
        )
        self.dash = alt.StrokeDash("model:N", title=None, legend=legend).scale(
            domain=names, range=[DASHES.get(look["line"], [1, 0]) for look in looks]
        )
        self.shape = alt.Shape("model:N", title=None, legend=legend).scale(
            domain=names, range=[SHAPES.get(look["marker"], "circle") for look in looks]
        )

    def chart(self, rows: pd.DataFrame) -> alt.Chart:
        """A chart of rows with a column ``model``; models that are not chosen are faint."""
        shown = rows.assign(model=[display_name(model) for model in rows.model])
        seen = alt.when(self.chosen).then(alt.value(1.0)).otherwise(alt.value(0.07))
        return alt.Chart(shown).encode(color=self._colour, opacity=seen)
