"""Findings in a few sentences, for the first screen of README.

Which words a sentence has follows from the verdict, so that none outlives its numbers; a claim that
was not measured has no sentence.
"""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.measured import ENDS
from experiments.reporting.text import interval, number, two_digits
from experiments.studies.claims import contest
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import rules
from experiments.studies.claims.piece import CONFIRMATORY
from experiments.studies.claims.rules import NO, PARTLY, UNDECIDED, YES
from experiments.studies.claims.verdict import Verdict, equal_weights
from experiments.studies.claims.view import OF as OF_CLAIMS
from experiments.studies.claims.view import every_piece, judged
from experiments.studies.table1.models import DESCENT
from experiments.studies.table1.rows import AT_PAPERS, OVER_NUMPY

OF = (*OF_CLAIMS, contest.rules().experiment)
LAST = (
    "**No public recording is of the paper's sensor.** Diffusers (captured) and fibres (computed) "
    "show laser speckle. The others show a gel, a skin with pins, or plastic fibres."
)
RAW, STRONGER = rules().rivals  # the second is the stronger one on most recordings
PUBLISHED, EXTENDED = rules().forms["published"], rules().forms["mended"]
# Verdicts against both baselines together: no, if one is no; partly, if one is yes.
RECOGNISES = {
    YES: "is more accurate than converged softmax",
    NO: "is not more accurate than converged softmax",
    PARTLY: "is more accurate than converged softmax on {frames} frames",
    UNDECIDED: "may or may not be more accurate than converged softmax",
}
KEEPS_UP = {
    YES: "keeps up with converged softmax",
    NO: "does not keep up with converged softmax",
    PARTLY: "keeps up with converged softmax on {frames} frames",
    UNDECIDED: "may or may not keep up with converged softmax",
}
# The verdict of rules 3.
LOSES = {
    YES: "lose nothing",
    NO: "lose accuracy",
    UNDECIDED: "may or may not lose accuracy",
}
# Test accuracies closer than this are called equal, in points.
EQUAL = 0.5


def findings(
    frame: pd.DataFrame,
    costs: pd.DataFrame | None = None,
    table1: pd.DataFrame | None = None,
) -> list[str]:
    """Sentences in Markdown, the answer first.

    Args:
        frame: the lines of the experiments that claims and the contest read (:data:`OF`).
        costs: the table ``recording_costs``; None where it was not measured.
        table1: the table ``table1``; None where it was not measured.
    """
    found = {(name, rival): verdict for name, rival, verdict, _ in judged(frame)}
    extended = _recognition(found, "accuracy_mended", _extended(), KEEPS_UP)
    sentences = [
        *_recognition(found, "accuracy", "Published HDC", RECOGNISES),
        *_contest(frame),
        *(sentence + _cost(costs) for sentence in extended),
        *_unseen(frame),
        *_times(found),
        *_order(table1),
    ]
    return [*sentences, LAST] if sentences else []


def _extended() -> str:
    """The extended form, in words."""
    levels = rules().mended["thresholds"]
    return f"Extended HDC, with {levels} levels per pixel and LDA,"


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
    given = {_with_equal_weights(verdict) for verdict in known}
    together = given.pop() if len(given) == 1 else NO if NO in given else PARTLY
    parts, won = [], []
    for verdict, frames in zip(known, ("standardised", "raw"), strict=True):
        won += [frames] * (_with_equal_weights(verdict) == YES)
        part = f"{_number(verdict.pooled.mean)} on {frames} frames, *{verdict.word}*"
        if verdict.word == YES and verdict.decided_by:
            equal = _number(equal_weights(verdict.decided_by))
            part += f" (with equal weights {equal}, *{_with_equal_weights(verdict)}*)"
        parts.append(part)
    head = f"{who} {words[together].format(frames=' and '.join(won))}"
    units = known[0].pooled.units
    yield f"**{head}**: {'; '.join(parts)} (means over {units} laboratories)."


def _with_equal_weights(verdict: Verdict) -> str:
    """The verdict, where a yes also needs the interval of laboratories of equal weight, as rules 3
    have it: a laboratory whose loss is large and uncertain hardly counts in random effects."""
    if verdict.word != YES or not verdict.decided_by:
        return verdict.word
    low = equal_weights(verdict.decided_by).low
    return YES if low > -rules().margin else UNDECIDED


def _contest(frame: pd.DataFrame) -> Iterator[str]:
    """Bits against grey values by rules 3, and on the recordings that no model had seen."""
    evidence = Evidence(frame)
    whole = contest.verdict(contest.measured(evidence))
    if whole is None:
        return
    listed, left = contest.rules().recordings, contest.missing(evidence)
    text = (
        f"**Chosen alike on training frames, one to seven bits per pixel {LOSES[whole.word]} "
        f"against grey values**: {_number(whole.equal)} with equal weights, "
        f"{_number(whole.random)} by random effects, *{whole.word}* ({whole.units} laboratories)."
    )
    if left:
        text = (
            "**Bits against grey values, chosen alike on training frames**: no verdict yet, "
            f"{len(listed) - len(left)} of {len(listed)} recordings are measured."
        )
    for scene, difference in contest.confirmed(evidence).items():
        word = contest.word_of(difference)
        text += f" {scene_name(scene)}, unseen before: {_number(difference)}, *{word}*."
    yield text


