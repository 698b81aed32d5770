"""Every model on frames that no choice has seen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hdc.accuracy import wilson
from hdc.backends import choose_backend
from hdc.command.compare import show
from hdc.command.compare.advice import paired_accuracies, paired_errors
from hdc.command.compare.budget import CHOOSING, Budget, estimate, in_words
from hdc.command.compare.choose import progress
from hdc.command.compare.cost import Costs, front
from hdc.command.compare.curve import STEPS, learning_curve
from hdc.command.compare.dither import dithered
from hdc.command.compare.frames import PIXELS, Parts, part, read_frames
from hdc.command.compare.rivals import Rival, rivals
from hdc.encoders import make_encoder
from hdc.readers import Recording
from hdc.selection import (
    FORMS,
    VALUE_FORMS,
    Combination,
    Frames,
    Method,
    Scores,
    combinations,
    folds,
    race,
)


def compare(
    recording: Recording,
    other: Recording | None,
    fraction: float,
    draws: int,
    encoders: Sequence[str] = (),
    readouts: Sequence[str] = (),
    every: bool = False,
    budget: Budget | None = None,
    period: float | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Choose encoder and read-out on training frames, and judge the choice on others.

    Args:
        recording: of classes or of values.
        other: frames of another day to test on.
        fraction: share of frames held out.
        draws: random choices of frames at each point of the learning curve.
        encoders, readouts: names to choose among; by default a short list.
        every: whether to try all of the library after the short list.
        budget: the time that may be taken; by default as long as it takes.
        period: of values that go round.
        say: is given lines while the comparison goes on.

    Returns:
        The result that ``--json`` writes.
    """
    budget = budget or Budget(None)
    frames = replace(read_frames(recording, other), period=period)
    parts = part(recording, other, fraction)
    learns_values = frames.values is not None
    ours: list[Method] = list(combinations(encoders, readouts, learns_values, every))
    theirs = rivals(learns_values)
    made, how = folds(frames, parts.chosen_on)
    n_pixels = len(made) * len(ours) * len(frames.bank) * frames.bank.dimension
    frames = replace(frames, backend=choose_backend("auto", "cpu", n_pixels))
    tests = list(parts.tests())
    result: dict[str, Any] = {
        "frames": len(recording),
        "shape": list(recording.frame_shape),
        "notes": list(recording.notes),
        "chosen_by": _how_chosen(len(made), how, len(parts.chosen_on)),
        "tests": [_head(frames, *test) for test in tests],
    }
    if learns_values:
        units = frames.units or [""] * len(frames.names)
        result["values"] = list(frames.names)
        result["units"] = dict(zip(frames.names, units, strict=True))
    else:
        result["classes"] = list(frames.names)
    say(show.head(result))
    result["estimate_s"] = _estimate(frames, parts, ours, theirs, len(made), draws)
    say(f"This takes about {in_words(result['estimate_s'])}, by a trial of few frames.")
    scores = Scores()
    tried: list[Method] = [*ours, *theirs]
    for method in race(tried, frames, made, scores, lambda: budget.is_spent(CHOOSING)):
        say(show.row(method.name, scores, learns_values))
    judged = Judged.of(ours[0], theirs, scores)
    result |= {
        "published": judged.published.name,
        "chosen": judged.chosen.name,
        "rival": "" if judged.rival is None else judged.rival.name,
        "cross_validation": _shown(scores, frames),
        "given_up": scores.given_up,
        "left_out": scores.reasons,
        "not_tried": scores.not_tried,
    }
    for head, test in zip(result["tests"], tests, strict=True):
        head |= _tested(frames, judged, budget, *test)
    _, train, later = tests[-1]
    _add_costs(result, frames, judged, train, later)
    result["dither"] = dithered(frames, judged.chosen, train, later)
    followed = judged.followed()
    result["curve"] = learning_curve(frames, train, later, followed, draws, budget)
    return result


@dataclass(frozen=True)
class Judged:
    """The models that are tested.

    Attributes:
        published: the published form.
        chosen: the combination with the least loss in cross-validation.
        forms: all combinations that were tried to the end.
        rivals: each rival with the best of its settings.
        rival: the one with the least loss; None where nothing was chosen by.
    """

    published: Method
    chosen: Method
    forms: list[Method]
    rivals: list[Rival]
    rival: Method | None

    @classmethod
    def of(cls, published: Method, others: Sequence[Rival], scores: Scores) -> Judged:
        groups: dict[tuple[str, str], list[Rival]] = {}
        for rival in others:
            if rival.name in scores.not_tried:
                continue
            groups.setdefault((rival.model, rival.pixels), []).append(rival)
        best = [
            min(group, key=lambda rival: _rank(rival, scores))
            for group in groups.values()
        ]
        chosen = scores.best(Combination) or published
        forms = scores.finished(Combination)
        return cls(published, chosen, forms, best, scores.best(Rival))

    def all(self) -> list[Method]:
        """All of them, each once."""
        ours = [self.published, self.chosen, *self.forms]
        return list(dict.fromkeys([*ours, *self.rivals]))

    def tested(self, budget: Budget, what: str) -> Iterator[Method]:
        """All of them; when the budget ends, no more than those whose learning is followed."""
        always = self.followed()
        with progress(what, len(self.all())) as step:
            for method in self.all():
                step()
                if method in always or not budget.is_spent():
                    yield method

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


