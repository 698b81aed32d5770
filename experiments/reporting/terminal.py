"""What a run shows on the terminal at its end, and terminals that lack a character of it."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from experiments.protocol import evaluate
from experiments.records import sources
from experiments.records.record import Finished

_NAMED = 12  # classes up to which the confusion matrix is shown


def in_any_encoding() -> None:
    """Show characters that the encoding of standard output lacks as escapes, not as an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def summarise(console: Console, record: Finished, folder: Path, repeated: bool = False) -> None:
    """A few lines: accuracy with its interval, confusion, times, where the record lies."""
    scene = record.scene
    low, high = evaluate.wilson(int(record.right.sum()), record.n_test)
    # Names go out as Text: no markup and no emoji codes are read in them.
    lines = [
        Text.assemble(
            (record.choices.model, "bold"),
            " on ",
            (scene.name, "bold"),
            f" ({scene.origin}), {record.n_train} training and {record.n_test} test samples",
        ),
        Text(
            f"  test accuracy {record.test_accuracy_final:.1%} "
            f"(95 % interval {low:.1%} to {high:.1%})"
        ),
        Text(
            f"  training {record.training_s:.4g} s ({record.stop}), prediction "
            f"{record.predict_single_s * 1e3:.3g} ms a single frame, "
            f"{record.predict_batch_s_per_frame * 1e3:.3g} ms a frame in a batch"
        ),
    ]
    if skipped := scene.skipped:
        frames = "1 frame" if len(skipped) == 1 else f"{len(skipped)} frames"
        lines.append(
            Text(f"  {frames} skipped, listed in the record; the first: {skipped[0]}", "yellow")
        )
    for line in lines:
        console.print(line, soft_wrap=True)
    if len(scene.classes) <= _NAMED:
        _print_confusion(console, record)
    note = " (finished before; force=true runs it again)" if repeated else ""
    if changed := sources.outdated(record.environment.sources):
        note += f" (made by other code than this: {', '.join(changed)})"
    console.print(f"  record {os.path.relpath(folder)}{note}", soft_wrap=True, markup=False)


def _print_confusion(console: Console, record: Finished) -> None:
    classes = record.scene.classes
    counts = evaluate.confusion(
        np.array(record.predicted), np.array(record.test_labels), len(classes)
    )
    table = Table(title="confusion (rows: true class)", title_justify="left")
    table.add_column("", no_wrap=True)
    for name in classes:
        table.add_column(Text(name), justify="right", overflow="fold")
    for name, row in zip(classes, counts, strict=True):
        table.add_row(Text(name), *(str(n) if n else "·" for n in row))
    if not console.is_terminal:
        # A file or a pipe has no width to keep to: names must not be cut until two look alike.
        console = Console(file=console.file, width=10_000)
    console.print(table)