def _cost(costs: pd.DataFrame | None) -> str:
    """How much longer the extended form trains than the published one, over recordings."""
    if costs is None:
        return ""
    at_most = costs[costs.n == costs.groupby("recording").n.transform("max")]
    times = at_most.pivot_table(index="recording", columns="model", values="fit_s")
    if not {PUBLISHED, EXTENDED} <= set(times.columns):
        return ""
    ratio = (times[EXTENDED] / times[PUBLISHED]).dropna()
    low, high = number(ratio.min(), 2), number(ratio.max(), 2)
    return f" Training takes {low} to {high} times as long as for the published form."


def _unseen(frame: pd.DataFrame) -> Iterator[str]:
    """Both forms on each recording that no model had classified when the rules were frozen."""
    found: dict[str, dict[str, float]] = {}
    for piece in every_piece(frame):
        unseen = piece.status == CONFIRMATORY and piece.enters
        if unseen and piece.rival == STRONGER:
            of_recording = found.setdefault(piece.evidence, {})
            of_recording[piece.claim] = piece.estimate.value
    parts = []
    for recording, values in found.items():
        if {"accuracy", "accuracy_mended"} <= set(values):
            published = _points(values["accuracy"])
            extended = _points(values["accuracy_mended"])
            name = scene_name(recording)
            parts.append(f"{name}: {published} published, {extended} extended")
    if parts:
        yield (
            "**Recordings unseen when the rules were fixed**, points relative to "
            f"converged softmax on standardised frames. {'; '.join(parts)}."
        )


def _times(found: dict[tuple[str, str], Verdict]) -> Iterator[str]:
    """How much longer baselines train than HDC in the same implementation."""
    parts = []
    for claim, rival, name in (
        ("softmax", "softmax_dual", "converged softmax"),
        ("networks_one_layer", "cnn1", "the CNN of one layer"),
        ("networks_three_layers", "cnn3", "the CNN of three layers"),
    ):
        verdict = found.get((claim, rival))
        if verdict is not None:
            least = interval(*map(two_digits, verdict.pooled.mean))
            parts.append(f"{name} ×{least}, *{verdict.word}*")
    if parts:
        yield (
            "**Training time relative to published HDC**, in the implementation that favours the "
            f"other model most: {'; '.join(parts)} (*yes*: at least ten in every implementation)."
        )


def _order(table1: pd.DataFrame | None) -> Iterator[str]:
    """Test accuracies of the paper's models where training passes 90 %, and after it converged;
    then softmax by full-batch descent, which ends at a limit of steps."""
    if table1 is None:
        return
    measured = table1[table1.test_accuracy_final.notna()].set_index("model")
    rows = measured[measured.published_test_accuracy.notna()]
    rows = rows.drop(DESCENT, errors="ignore")
    early, late = 100 * rows.test_accuracy_at_target, 100 * rows.test_accuracy_final
    if PUBLISHED not in rows.index or len(rows) < 2 or early.isna().any():
        return
    others = early.drop(PUBLISHED)
    ahead = early[PUBLISHED] - others.max() >= EQUAL
    equal = late.max() - late.min() < EQUAL
    head = "Table I"
    if ahead and equal:
        head = "HDC leads Table I only where training stops early"
    listed = (f"{display_name(model)} {number(of, 3)} %" for model, of in early.items())
    converged = (number(of, 3) for of in ([late.min()] if equal else late))
    yield (
        f"**{head}**. Test accuracy at 90 % training accuracy: {'; '.join(listed)}. "
        f"Converged: {', '.join(converged)} %.{_descent(measured)}"
    )


def _descent(rows: pd.DataFrame) -> str:
    """Softmax by full-batch descent from a normal start at the paper's training accuracy, and its
    time relative to an HDC whose median sorts."""
    if DESCENT not in rows.index:
        return ""
    row = rows.loc[DESCENT]
    papers = row.published_test_accuracy, row.published_training_time_over_hdc
    shares = [100 * row[f"{AT_PAPERS}{end}"] for end in ENDS]
    times = [row[f"{OVER_NUMPY}{end}"] for end in ENDS]
    return (
        " Softmax by full-batch descent from a normal start has, at the paper's "
        f"training accuracy, {interval(*(number(x, 3) for x in shares))} % in testing (paper: "
        f"{100 * papers[0]:g} %), and {interval(*map(two_digits, times))} times the training time "
        f"of an HDC whose median sorts (paper: {number(papers[1], 3)})."
    )


def _number(difference: Estimate) -> str:
    """``points [low, high]``."""
    value, low, high = map(_points, difference)
    return f"{value} points [{low}, {high}]"


def _points(share: float) -> str:
    """A difference of accuracies in points, with its sign."""
    value = 100 * min(1.0, max(-1.0, share))
    return f"{value:+.1f}".replace("-", "−")
