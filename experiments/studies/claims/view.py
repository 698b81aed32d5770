"""The paper's claims as data: for each piece of evidence a number, its interval and a verdict.

Numbers come from other studies; :mod:`.rules` turns them into one of four words, :mod:`.phrases`
into what is said after it. The paper's sentences are in claims.yaml.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from omegaconf import OmegaConf

from experiments.records import configs
from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.columns import Column, display_name
from experiments.reporting.estimates import (
    Estimate,
    difference,
    mean_difference,
    mean_interval,
)
from experiments.reporting.measured import ENDS, RIVAL, SATURATED, saturated
from experiments.reporting.study import RUN, Study, with_places
from experiments.reporting.table import frame, records
from experiments.reporting.text import CAPTURED, COMPUTED, SIMULATED, kind_of, number
from experiments.studies.claims import rules
from experiments.studies.claims.phrases import DECIDING, PHRASES
from experiments.studies.claims.rules import NO, UNDECIDED, YES
from experiments.studies.correlation.view import mean_contrast
from experiments.studies.crossing.view import first_crossings, middle, tidy
from experiments.studies.drift.view import accuracies as updated
from experiments.studies.recordings.view import over_rival, recordings
from experiments.studies.table1.view import WAYS, time_ratios
from experiments.studies.table1.view import scene as scene_of_table1

Evidence = dict[str, Any]
TIMED = "timed"  # kind of evidence that rests on times, besides the kinds of frames
KINDS_SHOWN = (CAPTURED, COMPUTED, SIMULATED)
HARD = ("finger", "spatial")  # simulated scenes on which not every model is right
FLIPPED = 0.01  # share of flipped bits
FEW = (1, 2, 3, 5)  # frames per class
LESS = f"HDC less {display_name(RIVAL)}"

STUDY = Study(
    "claims",
    "The paper's claims",
    "What did the paper claim, and what do captured, computed and simulated frames say? Captured: "
    "by a camera; computed: from measured matrices of a fibre.",
    0,
    front=True,
)

# Claim: what the paper says.
CLAIMS: Any = OmegaConf.load(Path(__file__).with_name("claims.yaml"))


# Evidence: each function yields the columns that differ from those of its line of EVIDENCE.


def _of_recordings(
    results: Results,
    sizes: Sequence[int] = (),
) -> Iterator[Evidence]:
    """HDC less its rival by the split that counts: mean over some numbers of frames per class, or
    at the most."""
    for scene, measured in recordings(results).items():
        if saturated(measured):
            continue
        found = over_rival(measured, sizes)
        if found:
            estimates = np.array([estimate for estimate, _ in found])
            value = Estimate(*estimates.mean(axis=0).tolist())
            _, most = found[0]
            n = None if sizes else f"{most} frames per class"
            yield {
                "evidence": scene,
                "kind": _kind(measured),
                "value": value,
                "n": n,
                "command": f"{RUN}recordings scene={scene}",
            }


def _of_scenes(results: Results) -> Iterator[Evidence]:
    """HDC less its rival on simulated scenes, on the same test samples."""
    for scene in (scene_of_table1(), *HARD, "tactile"):
        groups = [results.group(scene, model) for model in ("hdc", RIVAL)]
        of_hdc, of_rival = (group.runs for group in groups)
        paired = difference(of_hdc, of_rival)
        if paired is not None:
            name = f"{scene}, fitted to HDC" if _fitted(scene) else scene
            row = {
                "evidence": name,
                "value": paired,
                "n": f"{len(of_hdc)} seeds",
                "command": f"{RUN}all_scenes scene={scene}",
            }
            if all(group.right.mean() >= SATURATED for group in groups):
                row |= {"evidence": f"{scene}, saturated", "verdict": UNDECIDED}
            yield row


def _slower(results: Results, models: Sequence[str]) -> Iterator[Evidence]:
    """Training times over HDC's, until training accuracy exceeds 90 %, as in the paper."""
    for model in models:
        ratios = time_ratios(results, results.group(scene_of_table1(), model))
        for way, runs in ratios.items():
            if not runs:  # a way that was not measured
                continue
            value, count = Estimate(float(np.median(runs))), "1 run"
            if len(runs) > 1:
                value = value._replace(low=min(runs), high=max(runs))
                count = f"{len(runs)} runs"
            yield {
                "evidence": f"{display_name(model)}, over {way}",
                "kind": TIMED,
                "value": value,
                "verdict": rules.slower(runs),
                "n": count,
            }


