"""The summary of a run on the terminal, without pandas, which would take longer than a run."""

from __future__ import annotations

from rich.console import Console
from rich.text import Text

from experiments.records.run import Finished
from hdc.accuracy import wilson


def summarise(console: Console, record: Finished, repeated: bool = False) -> None:
    """A few lines: accuracy with its interval, times; one line for a run finished before."""
    scene = record.scene
    low, high = wilson(int(record.right.sum()), record.n_test)
    accuracy = f"test accuracy {record.test_accuracy_final:.1%} [{low:.1%}, {high:.1%}]"
    # Names go out as Text: no markup and no emoji codes are read in them.
    if repeated:
        text = f"{record.id}: {accuracy}, finished before (force=true runs it again)"
        versions = record.environment.other_versions
        if versions:
            text += f", by {', '.join(versions)}"
        console.print(Text(text), soft_wrap=True)
        return
    lines = [
        f"{record.choices.model} on {scene.name} ({scene.origin}), {record.n_train} training and "
        f"{record.n_test} test samples",
        f"  {accuracy} (95 % interval)",
        f"  training {record.training_s:.4g} s ({record.stop}), prediction "
        f"{record.predict_single_s * 1e3:.3g} ms a single frame, "
        f"{record.predict_batch_s_per_frame * 1e3:.3g} ms per frame in a batch",
    ]
    if scene.saturated:
        lines.append(f"  ranks no models: {scene.saturated}")
    console.print(Text("\n".join([*lines, f"  record {record.id}"])), soft_wrap=True)