def _head(
    frames: Frames, name: str, train: np.ndarray, test: np.ndarray
) -> dict[str, Any]:
    """How many frames a test has; of classes also the share that a guess of one gets right."""
    found: dict[str, Any] = {"name": name, "learnt": len(train), "tested": len(test)}
    if frames.values is None:
        largest = np.bincount(frames.labels[train]).argmax()
        found["guess"] = float((frames.labels[test] == largest).mean())
        found["guessed"] = frames.names[largest]
    return found


def _tested(
    frames: Frames,
    judged: Judged,
    budget: Budget,
    name: str,
    train: np.ndarray,
    test: np.ndarray,
) -> dict[str, Any]:
    """Accuracies, or mean absolute errors by value, on test frames; what the choice wins there."""
    errors: dict[str, np.ndarray] = {}
    for method in judged.tested(budget, f"Testing {name}"):
        answers = method.answers(frames, train, test)
        if frames.values is None:
            errors[method.name] = frames.losses(answers, test)
        else:
            errors[method.name] = frames.errors(answers, test)
    mine = errors[judged.chosen.name]
    result = {
        "methods": {name: _score(frames, own) for name, own in errors.items()},
        "gain": _gain(frames, mine, errors[judged.published.name]),
    }
    if judged.rival is not None:
        result["rival_gain"] = _gain(frames, errors[judged.rival.name], mine)
    return result


def _score(frames: Frames, errors: np.ndarray) -> dict[str, Any]:
    """The accuracy of losses [Q] with its interval, or the mean of errors [Q, T] by value."""
    if frames.values is not None:
        means = errors.mean(axis=0).tolist()
        return {"errors": dict(zip(frames.names, means, strict=True))}
    right = int((errors == 0).sum())
    low, high = wilson(right, len(errors))
    return {"accuracy": right / len(errors), "low": low, "high": high}


def _gain(frames: Frames, mine: np.ndarray, theirs: np.ndarray) -> dict[str, Any]:
    """What one model wins over another, from the errors of both; of values by name."""
    if frames.values is None:
        return paired_accuracies(mine == 0, theirs == 0).as_json()
    pairs = zip(frames.names, mine.T, theirs.T, strict=True)
    return {name: paired_errors(own, other).as_json() for name, own, other in pairs}


# Time --------------------------------------------------------------------------------------------


def _estimate(
    frames: Frames,
    parts: Parts,
    ours: Sequence[Method],
    theirs: Sequence[Rival],
    n_folds: int,
    draws: int,
) -> float:
    """Seconds of the whole comparison: folds, tests, costs, points of the curve."""
    train = parts.chosen_on
    names = {method.encoder for method in ours if isinstance(method, Combination)}
    points = draws * len(STEPS)
    shared = len(ours)  # for their costs, none share anything
    for name in names:
        shared += n_folds + 2 if make_encoder(name).learns else 1
    calls = len(ours) * (n_folds + 2) + points
    forms = FORMS if frames.values is None else VALUE_FORMS
    found = estimate(frames, train, Combination(*forms[0]), shared, calls)
    shared = 2 * len(PIXELS)
    calls = len(theirs) * n_folds + points
    return found + estimate(frames, train, theirs[-1], shared, calls)


def _add_costs(
    result: dict[str, Any],
    frames: Frames,
    judged: Judged,
    train: np.ndarray,
    test: np.ndarray,
) -> None:
    """Give each model of the last test its time and bytes, and say on which fronts it lies."""
    methods = result["tests"][-1]["methods"]
    costs = Costs(frames, train, test)
    errors = {}
    for method in judged.all():
        if method.name in methods:
            own = methods[method.name]
            own |= costs.of(method).as_json()
            errors[method.name] = _error(own, frames)
    for key in ("train_s", "predict_ms"):
        points = {name: (errors[name], own[key]) for name, own in methods.items()}
        leading = front(points)
        for name, own in methods.items():
            own[f"front_{key}"] = name in leading


def _error(found: dict[str, Any], frames: Frames) -> float:
    """The error of a tested model; of values the mean in units of their spread."""
    if frames.values is None:
        return 1 - found["accuracy"]
    return float(np.mean([*found["errors"].values()] / frames.spread))
