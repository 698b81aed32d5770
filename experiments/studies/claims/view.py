"""The paper's claims and ours, judged by the frozen rules: the word, the number across sensors, and
the evidence behind it.

Each module of this folder reads the records of one study and gives pieces of evidence;
:mod:`.verdict` joins them, :mod:`.rules` has the words. The rules as data are in rules.yaml.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import pandas as pd

from experiments.records.results import RUNS, once
from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.study import Study
from experiments.reporting.table import Table
from experiments.reporting.table import frame as table_of
from experiments.reporting.text import two_digits
from experiments.studies.claims import (
    contest,
    contrast,
    faults,
    recalibration,
    recordings,
    times,
)
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import (
    Claim,
    Rules,
    commit,
    digest,
    rules,
)
from experiments.studies.claims.piece import (
    CONFIRMATORY,
    EXPLORATORY,
    Piece,
)
from experiments.studies.claims.rules import UNDECIDED
from experiments.studies.claims.verdict import (
    Verdict,
    settled,
    verdict,
)

COMMAND = "python -m experiments.reproduce --full --claim"
Row = Mapping[str, Any]
Read = Callable[[str, Claim, Rules, Evidence], Iterator[Piece]]
# By the experiment whose records are the evidence.
READ: Mapping[str, Read] = {
    "recordings": recordings.pieces,
    "times_grid": times.pieces,
    "correlation": contrast.pieces,
    "drift": recalibration.pieces,
    "robustness": faults.pieces,
}


@once
def every_piece(frame: pd.DataFrame) -> list[Piece]:
    """All evidence, in the order of the claims."""
    frozen = rules()
    found: list[Piece] = []
    if not len(frame):
        return found
    evidence = Evidence(frame)
    for name, claim in frozen.claims.items():
        pieces = READ[claim.experiment](name, claim, frozen, evidence)
        found += [settled(piece, claim) for piece in pieces]
    return found


def by_rival(pieces: Iterable[Piece]) -> dict[Any, list[Piece]]:
    """Pieces by claim and baseline."""
    found: dict[Any, list[Piece]] = {}
    for piece in pieces:
        found.setdefault((piece.claim, piece.rival), []).append(piece)
    return found


def judged(
    frame: pd.DataFrame,
) -> Iterator[tuple[str, str, Verdict, list[Piece]]]:
    """Claim, baseline, verdict and pieces."""
    frozen = rules()
    for (name, rival), pieces in by_rival(every_piece(frame)).items():
        found = verdict(frozen.claims[name], pieces, frozen)
        if found is not None:
            yield name, rival, found, pieces


def _row(name: str, rival: str, found: Verdict, pieces: list[Piece]) -> dict[str, Any]:
    """A row of the table of claims."""
    claim = rules().claims[name]
    deciding = found.decided_by or pieces
    statuses = {piece.status for piece in deciding}
    where = dict.fromkeys(piece.record for piece in deciding if piece.record)
    return {
        "claim": name,
        "says": claim.paper or claim.ours,
        "by": "the paper" if claim.paper else "this repository",
        "rival": rival,
        **found.columns(pieces[0]),
        "by_scene": _by_scene(found) if claim.rule == "sharper" else "",
        "status": CONFIRMATORY if statuses == {CONFIRMATORY} else EXPLORATORY,
        "record": "; ".join(where),
        "command": f"{COMMAND} {name}",
        "rules": rules().version,
        "frozen": commit(),
        "digest": digest(),
    }


def _by_scene(found: Verdict) -> str:
    """Numbers behind a rule on the verdicts of scenes: each scene's number with its interval."""
    parts = []
    for piece in found.decided_by:
        shown = _with_unit(piece.row(), "value")
        parts.append(f"{scene_name(piece.evidence)}: {shown}")
    return "; ".join(parts)


# How cells are shown ------------------------------------------------------------------------------


def rival_name(rival: str) -> str:
    """The baseline of a claim, in words."""
    model, at, level = rival.partition(" at ")
    known = {
        "published": "the paper's accuracy",
        "unflipped": "itself without flips",
        "hypervector": "hypervectors",
        "speckle": "the speckle",
        "softmax_dual_int8": f"{display_name('softmax_dual')}, weights of 8 bits",
    }
    return f"{known.get(model) or display_name(model)}{at}{level}"


def _digits(row: Row, key: str) -> str:
    """A number of a row to two digits, points with their sign; nothing where it is unknown."""
    value = row.get(key)
    if value is None or value != value:
        return ""
    text = two_digits(value)
    if row["unit"] == "points" and value != 0:
        decimals = 1 if abs(value) < 10 else 0
        text = f"{value:+.{decimals}f}"
    return text.replace("-", "−")


def _with_unit(row: Row, name: str) -> str:
    """``value unit [low, high]`` of a row."""
    value, low, high = (_digits(row, f"{name}{end}") for end in ("", "_low", "_high"))
    if not value:
        return "–"
    units = {"×": f"×{value}", "1": value}
    shown = units.get(row["unit"], f"{value} {row['unit']}")
    return f"{shown} [{low}, {high}]" if low and high else shown


def _number(row: Row) -> str:
    """The mean with its interval; where the rule takes none, the numbers of scenes."""
    return row.get("by_scene") or _with_unit(row, "mean")


def _range(row: Row) -> str:
    """The range for the sensor of another laboratory."""
    low, high = _digits(row, "predicted_low"), _digits(row, "predicted_high")
    return f"{low} to {high} {row['unit']}" if low and high else "–"


