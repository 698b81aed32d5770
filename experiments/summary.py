"""What a run shows on the terminal at its end."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments import sources


def summarise(
    console: Console, entry: dict[str, Any], folder: Path, repeated: bool = False
) -> None:
    """A few lines on the terminal: accuracy with its interval, confusion, times, where it lies."""
    scene = entry["scene"]
    console.print(
        f"[bold]{entry['choices']['model']}[/bold] on [bold]{scene['name']}[/bold] "
        f"({scene['origin']}), {entry['n_train']} training and {entry['n_test']} test samples",
        soft_wrap=True,
    )
    console.print(
        f"  test accuracy {entry['test_accuracy_final']:.1%} "
        f"(95 % interval {entry['test_ci_low']:.1%} to {entry['test_ci_high']:.1%})",
        soft_wrap=True,
    )
    console.print(
        f"  training {entry['training_s']:.4g} s ({entry['stop']}), prediction "
        f"{entry['predict_single_s'] * 1e3:.3g} ms a single frame, "
        f"{entry['predict_batch_s_per_frame'] * 1e3:.3g} ms a frame in a batch",
        soft_wrap=True,
    )
    if len(scene["classes"]) <= 12:
        table = Table(title="confusion (rows: true class)", title_justify="left")
        table.add_column("")
        for name in scene["classes"]:
            table.add_column(escape(name), justify="right")
        for name, row in zip(scene["classes"], np.asarray(entry["confusion"]), strict=True):
            table.add_row(escape(name), *(str(n) if n else "·" for n in row))
        console.print(table)
    note = " (finished before; force=true runs it again)" if repeated else ""
    if changed := sources.outdated(entry["environment"]["sources"]):
        note += f" (made by other code than this: {', '.join(changed)})"
    console.print(f"  record {os.path.relpath(folder)}{note}", soft_wrap=True, markup=False)
