"""Interactive figures of the page: Vega-Lite by Altair, drawn by a library that lies beside it."""

from __future__ import annotations

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
    models = list(dict.fromkeys(rows.model))
    names = [display_name(model) for model in models]
    shown = rows.assign(model=[display_name(model) for model in rows.model])
    looks = [configs.display(model.partition(" (")[0]) for model in models]
    chosen = alt.selection_point(fields=["model"], bind="legend")
    legend = alt.Legend(orient="bottom", columns=3, labelLimit=0)
    colour = alt.Color("model:N", title=None, legend=legend).scale(
        domain=names, range=[look["colour"] for look in looks]
    )
    dash = alt.StrokeDash("model:N", title=None, legend=legend).scale(
        domain=names, range=[DASHES.get(look["line"], [1, 0]) for look in looks]
    )
    shape = alt.Shape("model:N", title=None, legend=legend).scale(
        domain=names, range=[SHAPES.get(look["marker"], "circle") for look in looks]
    )
    seen = alt.when(chosen).then(alt.value(1.0)).otherwise(alt.value(0.07))
    axis = alt.X(f"{x}:Q", title=x_title).scale(type="log", nice=False)
    told = [
        alt.Tooltip("model:N", title="model"),
        alt.Tooltip(f"{x}:Q", title=x_title),
        alt.Tooltip("accuracy:Q", title="accuracy, %", format=".1f"),
        alt.Tooltip("accuracy_low:Q", title="from, %", format=".1f"),
        alt.Tooltip("accuracy_high:Q", title="to, %", format=".1f"),
        alt.Tooltip("command:N", title="again"),
    ]
    base = alt.Chart(shown).encode(x=axis, color=colour, opacity=seen)
    height = alt.Y("accuracy:Q", title="test accuracy, %").scale(domain=(0, 100))
    lines = base.mark_line().encode(y=height, strokeDash=dash)
    bars = base.mark_rule().encode(
        y=alt.Y("accuracy_low:Q", title="test accuracy, %"), y2="accuracy_high:Q"
    )
    points = base.mark_point(filled=True, size=40).encode(
        y=height, shape=shape, tooltip=told
    )
    drawn = alt.layer(lines, bars, points).add_params(chosen)
    panels = drawn.properties(width=230, height=200).facet(
        facet=alt.Facet("scene:N", title=None), columns=3
    )
    return panels.to_dict()
