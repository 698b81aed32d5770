"""``hdc compare``: which encoder and read-out suit a recording, beside models of grey values."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from hdc.command import messages, options
from hdc.command.messages import with_units
from hdc.command.source import Source, pixels, recording
from hdc.readers import Recording, Window

if TYPE_CHECKING:
    from hdc.command.compare.judge import Data, Test

Losses = dict[str, list[np.ndarray]]
"""Losses of the models by name, in each test [Q]: 1 for a wrong label and 0 for a right one. A loss
of values is the mean of their errors, each divided by the error of the constant baseline."""
CLEAR = 0.05
"""A gain is clear below this probability that it is chance."""
_NAME = 26
"""Characters of the column of names."""


@click.command(short_help="Choose a model for your images.")
@recording
@click.option(
    "--test",
    "other",
    type=options.FILE,
    metavar="RECORDING",
    help="Test on this recording, of another day.",
)
@pixels
def compare(
    source: Source,
    window: Window,
    other: Path | None,
) -> None:
    """Find the encoder and read-out for a RECORDING, and compare with models of grey values.

    Cross-validation chooses: whole sessions are left out where there are several, else whole
    groups, else frames at random. A row is printed when it is done, the cheapest first; Ctrl-C
    keeps those that are there. The last lines have the options to type, and whether their gain over
    the published form is clear, by sign flips of whole sessions or groups. Frames are held in
    memory.
    """
    from hdc.command.compare import candidates, judge

    warnings.filterwarnings("ignore", module="sklearn")  # of baselines, in each fold
    frames = source.open(window)
    models = candidates.cheapest_first(frames.values is not None)
    later = None if other is None else source.like(other).open(window)
    if later is not None:
        _check_alike(frames, later)
    data, tests = judge.prepared(frames, later)
    heads = _heads(frames, ["in folds", f"on {other}"][: len(tests)])
    messages.say(*_about(frames, tests, other), "  ".join(heads))
    losses = _losses(models, data, tests, heads)
    published, *_ = models
    if published not in losses:
        raise ValueError(f"{source.path}: expected {published} to learn the frames")
    forms = [name for name in losses if candidates.is_form(models[name])]
    chosen = min(forms, key=lambda name: losses[name][0].mean())
    messages.say(
        *_chosen_lines(models[chosen], chosen, losses),
        *_gain_lines(chosen, published, forms, losses, tests[-1].units, frames),
    )


def _losses(
    models: Mapping[str, Any],
    data: Data,
    tests: Sequence[Test],
    heads: Sequence[str],
) -> Losses:
    """The losses of the models, whose rows are said; not of those that refuse the frames, or that
    come after an interruption."""
    from hdc.command.compare import judge

    losses: Losses = {}
    refused: list[str] = []
    try:
        for name, model in models.items():
            try:
                found = [judge.errors(model, data, test) for test in tests]
                times = judge.times(model, data, tests[0])
            except ValueError as why:
                refused.append(f"left out: {name}: {why}")
            else:
                losses[name] = [(each / data.scale).mean(axis=1) for each in found]
                messages.say(_row(name, model, found, times, data.truth, heads))
    except KeyboardInterrupt:
        messages.say("interrupted: the rows above are whole")
    messages.say(*refused)
    return losses


def _check_alike(recording: Recording, other: Recording) -> None:
    """Raise a ValueError for frames, values or classes that the first recording has not."""
    wanted, found = _kind(recording), _kind(other)
    if wanted != found:
        raise ValueError(
            f"--test: expected {wanted} as in the first recording, found {found}"
        )
    if unknown := sorted(set(other.classes) - set(recording.classes)):
        listed = ", ".join(recording.classes)
        raise ValueError(f"--test: expected classes among {listed}, found {unknown[0]}")


def _kind(recording: Recording) -> str:
    values = ", ".join(recording.value_names) or "none"
    return f"frames {recording.frame_shape} {recording.dtype} and values {values}"


# Words -------------------------------------------------------------------------------------------


def _about(frames: Recording, tests: Sequence[Test], other: Path | None) -> list[str]:
    """The recording, and how models are tested on it."""
    folds, *others = tests
    why = f", for {folds.units.why}" if folds.units.why else ""
    return [
        f"{len(frames)} frames, {messages.whole(frames)}",
        *messages.reading_lines(frames),
        f"chosen by {folds.how}{why}",
        *(f"tested on {other}: {len(test.units.of)} frames" for test in others),
    ]


def _heads(frames: Recording, tests: Sequence[str]) -> list[str]:
    """Names of the columns, that of the models as wide as the longest."""
    names = with_units(frames.value_names, frames.value_units) or ["accuracy"]
    columns = [f"{name} {test}" for name in names for test in tests]
    return [f"{'model':<{_NAME}}", *columns, "s to learn", "ms a frame", "exports"]


def _row(
    name: str,
    model: Any,
    found: Sequence[np.ndarray],
    times: tuple[float, float],
    truth: np.ndarray,
    heads: Sequence[str],
) -> str:
    """A row, its cells as wide as the heads: the accuracy, or the mean error of each value, in each
    test; the times to learn and to answer."""
    from hdc.command.compare import candidates

    means = [errors.mean(axis=0) for errors in found]
    if truth.ndim == 1:
        cells = [messages.percent(1 - mean.item()) for mean in means]
    else:
        cells = [f"{mean:.4g}" for mean in np.ravel(means, order="F")]
    cells += [f"{seconds:.3g}" for seconds in times]
    cells.append("yes" if candidates.exports(model) else "no")
    pairs = zip(cells, heads[1:], strict=True)
    columns = [f"{cell:>{len(head)}}" for cell, head in pairs]
    return "  ".join([f"{name:<{_NAME}}", *columns])


def _chosen_lines(form: Any, chosen: str, losses: Losses) -> list[str]:
    """The best models of the last test, and the options of the form that was chosen."""
    last = {name: of_tests[-1].mean() for name, of_tests in losses.items()}
    best = [name for name, loss in last.items() if loss == min(last.values())]
    line = f"Use: hdc train with --encoder {form.encoder} --readout {form.readout}"
    if best == [chosen]:
        return [line]
    said = f"Best of the table: {', '.join(best)}. Cross-validation chose {chosen}."
    return [said, line]


def _gain_lines(
    chosen: str,
    published: str,
    forms: Sequence[str],
    losses: Losses,
    units: Any,
    frames: Recording,
) -> list[str]:
    """The gain of the choice over the published form in the last test, and a line where its
    accuracy is much lower than in the folds."""
    from hdc.command.compare import judge

    first, *others = (1 - loss.mean() for loss in losses[chosen])
    falls = frames.values is None and others and first - others[-1] > messages.FALL
    differs = [messages.DIFFERS] if falls else []
    if chosen == published:
        return [f"No other form was better than {published} in the folds.", *differs]
    # No choice has seen another recording.
    compared = [published, chosen] if others else forms
    last = {name: losses[name][-1] for name in compared}
    gain = last[published].mean() - last[chosen].mean()
    won = f"{100 * gain:+.1f} points of accuracy"
    if frames.values is not None:
        word = "less" if gain >= 0 else "more"
        won = f"{abs(gain):.3g} of the constant baseline's error {word}"
    p = judge.p_value(chosen, published, last, units.of)
    return [f"{chosen} over {published}: {won}, {_clear(p, units.kind)}.", *differs]


def _clear(p: float, kind: str) -> str:
    """Whether a gain is clear: over recordings that are known, for frames of one are alike."""
    if kind == "frame":
        return f"p = {p:.2g} of single frames; a gain is clear only over sessions or groups"
    return f"{'a' if p < CLEAR else 'no'} clear gain (p = {p:.2g} of {kind}s)"
