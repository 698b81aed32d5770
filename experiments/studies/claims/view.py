"""The paper's claims as data: for each piece of evidence a number, its interval and a verdict.

Numbers come from other studies; :mod:`.rules` turns them into one of four words. The sentences are
written by people, in claims.yaml.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from omegaconf import OmegaConf

from experiments.records.results import Results
from experiments.reporting.columns import Column, display_name
from experiments.reporting.estimates import (
    Estimate,
    difference,
    mean_difference,
    mean_interval,
)
from experiments.reporting.study import RUN, Study, with_places
from experiments.reporting.table import frame, records
from experiments.reporting.text import number
from experiments.studies.claims import rules
from experiments.studies.claims.rules import NO, UNDECIDED, YES
from experiments.studies.correlation.view import mean_contrast
from experiments.studies.crossing.view import first_crossings, middle, tidy
from experiments.studies.drift.view import accuracies as updated
from experiments.studies.recordings.view import RIVAL, SATURATED, over_rival, recordings
from experiments.studies.table1.view import scene as scene_of_table1
from experiments.studies.table1.view import time_ratios

Evidence = dict[str, Any]
MEASURED, SIMULATED, TIMED = "measured", "simulated", "timed"
HARD = ("finger", "spatial")  # simulated scenes on which not every model is right
FLIPPED = 0.01  # share of flipped bits
FEW = (1, 2, 3, 5)  # frames per class
LESS = f"HDC less {display_name(RIVAL)}"

STUDY = Study(
    "claims",
    "The paper's claims",
    "What did the paper claim, and what do measured and simulated frames say?",
    0,
    front=True,
)

# Claim: what the paper says, and a few words for each verdict.
CLAIMS: Any = OmegaConf.load(Path(__file__).with_name("claims.yaml"))


# Evidence: each function yields the columns that differ from those of its line of EVIDENCE.


def _of_recordings(results: Results, sizes: Sequence[int] = ()) -> Iterator[Evidence]:
    """HDC less its rival by the split that counts: mean over some numbers of frames per class, or
    at the most."""
    for scene, measured in recordings(results).items():
        if measured.record.config["scene"].get("saturated"):
            continue
        if found := over_rival(measured, sizes):
            values = zip(*(value for value, _ in found), strict=True)
            value = Estimate(*(float(np.mean(part)) for part in values))
            n = None if sizes else f"{found[0][1]} frames per class"
            yield {"evidence": scene, "kind": MEASURED, "value": value, "n": n,
                   "command": f"{RUN}recordings scene={scene}"}  # fmt: skip


def _of_scenes(results: Results) -> Iterator[Evidence]:
    """HDC less its rival on simulated scenes, on the same test samples."""
    for scene in (scene_of_table1(), *HARD, "tactile"):
        groups = [results.group(scene, model) for model in ("hdc", RIVAL)]
        if paired := difference(groups[0].runs, groups[1].runs):
            row = {"evidence": scene, "value": paired, "n": f"{len(groups[0].runs)} seeds",
                   "command": f"{RUN}all_scenes scene={scene}"}  # fmt: skip
            if all(group.right.mean() >= SATURATED for group in groups):
                row |= {"evidence": f"{scene}, saturated", "verdict": UNDECIDED}
            yield row


def _slower(results: Results, models: Sequence[str]) -> Iterator[Evidence]:
    """Training times over HDC's, until training accuracy exceeds 90 %, as in the paper."""
    for model in models:
        ratios = time_ratios(results, results.group(scene_of_table1(), model))
        for way, runs in ratios.items():
            median = (
                float(np.median(runs)) if runs else math.nan
            )  # a way that was not measured
            bounds = (
                (min(runs), max(runs)) if len(runs) > 1 else ()
            )  # one run has no range
            yield {"evidence": f"{display_name(model)}, over {way}", "kind": TIMED,
                   "value": Estimate(median, *bounds), "verdict": rules.slower(runs),
                   "n": f"{len(runs)} run{'s' * (len(runs) != 1)}"}  # fmt: skip


def _of_places(
    results: Results, name: str, read: Callable[[pd.DataFrame, str], Iterator[Evidence]]
) -> Iterator[Evidence]:
    """Evidence of a measurement: on its own, simulated frames, and on others, measured ones."""
    for suffix, measured in with_places(results, name):
        of = {
            "kind": MEASURED if suffix else SIMULATED,
            "command": measured.record.command,
        }
        for row in read(measured.frame, suffix.lstrip("_")):
            yield {**of, "n": f"{measured.frame.seed.nunique()} seeds", **row}


def _few(rows: pd.DataFrame, place: str) -> Iterator[Evidence]:
    """HDC less its rival, mean over N."""
    equal = tidy(rows).query("equal")
    by_seed = equal.pivot_table("accuracy", "seed", "model")
    if RIVAL in by_seed:
        value = mean_interval((by_seed["hdc"] - by_seed[RIVAL]).tolist())
        yield {
            "evidence": f"{place or 'touch'}, N up to {equal.n.max()}",
            "value": value,
        }


def _first(rows: pd.DataFrame, place: str) -> Iterator[Evidence]:
    """The N at which one experiment with HDC exceeds 90 %: median and 95 % of experiments."""
    first = first_crossings(rows).query("model == 'hdc'")["first"]
    yield {"evidence": f"{place or 'touch'}, fitted", "value": middle(first),
           "n": f"{len(first)} experiments", "verdict": UNDECIDED}  # fmt: skip


