"""Claims, the paper's and ours, and their verdicts.

rules_4.yaml is judged on the records that there are. history.csv has the verdicts of rules 1 to 3,
as they were judged last: the words, the numbers, the digest of each version's rules, and the commit
whose code judged. rules.yaml, rules_3.yaml and, with the words of rules 1, earlier.yaml are what
that code read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pandas as pd

from experiments.records.results import of_experiment
from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.study import Study
from experiments.reporting.table import Table
from experiments.reporting.text import two_digits
from experiments.studies.claims import forest, judge
from experiments.studies.claims.history import frozen
from experiments.studies.claims.rules import RULES, read
from experiments.studies.drift import numbers as drift

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


def rival_name(rival: str) -> str:
    """The model or number that HDC was compared with, in words."""
    model, at, level = rival.partition(" at ")
    known = {
        "published": "the paper's accuracy",
        "unflipped": "itself without flips",
        "hypervector": "hypervectors",
        "speckle": "the speckle",
    }
    return f"{known.get(model) or display_name(model)}{at}{level}"


def word(row: Row) -> str:
    """The verdict with the version of its rules; where it was read otherwise later, that first."""
    said, read = row["word"], row["read_as"]
    by_rules = f"rules {row['rules']}"
    if read != said:
        by_rules += f": {said}"
    return f"{read.capitalize()} ({by_rules})"


def number(row: Row) -> str:
    """The mean with its interval; where the rule takes none, the numbers of scenes."""
    return row["by_scene"] or with_unit(row, "mean")


def _digits(row: Row, key: str) -> str:
    """A number of a row to two digits, points with their sign; nothing where it is unknown."""
    value = row.get(key)
    if value is None:
        return ""
    text = two_digits(value)
    if row["unit"] == "points" and value != 0:
        decimals = 1 if abs(value) < 10 else 0
        text = f"{value:+.{decimals}f}"
    return text.replace("-", "−")


def with_unit(row: Row, name: str) -> str:
    """``value unit [low, high]`` of a row."""
    value, low, high = (_digits(row, f"{name}{end}") for end in ("", "_low", "_high"))
    if not value:
        return "–"
    units = {"×": f"×{value}", "1": value}
    shown = units.get(row["unit"], f"{value} {row['unit']}")
    return f"{shown} [{low}, {high}]" if low and high else shown


def _frames(row: Row) -> str:
    """Kinds of the frames that decided; of one recording, its name."""
    scene = row["recording"]
    return f"{row['frames']}: {scene_name(scene)}" if scene else row["frames"]


NOTE = (
    "Points: accuracy of HDC minus that of the baseline, mean over sources (random "
    "effects), with the interval of the mean; bounds end where the difference does: at ±100 "
    "points, and at 0 against the paper's 100 %. Equal weights: a source is one value, Student; a "
    "yes that they do not bear out is read as undecided. One data set: unseen when its rules were "
    "written, with the interval of its own resamples. ×: training time relative to HDC in the same "
    "implementation, the one with the least ratio. %: share of the loss by drift that came back. "
    "Contrast: of prototypes minus that of hypervectors or speckle, for each scene over seeds."
)


def _note(data: pd.DataFrame) -> str:
    """How to read the verdicts, how rules 3 read some of rules 2, and what judged them."""
    parts = [NOTE, "Rules 3 add how some are read."]
    read = data.dropna(subset="reading").drop_duplicates("claim")
    parts += [f"{row.claim}: {row.reading}." for row in read.itertuples()]
    for row in data.drop_duplicates("rules").itertuples():
        frozen = f", frozen by commit {row.frozen}" if pd.notna(row.frozen) else ""
        parts.append(
            f"Rules {row.rules} of {row.dated}, digest {row.digest}{frozen}, judged last by the "
            f"code of commit {row.judged[:12]}."
        )
    return " ".join(parts)


def current(table: Table) -> Table:
    """The verdicts across recordings by rules that no others replaced."""
    data = table.data
    return replace(table, data=data[data.recording.isna() & (data.rules > 1)])


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
    lambda _: frozen(),
    of="recordings",
    key=("rules", "claim", "rival", "recording"),
    title="Verdicts by rules 1 to 3, frozen",
    note=_note,
    columns={
        "says": Column("Claim"),
        "rival": Column("Held against", rival_name),
        "word": Column("Verdict", cell=word),
        "mean": Column("Number [95 %]", cell=number),
        "equal": Column("Equal weights", cell=lambda row: with_unit(row, "equal")),
        "frames": Column("Frames", cell=_frames),
        "claim": Column("Name"),
    },
    shown=("says", "rival", "word", "mean", "equal", "frames", "claim"),
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
