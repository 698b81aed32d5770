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
    tables = _tests_of_values(result) if "values" in result else [_tests(result)]
    parts += [_of_table(table) for table in tables]
    parts.append(FRONT)
    parts.append(_of_table(_curve(result)))
    lines = advice.of_values if "values" in result else advice.of_classes
    parts.append("\n".join([*lines(result), *advice.of_dither(result)]))
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


def _tests(result: Mapping[str, Any]) -> Table:
    heads = [f"{_on(test['name'])} [95 %]" for test in result["tests"]]
    table = Table("accuracy", "folds", *heads, *COSTS, box=None)
    for name, last in result["tests"][-1]["methods"].items():
        tested = [test["methods"].get(name) for test in result["tests"]]
        cells = [_accuracy(found) for found in tested]
        inner = result["cross_validation"].get(name)
        first = "–" if inner is None else _score(inner, name, result)
        table.add_row(_named(name, result), first, *cells, *_cost(last))
    return table


def _accuracy(found: Mapping[str, float] | None) -> str:
    if found is None:
        return "–"
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


def _tests_of_values(result: Mapping[str, Any]) -> list[Table]:
    """A table for each value: errors, and coverage and width of the intervals of 90 %."""
    tables = []
    for value in result["values"]:
        unit = f" [{result['units'][value]}]" if result["units"].get(value) else ""
        heads = []
        for test in result["tests"]:
            heads += [_on(test["name"]), "90 % cover", "width"]
        table = Table(f"error of {printable(value)}{unit}", *heads, *COSTS, box=None)
        for name, last in result["tests"][-1]["methods"].items():
            cells = []
            for test in result["tests"]:
                cells += _cells_of_value(test["methods"].get(name), value)
            table.add_row(_named(name, result), *cells, *_cost(last))
        tables.append(table)
    return tables


def _cells_of_value(found: Mapping[str, Any] | None, value: str) -> list[str]:
    if found is None:
        return ["–"] * 3
    error = f"{found['errors'][value]:.4g}"
    if "coverage" not in found:
        return [error, "–", "–"]
    cover = f"{found['coverage'][value]['share']:.0%}"
    return [error, cover, f"{found['width'][value]:.4g}"]


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