def _contrast(rows: pd.DataFrame, place: str) -> Iterator[Evidence]:
    """Contrast of prototypes less that of the speckle, on samples held out."""
    if "speckle" in set(rows.kind):
        before, after = (
            mean_contrast(rows, k, "held-out")[0] for k in ("speckle", "prototype")
        )
        yield {"evidence": place or "touch", "value": Estimate(after - before),
               "quantity": f"contrast {number(before)} to {number(after)}",
               "verdict": YES if after > before else NO}  # fmt: skip


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
        gained = (part - of_model.query("method == 'stored'").new).dropna()
        if len(gained):
            row = {"evidence": f"{place or 'drift'}, {name}",
                   "quantity": f"gained, to {100 * part.mean():.3g} %",
                   "value": mean_interval(gained.tolist())}  # fmt: skip
            yield row if "p = " in name else {**row, "verdict": UNDECIDED}


def _faults(rows: pd.DataFrame, place: str) -> Iterator[Evidence]:
    """Accuracy lost when one stored bit in 100 is flipped."""
    rows = rows.assign(accuracy=rows.right / rows.n_test)
    for model, kind in (("hdc", "bit_flips"), (RIVAL, "bit_flips_int8")):
        of_model = rows[rows.model == model]
        clean = of_model[of_model.disturbance == "none"].groupby("seed").accuracy.mean()
        flipped = of_model[(of_model.disturbance == kind) & (of_model.level == FLIPPED)]
        lost = (flipped.groupby("seed").accuracy.mean() - clean).dropna()
        if len(lost):
            value = mean_difference(lost.tolist(), float(flipped.n_test.iloc[0]))
            row = {
                "evidence": f"{display_name(model)}, {place or 'touch'}",
                "value": value,
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
        of = {"claim": claim, "evidence": "", "kind": SIMULATED, "quantity": quantity}
        rest = {"unit": unit, "n": None, "rule": rule, "command": f"{RUN}{experiment}"}
        for found in read(results):
            value = found["value"]
            verdict = found.get("verdict") or getattr(rules, rule)(value)
            shown = (
                Estimate(*(100 * bound for bound in value))
                if unit == "points"
                else value
            )
            columns = {
                **of,
                **shown.columns("value"),
                **rest,
                **found,
                "verdict": verdict,
            }
            rows.append({**columns, "value": shown.value})
    return frame(rows)


def verdicts(rows: pd.DataFrame) -> dict[str, str]:
    """The word for each claim: by times as they are, contrast by all evidence, others by the
    measured one first."""
    words = {}
    for claim, part in rows.groupby("claim", sort=False):
        of = {
            kind: part[part.kind == kind].verdict.tolist()
            for kind in (MEASURED, SIMULATED)
        }
        timed = part[part.kind == TIMED].verdict.tolist()
        if timed:
            words[str(claim)] = (
                UNDECIDED if UNDECIDED in timed else rules.combine(timed)
            )
        elif claim == "contrast":
            words[str(claim)] = rules.combine(of[MEASURED] + of[SIMULATED])
        else:
            words[str(claim)] = rules.judge(of[MEASURED], of[SIMULATED])
    return words


def _text(row: Mapping[str, Any]) -> str:
    """A number with its name, its unit and its interval, to two digits."""
    value, name = row["value"], row["evidence"]
    if row["unit"] == "1":  # of a bare number, the quantity has both values
        return f"{name}: {row['quantity']}"
    bounds = [
        value,
        *(row[key] for key in ("value_low", "value_high") if row.get(key) is not None),
    ]
    points = row["unit"] == "points"
    texts = [f"{x:+.{int(abs(x) < 10)}f}" if points else number(x, 2) for x in bounds]
    shown = f"×{texts[0]}" if row["unit"] == "×" else f"{texts[0]} {row['unit']}"
    text = f"{name}: {shown}" + f" [{', '.join(texts[1:])}]" * (len(texts) == 3)
    return text.replace("-", "−")


@STUDY.table(
    "claims",
    title="Verdicts",
    shown=("paper", "verdict", "measured", "simulated"),
    columns={
        "paper": Column("The paper says"),
        "verdict": Column("Verdict", lambda text: text[:1].upper() + text[1:]),
        "measured": Column("Measured frames"),
        "simulated": Column("Simulated frames, fitted to the paper"),
    },
    note="Points: accuracy of HDC less that of softmax regression at its optimum, the primary "
    "rival. ×: training time over HDC's, lowest to highest run. Simulated frames can refute a "
    "claim and rank nothing. The rules are in docs/verdicts.md.",
)
def claims(results: Results) -> pd.DataFrame:
    """One row a claim."""
    every = evidence(results)
    words, table = verdicts(every), []
    for claim, phrases in CLAIMS.items():
        word = words.get(claim, UNDECIDED)
        verdict = ": ".join(filter(None, [word, phrases.get(word)]))
        part = every[(every.claim == claim) & every.value.notna()]
        table.append({
            "claim": claim, "paper": phrases.paper, "word": word, "verdict": verdict,
            **{name: "\n".join(map(_text, records(part[chosen]))) or "–"
               for name, chosen in (("measured", part.kind == MEASURED),
                                    ("simulated", part.kind != MEASURED))},
        })  # fmt: skip
    return pd.DataFrame(table)


STUDY.table(
    "claims_evidence",
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
