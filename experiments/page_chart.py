"""The interactive chart of the page: test error against training time, as a Vega-Lite 6 grammar.

The library is put into the page whole (0.9 MB), so the page needs no network. Colours, symbols and
the strip for errors of zero are those of :mod:`experiments.figures`.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from experiments.figures import style_of
from experiments.selection import Records, Run
from experiments.table_text import display_name
from experiments.tables import Row, published_row, row, training_time

MODELS = ("hdc", "softmax", "softmax_dual", "cnn1", "cnn1_fast", "cnn3", "cnn3_fast")
PAPER = ("hdc", "softmax", "cnn1", "cnn3")
_MOST_POINTS = 200  # of a run's curve
_DASHES = {"-": [1, 0], "--": [6, 3], ":": [2, 2]}
_SHAPES = {"o": "circle", "s": "square", "D": "diamond", "^": "triangle-up", "v": "triangle-down"}
_STAR = (  # five-pointed, of radius 1
    "M0,-1L0.24,-0.32L0.95,-0.31L0.38,0.12L0.59,0.81L0,0.4"
    "L-0.59,0.81L-0.38,0.12L-0.95,-0.31L-0.24,-0.32Z"
)
_INK = "currentColor"  # of the page: dark on light, light on dark


def error_vs_time(records: Records, scene: str) -> dict[str, Any]:
    """The grammar, with the data of the scene's records and the published points in it."""
    groups = [records.group(scene, model) for model in MODELS]
    rows = [row(group, groups[0]) for group in groups]
    floor = 0.5 / max((line["n_test"] for line in rows if line["seeds"]), default=100)
    points = [p for group in groups for run in group.runs for p in _points(run, floor)]
    paper = [_published(model, floor) for model in PAPER]
    shown = [m for m in MODELS if m in PAPER or any(p["model"] == display_name(m) for p in points)]
    styles = [style_of(model) for model in shown]
    names = [display_name(model) for model in shown]

    def scale(values: Sequence[Any]) -> dict[str, Any]:
        return {"domain": names, "range": list(values)}

    x = {
        "field": "seconds",
        "type": "quantitative",
        "title": "training time (s)",
        "scale": {"type": "log", "nice": False, "padding": 12},
        "axis": {"values": [10.0**k for k in range(-4, 6)], "format": "~g"},
    }
    ticks = [floor, *(t * k for t in (0.001, 0.01, 0.1) for k in (1, 2, 5)), 1.0]
    y = {
        "field": "drawn",
        "type": "quantitative",
        "title": "test error",
        "scale": {"type": "log", "domain": [floor * 0.8, 1.1], "nice": False},
        "axis": {
            "values": [t for t in ticks if t >= floor * 1.98 or t == floor],
            "labelExpr": f"datum.value < {1.5 * floor} ? '0' : format(datum.value, '~%')",
        },
    }
    legend = {"title": None, "orient": "bottom", "columns": 2}
    colour = {
        "field": "model",
        "scale": scale([style[0] for style in styles]),
        "legend": legend,
    }
    shape = {
        "field": "model",
        "scale": scale([_SHAPES[style[1]] for style in styles]),
        "legend": legend,
    }
    faint = {"condition": {"param": "chosen", "value": 1}, "value": 0.08}
    return {
        "$schema": "https://vega.github.io/schema/vega-lite/v6.json",
        "description": "Test error against training time, a curve a model and seed",
        "width": "container",
        "height": 360,
        "background": "transparent",
        "config": _config(),
        "datasets": {"measured": points, "published": paper},
        "data": {"name": "measured"},
        "encoding": {"x": x, "y": y},
        "layer": [
            {
                "data": {"values": [{"low": floor * 0.8, "high": floor * 1.44}]},
                "mark": {"type": "rect", "color": _INK, "opacity": 0.08},
                "encoding": {"x": None, "y": {**y, "field": "low"}, "y2": {"field": "high"}},
            },
            {
                "params": [{
                    "name": "chosen",
                    "select": {"type": "point", "fields": ["model"]},
                    "bind": "legend",
                }],
                "mark": {"type": "line", "strokeWidth": 1.2},
                "encoding": {
                    "color": colour,
                    "strokeDash": {
                        "field": "model",
                        "scale": scale([_DASHES[style[2]] for style in styles]),
                        "legend": legend,
                    },
                    "detail": {"field": "seed"},
                    "order": {"field": "seconds"},
                    "opacity": faint,
                },
            },
            {
                "mark": {"type": "point", "filled": True, "size": 28},
                "encoding": {
                    "color": colour,
                    "shape": shape,
                    "opacity": faint,
                    "tooltip": _tooltip("seed", "test accuracy", "training accuracy"),
                },
            },
            {
                "transform": [{"filter": "datum.reached"}],
                "mark": {"type": "point", "filled": False, "size": 130, "strokeWidth": 1.6},
                "encoding": {
                    "color": colour,
                    "opacity": faint,
                    "tooltip": _tooltip("seed", "test accuracy", "training accuracy", "event"),
                },
            },
            {
                "data": {"name": "published"},
                "mark": {
                    "type": "point", "filled": True, "shape": _STAR, "size": 130,
                    "stroke": _INK, "strokeWidth": 0.7,
                },
                "encoding": {
                    "color": colour,
                    "opacity": faint,
                    "tooltip": _tooltip("test accuracy", "interval", "event"),
                },
            },
        ],
    }  # fmt: skip