def _kind(measured: Measured) -> str:
    """The kind of the frames of a measurement."""
    if "origin" in measured.frame:
        return kind_of(str(measured.frame.origin.iloc[0]))
    return str(configs.scene_display(measured.record.scene)["kind"])


def _fitted(scene: str) -> bool:
    """Whether parameters of a scene were chosen by the accuracy of HDC on it."""
    return bool(configs.scene_display(scene)["fitted"])


def _of_places(
    results: Results,
    name: str,
    read: Callable[[pd.DataFrame, str], Iterator[Evidence]],
) -> Iterator[Evidence]:
    """Evidence of a measurement, on each kind of frames."""
    for suffix, measured in with_places(results, name):
        of = {
            "kind": _kind(measured),
            "command": measured.record.command,
            "n": f"{measured.frame.seed.nunique()} seeds",
        }
        for row in read(measured.frame, suffix.lstrip("_")):
            yield {**of, **row}


def _few(rows: pd.DataFrame, place: str) -> Iterator[Evidence]:
    """HDC less its rival, mean over N."""
    equal = tidy(rows).query("equal")
    by_seed = equal.pivot_table("accuracy", "seed", "model")
    if {"hdc", RIVAL} <= set(by_seed):
        ahead = by_seed["hdc"] - by_seed[RIVAL]
        yield {
            "evidence": f"{place or 'touch'}, N up to {equal.n.max()}",
            "value": mean_interval(ahead.tolist()),
        }


def _first(rows: pd.DataFrame, place: str) -> Iterator[Evidence]:
    """The N at which one experiment with HDC exceeds 90 %: median and 95 % of experiments."""
    first = first_crossings(rows).query("model == 'hdc'")["first"]
    if not len(first):
        return
    yield {
        "evidence": f"{place or 'touch'}, fitted",
        "value": middle(first),
        "n": f"{len(first)} experiments",
        "verdict": UNDECIDED,
    }


def _contrast(rows: pd.DataFrame, place: str) -> Iterator[Evidence]:
    """Contrast of prototypes less that of the speckle, on samples held out."""
    if "speckle" in set(rows.kind):
        before = mean_contrast(rows, "speckle", "held-out").value
        after = mean_contrast(rows, "prototype", "held-out").value
        yield {
            "evidence": place or "touch",
            "value": Estimate(after - before),
            "quantity": f"contrast {number(before)} to {number(after)}",
            "verdict": YES if after > before else NO,
        }


def _recalibration(rows: pd.DataFrame, place: str) -> Iterator[Evidence]:
    """Accuracy in the new session after an update with 50 new samples, first in time."""
    every = updated(rows).query("order == 'time'")
    for model, update, name in (
        ("hdc", "bits replaced, p = 0.75", "HDC, p = 0.75"),
        ("hdc", "new samples alone", "HDC, new samples alone"),
        ("ridge", "new, from the old weights", "ridge from old weights"),
    ):
        of_model = every[every.model == model].set_index("seed")
        part = of_model.query(f"update == '{update}' and n_new == 50").new
        stored = of_model.query("method == 'stored'").new
        gained = (part - stored).dropna()
        if len(gained):
            row = {
                "evidence": f"{place or 'drift'}, {name}",
                "quantity": f"gained, to {100 * part.mean():.3g} %",
                "value": mean_interval(gained.tolist()),
            }
            yield row if "p = " in name else {**row, "verdict": UNDECIDED}


def _faults(rows: pd.DataFrame, place: str) -> Iterator[Evidence]:
    """Accuracy lost when one stored bit in 100 is flipped."""
    rows = rows.assign(accuracy=rows.right / rows.n_test)
    kinds = {"hdc": "bit_flips", RIVAL: "bit_flips_int8"}
    for model, kind in kinds.items():
        of_model = rows[rows.model == model]
        clean = of_model[of_model.disturbance == "none"]
        disturbed = of_model[of_model.disturbance == kind]
        flipped = disturbed[disturbed.level == FLIPPED]
        before = clean.groupby("seed").accuracy.mean()
        after = flipped.groupby("seed").accuracy.mean()
        lost = (after - before).dropna()
        if len(lost):
            n_test = float(flipped.n_test.iloc[0])
            row = {
                "evidence": f"{display_name(model)}, {place or 'touch'}",
                "value": mean_difference(lost.tolist(), n_test),
            }
            yield row if model == "hdc" else {**row, "verdict": UNDECIDED}


