"""What was found, in a few sentences for the first screen of README.

Which words a sentence has follows from the verdict, so that none outlives its numbers; a claim that
was not measured has no sentence.
"""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.text import number
from experiments.studies.claims.frozen import rules
from experiments.studies.claims.rules import NO, PARTLY, UNDECIDED, YES
from experiments.studies.claims.verdict import Verdict
from experiments.studies.claims.view import JOINED, confirmatory, judged

LAST = (
    "**No public recording is of the paper's sensor.** Of those that decide, diffusers (captured) "
    "and fibres (computed) show laser speckle; the others are of cameras under a gel or a skin, or "
    "behind plastic fibres."
)
RAW, STRONGER = rules().rivals  # the second is the stronger one on most recordings
# What the words against both rivals say together: no, if one is no; partly, if one is yes.
RECOGNISES = {
    YES: "HDC is more accurate than",
    NO: "HDC is not more accurate than",
    PARTLY: "HDC is more accurate than one of two forms of",
    UNDECIDED: "it is undecided whether HDC is more accurate than",
}
KEEPS_UP = {
    YES: "HDC keeps up with",
    NO: "HDC does not keep up with",
    PARTLY: "HDC keeps up with one of two forms of",
    UNDECIDED: "it is undecided whether HDC keeps up with",
}
SLOWER = {
    YES: "at least ten times in every way of computing both",
    NO: "less than ten times in every way of computing both",
    PARTLY: "at least ten times in some ways of computing both, not surely in all",
    UNDECIDED: "and whether at least ten times is undecided",
}


def findings(frame: pd.DataFrame) -> list[str]:
    """Sentences in Markdown, the answer first.

    Args:
        frame: the lines of the experiments that claims read (:data:`.view.OF`).
    """
    found = {(name, rival): verdict for name, rival, verdict, _ in judged(frame)}
    sentences = [
        *_recognition(found, "accuracy", "As published", RECOGNISES),
        *_recognition(found, "accuracy_mended", _mended(), KEEPS_UP),
        *_unseen(frame),
        *_times(found),
    ]
    return [*sentences, LAST] if sentences else []


def _mended() -> str:
    """The form that is mended, in words."""
    levels = rules().mended["thresholds"]
    return (
        f"With {levels} levels a pixel and a discriminant analysis of the bits (mended)"
    )


def _recognition(
    found: dict[tuple[str, str], Verdict],
    claim: str,
    who: str,
    words: dict[str, str],
) -> Iterator[str]:
    """HDC against softmax regression of standardised and of raw frames, the answer first."""
    verdicts = [found.get((claim, rival)) for rival in (STRONGER, RAW)]
    if None in verdicts:
        return
    known = [verdict for verdict in verdicts if verdict is not None]
    said = {verdict.word for verdict in known}
    together = said.pop() if len(said) == 1 else NO if NO in said else PARTLY
    parts = []
    for verdict, frames in zip(known, ("standardised", "raw"), strict=True):
        mean = verdict.pooled.mean
        low, high = (_points(bound) for bound in mean[1:])
        part = f"{_points(mean.value)} points [{low}, {high}] on {frames} frames"
        parts.append(f"{part}, *{verdict.word}*")
    rival = display_name(RAW).lower()
    yield (
        f"**{who}, {words[together]} {rival}**: {'; '.join(parts)} (means over "
        f"{known[0].pooled.units} laboratories, 95 %)."
    )


def _unseen(frame: pd.DataFrame) -> Iterator[str]:
    """Both forms on each recording that no model had classified when the rules were frozen."""
    rows = confirmatory(frame)
    if rows is None:
        return
    rows = rows[(rows.rival == STRONGER) & (rows.recording != JOINED)]
    parts = []
    for recording, of_recording in rows.groupby("recording", sort=False):
        means = of_recording.set_index("claim")["mean"]
        if {"accuracy", "accuracy_mended"} <= set(means.index):
            published, mended = (
                _points(means[claim] / 100) for claim in ("accuracy", "accuracy_mended")
            )
            name = scene_name(str(recording))
            parts.append(f"{name} {published} as published, {mended} mended")
    if parts:
        yield (
            "**On recordings that no model had classified when the rules were frozen**, in points "
            f"and less {display_name(STRONGER).lower()}: {'; '.join(parts)}."
        )


def _times(found: dict[tuple[str, str], Verdict]) -> Iterator[str]:
    """How much longer rivals train than HDC that is computed in the same way."""
    parts = []
    for claim, rival in (
        ("softmax", "softmax_dual"),
        ("networks_one_layer", "cnn1"),
        ("networks_three_layers", "cnn3"),
    ):
        verdict = found.get((claim, rival))
        if verdict is not None:
            least = number(verdict.pooled.mean.value, 2)
            name = display_name(rival)
            parts.append(f"{name} ×{least}, {SLOWER[verdict.word]}")
    if parts:
        yield (
            "**Training time over that of HDC**, by the way of computing both that favours the "
            f"rival most: {'; '.join(parts)}."
        )


def _points(share: float) -> str:
    """A difference of accuracies in points, with its sign."""
    value = 100 * min(1.0, max(-1.0, share))
    return f"{value:+.1f}".replace("-", "−")
