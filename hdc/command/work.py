"""What the commands share: recordings, models, and which frames are held out."""

from __future__ import annotations

import math
import re
import shlex
import warnings
from collections import Counter
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import click
import numpy as np

import hdc
from hdc import circular, io, readers
from hdc.command.options import TRUSTED
from hdc.readers import BadFrame, Recording, Window, natural_key
from hdc.readers.images import stream_files
from hdc.readers.listing import MANIFEST, image_files
from hdc.readers.recording import with_progress

KINDS = ("HDCClassifier", "HDCRegressor")
"""Models that the commands know."""
_SKIPS = ("skip_damaged", "skip_missing")
TURN = 360
"""Degrees; values that span this share of them look like angles of a whole turn."""
_WHOLE = 0.9
_DEGREES = re.compile(r"deg|angle|°|theta|yaw|rotation|azimuth|orientation")
LISTED = 12
"""Names of classes or sessions that one line shows."""


def open_frames(
    recording: Path, window: Window, fewest_classes: int = 2, **source: Any
) -> Recording:
    """Open a recording as the options of the command line say; images are decoded when needed."""
    frames = readers.open_recording(
        recording, window=window, check=False, fewest_classes=fewest_classes, **source
    )
    if line := frames.left_out():
        warnings.warn(line, stacklevel=2)
    return frames


def load(path: Path) -> tuple[Any, Window]:
    """A saved classifier or regressor, and which pixels of an image it looks at.

    Raises:
        ValueError: the file is no such model.
    """
    try:
        header, _ = io.read_model(path, tensors=False)
    except ValueError as error:
        raise ValueError(f"{path}: expected a saved model, found {error}") from error
    kind = header.get("kind")
    if kind not in KINDS:
        raise ValueError(
            f"{path}: expected a saved {' or '.join(KINDS)}, found {kind!r}"
        )
    context = click.get_current_context(silent=True)
    trusted = context.meta.get(TRUSTED, ()) if context else ()
    model = getattr(hdc, kind).load(path, trusted)
    crop, subsample = (model.metadata_.get(key) for key in ("crop", "subsample"))
    return model, Window(crop, subsample or 1)


def frames_for(
    model: Any, window: Window, recording: Path, source: dict[str, Any]
) -> Recording:
    """A recording of classes that the model knows (one of them, or more), or of its values."""
    names = value_names(model)
    has_columns = source["table"] or recording.suffix.lower() in (".npz", ".csv")
    if names and has_columns and not source["value_columns"]:
        source = source | {"value_columns": names}
    frames = open_frames(recording, window, 1, **source)
    check_fits(model, frames)
    if not hasattr(model, "classes_"):
        return frames
    known = [str(c) for c in model.classes_]
    unknown = sorted(set(frames.names) - set(known), key=natural_key)
    if unknown:
        raise ValueError(
            f"{recording}: expected classes among {', '.join(known)}, found "
            f"{unknown[0]!r} (to add a class: hdc train on all of them, or partial_fit in Python)"
        )
    return frames


def unlabelled_frames(
    model: Any, window: Window, recording: Path, source: dict[str, Any]
) -> np.ndarray | None:
    """Frames [N, H, W] or [N, D] of a recording without labels; None where it has labels.

    Such are the images of a folder without sub-folders of images, a table or a template, and an
    array or a table of frames alone.
    """
    if any(source.get(name) for name in ("table", "template", "labels")):
        return None
    if recording.is_dir():
        if (recording / MANIFEST).exists():
            return None
        files = image_files(recording)
        if any(file.parent != recording for file in files):
            return None
        placed = zip(files, stream_files(files, window), strict=True)
        stream: Any = (_checked(model, place, frame) for place, frame in placed)
        total = len(files)
    elif readers.split_name(recording)[0].suffix.lower() in readers.FRAMES:
        found = readers.open_recording(
            recording, window=window, axes=source.get("axes"), fewest_classes=0
        )
        if found.labels is not None:
            return None
        check_fits(model, found)
        stream, total = found.stream(), len(found)
    else:
        return None
    return np.stack(list(with_progress(stream, total, "Reading")))