class Source(NamedTuple):
    """Where evidence for a claim comes from: `read` of the results, and columns of all its rows.

    `rule` is one of :mod:`.rules`, or says why the rows have a verdict of their own.
    """

    claim: str
    read: Callable[[Results], Iterator[Evidence]]
    experiment: str
    quantity: str
    rule: str
    unit: str = "points"


_OVER = "training time over HDC's, lowest to highest run"
_UP_TO = f"{LESS}, mean over n = {', '.join(map(str, FEW))} frames per class"
# fmt: off
EVIDENCE = (
    Source("accuracy", _of_recordings, "recordings", LESS, "more_accurate"),
    Source("accuracy", _of_scenes, "all_scenes", LESS, "more_accurate"),
    Source("networks", partial(_slower, models=("cnn1", "cnn3")), "table1", _OVER, "slower", "×"),
    Source("softmax", partial(_slower, models=("softmax", RIVAL)), "table1", _OVER, "slower", "×"),
    Source("few_samples", partial(_of_recordings, sizes=FEW), "recordings", _UP_TO,
           "at_least_as_accurate"),
    Source("few_samples", partial(_of_places, name="crossing", read=_few), "crossing",
           f"{LESS}, mean over N", "at_least_as_accurate"),
    Source("few_samples", partial(_of_places, name="crossing", read=_first), "crossing",
           "N of one experiment to exceed 90 %", "fitted numbers get no verdict", "samples"),
    Source("contrast", partial(_of_places, name="correlation", read=_contrast), "correlation",
           "contrast", "larger than that of the speckle", "1"),
    Source("recalibration", partial(_of_places, name="drift", read=_recalibration), "drift",
           "gained", "more_accurate"),
    Source("faults", partial(_of_places, name="robustness", read=_faults), "robustness",
           "change by 1 % flipped bits", "at_least_as_accurate"),
)
# fmt: on


@cache
def evidence(results: Results) -> pd.DataFrame:
    """Every piece of evidence: ``claim, evidence, kind, quantity, value, value_low, value_high,
    unit, n, rule, command, verdict``."""
    rows = []
    for claim, read, experiment, quantity, rule, unit in EVIDENCE:
        of = {
            "claim": claim,
            "evidence": "",
            "kind": SIMULATED,
            "quantity": quantity,
        }
        rest = {
            "unit": unit,
            "n": None,
            "rule": rule,
            "command": f"{RUN}{experiment}",
        }
        for found in read(results):
            value = found["value"]
            verdict = found.get("verdict") or getattr(rules, rule)(value)
            factor = 100 if unit == "points" else 1
            shown = Estimate(*(factor * bound for bound in value))
            line = {
                **of,
                **shown.columns("value"),
                **rest,
                **found,
            }
            rows.append(
                {
                    **line,
                    "verdict": verdict,
                    "value": shown.value,
                }
            )
    return frame(
        rows, () if rows else ("claim", "evidence", "kind", "value", "verdict")
    )


def verdicts(rows: pd.DataFrame) -> dict[str, str]:
    """The word for each claim of which there is evidence: by times as they are, contrast by all
    evidence, others by captured and computed frames first."""
    words = {}
    for claim, part in rows.groupby("claim", sort=False):
        if not _complete(part):
            continue
        simulated = part[part.kind == SIMULATED].verdict.tolist()
        deciding = part[part.kind.isin(DECIDING)].verdict.tolist()
        timed = part[part.kind == TIMED].verdict.tolist()
        if timed:
            word = UNDECIDED if UNDECIDED in timed else rules.combine(timed)
        elif claim == "contrast":
            word = rules.combine(deciding + simulated)
        else:
            word = rules.judge(deciding, simulated)
        words[str(claim)] = word
    return words


