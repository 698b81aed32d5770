"""Every model on frames that no choice has seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hdc import HDCRegressor
from hdc.accuracy import wilson
from hdc.bits import choose_backend
from hdc.command.compare.advice import paired_accuracies, paired_errors
from hdc.command.compare.choose import progress
from hdc.command.compare.curve import learning_curve
from hdc.command.compare.frames import part, read_frames
from hdc.command.compare.rivals import Rival, rivals
from hdc.readers import Recording
from hdc.selection import (
    Combination,
    Frames,
    Method,
    Scores,
    combinations,
    cross_validate,
    folds,
)

ALPHA = 0.1
"""Share of the values that may lie outside the intervals whose coverage is counted."""


def compare(
    recording: Recording,
    other: Recording | None,
    fraction: float,
    draws: int,
    encoders: Sequence[str] = (),
    readouts: Sequence[str] = (),
) -> dict[str, Any]:
    """Choose encoder and read-out on training frames, and judge the choice on others.

    Args:
        recording: of classes or of values.
        other: frames of another day to test on.
        fraction: share of frames held out.
        draws: random choices of frames at each point of the learning curve.
        encoders, readouts: names to choose among; by default all of the library.

    Returns:
        What ``--json`` writes.
    """
    frames = read_frames(recording, other)
    parts = part(recording, other, fraction)
    learns_values = frames.values is not None
    ours: list[Method] = list(combinations(encoders, readouts, learns_values))
    theirs = rivals(learns_values)
    made, how = folds(frames, parts.chosen_on)
    n_pixels = len(made) * len(ours) * len(frames.bank) * frames.bank.dimension
    frames = replace(frames, backend=choose_backend("auto", "cpu", n_pixels))
    every = [*ours, *theirs]
    with progress("Choosing", len(made) * len(every)) as step:
        scores = cross_validate(every, frames, made, step)
    judged = Judged.of(ours[0], theirs, scores)
    result: dict[str, Any] = {
        "frames": len(recording),
        "shape": list(recording.frame_shape),
        "chosen_by": _how_chosen(len(made), how, len(parts.chosen_on)),
        "published": judged.published.name,
        "chosen": judged.chosen.name,
        "rival": "" if judged.rival is None else judged.rival.name,
        "cross_validation": _shown(scores, frames),
        "given_up": scores.given_up,
        "left_out": scores.reasons,
    }
    tests = list(parts.tests())
    if learns_values:
        units = frames.units or [""] * len(frames.names)
        result["values"] = list(frames.names)
        result["units"] = dict(zip(frames.names, units, strict=True))
        result["tests"] = [_test_of_values(frames, judged, *test) for test in tests]
    else:
        result["classes"] = list(frames.names)
        result["tests"] = [_test_of_classes(frames, judged, *test) for test in tests]
    result["curve"] = learning_curve(
        frames, parts.earlier, parts.later, judged.followed(), draws
    )
    return result


@dataclass(frozen=True)
class Judged:
    """The models that are tested.

    Attributes:
        published: the published form.
        chosen: the combination with the least loss in cross-validation.
        rivals: each rival with the best of its settings.
        rival: the one with the least loss; None where nothing was chosen by.
    """

    published: Method
    chosen: Method
    rivals: list[Rival]
    rival: Method | None

    @classmethod
    def of(cls, published: Method, others: Sequence[Rival], scores: Scores) -> Judged:
        groups: dict[tuple[str, str], list[Rival]] = {}
        for rival in others:
            groups.setdefault((rival.model, rival.pixels), []).append(rival)
        best = [
            min(group, key=lambda rival: _rank(rival, scores))
            for group in groups.values()
        ]
        chosen = scores.best(Combination) or published
        return cls(published, chosen, best, scores.best(Rival))

    def all(self) -> list[Method]:
        """All of them, each once."""
        return list(dict.fromkeys([self.published, self.chosen, *self.rivals]))

    def followed(self) -> list[Method]:
        """Those whose learning is followed."""
        found = [self.published, self.chosen]
        if self.rival is not None:
            found.append(self.rival)
        return list(dict.fromkeys(found))


def _rank(method: Method, scores: Scores) -> tuple[bool, float]:
    """Sorts methods that were tried to the end first, by their losses."""
    return method.name in scores.given_up, scores.losses.get(method, np.inf)


def _how_chosen(count: int, how: str, n: int) -> str:
    """How encoder and read-out were chosen, in words; nothing where there were no folds."""
    if count == 0:
        return ""
    return f"cross-validation on {n} training frames, {count} folds {how}"


def _shown(scores: Scores, frames: Frames) -> dict[str, float]:
    """Accuracy in cross-validation, or the error in units of the values' spread."""
    if frames.values is None:
        return {method.name: 1 - loss for method, loss in scores.losses.items()}
    return {method.name: loss for method, loss in scores.losses.items()}


