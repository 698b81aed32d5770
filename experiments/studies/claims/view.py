"""The paper's claims as data: for each piece of evidence a number, its interval and a verdict.

Numbers come from other studies; :mod:`.rules` turns them into one of four words. The sentences are
written by people, below.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pandas as pd

from experiments.records.results import Results
from experiments.reporting.columns import Column, display_name
from experiments.reporting.estimates import Estimate, difference, mean_difference, mean_interval
from experiments.reporting.study import RUN, Study, with_places
from experiments.reporting.table import frame
from experiments.reporting.text import number
from experiments.studies.claims import rules
from experiments.studies.claims.rules import NO, UNDECIDABLE, YES
from experiments.studies.correlation.view import mean_contrast
from experiments.studies.crossing.view import first_crossings, tidy
from experiments.studies.drift.view import accuracies as updated
from experiments.studies.recordings.view import RIVAL, SATURATED, over_rival, recordings
from experiments.studies.table1.view import scene as scene_of_table1
from experiments.studies.table1.view import time_ratios

Evidence = dict[str, Any]
MEASURED, SIMULATED, TIMED = "measured", "simulated", "timed"
HARD = ("finger", "spatial")  # simulated scenes on which not every model is right
FLIPPED = 0.01  # share of flipped bits

STUDY = Study(
    "claims",
    "The paper's claims",
    "What did the paper claim, and what do measured and simulated frames say?",
    0,
    front=True,
)

# Claim: its name, what the paper says, and at most twelve words for each verdict.
CLAIMS = {
    "accuracy": (
        "HDC recognises slightly better (100 against 90–93 %)",
        {
            NO: "softmax regression at its optimum is as accurate or better",
            YES: "better than softmax regression at its optimum",
            "partly": "better on some recordings, worse on others",
        },
    ),
    "networks": (
        "HDC trains much faster than networks (×82, ×356)",
        {
            YES: "at least ten times, however HDC is computed",
            "partly": "depends on how HDC is computed",
        },
    ),
    "softmax": (
        "HDC trains much faster than softmax regression (×137)",
        {
            NO: "less than ten times, by descent and solved directly",
            "partly": "only against slow training, not against a direct solve",
            YES: "at least ten times, even against a direct solve",
        },
    ),
    "few_samples": (
        "Few samples suffice (90 % only for N > 20)",
        {
            YES: "but softmax regression at its optimum needs no more",
            NO: "softmax regression at its optimum needs fewer",
            "partly": "as few as softmax at its optimum on some recordings only",
        },
    ),
    "contrast": (
        "Prototypes sharpen the contrast of classes (0.055 to 0.1)",
        {
            "partly": "only where frames of a class correlate below 0.64",
            YES: "and raise the floor by the same factor",
            NO: "frames of a class correlate above 0.64",
        },
    ),
    "recalibration": (
        "Recalibration restores accuracy (32 to 95 %)",
        {
            YES: "linear models from old weights restore more",
            NO: "new samples do not raise the accuracy of HDC",
            "partly": "not on every recording; linear models from old weights restore more",
        },
    ),
    "faults": (
        "No error-prone bits: flipped bits are tolerated",
        {YES: "so do 8-bit weights of softmax regression", NO: "one flipped bit in 100 costs more"},
    ),
    "objects": (
        "Touched objects are recognised (100 %)",
        {UNDECIDABLE: "no public recording; the simulation assumes their thickness"},
    ),
}

_MAKERS: dict[str, Callable[[Results], Iterator[Evidence]]] = {}


def _claim(function: Callable[[Results], Iterator[Evidence]]) -> Any:
    _MAKERS[function.__name__] = function
    return function


def evidence(results: Results) -> pd.DataFrame:
    """Every piece of evidence: ``claim, evidence, kind, quantity, value, low, high, unit, n, rule,
    verdict, command``."""
    rows = [{"claim": name, **row} for name, make in _MAKERS.items() for row in make(results)]
    return frame(rows)


def _row(
    name: str, kind: str, quantity: str, value: Estimate, verdict: str, **more: Any
) -> Evidence:
    return {
        "evidence": name, "kind": kind, "quantity": quantity, **value.columns("value"),
        "unit": "points", **more, "verdict": verdict,
    }  # fmt: skip


def _points(value: Estimate) -> Estimate:
    return Estimate(*(100 * bound for bound in value))


@_claim
def accuracy(results: Results) -> Iterator[Evidence]:
    """HDC against softmax regression at its optimum, by the split that counts."""
    quantity = f"HDC less {display_name(RIVAL)}"
    for scene, measured in recordings(results).items():
        if measured.record.config["scene"].get("saturated"):
            continue
        value, n = over_rival(measured)
        yield _row(
            scene, MEASURED, quantity, _points(value), rules.more_accurate(value),
            n=f"{n} frames a class", rule="more_accurate",
            command=f"{RUN}recordings scene={scene}",
        )  # fmt: skip
    for scene in (scene_of_table1(), *HARD, "tactile"):
        groups = [results.group(scene, model) for model in ("hdc", RIVAL)]
        if any(not group.runs for group in groups):
            continue
        paired = difference(groups[0].runs, groups[1].runs)
        if paired is None:
            continue
        ceiling = all(group.right.mean() >= SATURATED for group in groups)
        yield _row(
            f"{scene}{', saturated' * ceiling}", SIMULATED, quantity,
            _points(paired), UNDECIDABLE if ceiling else rules.more_accurate(paired),
            n=f"{len(groups[0].runs)} seeds", rule="more_accurate",
            command=f"{RUN}all_scenes scene={scene}",
        )  # fmt: skip


def _slower(results: Results, model: str, name: str) -> Iterator[Evidence]:
    group = results.group(scene_of_table1(), model)
    for way, runs in time_ratios(results, group).items():
        middle = float(np.median(runs)) if runs else math.nan  # a way that was not measured
        several = len(runs) > 1  # one run has no range
        value = Estimate(middle, min(runs), max(runs)) if several else Estimate(middle)
        yield _row(
            f"{name}, over {way}", TIMED, "training time over HDC's, lowest to highest run", value,
            rules.slower({way: runs}), unit="×", n=f"{len(runs)} run{'s' * (len(runs) != 1)}",
            rule="slower", command=f"{RUN}table1",
        )  # fmt: skip


@_claim
def networks(results: Results) -> Iterator[Evidence]:
    """Training times of the networks until training accuracy exceeds 90 %, as in the paper."""
    for model in ("cnn1", "cnn3"):
        yield from _slower(results, model, display_name(model))


@_claim
def softmax(results: Results) -> Iterator[Evidence]:
    """Training times of softmax regression by the recipe of Table I, and solved directly."""
    for model in ("softmax", RIVAL):
        yield from _slower(results, model, display_name(model))


@_claim
def few_samples(results: Results) -> Iterator[Evidence]:
    """HDC against softmax regression at its optimum with at most 5 frames a class."""
    quantity = f"HDC less {display_name(RIVAL)}, mean up to n = 5 a class"
    for scene, measured in recordings(results).items():
        if measured.record.config["scene"].get("saturated"):
            continue
        few = [over_rival(measured, n)[0] for n in (1, 2, 3, 5) if n in _sizes(measured)]
        if few:
            value = Estimate(*(float(np.mean(part)) for part in zip(*few, strict=True)))
            yield _row(
                scene, MEASURED, quantity, _points(value), rules.at_least_as_accurate(value),
                rule="at_least_as_accurate", command=f"{RUN}recordings scene={scene}",
            )  # fmt: skip
    for suffix, measured in with_places(results, "crossing"):
        rows = tidy(measured.frame).query("equal")
        by_seed = rows.pivot_table("accuracy", "seed", "model")
        if RIVAL not in by_seed:
            continue
        value = mean_interval((by_seed["hdc"] - by_seed[RIVAL]).tolist())
        yield _row(
            f"touch{suffix}, N up to {rows.n.max()}", SIMULATED, quantity, _points(value),
            rules.at_least_as_accurate(value), n=f"{len(by_seed)} seeds",
            rule="at_least_as_accurate", command=f"{RUN}crossing",
        )  # fmt: skip
        first = first_crossings(measured.frame).query("model == 'hdc'")["first"]
        low, middle, high = np.quantile(first, (0.025, 0.5, 0.975), method="inverted_cdf")
        yield _row(
            f"touch{suffix}, fitted", SIMULATED, "N of one experiment to exceed 90 %",
            Estimate(middle, low, high), UNDECIDABLE, unit="samples", n=f"{len(first)} experiments",
            rule="fitted numbers get no verdict", command=f"{RUN}crossing",
        )  # fmt: skip


def _sizes(measured: Any) -> set[int]:
    return {n for sizes in measured.frame.n for n in sizes}


@_claim
def contrast(results: Results) -> Iterator[Evidence]:
    """Contrast of prototypes less that of the speckle, on samples held out."""
    for suffix, measured in with_places(results, "correlation"):
        rows = measured.frame
        speckle = mean_contrast(rows, "speckle", "held-out")
        prototype = mean_contrast(rows, "prototype", "held-out")
        value = Estimate(prototype.value - speckle.value)
        verdict = YES if value.value > 0 else NO
        yield _row(
            suffix.lstrip("_") or "touch", MEASURED if suffix else SIMULATED,
            f"contrast {number(speckle.value)} to {number(prototype.value)}", value, verdict,
            unit="1", n=f"{rows.seed.nunique()} seeds", rule="larger than that of the speckle",
            command=measured.record.command,
        )  # fmt: skip


@_claim
def recalibration(results: Results) -> Iterator[Evidence]:
    """Accuracy in the new session after an update with 50 new samples, first in time."""
    for suffix, measured in with_places(results, "drift"):
        every = updated(measured.frame).query("order == 'time'")
        stored = every.query("model == 'hdc' and method == 'stored'").set_index("seed")["new"]
        for model, method, share, name in (
            ("hdc", "replace", 0.75, "HDC, p = 0.75"),
            ("hdc", "new", None, "HDC, new samples alone"),
            ("ridge", "from_old", None, "ridge from old weights"),
        ):
            part = every[(every.model == model) & (every.method == method) & (every.n_new == 50)]
            part = part if share is None else part[part.p == share]
            gained = (part.set_index("seed")["new"] - stored).dropna()
            if not len(gained):
                continue
            value = mean_interval(gained.tolist())
            yield _row(
                f"{suffix.lstrip('_') or 'drift'}, {name}", MEASURED if suffix else SIMULATED,
                f"above HDC not updated, to {100 * part['new'].mean():.3g} %", _points(value),
                rules.more_accurate(value) if share else UNDECIDABLE, n=f"{len(gained)} seeds",
                rule="more_accurate", command=measured.record.command,
            )  # fmt: skip


@_claim
def faults(results: Results) -> Iterator[Evidence]:
    """Accuracy lost when one stored bit in 100 is flipped."""
    for suffix, measured in with_places(results, "robustness"):
        rows = measured.frame.assign(accuracy=measured.frame.right / measured.frame.n_test)
        for model, kind in (("hdc", "bit_flips"), ("softmax_dual", "bit_flips_int8")):
            of_model = rows[rows.model == model]
            clean = of_model[of_model.disturbance == "none"].groupby("seed").accuracy.mean()
            flipped = of_model[(of_model.disturbance == kind) & (of_model.level == FLIPPED)]
            if len(flipped):
                lost = (flipped.groupby("seed").accuracy.mean() - clean).dropna()
                value = mean_difference(lost.tolist(), float(flipped.n_test.iloc[0]))
                yield _row(
                    f"{display_name(model)}, {suffix.lstrip('_') or 'touch'}",
                    MEASURED if suffix else SIMULATED,
                    "change by 1 % flipped bits",
                    _points(value),
                    rules.at_least_as_accurate(value) if model == "hdc" else UNDECIDABLE,
                    n=f"{len(lost)} seeds",
                    rule="at_least_as_accurate",
                    command=measured.record.command,
                )


@_claim
def objects(results: Results) -> Iterator[Evidence]:
    """No recording of touched objects is public, and simulated ones rest on assumed thickness."""
    yield _row(
        "simulated objects", SIMULATED, "none: the answer follows from an assumption of ours",
        Estimate(math.nan), UNDECIDABLE, unit="", rule="no evidence",
        command=f"{RUN}tactile_controls",
    )  # fmt: skip


def verdicts(rows: pd.DataFrame) -> dict[str, str]:
    """The word for each claim. Times are judged as they are; contrast and recalibration by all
    evidence, others by the measured one first."""
    words = {}
    for claim, part in rows.groupby("claim", sort=False):
        of = {kind: part[part.kind == kind].verdict.tolist() for kind in (MEASURED, SIMULATED)}
        timed = part[part.kind == TIMED].verdict.tolist()
        if timed:
            words[str(claim)] = UNDECIDABLE if UNDECIDABLE in timed else rules.combine(timed)
        elif claim in ("contrast", "recalibration"):
            words[str(claim)] = rules.combine(of[MEASURED] + of[SIMULATED])
        else:
            words[str(claim)] = rules.judge(of[MEASURED], of[SIMULATED])
    return words


def _best(rows: pd.DataFrame, kind: str) -> str:
    """Numbers of one kind of evidence, in the order of the table."""
    return "; ".join(
        f"{row['evidence']} {_value(row)}"
        for row in rows[rows.kind == kind].to_dict("records")
        if row["value"] is not None and row["value"] == row["value"]
    )


def _value(row: dict[str, Any]) -> str:
    unit = row["unit"]
    value = f"{row['value']:+.1f}" if unit == "points" else number(row["value"])
    text = f"×{value}" if unit == "×" else value
    if row["value_low"] == row["value_low"] and row["value_low"] is not None:
        low, high = (number(row[key]) for key in ("value_low", "value_high"))
        text += f" [{low}, {high}]"
    return text.replace("-", "−")


@STUDY.table(
    "claims",
    title="The paper's claims",
    columns={
        "paper": Column("The paper says"),
        "verdict": Column("Verdict", lambda text: text[:1].upper() + text[1:]),
        "measured": Column("Measured", lambda text: text or "no recording"),
        "simulated": Column("Simulated, fitted to the paper", lambda text: text or "–"),
    },
    note="Points: accuracy of HDC less that of softmax regression at its optimum, the primary "
    "rival. ×: training time over HDC's, lowest to highest run. Simulated frames can refute a "
    "claim and rank nothing. The rules are in docs/verdicts.md.",
)
def claims(results: Results) -> pd.DataFrame | None:
    """One row a claim."""
    rows = evidence(results)
    words = verdicts(rows)
    table = []
    for claim, (paper, phrases) in CLAIMS.items():
        part = rows[rows.claim == claim]
        word = words.get(claim, UNDECIDABLE)
        phrase = phrases.get(word, "")
        table.append({
            "claim": claim, "paper": paper, "word": word,
            "verdict": f"{word}: {phrase}" if phrase else word,
            "measured": _best(part, MEASURED),
            "simulated": _best(part, SIMULATED) or _best(part, TIMED),
        })  # fmt: skip
    data = pd.DataFrame(table)
    data.attrs["shown"] = ["paper", "verdict", "measured", "simulated"]
    return data


@STUDY.table(
    "claims_evidence",
    title="Evidence for each claim",
    columns={
        "claim": Column("Claim"),
        "evidence": Column("Evidence"),
        "kind": Column("Kind"),
        "quantity": Column("Quantity"),
        "value": Column("Number [interval]", lambda value: number(value)),
        "n": Column("n"),
        "verdict": Column("Verdict"),
        "command": Column("Command"),
    },
    folded=True,
)
def all_evidence(results: Results) -> pd.DataFrame | None:
    """Every piece of evidence with its rule and the command that makes it."""
    data = evidence(results)
    data.attrs["shown"] = ["claim", "evidence", "kind", "quantity", "value", "n", "verdict"]
    return data
