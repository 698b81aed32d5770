"""A comparison as text: tables of all models, the learning curve, and the advice."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

from hdc.command.compare import advice
from hdc.command.work import printable, size

_WIDTH = 120


def text(result: Mapping[str, Any]) -> str:
    """All that the command prints."""
    parts = [_head(result)]
    if result["cross_validation"]:
        parts.append(_of_table(_choice(result)))
        if result["given_up"]:
            parts.append("* given up after the first fold, far behind the best there")
    parts += [f"left out: {name}: {why}" for name, why in result["left_out"].items()]
    tables = _tests_of_values(result) if "values" in result else [_tests(result)]
    parts += [_of_table(table) for table in tables]
    parts.append(_of_table(_curve(result)))
    lines = advice.of_values if "values" in result else advice.of_classes
    parts.append("\n".join(lines(result)))
    return "\n\n".join(parts)


def _head(result: Mapping[str, Any]) -> str:
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
        lines.append(f"tested {_on(test['name'])}: {counts}")
    return "\n".join(lines)


def _choice(result: Mapping[str, Any]) -> Table:
    """Encoders down, read-outs across: scores in cross-validation."""
    pairs = {}
    for name, score in result["cross_validation"].items():
        encoder, _, readout = name.partition(", ")
        if not readout.endswith(" greys"):
            pairs[encoder, readout] = _score(score, name, result)
    encoders = list(dict.fromkeys(encoder for encoder, _ in pairs))
    readouts = list(dict.fromkeys(readout for _, readout in pairs))
    kind = "error / that of a guess" if "values" in result else "accuracy"
    table = Table(f"cross-validation, {kind}", *readouts, box=None)
    for encoder in encoders:
        cells = [pairs.get((encoder, readout), "–") for readout in readouts]
        table.add_row(printable(encoder), *cells)
    return table


def _score(score: float, name: str, result: Mapping[str, Any]) -> str:
    text = f"{score:.3g}" if "values" in result else f"{score:.1%}"
    return f"{text}*" if name in result["given_up"] else text


def _tests(result: Mapping[str, Any]) -> Table:
    heads = [f"tested {_on(test['name'])} [95 %]" for test in result["tests"]]
    table = Table("accuracy", "cross-validation", *heads, box=None)
    for name in result["tests"][0]["methods"]:
        cells = []
        for test in result["tests"]:
            found = test["methods"][name]
            interval = f"[{found['low']:.1%}, {found['high']:.1%}]"
            cells.append(f"{found['accuracy']:.1%} {interval}")
        inner = result["cross_validation"].get(name)
        first = "–" if inner is None else _score(inner, name, result)
        table.add_row(_named(name, result), first, *cells)
    return table


def _tests_of_values(result: Mapping[str, Any]) -> list[Table]:
    """A table for each value: errors, and coverage and width of the intervals of 90 %."""
    tables = []
    for value in result["values"]:
        unit = f" [{result['units'][value]}]" if result["units"].get(value) else ""
        heads = []
        for test in result["tests"]:
            on = _on(test["name"])
            heads += [f"error {on}", "90 % cover", "width"]
        table = Table(f"{printable(value)}{unit}", *heads, box=None)
        for name in result["tests"][0]["methods"]:
            cells = []
            for test in result["tests"]:
                cells += _cells_of_value(test["methods"][name], value)
            table.add_row(_named(name, result), *cells)
        tables.append(table)
    return tables


def _cells_of_value(found: Mapping[str, Any], value: str) -> list[str]:
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
