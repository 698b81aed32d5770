"""Claims, the paper's and ours, and their verdicts.

rules_4.yaml is judged on the records that there are. history.csv has the verdicts of rules 1 to 3,
as they were judged last: the words, the numbers, the digest of each version's rules, and the commit
whose code judged. rules.yaml, rules_3.yaml and, with the words of rules 1, earlier.yaml are what
that code read.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.records.results import of_experiment
from experiments.reporting.columns import Column, display_name
from experiments.reporting.study import Study
from experiments.reporting.table import Table
from experiments.reporting.text import two_digits
from experiments.studies.claims import forest, judge
from experiments.studies.claims.findings import Line
from experiments.studies.claims.rules import RULES, read
from experiments.studies.drift import numbers as drift

HISTORY = Path(__file__).with_name("history.csv")
COMMAND = "python -m experiments.reproduce --claim NAME"
Row = Mapping[str, Any]


def verdicts(frame: pd.DataFrame) -> pd.DataFrame:
    """The verdicts of rules 4 on the lines of the experiments of :data:`VERDICTS`."""
    recalibrated = of_experiment(frame, "drift")
    if len(recalibrated):
        others = frame[frame.experiment != "drift"]
        frame = pd.concat([others, drift.accuracies(recalibrated)], ignore_index=True)
    return judge.judge(read(RULES), frame)


def shown_word(row: Row) -> str:
    """The verdict of rules 4 in words; what leaves it open."""
    word = WORDS.get(row["word"]) or display_name(row["word"])
    return f"{word}: {row['why']}" if row["why"] else word


def size(row: Row) -> str:
    """Frames per class, and whether only unseen recordings count."""
    unseen = ", unseen data sets" if row["status"] == "confirmatory" else ""
    return f"{row['size']}{unseen}"


def with_unit(row: Row, name: str) -> str:
    """``value unit [low, high]`` of a row."""
    if row[name] is None:
        return "–"
    cell, unit = Line(row)[name], row["unit"]
    texts = {"points": f"{cell:points interval}", "×": f"×{cell:two interval}"}
    return texts.get(unit) or f"{cell:two interval} {unit}"


def frozen(_: pd.DataFrame) -> pd.DataFrame:
    """The last verdicts by rules 2 and 3 over all recordings, but of those whose interval is all
    that a difference can be."""
    every = pd.read_csv(HISTORY, dtype={"frozen": str, "digest": str, "judged": str})
    says_nothing = (every.mean_low <= -100) & (every.mean_high >= 0)
    return every[every.recording.isna() & (every.rules > 1) & ~says_nothing]


WORDS = {judge.YES: "holds", judge.NO: "does not hold", judge.OPEN: "open"}
VERDICTS = Table(
    "verdicts",
    verdicts,
    of=("recordings", "robustness", "drift", "times"),
    key=("claim", "size", "status", "rival"),
    title="Verdicts by rules 4",
    note="Points: accuracy of the form minus that of what it is held against, mean over sources by "
    "a hierarchical model, with its 95 % interval. Holds: the loss is below 3 points with a "
    "probability of at least 95 %; does not hold: of at most 5 %; otherwise open, with the reason "
    "where something was not measured or was disturbed. Equal weights: each source is one value, "
    "Student. ×: ratio of training times by one thread, with the range of medians and minima of "
    "both measurements; holds: all are at least 10. Exploratory data sets were known when the "
    "rules were written; unseen data sets were not.",
    columns={
        "says": Column("Claim"),
        "rival": Column("Held against", display_name),
        "size": Column("Frames per class", cell=size),
        "word": Column("Verdict", cell=shown_word),
        "mean": Column("Number [95 %]", cell=lambda row: with_unit(row, "mean")),
        "equal": Column("Equal weights", cell=lambda row: with_unit(row, "equal")),
        "probability": Column("P(loss < 3 points)", two_digits),
        "claim": Column("Name"),
    },
    shown=("says", "rival", "size", "word", "mean", "equal", "probability", "claim"),
)
CLAIMS = Table(
    "claims",
    frozen,
    of="recordings",
    key=("rules", "claim", "rival"),
    title="Verdicts by rules 2 and 3, frozen",
    note="Points: accuracy of HDC minus that of the baseline, mean over sources (random effects), "
    "with the interval of the mean. ×: training time relative to HDC in the same implementation, "
    "the one with the least ratio. %: share of the loss by drift that came back. Contrast: of "
    "prototypes minus that of hypervectors or speckle, for each scene over seeds.",
    columns={
        "says": Column("Claim"),
        "rival": Column("Held against", display_name),
        "word": Column("Verdict"),
        "read_as": Column("Read by rules 3 as"),
        "mean": Column(
            "Number [95 %]", cell=lambda row: row["by_scene"] or with_unit(row, "mean")
        ),
        "claim": Column("Name"),
    },
    shown=("says", "rival", "rules", "word", "read_as", "mean", "frames", "claim"),
    commands=[COMMAND],
)
STUDY = Study(
    "claims",
    "The paper's claims",
    "Which claims of the paper hold on captured, computed and simulated frames? Captured: "
    "by a camera; computed: from measured matrices of a fibre.",
    0,
    front=True,
    tables=[VERDICTS, CLAIMS],
    figures=[forest.FIGURE],
)
