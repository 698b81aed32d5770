"""A comparison as text: tables of all models, the learning curve, and the advice."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

from hdc.command.compare import advice
from hdc.command.messages import printable, size
from hdc.selection import Scores

COSTS = ("train s", "ms a frame", "size", "front of")
FRONT = (
    "front: no other model has both less error on the last test and less time, of training or of "
    "prediction.\nTimes are of this machine, predictions in batches of 100; those of models of "
    "greys are of inner products of frames."
)
_WIDTH = 160


def text(result: Mapping[str, Any]) -> str:
    """Text that the command prints after the rows of the cross-validation."""
    parts = []
    if result["given_up"]:
        parts.append("* given up after the first fold, far behind the best so far")
    if result["not_tried"]:
        parts.append(f"Not tried in the time given: {'; '.join(result['not_tried'])}.")
    parts += [f"left out: {name}: {why}" for name, why in result["left_out"].items()]
    parts += [_of_table(_tests(result, value)) for value in result.get("values", [""])]
    parts.append(FRONT)
    parts.append(_of_table(_curve(result)))
    lines = [*advice.sentences(result), *advice.of_dither(result)]
    parts.append("\n".join(lines))
    return "\n\n".join(parts)


def head(result: Mapping[str, Any]) -> str:
    """Lines on the models compared, the choice, and the test frames."""
    if "values" in result:
        learnt = f"values of {', '.join(map(printable, result['values']))}"
    else:
        learnt = f"{len(result['classes'])} classes"
    lines = [f"{result['frames']} frames, {learnt}, {size(result['shape'])}"]
    if result.get("notes"):
        lines.append(f"read: {'; '.join(result['notes'])}")
    chosen_by = result["chosen_by"]
    lines.append(f"chosen by {chosen_by}" if chosen_by else advice.UNCHOSEN)
    for test in result["tests"]:
        counts = f"{test['tested']} frames, learnt from {test['learnt']}"
        if "guess" in test:
            largest = printable(test["guessed"])
            counts += (
                f"; a guess of {largest}, the largest class, has {test['guess']:.1%}"
            )
        lines.append(f"tested {_on(test['name'])}: {counts}")
    return "\n".join(lines)


def row(name: str, scores: Scores, learns_values: bool) -> str:
    """A line on a model that was just tried."""
    losses = {method.name: loss for method, loss in scores.losses.items()}
    if name not in losses:
        return f"{printable(name)}: left out"
    if learns_values:
        found = f"{losses[name]:.3g} of a guess's error"
    else:
        found = f"accuracy {1 - losses[name]:.1%}"
    mark = "*" if name in scores.given_up else ""
    return f"{printable(name)}: {found}{mark}"


def _score(score: float, name: str, result: Mapping[str, Any]) -> str:
    text = f"{score:.3g}" if "values" in result else f"{score:.1%}"
    return f"{text}*" if name in result["given_up"] else text


def _tests(result: Mapping[str, Any], value: str) -> Table:
    """Accuracies, or errors of one value, in folds and tests; and costs."""
    heads = [_on(test["name"]) for test in result["tests"]]
    unit = result.get("units", {}).get(value)
    title = f"error of {printable(value)}" + (f" [{unit}]" if unit else "")
    if not value:
        title, heads = "accuracy", [f"{head} [95 %]" for head in heads]
    table = Table(title, "folds", *heads, *COSTS, box=None)
    for name, last in result["tests"][-1]["methods"].items():
        tested = [test["methods"].get(name) for test in result["tests"]]
        cells = [_tested(found, value) for found in tested]
        inner = result["cross_validation"].get(name)
        first = "–" if inner is None else _score(inner, name, result)
        table.add_row(_named(name, result), first, *cells, *_cost(last))
    return table


def _tested(found: Mapping[str, Any] | None, value: str) -> str:
    if found is None:
        return "–"
    if value:
        return f"{found['errors'][value]:.4g}"
    low, high = 100 * found["low"], 100 * found["high"]
    return f"{found['accuracy']:.1%} [{low:.0f}, {high:.0f}]"


def _cost(found: Mapping[str, Any]) -> list[str]:
    """Times, size and the fronts on which a model lies."""
    fronts = {"training": "front_train_s", "prediction": "front_predict_ms"}
    leading = [word for word, key in fronts.items() if found[key]]
    times = [f"{found['train_s']:.3g}", f"{found['predict_ms']:.2g}"]
    return [*times, _bytes(found["bytes"]), ", ".join(leading) or "–"]


def _bytes(n: int) -> str:
    for unit in ("B", "kB", "MB"):
        if n < 1000:
            return f"{n:.3g} {unit}"
        n /= 1000  # type: ignore[assignment]
    return f"{n:.3g} GB"


def _curve(result: Mapping[str, Any]) -> Table:
    curves = result["curve"]
    counts = [f"{point['frames']:.3g}" for point in curves[result["published"]]]
    per = "frames" if "values" in result else "frames per class"
    title = f"{_on(result['tests'][-1]['name'])}, by {per}"
    table = Table(title, *counts, box=None)
    for name, curve in curves.items():
        cells = []
        for point in curve:
            if "error" in point:
                cells.append(f"{point['error']:.3g}")
            else:
                cells.append(f"{point['accuracy']:.0%}")
        table.add_row(printable(name), *cells)
    return table


def _on(name: str) -> str:
    return name if name.startswith("at ") else f"on {name}"


def _named(name: str, result: Mapping[str, Any]) -> str:
    marks = []
    if name == result["published"]:
        marks.append("published" if "classes" in result else "default")
    if name == result["chosen"]:
        marks.append("chosen")
    mark = f" ({', '.join(marks)})" if marks else ""
    return printable(name) + mark


def _of_table(table: Table) -> str:
    console = Console(width=_WIDTH, highlight=False, markup=False)
    with console.capture() as captured:
        console.print(table)
    return "\n".join(line.rstrip() for line in captured.get().rstrip().splitlines())