# Tests -------------------------------------------------------------------------------------------


def _test_of_classes(
    frames: Frames, judged: Judged, name: str, train: np.ndarray, test: np.ndarray
) -> dict[str, Any]:
    """Accuracies on one set of test frames, and what the choice wins there."""
    right: dict[str, np.ndarray] = {}
    with progress(f"Testing {name}", len(judged.all())) as step:
        for method in judged.all():
            answers = method.answers(frames, train, test)
            right[method.name] = answers == frames.labels[test]
            step()
    methods = {}
    for method_name, found in right.items():
        low, high = wilson(int(found.sum()), len(found))
        methods[method_name] = {
            "accuracy": float(found.mean()),
            "low": low,
            "high": high,
        }
    mine = right[judged.chosen.name]
    gain = paired_accuracies(mine, right[judged.published.name]).as_json()
    result = {
        "name": name,
        "learnt": len(train),
        "tested": len(test),
        "methods": methods,
        "gain": gain,
    }
    if judged.rival is not None:
        over = paired_accuracies(right[judged.rival.name], mine)
        result["rival_gain"] = over.as_json()
    return result


def _test_of_values(
    frames: Frames, judged: Judged, name: str, train: np.ndarray, test: np.ndarray
) -> dict[str, Any]:
    """Mean absolute errors, coverage and width of intervals, and what the choice wins."""
    assert frames.values is not None
    errors: dict[str, np.ndarray] = {}
    methods: dict[str, Any] = {}
    with progress(f"Testing {name}", len(judged.all())) as step:
        for method in judged.all():
            if isinstance(method, Combination):
                answers, intervals = _with_intervals(frames, method, train, test)
            else:
                answers, intervals = method.answers(frames, train, test), {}
            errors[method.name] = np.abs(answers - frames.values[test])
            means = errors[method.name].mean(axis=0).tolist()
            own = {"errors": dict(zip(frames.names, means, strict=True)), **intervals}
            methods[method.name] = own
            step()
    mine = errors[judged.chosen.name]
    result = {
        "name": name,
        "learnt": len(train),
        "tested": len(test),
        "methods": methods,
        "gain": _less(frames, mine, errors[judged.published.name]),
    }
    if judged.rival is not None:
        result["rival_gain"] = _less(frames, errors[judged.rival.name], mine)
    return result


def _with_intervals(
    frames: Frames, method: Combination, train: np.ndarray, test: np.ndarray
) -> tuple[np.ndarray, dict[str, Any]]:
    """Values [Q, T]; coverage and mean width of 90 % intervals by value, if there are any."""
    assert frames.values is not None
    encoder = frames.encoder(method.encoder)
    model = HDCRegressor(encoder, method.readout, backend=frames.backend)
    model.fit(frames.bank.at(train), frames.values[train])
    try:
        answers, low, high = model.predict(
            frames.bank.at(test), return_interval=True, alpha=ALPHA
        )
    except ValueError:  # a read-out of one's own may have none
        return model.predict(frames.bank.at(test)), {}
    truth = frames.values[test]
    inside = ((low <= truth) & (truth <= high)).sum(axis=0).tolist()
    widths = (high - low).mean(axis=0).tolist()
    coverage = {}
    for name, count in zip(frames.names, inside, strict=True):
        ends = wilson(count, len(test))
        coverage[name] = {"share": count / len(test), "low": ends[0], "high": ends[1]}
    return answers, {
        "coverage": coverage,
        "width": dict(zip(frames.names, widths, strict=True)),
    }


def _less(frames: Frames, mine: np.ndarray, theirs: np.ndarray) -> dict[str, Any]:
    """By how much one's errors [Q, T] are less than others', for each value."""
    found = {}
    for column, name in enumerate(frames.names):
        gain = paired_errors(mine[:, column], theirs[:, column])
        found[name] = gain.as_json()
    return found
