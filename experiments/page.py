"""The page: everything in a results folder in one file that needs no network, report.html.

Its parts come from :mod:`page_tables`, :mod:`page_figures` and :mod:`page_chart`; the template
escapes every text that is put into it. What is missing says so where it would stand.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2

from experiments import page_chart, page_figures, page_tables
from experiments.page_figures import Figure
from experiments.page_tables import Cell, Table
from experiments.record import ROOT, read_record, write_atomically
from experiments.selection import sweep
from experiments.tables import Row

TEMPLATES = Path(__file__).parent / "templates"
_RUN = "python -m experiments.run experiment="


@dataclass
class Section:
    """A part of the page, with its anchor."""

    name: str
    title: str
    text: str = ""
    tables: list[Table] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    chart: bool = False


# Measurements of results/measured by name; one that is not here gets a table all the same.
_MEASURED: dict[str, tuple[str, str]] = {
    "correlation": ("Correlations of Fig. 4", "Eqs. 4 to 6 for every pair of classes."),
    "spatial_correlation": ("Correlations of Fig. 7(a)", "Eq. 6 for every pair of positions."),
    "drift": ("Recalibration of Fig. 8", "Accuracy in the new and in the old environment."),
    "stability": (
        "Numerical stability",
        "Extreme cases on purpose, against references that are exact: what is extreme, the error "
        "and the run time of the obvious method and of ours. A case holds if our error is within "
        "its tolerance.",
    ),
    "numerics": ("Error against run time of the numerics", ""),
    "stiffness": ("Stiffness", "Largest stable learning rates, predicted and found."),
    "softmax_methods": ("Methods for softmax regression", "Loss gap against run time."),
    "robustness": ("Robustness", "Accuracy when something goes wrong after training."),
    "footprint": (
        "Footprint",
        "What a scene loads and needs, beside a build with every part switched on.",
    ),
}
_CURVES = ("accuracy_vs_n", "accuracy_vs_d", "work_precision")
_SENSOR_TABLES = (
    ("calibration", "Calibration of the simulated sensor", "python -m scenes.sensor.calibrate",
     "Rows called fitted chose the sensor's free parameters, predicted rows did not."),
    ("sensor_check", "Speckle and elastic layer against closed forms",
     "python -m scenes.sensor.check", ""),
    ("sensor_precision", "Error of the approximations against their run time",
     "python -m scenes.sensor.check", ""),
    ("sensor_footprint", "Parts, time and memory of a scene", "python -m scenes.sensor.check", ""),
)  # fmt: skip


def write(
    results: Path, records: Any, compared: Sequence[Row], shown: Mapping[str, list[Table]]
) -> list[Path]:
    """Write report.html into a results folder.

    Args:
        results: the folder; its figures are in place.
        records: :class:`experiments.selection.Records` of it.
        compared: rows of :func:`experiments.comparison.compare`.
        shown: tables of the report by name; ``comparison`` and ``table1`` are among them.
    """
    scene = sweep("table1")["scene"][0]
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["verdict"] = _tone
    text = environment.get_template("report.html").render(
        sections=list(_sections(results, shown)),
        verdicts=Counter(row["verdict"] for row in compared).most_common(),
        spec=page_chart.error_vs_time(records, scene),
        library=page_chart.library(),
        quick=_quick(results),
        problems=records.problems,
    )
    write_atomically(results / "report.html", text)
    return [results / "report.html"]


def _sections(results: Path, shown: Mapping[str, list[Table]]) -> Iterator[Section]:
    figures = page_figures.collect(results / "figures")
    yield Section(
        "verdicts",
        "Every published number",
        "Intervals hold with 95 %. A number matches if the difference from the published one is "
        "within the interval that both have, and never without an interval; fitted: it chose a "
        "parameter of the simulated sensor; predicted: it did not, but calibration looked at it.",
        shown["comparison"],
    )
    yield Section(
        "table1",
        "Table I",
        "",
        _all(shown, ("table1", "table1_extended")),
        chart=True,
    )
    yield Section(
        "figures",
        "Figures",
        "",
        _all(shown, _CURVES),
        [figure for figure in figures if not figure.of_sensor],
    )
    for name, (title, text) in _measured(results).items():
        found = page_tables.of_measurement(results, name, title, f"{_RUN}{name}")
        yield Section(name, title, text, found)
    yield Section(
        "benchmark",
        "Benchmark",
        "Routes of the classifier beside its peers, on the "
        "same bytes; the whole of it is in results/benchmark.csv.",
        [_benchmark(results)],
    )
    yield Section(
        "sensor",
        "The simulated sensor",
        "Frames of every scene that is not called measured or recorded come from it.",
        [
            page_tables.of_csv(_lying(results, f"{name}.csv"), title, command, intro)
            for name, title, command, intro in _SENSOR_TABLES
        ],
        [figure for figure in figures if figure.of_sensor],
    )
    entries = list(_entries(results))
    yield Section(
        "environment",
        "Where and how it was made",
        "",
        [page_tables.of_machines(entries), _commands(entries), _steps(results)],
    )


def _tone(verdict: str) -> str:
    """Class of a verdict; those of measurements count as well."""
    words = verdict.lower().replace(",", " ").split()
    if {"differs", "reached", "fails", "failed", "another", "worse"} & set(words):
        return "bad"
    if {"matches", "same", "holds", "ok", "yes", "better", "exact"} & set(words):
        return "good"
    return "plain" if "fitted" in words else "none"


def _all(shown: Mapping[str, list[Table]], names: Sequence[str]) -> list[Table]:
    return [table for name in names for table in shown.get(name, ())]


def _measured(results: Path) -> dict[str, tuple[str, str]]:
    """Title and text of every measurement that there is or should be."""
    found = sorted(path.parent.name for path in results.glob("measured/*/record.json"))
    others = {name: (name.replace("_", " ").capitalize(), "") for name in found}
    return {**_MEASURED, **{k: v for k, v in others.items() if k not in _MEASURED}}


def _benchmark(results: Path) -> Table:
    from experiments import benchmark_results

    path, command = _lying(results, "benchmark.csv"), f"{_RUN}benchmark"
    if not path.is_file():
        return page_tables.of_csv(path, "Benchmark", command)
    keys = ("operation", "route", "n", "median_s", "ratio_to_ours", "peak_bytes", "equal_result",
            "status")  # fmt: skip
    rows = benchmark_results.headline(benchmark_results.read(path))
    texts = [{key: "" if (v := getattr(row, key)) is None else str(v) for key in keys}
             for row in rows]  # fmt: skip
    intro = f"{rows[0].cpu}, {rows[0].threads} threads; {rows[0].versions}." if rows else ""
    return page_tables.of_dicts("benchmark", "At the size of Table I", texts, [command], intro)


def _entries(results: Path) -> Iterator[Mapping[str, Any]]:
    """Every record there is, of runs and measurements."""
    for path in sorted(results.glob("*/*/record.json")):
        try:
            yield read_record(path.parent) or {}
        except ValueError:  # named among the problems
            continue


def _commands(entries: Sequence[Mapping[str, Any]]) -> Table:
    """How many records each command left, and what became of them."""
    count = Counter((entry.get("command", "–"), entry.get("status", "–")) for entry in entries)
    return Table(
        "commands", "Commands that made the records", ["records", "status", "command"],
        [[Cell(str(n)), Cell(status), Cell(command)]
         for (command, status), n in sorted(count.items())],
        instead="" if count else "missing: no records",
    )  # fmt: skip


def _steps(results: Path) -> Table:
    return page_tables.of_csv(
        results / "tables" / "reproduce.csv", "Steps of the reproduction", "make reproduce",
        "Wall-clock time and peak memory of each step when it was last run from nothing.",
    )  # fmt: skip


def _quick(results: Path) -> bool:
    """Whether what is there was made by the quick reproduction."""
    path = results / "tables" / "reproduce.csv"
    if not path.is_file():
        return False
    with path.open(encoding="utf-8", newline="") as file:
        return {row.get("mode") for row in csv.DictReader(file)} == {"quick"}


def _lying(results: Path, name: str) -> Path:
    """A file of the results folder, or of the checkout, where the sensor's scripts write."""
    path = results / name
    return path if path.exists() else ROOT / "results" / name