def _complete(part: pd.DataFrame) -> bool:
    """Whether a claim can be judged: one on times needs HDC computed by every way."""
    timed = part[part.kind == TIMED].evidence
    ways = {name.partition(", over ")[2] for name in timed}
    return not ways or ways == set(WAYS)


def decided_by(claim: str, rows: pd.DataFrame) -> str:
    """The kinds of frames, or times, that decide a claim, in words; those that may refute it."""
    kinds = set(rows.kind)
    if TIMED in kinds:
        return "times"
    may_decide = (*DECIDING, SIMULATED) if claim == "contrast" else DECIDING
    deciding = [kind for kind in may_decide if kind in kinds]
    if not deciding:
        return "simulated frames, which can only refute"
    return f"{' and '.join(deciding)} frames"


def _text(row: Mapping[str, Any]) -> str:
    """A number with its name, its unit and its interval, to two digits."""
    name = row["evidence"]
    if row["unit"] == "1":  # of a bare number, the quantity has both values
        return f"{name}: {row['quantity']}"
    value, low, high = (_digits(row, f"value{end}") for end in ENDS)
    shown = f"×{value}" if row["unit"] == "×" else f"{value} {row['unit']}"
    if low and high:
        shown += f" [{low}, {high}]"
    return f"{name}: {shown}".replace("-", "−")


def _digits(row: Mapping[str, Any], key: str) -> str:
    """A number of a row to two digits, points with their sign; nothing where it is unknown."""
    number_of = row.get(key)
    if number_of is None:
        return ""
    if row["unit"] != "points":
        return number(number_of, 2)
    decimals = 1 if abs(number_of) < 10 else 0
    return f"{number_of:+.{decimals}f}"


NOTE = (
    "Points: accuracy of HDC less that of softmax regression at its optimum, the primary rival. "
    "×: training time over HDC's, lowest to highest run. Simulated frames can refute a claim; they "
    "cannot rank models. The rules are in docs/verdicts.md."
)


@STUDY.table(
    "claims",
    title="Verdicts",
    shown=("paper", "verdict", "decided_by", *KINDS_SHOWN),
    columns={
        "paper": Column("The paper says"),
        "verdict": Column("Verdict", lambda text: text[:1].upper() + text[1:]),
        "decided_by": Column("Decided by"),
        "captured": Column("Captured frames"),
        "computed": Column("Computed frames"),
        "simulated": Column("Simulated frames, fitted to the paper; times on them"),
    },
)
def claims(results: Results) -> pd.DataFrame | None:
    """One row a claim of which there is evidence; a claim that no study tests is named below."""
    every = evidence(results)
    words = verdicts(every) if len(every) else {}
    table = []
    for claim, paper in CLAIMS.items():
        if claim in words:
            part = every[every.claim == claim]
            table.append(_verdict(claim, paper, words[claim], part))
    if not table:
        return None
    tested = {source.claim for source in EVIDENCE}
    untested = [paper for claim, paper in CLAIMS.items() if claim not in tested]
    data = pd.DataFrame(table)
    data.attrs["note"] = f"{NOTE} Not tested: {'; '.join(untested)}."
    return data


def _verdict(
    claim: str,
    paper: str,
    word: str,
    part: pd.DataFrame,
) -> dict[str, str]:
    """The row of a claim."""
    phrase = PHRASES[claim](part)
    row = {"claim": claim, "paper": paper, "word": word}
    row["verdict"] = f"{word}: {phrase}" if phrase else word
    row["decided_by"] = decided_by(claim, part)
    for kind in KINDS_SHOWN:
        kinds = (kind, TIMED) if kind == SIMULATED else (kind,)
        of_kinds = part[part.kind.isin(kinds)]
        lines = [_text(line) for line in records(of_kinds)]
        row[kind] = "\n".join(lines) or "–"
    return row


STUDY.table(
    "claims_evidence",
    key=("claim", "evidence"),
    title="Evidence for each claim",
    shown=("claim", "evidence", "kind", "quantity", "value", "unit", "n", "verdict"),
    columns={
        **{
            name: Column(name.capitalize())
            for name in ("claim", "evidence", "kind", "quantity")
        },
        "value": Column("Number [interval]"),
        "unit": Column("Unit"),
        "n": Column("n"),
    },
)(evidence)
