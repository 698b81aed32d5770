"""Tables, figures and the page from the records there are: ``python -m experiments.report``.

Reads the records and measurements of the results folder and ``results/published.csv``, never
trains, and writes ``tables/``, ``figures/``, ``comparison.csv`` and ``report.html``. What is
missing is said in the table, on the terminal, in the figure and on the page.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments import comparison, page, page_figures, page_tables, table_text, tables
from experiments.comparison import MISFITS
from experiments.record import results_dir, write_atomically
from experiments.selection import Records
from experiments.table_text import Columns, number, percent
from experiments.tables import Row

WIDTH = 100  # columns of the terminal that Table I needs
_OVER_N = ["accuracy_vs_n", "accuracy_vs_n_cnn"]


def main(arguments: list[str] | None = None) -> None:
    """Write everything, show Table I."""
    parser = argparse.ArgumentParser(prog="python -m experiments.report", description=__doc__)
    parser.add_argument("--device", default="cpu", help="use records of this device (cpu)")
    device = parser.parse_args(arguments).device
    write(results_dir(), device, Console(width=WIDTH, highlight=False))


def write(results: Path, device: str, console: Console) -> list[Path]:
    """Write tables and figures into a results folder from the records in it; what was written."""
    records = Records(results, device)
    table1, extended, over_n, over_d, work = (
        tables.table1(records),
        tables.table1(records, "table1_extended"),
        tables.curve(records, _OVER_N),
        tables.curve(records, ["accuracy_vs_d"]),
        tables.curve(records, ["work_precision"]),
    )
    written: list[Path] = []
    shown = {}
    for name, rows, columns, cells, title in (
        ("table1", table1, tables.TABLE1, table_text.TABLE1_COLUMNS,
         "Table I, published and measured"),
        ("table1_extended", extended, tables.TABLE1, table_text.EXTENDED_COLUMNS,
         "Table I for other competitors"),
        ("accuracy_vs_n", over_n, tables.CURVE, table_text.CURVE_COLUMNS,
         "Accuracy against the number N of training samples"),
        ("accuracy_vs_d", over_d, tables.CURVE, table_text.CURVE_COLUMNS,
         "Accuracy against the number D of pixels seen"),
        ("work_precision", work, tables.CURVE, table_text.CURVE_COLUMNS,
         "Accuracy against the time of a prediction"),
    ):  # fmt: skip
        written += _write_table(results / "tables", name, rows, columns, cells, title)
        text = table_text.to_markdown(rows, cells, title)
        experiments = _OVER_N if name == "accuracy_vs_n" else [name]
        command = " && ".join(f"python -m experiments.run experiment={x}" for x in experiments)
        shown[name] = page_tables.of_markdown(name, title, text, command)
        if name.startswith("table1"):  # the experiment by itself is a first look with one seed
            made = [records.group(row["scene"], row["model"]) for row in rows]
            commands = comparison.commands(made) or [command]
            shown[name][-1] = replace(shown[name][-1], commands=commands)
    compared = comparison.compare(records, results)
    written += _write_comparison(results, compared)
    shown["comparison"] = page_tables.of_markdown(
        "comparison", comparison.TITLE, comparison.to_markdown(compared), page_figures.REPORT
    )
    written += _write_figures(results / "figures", records, table1 + extended, over_n, over_d, work)
    written += _write_measured(results, records)
    written += page.write(results, records, compared, shown)
    console.print(terminal_table(table1))
    _print_notes(console, records, table1, extended + over_n + over_d + work)
    folders = sorted({os.path.relpath(path.parent) for path in written})
    console.print(f"{len(written)} files in {' and '.join(folders)}", soft_wrap=True)
    return written


def _write_measured(results: Path, records: Records) -> list[Path]:
    """Tables and figures of the paper's experiments and of the measurements that there are.

    What cannot be made of a measurement goes to the problems of the records.
    """
    from experiments import (
        fuzz_table,
        numerics_figure,
        paper_figures,
        stability_table,
        stiffness_figures,
        stiffness_tables,
    )

    folder = results / "figures"

    def save(name: str, figure: Any) -> list[Path]:
        return [] if figure is None else _save(folder, name, figure)

    written: list[Path] = []
    for name, make in {
        "the paper's figures": lambda: paper_figures.write(results, records.device),
        "stability": lambda: stability_table.tables(results),
        "stiffness and footprint": lambda: stiffness_tables.write(results),
        "robustness": lambda: _write_robustness(results),
        "fuzz": lambda: fuzz_table.table(results),
        "figure numerics": lambda: save("numerics", numerics_figure.figure(results)),
        "figure stiffness_limit": lambda: save(
            "stiffness_limit", stiffness_figures.stability_limit(results)
        ),
        "figure stiffness_spectrum": lambda: save(
            "stiffness_spectrum", stiffness_figures.spectrum(results)
        ),
        "figure softmax_methods": lambda: save(
            "softmax_methods", stiffness_figures.methods(results)
        ),
    }.items():
        try:
            written += make()
        except MISFITS as error:  # the rest is shown all the same
            records.problems.append(f"{name}: {type(error).__name__}: {error}")
    return written


def _write_robustness(results: Path) -> list[Path]:
    from experiments import robustness_table

    rows = robustness_table.rows(results)
    if not rows:
        return []
    texts = {
        results / "tables" / "robustness.csv": table_text.to_csv(rows, robustness_table.COLUMNS),
        results / "tables" / "robustness.md": robustness_table.markdown(rows),
    }
    for path, text in texts.items():
        write_atomically(path, text)
    figure = robustness_table.figure(rows)
    return [*texts, *_save(results / "figures", "robustness", figure)]


def _write_comparison(results: Path, compared: list[Row]) -> list[Path]:
    texts = {
        results / "comparison.csv": comparison.to_csv(compared),
        results / "tables" / "comparison.md": comparison.to_markdown(compared),
    }
    for path, text in texts.items():
        write_atomically(path, text)
    return list(texts)


def terminal_table(rows: list[Row]) -> Table:
    """Table I for the terminal: the paper's number beside ours, at most 100 columns."""
    table = Table(
        title=table_text.caption(rows, "Table I"),
        title_justify="left",
        box=box.SIMPLE_HEAD,
        padding=0,
        pad_edge=False,
    )
    table.add_column("model\nseeds", min_width=13)
    for head, width in (
        ("training (s)\npaper", 12), ("\nhere", 22), ("train (%)\npaper", 9), ("\nhere", 4),
        ("test (%) [95 %]\npaper", 15), ("\nhere", 15),
    ):  # fmt: skip
        table.add_column(escape(head), justify="right", min_width=width)
    for line in rows:
        seeds = "1 seed" if line["seeds"] == 1 else f"{line['seeds']} seeds"
        cells = (
            f"{table_text.display_name(line['model'])}\n{seeds}",
            number(line["published_training_time_s"])
            + _times(line["published_training_time_over_hdc"]),
            table_text.time_cell(line) + _times(line.get("training_time_over_hdc")),
            percent(line["published_train_accuracy"]),
            percent(line.get("train_accuracy_max")),
            table_text.published_cell(line),
            table_text.interval_cell(line),
        )
        table.add_row(*(escape(cell) for cell in cells))
    return table


