"""``hdc compare``: which encoder and read-out suit a recording, beside models of grey values."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from hdc.command import messages, options
from hdc.command.messages import with_units
from hdc.command.source import Source, check_circular, pixels, recording
from hdc.readers import Recording, Window

if TYPE_CHECKING:
    from hdc.command.compare.candidates import Candidate
    from hdc.command.compare.judge import Row, Test
    from hdc.command.splits import Units

FOLDS = "folds"
"""Name of the test that chooses."""
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
@click.option(
    "--encoder",
    "encoders",
    multiple=True,
    metavar="NAME",
    help="Choose among this encoder, or a module.Class; may be repeated. [default: a short list]",
)
@click.option(
    "--readout",
    "readouts",
    multiple=True,
    metavar="NAME",
    help="Choose among this read-out, or a module.Class; may be repeated. [default: a short list]",
)
@options.circular
@pixels
@options.json
@options.left(
    "--budget", "rows come cheapest first, and Ctrl-C keeps those that are done"
)
@options.left("--all", "--encoder and --readout name other forms")
@options.left("--draws", "there is no learning curve")
@options.left("--output", "there is no figure", "-o")
@options.left("--test-fraction", "each frame is tested once, or --test names others")
def compare(
    source: Source,
    window: Window,
    other: Path | None,
    encoders: tuple[str, ...],
    readouts: tuple[str, ...],
    period: float | None,
    as_json: bool,
) -> None:
    """Find the encoder and read-out for a RECORDING, and compare with models of grey values.

    Cross-validation chooses: whole sessions are left out where there are several, else whole
    groups, else frames at random. A row is printed when it is done, the cheapest first; Ctrl-C
    keeps those that are there. The last lines have the line to type, and whether its gain over the
    published form is clear, by sign flips of whole sessions or groups. Frames are held in memory.
    """
    from hdc.command.compare import candidates, judge

    frames = source.open(window)
    check_circular(frames, period)
    learns_values = frames.values is not None
    listed = candidates.cheapest_first(encoders, readouts, learns_values, period)
    later = None if other is None else source.like(other).open(window)
    if later is not None:
        _check_alike(frames, later)
    data, of_each = judge.prepared(frames, np.arange(len(frames)), later, period)
    second = f"./{other}" if str(other) == FOLDS else str(other)
    tests = dict(zip((FOLDS, second), of_each, strict=False))
    say = _nothing if as_json else messages.say
    heads = _heads(frames, tests)
    say(*_about(frames, tests, period), "  ".join(heads))
    tried: dict[Candidate, list[Row]] = {}
    left_out: dict[str, str] = {}
    try:
        for candidate, found in judge.compared(listed, data, of_each):
            if isinstance(found, str):
                left_out[candidate.name] = found
            else:
                tried[candidate] = found
                say(_line(candidate.name, _numbers(candidate, found, frames), heads))
    except KeyboardInterrupt:
        say("interrupted: the rows above are whole")
    if listed[0] not in tried:
        why = left_out.get(listed[0].name, "it was interrupted")
        raise ValueError(f"{source.path}: expected {listed[0].name} to learn, {why}")
    chosen = judge.best({form: rows[0] for form, rows in tried.items()})
    result = {
        "recording": str(source.path),
        **_content(frames),
        "tests": {name: len(test.rows) for name, test in tests.items()},
        "models": {c.name: _numbers(c, rows, frames) for c, rows in tried.items()},
        "left_out": left_out,
        **_gain(chosen, listed[0], tried, of_each[-1].units),
        "best": _best(tried),
        "command": source.training_line(window, *_words(chosen, period)),
    }
    if as_json:
        click.echo(json.dumps(result))
    else:
        say(*_sentences(result))


def _nothing(*_: str) -> None:
    """Say nothing: JSON alone is printed."""


def _words(form: Candidate, period: float | None) -> list[str]:
    """The options of a form on the command line."""
    around = [] if period is None else ["--circular", f"{period:.12g}"]
    return [*around, "--encoder", form.model.encoder, "--readout", form.model.readout]


def _check_alike(recording: Recording, other: Recording) -> None:
    """Raise a ValueError for frames, values or classes that the first recording has not."""
    for what, first, second in (
        ("frames", _frame(recording), _frame(other)),
        ("values", _listed(recording.value_names), _listed(other.value_names)),
    ):
        if first != second:
            raise ValueError(
                f"--test: expected {what} {first} as in the first recording, found {second}"
            )
    if unknown := sorted(set(other.classes) - set(recording.classes)):
        listed = _listed(recording.classes)
        raise ValueError(f"--test: expected classes among {listed}, found {unknown[0]}")


def _frame(recording: Recording) -> str:
    return f"{recording.frame_shape} {recording.dtype}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"


# Numbers -----------------------------------------------------------------------------------------


def _content(frames: Recording) -> dict[str, Any]:
    """The content of a recording, as JSON."""
    kinds = {"classes": frames.classes}
    if frames.values is not None:
        kinds = {"values": frames.value_names}
    listed = {"shape": frames.frame_shape, "notes": frames.notes, **kinds}
    return {"frames": len(frames), **{name: [*part] for name, part in listed.items()}}


def _numbers(
    candidate: Candidate, rows: Sequence[Row], frames: Recording
) -> dict[str, Any]:
    """The accuracy of each test, or the mean absolute error of each value; times; whether it
    exports."""
    found: dict[str, Any] = {
        "train_s": rows[-1].train_s,
        "predict_ms": rows[-1].frame_ms,
        "exports": candidate.exports,
    }
    if frames.values is None:
        return found | {"accuracy": [1 - float(row.losses.mean()) for row in rows]}
    errors = np.stack([row.errors.mean(axis=0) for row in rows], axis=1).tolist()
    return found | {"errors": dict(zip(frames.value_names, errors, strict=True))}


def _gain(
    chosen: Candidate,
    published: Candidate,
    tried: Mapping[Candidate, Sequence[Row]],
    units: Units,
) -> dict[str, Any]:
    """Names of the chosen and the published form, and what the one wins in the last test."""
    from hdc.command.compare import judge

    found = {"published": published.name, "chosen": chosen.name}
    if chosen == published:
        return found
    losses = {
        form.name: rows[-1].losses for form, rows in tried.items() if form.is_form
    }
    if len(tried[chosen]) > 1:  # no choice has seen the other recording
        losses = {name: losses[name] for name in found.values()}
    gain = losses[published.name].mean() - losses[chosen.name].mean()
    p = judge.p_value(chosen.name, published.name, losses, units.of)
    return {**found, "gain": float(gain), "p_value": p, "of": f"{units.kind}s"}


def _best(tried: Mapping[Candidate, Sequence[Row]]) -> list[str]:
    """Names of the models with the least loss in the last test; of the grey values, too."""
    losses = {model.name: rows[-1].losses.mean() for model, rows in tried.items()}
    return [name for name, loss in losses.items() if loss == min(losses.values())]


# Words -------------------------------------------------------------------------------------------


def _about(
    frames: Recording, tests: Mapping[str, Test], period: float | None
) -> list[str]:
    """The recording, and how models are tested on it."""
    (_, folds), *others = tests.items()
    reason = folds.units.reason(frames)
    why = f", for {reason}" if reason else ""
    return [
        f"{len(frames)} frames, {messages.whole(frames)}",
        *messages.reading_lines(frames),
        *messages.circular_lines(frames, period),
        f"chosen by {folds.how}{why}",
        *(
            f"tested on {messages.printable(name)}: {len(test.rows)} frames"
            for name, test in others
        ),
    ]


def _heads(frames: Recording, tests: Iterable[str]) -> list[str]:
    """Names of the columns, that of the models as wide as the longest."""
    names = with_units(frames.value_names, frames.value_units) or ["accuracy"]
    heads = [
        f"{messages.printable(name)} in folds" if test == FOLDS else f"on {test}"
        for name in names
        for test in tests
    ]
    return [f"{'model':<{_NAME}}", *heads, "s to learn", "ms a frame", "exports"]


def _line(name: str, numbers: Mapping[str, Any], heads: Sequence[str]) -> str:
    """A row, its cells as wide as the heads."""
    cells = [messages.percent(share) for share in numbers.get("accuracy", ())]
    for errors in numbers.get("errors", {}).values():
        cells += [f"{error:.4g}" for error in errors]
    cells += [f"{numbers['train_s']:.3g}", f"{numbers['predict_ms']:.2g}"]
    cells.append("yes" if numbers["exports"] else "no")
    pairs = zip(cells, heads[1:], strict=True)
    named = f"{messages.printable(name):<{_NAME}}"
    return "  ".join([named, *(f"{cell:>{len(head)}}" for cell, head in pairs)])


def _sentences(result: Mapping[str, Any]) -> list[str]:
    """Models that were left out, the line to type, and the gain of the choice."""
    lines = [f"left out: {name}: {why}" for name, why in result["left_out"].items()]
    chosen, published = result["chosen"], result["published"]
    if result["best"] != [chosen]:
        names = ", ".join(result["best"])
        lines.append(f"Best of the table: {names}. Cross-validation chose {chosen}.")
    lines.append(f"Use: {result['command']}")
    if chosen == published:
        lines.append(f"No other form was better than {published} in the folds.")
    else:
        won = f"{100 * result['gain']:+.1f} points of accuracy"
        if "values" in result:
            size, word = abs(result["gain"]), "less" if result["gain"] >= 0 else "more"
            won = f"{size:.3g} of the constant baseline's error {word}"
        lines.append(f"{chosen} over {published}: {won}, {_clear(result)}.")
    first, *others = result["models"][chosen].get("accuracy", (0,))
    if others and first - others[-1] > messages.FALL:
        lines.append(messages.DIFFERS)
    return lines


def _clear(result: Mapping[str, Any]) -> str:
    """Whether a gain is clear: over recordings that are known, for frames of one are alike."""
    p = f"p = {result['p_value']:.2g}"
    if result["of"] == "frames":
        return f"{p} of single frames; a gain is clear only over sessions or groups"
    return f"{'a' if result['p_value'] < CLEAR else 'no'} clear gain ({p} of {result['of']})"
