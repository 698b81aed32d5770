"""``hdc train``: a model of a recording, of named parts or of those that are chosen."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import hdc
from hdc.command import messages, options
from hdc.command.source import Source, check_circular, pixels, recording
from hdc.io import check_replaceable
from hdc.readers import Recording, Window
from hdc.readers.recording import with_progress

if TYPE_CHECKING:
    from hdc.command.splits import Units


@click.command(short_help="Train a model on labelled images.")
@recording
@options.output
@pixels
@click.option(
    "--test-fraction",
    type=options.SHARE,
    help="Share of each class to hold out: its last sessions if known, else whole groups, else "
    "frames at random.",
)
@click.option(
    "--encoder",
    metavar="NAME",
    help="How frames become bits: median, quantile, levels, reference, reference_levels, "
    "deviation, smoothed, or a module.Class. [default: median]",
)
@click.option(
    "--readout",
    metavar="NAME",
    help="How bits are read: majority, counts, ridge, neighbours, lda, trained, kernel, "
    "or a module.Class; for numbers ridge or neighbours. [default: majority; for numbers ridge]",
)
@options.parameters
@options.circular
@click.option(
    "--choose",
    is_flag=True,
    help="Take the encoder and the read-out that are best in cross-validation of the training "
    "frames, by session if there are several. Frames are held in memory.",
)
def train(
    source: Source,
    window: Window,
    output: Path,
    test_fraction: float | None,
    encoder: str | None,
    readout: str | None,
    parameters: dict[str, Any],
    choose: bool,
    period: float | None,
) -> None:
    """Learn the classes of a RECORDING, or its numbers with --values.

    Frames of one class alone make a model that tells what is unlike them: hdc predict --reject.
    """
    if choose and (encoder or readout or parameters):
        raise click.UsageError("expected --choose, or --encoder, --readout and --set")
    frames = source.open(window, fewest_classes=2 if choose else 1)
    check_circular(frames, period)
    check_replaceable(output)
    learnt, held_out = np.arange(len(frames)), None
    if test_fraction is not None:
        from hdc.command import splits

        (learnt, tested), unit = splits.hold_out(frames, test_fraction)
        held_out = tested, unit
    how = []
    if choose:
        encoder, readout, line = chosen(frames, learnt, period)
        how.append(line)
    model = untrained(frames, encoder, readout, period, parameters)
    learn(model, frames, learnt)
    model.save(output, metadata=_metadata(frames, window))
    lines = [f"{output}: {len(learnt)} frames, {messages.whole(frames)}", *how]
    lines += _content_lines(frames, learnt)
    if held_out is not None:
        is_plain = encoder is None and readout is None
        lines += _held_out_lines(model, frames, *held_out, is_plain)
    lines += messages.reading_line(frames)
    lines += messages.circular_lines(frames, period)
    click.echo("\n".join(lines))


def _content_lines(frames: Recording, learnt: np.ndarray) -> list[str]:
    """The classes that are learnt, and the sessions of a recording."""
    lines = []
    if frames.values is None:
        lines.append(messages.class_line(frames, learnt))
        if len(frames.classes) == 1:
            lines.append("one class: hdc predict --reject tells what is unlike it")
    return [*lines, messages.session_line(frames)]


def _held_out_lines(
    model: Any, frames: Recording, tested: np.ndarray, unit: Units, is_plain: bool
) -> list[str]:
    """The score of the frames that were held out, and why they were these.

    Where a plain model was trained, without a choice, also what could be tried.
    """
    from hdc.command import scores, splits

    first, *others = scores.lines(scores.score(model, frames, tested))
    lines = [f"held out {splits.HOW[unit.kind]}: {first}", *others]
    if is_plain:
        lines.append(would_try(frames.values is not None))
    if unit.kind == "frame":
        lines.append(f"held out at random because {unit.why}")
    return lines


def _metadata(frames: Recording, window: Window) -> dict[str, Any]:
    """What is kept with a model of a recording."""
    metadata: dict[str, Any] = {"crop": window.crop, "subsample": window.subsample}
    if window.crop is not None and frames.image_shape:
        metadata["image"] = list(frames.image_shape)
    if frames.values is not None:
        metadata["values"] = list(frames.value_names)
    if any(frames.value_units):
        metadata["units"] = list(frames.value_units)
    metadata["trained"] = datetime.now(UTC).isoformat(timespec="seconds")
    metadata["version"] = hdc.__version__
    return metadata


def untrained(
    recording: Recording,
    encoder: str | None,
    readout: str | None,
    period: float | None,
    parameters: Mapping[str, Any],
) -> Any:
    """A model of the classes or values of a recording; None is a part without a choice.

    Raises:
        ValueError: for a parameter that its parts do not have.
    """
    model: Any
    if recording.values is not None:
        model = hdc.HDCRegressor(encoder or "median", readout or "ridge", period=period)
    else:
        model = hdc.HDCClassifier(encoder or "median", readout or "majority")
    return model.set_params(**parameters)


def learn(model: Any, recording: Recording, rows: np.ndarray) -> None:
    """Train a model on the frames `rows`, which are decoded as it asks for them."""
    from hdc.encoders import make_encoder

    frames: Any = recording.batches(rows)
    if make_encoder(model.encoder).learns:  # it reads all frames twice
        frames = recording.frames(rows)
    if recording.values is not None:
        model.fit(frames, recording.values[rows])
    else:
        model.fit(frames, np.array(recording.names)[rows])
    model._columns = list(recording.features) or None


def chosen(
    recording: Recording, rows: np.ndarray, period: float | None
) -> tuple[str, str, str]:
    """Encoder and read-out that are best in cross-validation of the frames `rows`, and a line."""
    from hdc.command.compare import candidates, judge

    data = judge.Data.within(recording, rows, period)
    forms = candidates.forms((), (), recording.values is not None, period)
    shown = with_progress(forms, len(forms), "Choosing")
    tried = {form: found for form, (found,) in judge.compared(shown, [data], {})}
    best = judge.best(tried)
    mine, published = (float(tried[form].losses.mean()) for form in (best, forms[0]))
    if recording.values is not None:
        found = f"{mine:.3g} of a guess's error, {forms[0].name} {published:.3g}"
    else:
        found = f"accuracy {1 - mine:.1%}, the published form {1 - published:.1%}"
    encoder, readout = best.parts or ("", "")
    return (
        encoder,
        readout,
        f"chosen: {best.name} among {len(tried)} by {data.how} ({found})",
    )


def would_try(learns_values: bool) -> str:
    """A line on the forms that ``--choose`` tries after the one without a choice."""
    from hdc.command.compare import candidates

    first, *others = candidates.forms((), (), learns_values)
    listed = "; ".join(form.name for form in others)
    return f"--choose would try, besides {first.name}: {listed}"