def _checked(model: Any, place: Path, frame: np.ndarray) -> np.ndarray:
    check_size(model, frame.shape, place)
    return frame


def value_names(model: Any) -> tuple[str, ...]:
    """Names of the numbers that a regressor was trained on; none of a classifier."""
    if hasattr(model, "classes_"):
        return ()
    return tuple(model.metadata_.get("values", ()))


def with_units(names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Names of values, with the unit in brackets where there is one."""
    if not any(units):
        return list(names)
    pairs = zip(names, units, strict=True)
    return [f"{name} [{unit}]" if unit else name for name, unit in pairs]


def check_fits(model: Any, recording: Recording) -> None:
    """Raise a BadFrame for other columns, or another size, than those in training."""
    trained = getattr(model, "feature_names_in_", ())
    found = recording.features
    place = recording.place(0)
    if len(trained) and found and tuple(trained) != found:
        pairs = zip_longest(trained, found, fillvalue="none")
        wanted, other = next((a, b) for a, b in pairs if a != b)
        raise BadFrame(
            f"{place}: expected the columns of training in its order, found {other} for {wanted}"
        )
    check_size(model, recording.frame_shape, place)


def check_size(model: Any, shape: tuple[int, ...], place: object) -> None:
    """Raise a BadFrame for a frame of another size than those in training; flat ones have none."""
    expected = model.frame_shape_
    if shape == expected or (len(expected) == 1 and math.prod(shape) == expected[0]):
        return
    raise BadFrame(
        f"{place}: expected {size(expected)} as in training, found {size(shape)}"
    )


def size(shape: Sequence[int]) -> str:
    """The size of a frame in words, width first."""
    return f"{' × '.join(str(side) for side in reversed(shape))} pixels"


def described(model: Any, path: Path) -> dict[str, Any]:
    """What a saved model is, for people; the last rows say what was trained."""
    classifies = hasattr(model, "classes_")
    n_outputs = len(model.classes_) if classifies else len(value_names(model)) or 1
    if classifies:
        tensors = model.state_tensors().values()
        n_bits = 8 * sum(tensor.nbytes for tensor in tensors)
    else:  # its training frames are kept, and all of the file is needed
        n_bits = 8 * path.stat().st_size
    unit = "class" if classifies else "value"
    rows: dict[str, Any] = {
        "kind": type(model).__name__,
        "encoder": repr(model.encoder_),
        "encoder in words": _in_words(model.encoder_),
        "readout": repr(model.readout_),
        "readout in words": _in_words(model.readout_),
        "frames": size(model.frame_shape_),
        f"bits a pixel and {unit}": round(n_bits / model.n_features_in_ / n_outputs, 2),
        **model.metadata_,
    }
    if classifies:
        counts = zip(model.classes_, model.counts_, strict=True)
        rows["classes"] = {str(c): int(n) for c, n in counts}
    return rows


def _in_words(part: object) -> str:
    """The first paragraph of what a part of a model says of itself."""
    text = type(part).__doc__ or ""
    return " ".join(text.strip().partition("\n\n")[0].split())


def command_line(
    recording: Path,
    window: Window,
    source: dict[str, Any],
    encoder: str,
    readout: str,
    period: float | None = None,
) -> str:
    """What to type to train such a model of a recording that was opened so."""
    words = ["hdc", "train", *recording_words(recording, window, source)]
    if period is not None:
        words += ["--circular", f"{period:.12g}"]
    words += ["--encoder", encoder, "--readout", readout, "-o", "model.safetensors"]
    return shlex.join(words)


def recording_words(
    recording: Path, window: Window, source: dict[str, Any]
) -> list[str]:
    """What to type to open a recording so: its path, and options."""
    words = [str(recording)]
    if source["template"]:
        words += ["--template", source["template"]]
    if source["table"]:
        words += ["--values", str(source["table"])]
    for column in source["value_columns"]:
        words += ["--column", column]
    if source["image_column"] != "image":
        words += ["--image-column", source["image_column"]]
    if source["labels"]:
        words += ["--labels", source["labels"]]
    if source["axes"]:
        words += ["--axes", ",".join(source["axes"])]
    words += [f"--{name.replace('_', '-')}" for name in _SKIPS if source[name]]
    if window.crop is not None:
        words += ["--crop", *map(str, window.crop)]
    if window.subsample != 1:
        words += ["--subsample", str(window.subsample)]
    return words


# What was read -----------------------------------------------------------------------------------


def class_line(recording: Recording, index: np.ndarray) -> str:
    """The classes of some frames, and how many each has."""
    names = np.array(recording.names)[index].tolist()
    return f"classes: {_counted(names, recording.classes)}"


def guess_line(
    recording: Recording,
    training: np.ndarray,
    test: np.ndarray,
    period: float | None = None,
) -> str:
    """What is right of the test frames without looking: the largest class, or the mean."""
    labels = learnt_labels(recording)
    if labels is not None:
        largest = np.bincount(labels[training]).argmax()
        share = (labels[test] == largest).mean()
        name = printable(recording.classes[largest])
        return f"a guess of {name}, the largest class: accuracy {share:.1%}"
    values = recording.values
    assert values is not None
    mean = values[training].mean(axis=0)
    if period is not None:
        plane = circular.to_plane(values[training], period).mean(axis=0)[None]
        mean = circular.from_plane(plane, period, True)[0]
    errors = circular.errors(values[test], mean, period).mean(axis=0).tolist()
    units = recording.value_units or ("",) * len(errors)
    parts = []
    for name, unit, error in zip(recording.value_names, units, errors, strict=True):
        parts.append(f"{printable(name)} {error:.4g} {unit}".rstrip())
    return f"a guess of the mean: mean absolute error {', '.join(parts)}"


def check_circular(recording: Recording, period: float | None) -> None:
    """Raise a ValueError for a period of no values."""
    if period is not None and recording.values is None:
        raise ValueError("--circular: expected a table of numbers, found classes")


def circular_lines(recording: Recording) -> list[str]:
    """A line on each value that looks like degrees of a whole turn."""
    lines = []
    units = recording.value_units or ("",) * len(recording.value_names)
    for column, name in enumerate(recording.value_names):
        assert recording.values is not None
        low, high = np.quantile(recording.values[:, column], [0, 1]).tolist()
        named = _DEGREES.search(f"{name} {units[column]}".lower())
        turns = low >= -TURN / 2 and high <= TURN and high - low >= _WHOLE * TURN
        if named and turns:
            lines.append(
                f"{printable(name)}: {low:.4g} to {high:.4g} looks like angles of a whole turn; "
                "--circular 360 predicts them by sine and cosine"
            )
    return lines


def learnt(recording: Recording) -> str:
    """What a model learns of a recording, in words."""
    if recording.values is None:
        return f"{len(recording.classes)} classes"
    names = with_units(recording.value_names, recording.value_units)
    return f"values of {', '.join(names)}"


def reading_line(recording: Recording) -> list[str]:
    """How the file was read, where it could be read otherwise; or nothing."""
    return [f"read: {'; '.join(recording.notes)}"] if recording.notes else []


def session_line(recording: Recording) -> str:
    """The sessions of a recording, and how many frames each has."""
    if recording.session is None:
        return "sessions: none known"
    names = recording.samples.get("session_name", recording.session)
    texts = [str(name) for name in names.tolist()]
    return f"sessions: {_counted(texts, sorted(set(texts), key=natural_key))}"


def _counted(names: Sequence[str], different: Sequence[str]) -> str:
    counts = Counter(names)
    shown = [f"{printable(name)} ({counts[name]})" for name in different[:LISTED]]
    if len(different) > LISTED:
        shown.append(f"… {len(different)} in all")
    return ", ".join(shown)


def printable(text: str) -> str:
    """A name on one line of a table: tabs, line feeds and the like are written as escapes."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


UNSEEN_GROUPS = "in groups that training has not seen"

# Splits ------------------------------------------------------------------------------------------


def hold_out(
    recording: Recording, fraction: float | None
) -> tuple[np.ndarray, np.ndarray, str]:
    """Indices to train on and to hold out, increasing, and how these were chosen.

    The last sessions where there are several, else whole groups where they are known, else the
    same share of each class at random, or of all where numbers are learnt.

    Raises:
        ValueError: no group can be held out.
    """
    every = np.arange(len(recording))
    if fraction is None:
        return every, every[:0], ""
    last = last_sessions(recording, fraction)
    if last is not None:
        return every[~last], every[last], "in the last sessions"
    labels = learnt_labels(recording)
    if labels is None:
        labels = np.zeros(len(recording), int)
    if recording.group is not None:
        return *split_groups(labels, recording.group, fraction, 0), UNSEEN_GROUPS
    return *split(labels, fraction, 0), "at random"


def learnt_labels(recording: Recording) -> np.ndarray | None:
    """Labels [N] that a model learns; None where it learns numbers, labels or not."""
    return recording.labels if recording.values is None else None


def why_random(recording: Recording) -> str:
    """Why no session was held out."""
    if recording.session is None:
        return (
            "no sessions are known ({session} in a template, or a column session, tells them), and "
            "frames beside those trained on may be nearly the same"
        )
    if len(np.unique(recording.session)) < 2:
        return "all frames are of one session"
    return "the last sessions have a class that the others have not"


def last_sessions(recording: Recording, fraction: float) -> np.ndarray | None:
    """Mask [N] of the last sessions; None unless there are several, the first of every class, and
    no group is in both."""
    if recording.session is None:
        return None
    known = np.unique(recording.session)
    if len(known) < 2:
        return None
    count = min(max(1, round(fraction * len(known))), len(known) - 1)
    last = np.isin(recording.session, known[-count:])
    labels = learnt_labels(recording)
    if labels is not None and set(labels) - set(labels[~last]):
        return None
    group = recording.group
    if group is not None and set(group[last].tolist()) & set(group[~last].tolist()):
        return None
    return last


def split_groups(
    labels: np.ndarray, group: np.ndarray, fraction: float, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Indices to train on and to hold out, increasing; whole groups [N] are held out, at random,
    until they are a `fraction` of the frames. Every class keeps a group to train on.

    Raises:
        ValueError: each group is the only one of some class.
    """
    held = np.zeros(len(labels), bool)
    known = np.unique(group)
    for name in np.random.default_rng(seed).permutation(known):
        members = group == name
        trained = labels[~(held | members)]
        if held.sum() < fraction * len(labels) and set(labels) == set(trained):
            held |= members
    if not held.any():
        raise ValueError(
            f"group: expected two groups or more of each class, found {len(known)} groups, each "
            "the only one of some class"
        )
    return np.flatnonzero(~held), np.flatnonzero(held)


def split(
    labels: np.ndarray, fraction: float, seed: int, order: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Indices to train on and to hold out, increasing; of each class the same share, at random.

    With the `order` [N] of the frames, the last of each class are held out.

    Raises:
        ValueError: for a class of one frame.
    """
    rng = np.random.default_rng(seed)
    test = []
    for c in np.unique(labels):
        members = np.flatnonzero(labels == c)
        if len(members) < 2:
            raise ValueError(
                "--test-fraction: expected two frames or more of each class, found one"
            )
        held = min(max(1, round(len(members) * fraction)), len(members) - 1)
        if order is None:
            test.append(rng.permutation(members)[:held])
        else:
            in_time = members[np.argsort(order[members], kind="stable")]
            test.append(in_time[-held:])
    chosen = np.sort(np.concatenate(test))
    return np.setdiff1d(np.arange(len(labels)), chosen), chosen
