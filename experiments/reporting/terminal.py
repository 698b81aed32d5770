"""The summary of a run on the terminal, and terminals that lack a character of it."""

from __future__ import annotations

import io
import sys

from rich.console import Console
from rich.text import Text

from experiments.records.record import Finished
from experiments.records.sources import outdated
from hdc.accuracy import wilson


def in_any_encoding() -> None:
    """Show characters that the encoding of standard output lacks as escapes, not as an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def summarise(console: Console, record: Finished, repeated: bool = False) -> None:
    """A few lines: accuracy with its interval, times; one line for a run finished before."""
    scene = record.scene
    low, high = wilson(int(record.right.sum()), record.n_test)
    accuracy = f"test accuracy {record.test_accuracy_final:.1%} [{low:.1%}, {high:.1%}]"
    # Names go out as Text: no markup and no emoji codes are read in them.
    if repeated:
        changed = outdated(record.environment.sources)
        note = f", by code that has changed since: {', '.join(changed)}" if changed else ""
        text = f"{record.id}: {accuracy}, finished before (force=true runs it again){note}"
        console.print(Text(text), soft_wrap=True)
        return
    lines = [
        Text.assemble(
            (record.choices.model, "bold"),
            " on ",
            (scene.name, "bold"),
            f" ({scene.origin}), {record.n_train} training and {record.n_test} test samples",
        ),
        Text(f"  {accuracy} (95 % interval)"),
        Text(
            f"  training {record.training_s:.4g} s ({record.stop}), prediction "
            f"{record.predict_single_s * 1e3:.3g} ms a single frame, "
            f"{record.predict_batch_s_per_frame * 1e3:.3g} ms a frame in a batch"
        ),
    ]
    if scene.saturated:
        lines.append(Text(f"  ranks no models: {scene.saturated}", "yellow"))
    if skipped := scene.skipped:
        lines.append(Text(f"  {len(skipped)} files skipped, the first: {skipped[0]}", "yellow"))
    for line in lines:
        console.print(line, soft_wrap=True)
    console.print(Text(f"  record {record.id}"), soft_wrap=True)