# What the readings of rules 3 make of a verdict by the rules of version 2.
READ_AS = {"recalibration": UNDECIDED}


def _word(row: Row) -> str:
    """The verdict; where rules 3 read it otherwise, theirs first."""
    word: str = row["word"]
    read: str = READ_AS.get(row["claim"], word)
    shown = read[:1].upper() + read[1:]
    return shown if read == word else f"{shown} (rules 2: {word})"


COLUMNS = {
    "says": Column("Claim"),
    "rival": Column("Held against", rival_name),
    "word": Column("Verdict", cell=_word),
    "mean": Column("Number [95 %]", cell=_number),
    "equal": Column("Equal weights", cell=lambda row: _with_unit(row, "equal")),
    "predicted": Column("New sensor, 95 %", cell=_range),
    "frames": Column("Frames"),
    "command": Column("Command"),
}
SHOWN = (
    *("says", "rival", "word"),
    *("mean", "equal", "predicted", "frames", "command"),
)
NOTE = (
    "Points: accuracy of HDC minus that of the baseline, mean over laboratories (random "
    "effects), with the interval of the mean and the range for a sensor of another "
    "laboratory; bounds end where the difference does: at ±100 points, and at 0 against "
    "the paper's 100 %. Equal weights: a laboratory is one value, Student; they decide nothing "
    "here, and README calls a yes undecided that they do not bear out. One laboratory has the "
    "normal interval, and Student's over seeds in the table of evidence. ×: training time "
    "relative to HDC in the same "
    "implementation, the one with the least ratio. %: share of the loss by drift that "
    "came back. Contrast: of prototypes minus that of hypervectors or speckle, for each "
    "scene over seeds; its rule joins the verdicts of scenes and takes no mean."
)
SEEN = (
    "Verdicts are exploratory: numbers of most of these recordings were known when the rules "
    "were written."
)
FEW = 5  # frames per class: N = 25 of the paper's five labels
LEVEL = 0.9  # accuracy that the paper exceeds once N > 20


def _note(lines: pd.DataFrame) -> str:
    """How to read the verdicts on all recordings, and how rules 3 read some of them."""
    readings = (f"{name}: {text}." for name, text in contest.rules().readings.items())
    read = " ".join(["Rules 3 add how some are read.", *readings])
    return " ".join([NOTE, SEEN, *_papers_sentence(lines), read, _rules_named()])


def _papers_sentence(lines: pd.DataFrame) -> Iterator[str]:
    """On how many recordings published HDC is as accurate as the paper says of few samples."""
    frozen, evidence = rules(), Evidence(lines)
    experiment = frozen.claims["few_samples"].experiment
    every, form = evidence.accuracies(experiment), frozen.forms["published"]
    found = [
        every[scene].mean(form, FEW).value
        for scene, rows in evidence.scenes(experiment).items()
        if scene in frozen.recordings
        and recordings.is_split(rows, frozen.recordings[scene])
    ]
    known = [value for value in found if not math.isnan(value)]
    if known:
        above = sum(value > LEVEL for value in known)
        yield (
            f"With {FEW} frames per class published HDC exceeds {100 * LEVEL:g} % on {above} of "
            f"{len(known)} recordings."
        )


def _rules_named() -> str:
    """The version, the digest and the commit of the rules."""
    frozen = rules()
    named = f", frozen by commit {commit()}" if commit() else ""
    version = f"version {frozen.version} of {frozen.dated}"
    return f"Rules: docs/claims.md, {version}, digest {digest()}{named}."


def claims(frame: pd.DataFrame) -> pd.DataFrame | None:
    """One row per claim and baseline, of all recordings that the rules list."""
    return _table([_row(*line) for line in judged(frame)])


def evidence(frame: pd.DataFrame) -> pd.DataFrame | None:
    """One row per claim, baseline and recording, scene or implementation."""
    return _table([piece.row() for piece in every_piece(frame)])


def _table(rows: list[dict[str, Any]]) -> pd.DataFrame | None:
    return table_of(rows) if rows else None


OF = (*READ, RUNS)
STUDY = Study(
    "claims",
    "The paper's claims",
    "Which claims of the paper hold on captured, computed and simulated frames? Captured: "
    "by a camera; computed: from measured matrices of a fibre.",
    0,
    front=True,
    tables=[
        Table(
            "claims",
            claims,
            of=OF,
            title="Verdicts",
            shown=SHOWN,
            columns=COLUMNS,
            key=("claim", "rival"),
            note=_note,
            commands=[COMMAND],
        ),
        Table(
            "claims_evidence",
            evidence,
            of=OF,
            key=("claim", "rival", "evidence"),
            title="Evidence for each claim",
            shown=(
                "claim",
                "rival",
                "evidence",
                "frames",
                "quantity",
                "value",
                "word",
                "remark",
            ),
            columns={
                "rival": COLUMNS["rival"],
                "evidence": Column("Recording, scene or implementation", scene_name),
                "value": Column(
                    "Number [of this sensor]", cell=lambda r: _with_unit(r, "value")
                ),
                "n": Column("n"),
                "word": Column("Of this sensor", lambda word: word or "–"),
                "remark": Column("Remark", lambda text: text or "–"),
            },
            note="Brackets are of one sensor: the central 95 % of draws for a recording by a "
            "camera, none of fewer than ten, Student over seeds for others. They say nothing of "
            "another sensor.",
            commands=[COMMAND],
        ),
        contest.TABLE,
    ],
)
