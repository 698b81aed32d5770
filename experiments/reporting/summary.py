"""The summary of a run on the terminal, without pandas, which would take longer than a run."""

from __future__ import annotations

from rich.console import Console

from experiments.records.console import say
from experiments.records.record import Record
from experiments.reporting.text import percent
from hdc.accuracy import wilson


def summarise(console: Console, record: Record, repeated: bool) -> None:
    """Print the result of a call: accuracy with its interval and times of a training, or one line
    for another experiment and for a record that was finished before."""
    text = _repeated(record) if repeated else _made(record)
    for line in text.splitlines():
        say(console, line)


def _repeated(record: Record) -> str:
    name = record.experiment
    if record.is_training:
        name = f"{record.id}: {_accuracy(record)}"
    sign = "," if record.is_training else ":"
    return f"{name}{sign} finished before (force=true runs it again)"


def _accuracy(record: Record) -> str:
    results = record.results
    low, high = wilson(results["right"], results["n_test"])
    shares = map(percent, (results["test_accuracy_final"], low, high))
    return "test accuracy {} % [{}, {}]".format(*shares)


def _made(record: Record) -> str:
    if record.scene is None or record.model is None:  # no training
        n, seconds = len(record.rows.values), record.seconds or 0.0
        return f"{record.experiment}: {n} rows in {seconds:.1f} s, {record.id}"
    results = record.results
    lines = [
        f"{record.model.name} on {record.scene.name} ({results['origin']}), "
        f"{results['n_train']} training and {results['n_test']} test samples",
        f"  {_accuracy(record)} (95 % interval)",
        f"  training {results['total_time_s']:.4g} s ({results['stop']}), prediction "
        f"{results['predict_single_s'] * 1e3:.3g} ms a single frame, "
        f"{results['predict_batch_s_per_frame'] * 1e3:.3g} ms per frame in a batch",
        f"  record {record.id}",
    ]
    return "\n".join(lines)
