"""The page of ``hdc compare``: table, learning curve and confusions in one file of HTML."""

from __future__ import annotations

import io
from collections.abc import Sequence
from html import escape
from string import Template
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, NullLocator

from hdc.command.compare import HEADS, Comparison, Result, conditions, rows
from hdc.command.methods import METHODS, STEPS

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.2,
    "lines.markersize": 4,
    "legend.frameon": False,
    "svg.hashsalt": "hdc compare",
}
# Told apart in any colour vision (Okabe and Ito), and by their markers in none.
LINES = dict(zip(METHODS, (("#000000", "o"), ("#56B4E9", "P"), ("#0072B2", "D"),
                           ("#E69F00", "s"), ("#009E73", "^")), strict=True))  # fmt: skip
PRINTED = 12  # classes up to which every one is named and every cell has its number

PAGE = Template("""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>hdc compare: $recording</title>
<style>
body { margin: 0 auto; padding: 0 16px 40px; max-width: 60rem; color: #1b1e23; background: #fff;
  font: 16px/1.5 system-ui, sans-serif; overflow-wrap: break-word; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.2rem; margin-top: 2em; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .3em .7em; border-bottom: 1px solid #d5d9e0; text-align: right; }
th { background: #f4f5f7; vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; }
figure { margin: 1em 0; } svg { width: 100%; max-width: 34rem; height: auto; }
figcaption, .notes { color: #5a6270; font-size: .9rem; max-width: 75ch; }
</style>
<h1>$recording</h1>
<p>$conditions. These are your own frames: nothing here is a published number, nor comparable with
one.</p>
<div class="scroll"><table><thead><tr>$heads</tr></thead><tbody>$rows</tbody></table></div>
<p class="notes">Accuracy: mean over all test frames; interval: Wilson, for $level of the different
frames that were tested. Times: medians, on this machine, frames in memory. Bytes: what a prediction
needs of what was learnt. Frames held out at random lie between those trained on: if frames were
recorded in close succession they are alike, and every method does better here than it will
tomorrow. <code>hdc evaluate</code> on a recording of another day tells.</p>
<h2>Learning curve</h2>
<figure>$curve<figcaption>Test accuracy over the number of training frames, with 95 % intervals.
</figcaption></figure>
<h2>Confusions</h2>
<figure>$hdc<figcaption>HDC: how often each class was told as each, over all seeds.</figcaption>
</figure>
<figure>$best<figcaption>$best_name, the most accurate of the others.</figcaption></figure>
<h2>Methods</h2>
<ul>$methods</ul>
<p class="notes">$steps All but HDC see pixels scaled to 0…1. Made by hdc $version.</p>
</html>
""")


def page(comparison: Comparison) -> str:
    """HTML that refers to no other file."""
    best = comparison.best()
    (mine,) = (result for result in comparison.methods if result.name == "HDC")
    with matplotlib.rc_context(STYLE):
        figures = {
            "curve": _svg(curve(comparison.methods)),
            "hdc": _svg(confusion(mine, comparison.classes)),
            "best": _svg(confusion(best, comparison.classes)),
        }
    cells = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows(comparison))
    settings = (f"<li>{escape(r.name)}: {escape(r.settings)}</li>" for r in comparison.methods)
    return PAGE.substitute(
        figures,
        recording=escape(comparison.recording),
        conditions=escape(conditions(comparison)),
        heads="".join(f"<th>{escape(head)}</th>" for head in HEADS),
        rows="".join(f"<tr>{row}</tr>" for row in cells),
        level="95 %",
        best_name=escape(best.name),
        methods="".join(settings),
        steps=escape(STEPS),
        version=escape(comparison.hdc),
    )


def curve(results: Sequence[Result]) -> Figure:
    """Test accuracy over the number of training frames; methods are set apart by some per cent."""
    figure = Figure(figsize=(5, 3.2), layout="constrained")
    axes = figure.add_subplot()
    for k, result in enumerate(results):
        x = np.array([point.frames for point in result.curve]) * 1.02 ** (k - len(results) // 2)
        y, low, high = 100 * np.array([(p.accuracy, p.low, p.high) for p in result.curve]).T
        colour, marker = LINES[result.name]
        axes.errorbar(x, y, yerr=np.maximum([y - low, high - y], 0), label=result.name,
                      color=colour, marker=marker, elinewidth=0.7, capsize=1.5)  # fmt: skip
    sizes = [point.frames for point in results[0].curve]
    axes.set_xscale("log")
    axes.set_xticks(sizes, [str(n) for n in sizes])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(sizes[0] / 1.15, sizes[-1] * 1.15)
    axes.set_ylim(top=101)
    axes.set_xlabel("training frames, all classes together")
    axes.set_ylabel("test accuracy (%)")
    axes.legend(loc="lower right")
    return figure


def confusion(result: Result, classes: Sequence[str]) -> Figure:
    """Shares of each true class (rows) in colour, counts in the cells."""
    counts = np.array(result.confusion)
    shares = 100 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure = Figure(figsize=(5, 4), layout="constrained")
    axes = figure.add_subplot()
    image = axes.imshow(shares, cmap="Blues", vmin=0, vmax=100)
    few = len(classes) <= PRINTED
    ticks = range(0, len(classes), 1 if few else 10)
    names = [_short(classes[i]) for i in ticks]
    axes.set_xticks(ticks, names, rotation=45, ha="right", rotation_mode="anchor")
    axes.set_yticks(ticks, names)
    axes.set_xlabel("predicted class")
    axes.set_ylabel("true class")
    for (i, j), n in np.ndenumerate(counts) if few else ():
        ink = "white" if shares[i, j] > 50 else "black"
        axes.text(j, i, str(n), ha="center", va="center", color=ink, fontsize=7)
    figure.colorbar(image, label="share of the true class (%)")
    return figure


def _short(name: str) -> str:
    """A name of the user's, in which matplotlib must not look for mathematics."""
    return (name if len(name) <= 16 else name[:15] + "…").replace("$", r"\$")


def _svg(figure: Figure) -> str:
    stream = io.StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None})
    drawing = stream.getvalue()
    return drawing[drawing.index("<svg") :]
