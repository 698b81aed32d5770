"""How Table I is shown: heads, cells, and the note below it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

from experiments.reporting.columns import Column, display_name
from experiments.reporting.table import records
from experiments.reporting.text import interval, percent, two_digits
from experiments.studies.table1 import models
from experiments.studies.table1.equal import equal_accuracy
from experiments.studies.table1.rows import AT_PAPERS, OVER_NUMPY, RATIO, table1

# The rules that end a training before its loss has converged.
NOT_FINISHED = ("budget", "steps", "diverged")
NOT_MEASURED = "not measured yet"
Cells = Mapping[str, Any]


def _time(cells: Cells) -> str:
    """Seconds; of a training that never reached 90 %, where it stood."""
    if not cells["seeds"]:
        return NOT_MEASURED
    time = cells["training_time_s"]
    if isinstance(time, str):
        return f"{time}: {percent(cells['train_accuracy_final'])} % in training"
    return two_digits(time)


def _at_papers(cells: Cells) -> str:
    """Test accuracy with its interval, and how many seeds it is of where not all got there."""
    got_there = cells.get("seeds_at_papers")
    if not cells["seeds"] or got_there is None:
        return "–"
    level = cells["published_training_accuracy"]
    if not got_there and level is not None:
        return f"not reached: {percent(cells['train_accuracy_final'])} % in training"
    ends = (percent(cells.get(f"{AT_PAPERS}{end}")) for end in ("", "_low", "_high"))
    text = interval(*ends)
    if got_there and got_there < cells["seeds"]:
        text += f" ({got_there} of {cells['seeds']} seeds)"
    return text


def _at_end(cells: Cells) -> str:
    """Test accuracy at the end of training, and whether the training was finished."""
    low, high = cells["test_accuracy_final_low"], cells["test_accuracy_final_high"]
    text = interval(*map(percent, (cells["test_accuracy_final"], low, high)))
    if any(reason in str(cells["stop"]) for reason in NOT_FINISHED):
        return f"not finished: {text}"
    return text


COLUMNS = {
    "training_time_s": Column(
        "Training time to 90 % (s)",
        cell=_time,
        note="Training time: an iterative model is timed until its training accuracy exceeds 90 % "
        "at a checkpoint, as in the paper; a one-pass model until it is fitted. Times are medians "
        "over seeds.",
    ),
    RATIO: Column(
        "relative to HDC",
        two_digits,
        note="Relative time: median over seeds of the ratio to HDC, trained just before and just "
        "after; its order-statistic interval, of fewer than six seeds the lowest and the highest. "
        "The whole row comes from one source, the runs whose accuracies it shows.",
    ),
    "test_accuracy_at_target": Column("Test accuracy there (%)", percent),
    AT_PAPERS: Column(
        "Test accuracy at the paper's training accuracy (%)",
        percent,
        cell=_at_papers,
        note="Accuracies: mean over seeds; 95 % interval by Student, never narrower than the test "
        "set allows; Wilson for one seed.",
    ),
    "published_training_time_over_hdc": Column("Paper: relative time", two_digits),
    "published_test_accuracy": Column("Paper: accuracy", percent),
}
SHOWN = (
    *("model", "training_time_s", RATIO, "test_accuracy_at_target", AT_PAPERS),
    *("published_training_time_over_hdc", "published_test_accuracy"),
)


def note(lines: pd.DataFrame) -> str:
    """Below Table I: what the paper's training accuracies are, how the models end, and which are
    as accurate as HDC in less time."""
    data = table1(lines)
    rows = [] if data is None else records(data)
    return " ".join(
        [*_papers_levels(), *_ends(rows), *_over_numpy(rows), *_cheaper(lines)]
    )


def _papers_levels() -> Iterator[str]:
    levels = {model: models.papers_training_accuracy(model) for model in models.PAPER}
    known = [f"{display_name(m)} {percent(v)} %" for m, v in levels.items() if v]
    yield f"The paper's training accuracies: {'; '.join(known)}."


def _ends(rows: Sequence[Cells]) -> Iterator[str]:
    ends = [f"{display_name(r['model'])} {_at_end(r)}" for r in rows if r["seeds"]]
    if ends:
        yield f"Test accuracy at the end of training (%): {'; '.join(ends)}."


def _over_numpy(rows: Sequence[Cells]) -> Iterator[str]:
    """The forms of softmax relative to HDC as the paper may have computed it."""
    known = [
        f"{display_name(r['model'])} {two_digits(r[OVER_NUMPY])}"
        for r in rows
        if models.papers_row(r["model"]) == "softmax" and r.get(OVER_NUMPY)
    ]
    if known:
        yield f"Time relative to HDC by numpy.median: {'; '.join(known)}."


def _cheaper(lines: pd.DataFrame) -> Iterator[str]:
    """The baselines that reach HDC's test accuracy sooner than HDC, on all or fewer pixels."""
    data = equal_accuracy(lines)
    rows = [] if data is None else records(data)
    # Times of another machine, which have no ratio, do not compare.
    rows = [line for line in rows if line.get("ratio") is not None]
    of_hdc = [line for line in rows if line["model"] == "hdc"]
    others = [line for line in rows if not line["model"].startswith("hdc")]
    if not of_hdc:
        return
    shortest = min(line["time"] for line in of_hdc)
    cheaper = [_with_pixels(line) for line in others if line["time"] < shortest]
    if cheaper:
        ours = "; ".join(map(_with_pixels, of_hdc))
        yield f"Models as accurate as HDC in less time: {'; '.join(cheaper)}. {ours}."


def _with_pixels(line: Cells) -> str:
    pixels = line["pixels"]
    where = "all pixels" if pixels == "all" else f"{pixels:,} pixels"
    time = f"{two_digits(1e3 * line['time'])} ms"
    return f"{display_name(line['model'])} on {where} {time}"
