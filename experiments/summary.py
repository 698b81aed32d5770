"""What a run shows on the terminal at its end."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from experiments import schema, sources


def summarise(
    console: Console, entry: dict[str, Any], folder: Path, repeated: bool = False
) -> None:
    """A few lines on the terminal: accuracy with its interval, confusion, times, where it lies.

    Raises:
        ValueError: the record is one that was read (repeated) and does not hold what it should.
    """
    if repeated:
        try:
            schema.check_run(entry, summary=True)
        except ValueError as error:
            path = folder / "record.json"
            raise ValueError(f"{path}: {error} (force=true runs it again)") from error
    scene = entry["scene"]
    # Names go out as Text: no markup and no emoji codes are read in them.
    console.print(
        Text.assemble(
            (entry["choices"]["model"], "bold"), " on ", (scene["name"], "bold"),
            f" ({scene['origin']}), {entry['n_train']} training and {entry['n_test']} test samples",
        ),
        soft_wrap=True,
    )  # fmt: skip
    console.print(
        f"  test accuracy {entry['test_accuracy_final']:.1%} "
        f"(95 % interval {entry['test_ci_low']:.1%} to {entry['test_ci_high']:.1%})",
        soft_wrap=True,
    )
    console.print(
        Text(
            f"  training {entry['training_s']:.4g} s ({entry['stop']}), prediction "
            f"{entry['predict_single_s'] * 1e3:.3g} ms a single frame, "
            f"{entry['predict_batch_s_per_frame'] * 1e3:.3g} ms a frame in a batch"
        ),
        soft_wrap=True,
    )
    if skipped := scene.get("skipped"):
        frames = "1 frame" if len(skipped) == 1 else f"{len(skipped)} frames"
        console.print(
            Text(f"  {frames} skipped, listed in the record; the first: {skipped[0]}", "yellow"),
            soft_wrap=True,
        )
    if len(scene["classes"]) <= 12:
        table = Table(title="confusion (rows: true class)", title_justify="left")
        table.add_column("")
        for name in scene["classes"]:
            table.add_column(Text(name), justify="right")
        for name, row in zip(scene["classes"], np.asarray(entry["confusion"]), strict=True):
            table.add_row(Text(name), *(str(n) if n else "·" for n in row))
        console.print(table)
    note = " (finished before; force=true runs it again)" if repeated else ""
    if changed := sources.outdated(entry["environment"]["sources"]):
        note += f" (made by other code than this: {', '.join(changed)})"
    console.print(f"  record {os.path.relpath(folder)}{note}", soft_wrap=True, markup=False)
