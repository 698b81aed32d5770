"""``hdc compare``: which encoder and read-out suit a recording, beside models of grey values."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from hdc.command import messages, options, splits
from hdc.command.compare import candidates, judge
from hdc.command.messages import with_units
from hdc.command.source import Source, pixels, recording, truth_of
from hdc.readers import Recording, Window

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
    warnings.filterwarnings("ignore", module="sklearn")  # of baselines, in each fold
    frames = last = source.open(window)
    if other is not None:
        last = source.like(other).open(window)
        _check_alike(frames, last)
    folds, units = splits.folds(frames)
    messages.say(*_about(frames, len(folds), units))
    recordings, tests = [frames], {"in folds": folds}
    if other is not None:
        messages.say(f"tested on {other}: {len(last)} frames")
        recordings, units = [frames, last], splits.units(last)
        new = np.arange(len(last)) + len(frames)
        tests[f"on {other}"] = [(np.arange(len(frames)), new)]
    models = candidates.cheapest_first(frames.values is not None)
    values = with_units(frames.value_names, frames.value_units)
    losses = _losses(models, recordings, tests, values)
    published, *_ = models
    if published not in losses:
        raise ValueError(f"{source.path}: expected {published} to learn the frames")
    forms = [name for name in losses if hasattr(models[name], "encoder")]
    means = {name: [loss.mean() for loss in own] for name, own in losses.items()}
    chosen = min(forms, key=lambda name: means[name][0])
    form = models[chosen]
    messages.say(
        *_best_lines(chosen, {name: own[-1] for name, own in means.items()}),
        f"Use: hdc train with --encoder {form.encoder} --readout {form.readout}",
        _gain_line(chosen, forms, losses, units, bool(values)),
    )
    if not values and means[chosen][-1] - means[chosen][0] > messages.FALL:
        messages.say(messages.DIFFERS)


def _losses(
    models: Mapping[str, Any],
    recordings: Sequence[Recording],
    tests: Mapping[str, Sequence[splits.Split]],
    values: Sequence[str],
) -> judge.Losses:
    """The losses of the models, whose rows are said; not of those that refuse the frames, or that
    come after an interruption."""
    losses: judge.Losses = {}
    frames = np.concatenate([one[:].reshape(len(one), -1) for one in recordings])
    truth = np.concatenate([truth_of(one) for one in recordings])
    scale = judge.scale(truth[: len(recordings[0])])
    try:
        for name, model in models.items():
            try:
                found = {
                    test: judge.tested(model, frames, truth, rows)
                    for test, rows in tests.items()
                }
            except ValueError as why:
                messages.say(f"left out: {name}: {why}")
                continue
            row = _row(name, model, found, values)
            if not losses:
                messages.say("  ".join(row))
            cells = (f"{cell:>{len(head)}}" for head, cell in row.items())
            messages.say("  ".join(cells))
            losses[name] = [(own.errors / scale).mean(axis=1) for own in found.values()]
    except KeyboardInterrupt:
        messages.say("interrupted: the rows above are whole")
    return losses


def _row(
    name: str, model: Any, found: Mapping[str, judge.Tested], values: Sequence[str]
) -> dict[str, str]:
    """The cells of a model by their heads: its name; the accuracy, or the mean error of each value,
    in each test; the times to learn and to answer; whether it can be exported."""
    from hdc.export.plan import exports  # late: it imports torch

    row = {f"{'model':<{_NAME}}": name.ljust(_NAME)}
    for k, value in enumerate(values or ["accuracy"]):
        for test, own in found.items():
            mean = own.errors[:, k].mean()
            shown = f"{mean:.4g}" if values else messages.percent(1 - mean)
            row[f"{value} {test}"] = shown
    first, *_ = found.values()
    return row | {
        "s to learn": f"{first.learn_s:.3g}",
        "ms a frame": f"{first.frame_ms:.3g}",
        "exports": "yes" if exports(model) else "no",
    }


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


def _about(frames: Recording, n_folds: int, units: splits.Units) -> list[str]:
    """The recording, and how models are chosen on it."""
    by = "at random" if units.kind == "frame" else f"by {units.kind}"
    why = f", for {units.why}" if units.why else ""
    return [
        f"{len(frames)} frames, {messages.whole(frames)}",
        *messages.reading_lines(frames),
        f"chosen by {n_folds} folds {by}{why}",
    ]


def _best_lines(chosen: str, means: Mapping[str, float]) -> list[str]:
    """The models of the least mean loss, where they are not the chosen one alone."""
    best = [name for name, loss in means.items() if loss == min(means.values())]
    said = f"Best of the table: {', '.join(best)}. Cross-validation chose {chosen}."
    return [] if best == [chosen] else [said]


def _gain_line(
    chosen: str,
    forms: Sequence[str],
    losses: judge.Losses,
    units: splits.Units,
    is_of_values: bool,
) -> str:
    """The gain of the choice over the first form in the last test, and whether it is clear: over
    recordings that are known, for frames of one are alike."""
    published = forms[0]
    if chosen == published:
        return f"No other form was better than {published} in the folds."
    if len(losses[chosen]) > 1:  # no choice has seen another recording
        forms = [published, chosen]
    last = {name: losses[name][-1] for name in forms}
    gain = 100 * (last[published].mean() - last[chosen].mean())
    won = f"{gain:+.1f} points of accuracy"
    if is_of_values:
        won = f"{-gain:+.1f} % of the constant baseline's error"
    p = judge.p_value(chosen, published, last, units.of)
    said = f"{'a' if p < CLEAR else 'no'} clear gain (p = {p:.2g} of {units.kind}s)"
    if units.kind == "frame":
        said = f"p = {p:.2g} of single frames; a gain is clear only over sessions or groups"
    return f"{chosen} over {published}: {won}, {said}."