def _times(ratio: float | None) -> str:
    return f"\n{number(ratio)} × HDC" if ratio else ""


def _write_table(
    folder: Path, name: str, rows: list[Row], columns: Any, shown: Columns, title: str
) -> list[Path]:
    texts = {
        "csv": table_text.to_csv(rows, columns),
        "md": table_text.to_markdown(rows, shown, title),
        "tex": table_text.to_latex(rows, shown, title, name),
    }
    for kind, text in texts.items():
        write_atomically(folder / f"{name}.{kind}", text)
    return [folder / f"{name}.{kind}" for kind in texts]


def _write_figures(
    folder: Path,
    records: Records,
    table: list[Row],
    over_n: list[Row],
    over_d: list[Row],
    work: list[Row],
) -> list[Path]:
    from experiments import figures

    written = []
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in {
        "error_vs_time": figures.error_vs_time(records),
        "accuracy_vs_n": figures.accuracy_vs_n(over_n),
        "accuracy_vs_d": figures.accuracy_vs_d(over_d),
        "work_precision": figures.work_precision(work, table),
    }.items():
        written += _save(folder, name, figure)
    return written


def _save(folder: Path, name: str, figure: Any) -> list[Path]:
    from experiments import figures

    paths = [folder / f"{name}.{kind}" for kind in ("svg", "pdf")]
    for path in paths:
        path.write_bytes(figures.save(figure, path.suffix[1:]))
    figures.plt.close(figure)
    return paths


def _print_notes(console: Console, records: Records, table1: list[Row], rest: list[Row]) -> None:
    """How to read the table, and what is missing from it and from the others."""
    console.print(f"[dim]{escape(table_text.notes(table1))}[/dim]")
    for line in table1:
        if line["status"] != "ok":
            console.print(escape(f"{line['model']}: {line['status']}"), style="yellow")
    missing = sum(line["status"] == "missing" for line in rest)
    failed = sum(line["status"] not in ("ok", "missing") for line in rest)
    if missing or failed:
        console.print(
            f"other tables: {len(rest)} rows, {missing} missing, {failed} with failed runs",
            style="yellow",
        )
    for problem in records.problems:
        console.print(escape(f"left out: {problem}"), style="yellow")
    if records.skipped:
        console.print(
            f"{len(records.skipped)} records left out: their configuration is not the one that "
            f"configs/ has for their model or scene (first: {records.skipped[0]})",
            style="yellow",
        )


if __name__ == "__main__":
    main()