def _points(run: Run, floor: float) -> list[dict[str, Any]]:
    """What is drawn of a run: every report, or that many of a long curve."""
    reports = [report for report in run.curve if "test_accuracy" in report]
    reached = training_time(run) if run.iterative else np.inf
    at = {int(k) for k in np.linspace(0, len(reports) - 1, min(len(reports), _MOST_POINTS))}
    at |= {k for k, report in enumerate(reports) if report["training_s"] == reached}
    return [
        {
            "model": display_name(run.record["choices"]["model"]),
            "seed": run.record["config"]["seed"]["run"],
            "seconds": report["training_s"],
            "drawn": max(1 - report["test_accuracy"], floor),
            "test accuracy": report["test_accuracy"],
            "training accuracy": report.get("train_accuracy"),
            "reached": report["training_s"] == reached,
            "event": "training accuracy above 90 %" if report["training_s"] == reached else "",
        }
        for k, report in enumerate(reports)
        if k in at
    ]


def _published(model: str, floor: float) -> Row:
    known = published_row(model)
    low, high = (100 * known[f"published_test_ci_{side}"] for side in ("low", "high"))
    return {
        "model": display_name(model),
        "seconds": known["published_training_time_s"],
        "drawn": max(1 - known["published_test_accuracy"], floor),
        "test accuracy": known["published_test_accuracy"],
        "interval": f"{low:.1f} to {high:.1f} % (95 %, 100 samples)",
        "event": "published, Table I",
    }


def _tooltip(*fields: str) -> list[dict[str, Any]]:
    every = [
        {"field": "model"},
        {"field": "seconds", "title": "training time (s)", "format": ".4~g"},
    ]
    return every + [
        {"field": name, "format": ".1~%"} if "accuracy" in name else {"field": name}
        for name in fields
    ]


def _config() -> dict[str, Any]:
    text = {"labelColor": _INK, "titleColor": _INK}
    return {
        "font": "system-ui, sans-serif",
        "axis": {
            **text, "labelFontSize": 12, "titleFontSize": 13, "titleFontWeight": "normal",
            "gridColor": _INK, "gridOpacity": 0.12, "domainColor": _INK, "tickColor": _INK,
        },
        "legend": {**text, "labelFontSize": 12, "labelLimit": 260, "symbolSize": 80},
        "view": {"stroke": None},
    }  # fmt: skip


@functools.cache
def library() -> str:
    """The JavaScript that draws the grammar, safe inside a script element."""
    import vl_convert

    # Its type stub knows no default for the snippet.
    bundle = vl_convert.javascript_bundle()  # type: ignore[call-arg]
    return bundle.replace("</script", "<\\/script")
