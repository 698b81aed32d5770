"""Table I, and error against run time.

Table I and training times that are measured alone rest on other records, and have a file each:
``tables`` and ``times``. ``numpy_hdc`` is a model, and ``cold`` is run as a process of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from experiments.records.results import CHECKPOINTS, RUNS, of_experiment
from experiments.reporting import estimates
from experiments.reporting.columns import Column, display_name
from experiments.reporting.estimates import ONE_SENSOR
from experiments.reporting.study import RUN, Numbers, Quantity, Study
from experiments.reporting.table import ENDS, Table, records
from experiments.reporting.text import counted, number, percent, two_digits
from experiments.reporting.trained import caption
from experiments.studies.table1 import figure, tables, times
from experiments.studies.table1.tables import (
    AT_LEAST,
    AT_PAPERS,
    DISTURBED,
    OVER_NUMPY,
    PAPER,
    RATIO,
)

KEY = ("scene", "model", "n_train", "pixels")
# The rules that end a training before its loss has converged.
NOT_FINISHED = ("budget", "steps", "diverged")
NOT_MEASURED = "not measured yet"
Cells = Mapping[str, Any]


# Cells --------------------------------------------------------------------------------------------


def _time(cells: Cells) -> str:
    """Seconds; of a training that never reached 90 %, how long it was given, and where it stood;
    why they do not count, if something disturbed them."""
    if not cells["seeds"]:
        return NOT_MEASURED
    reason = cells.get(DISTURBED)
    # Of several seeds only how many; the CSV has every reason.
    mark = f" (disturbed: {reason.partition(': ')[0]})" if reason else ""
    if cells["at_least_s"] is not None:
        accuracy = percent(cells["train_accuracy_final"])
        return f"> {number(cells['at_least_s'])}: {accuracy} % in training{mark}"
    return f"{two_digits(cells['training_time_s'])}{mark}"


def _ratio(cells: Cells) -> str:
    """The ratio with its interval; the least that it can be of a training that never got there."""
    if cells.get(AT_LEAST) is not None:
        return f"> {float(two_digits(cells[AT_LEAST])):,g}"
    return Column("", two_digits).text(RATIO, cells)


def _at_papers(cells: Cells) -> str:
    """Test accuracy with its interval, and how many seeds it is of where not all got there."""
    got_there = cells.get("seeds_at_papers")
    if not cells["seeds"] or got_there is None:
        return "–"
    level = cells["published_training_accuracy"]
    if not got_there and level is not None:
        return f"not reached: {percent(cells['train_accuracy_final'])} % in training"
    text = Column("", percent).text(AT_PAPERS, cells)
    if got_there and got_there < cells["seeds"]:
        text += f" ({got_there} of {cells['seeds']} seeds)"
    return text


def _at_end(cells: Cells) -> str:
    """Test accuracy at the end of training, and whether the training was finished."""
    text = Column("", percent).text("test_accuracy_final", cells)
    if any(reason in str(cells["stop"]) for reason in NOT_FINISHED):
        return f"not finished: {text}"
    return text


def note(data: pd.DataFrame) -> str:
    """Below Table I: what the paper's training accuracies are, how the models end, and the forms of
    softmax relative to HDC as the paper may have computed it."""
    rows = records(data)
    levels = [(model, tables.papers_training_accuracy(model)) for model in PAPER]
    softmax = [r for r in rows if tables.papers_row(r["model"]) == "softmax"]
    told = {
        "The paper's training accuracies": [
            f"{display_name(model)} {percent(level)} %"
            for model, level in levels
            if level
        ],
        "Test accuracy at the end of training (%)": [
            f"{display_name(r['model'])} {_at_end(r)}" for r in rows if r["seeds"]
        ],
        "Time relative to HDC by numpy.median": [
            f"{display_name(r['model'])} {two_digits(r[OVER_NUMPY])}"
            for r in softmax
            if r.get(OVER_NUMPY)
        ],
    }
    return " ".join(f"{of}: {'; '.join(known)}." for of, known in told.items() if known)


def or_never(value: float) -> str:
    """A time or a ratio; infinite where a model never got there."""
    return number(value) if np.isfinite(value) else "never"


def cheaper(data: pd.DataFrame) -> str:
    """The rule of the table, and the baselines that are as accurate as HDC sooner than HDC, on all
    or fewer pixels."""
    rule = (
        "Rule: a model is as accurate as HDC at its first report of at least the test accuracy "
        "that HDC of the same seed ends with; never, if it stops before. One-pass models report "
        "when they are fitted. × HDC: relative to HDC that was trained just before and just "
        "after; where none was, to its run of the same seed on the same machine. Median [lowest, "
        "highest] over seeds. Fewer pixels: the fewest with which every seed gets there."
    )
    known = data.dropna(subset="ratio")  # times of another machine do not compare
    if DISTURBED in known:
        known = known[known[DISTURBED].isna()]
    is_hdc = known.model.str.startswith("hdc")
    of_hdc = known[known.model == "hdc"]
    sooner = known[~is_hdc & (known.time < of_hdc.time.min())]
    if not len(sooner):
        return rule
    names = "; ".join(map(_with_pixels, records(sooner)))
    ours = "; ".join(map(_with_pixels, records(of_hdc)))
    return f"{rule} As accurate as HDC in less time: {names}. {ours}."


def _with_pixels(line: Cells) -> str:
    pixels = line["pixels"]
    where = "all pixels" if pixels == "all" else f"{pixels:,} pixels"
    time = f"{two_digits(1e3 * line['time'])} ms"
    return f"{display_name(line['model'])} on {where} {time}"


# Numbers of the paper -----------------------------------------------------------------------------


def quantities(frame: pd.DataFrame) -> Iterator[Quantity]:
    """Times and accuracies of Table I, in seconds and percent, and the learning rate."""
    every = tables.table1(frame)
    runs = tables.on_scene(of_experiment(frame, RUNS))
    rows = records(every) if every is not None else []
    alone = records(times.times(frame))
    for line in rows:
        model = line["model"]
        if line["seeds"] and model in PAPER:
            own = runs[runs.model == model]
            yield from _of_model(line, own)
            if model != "hdc":
                timed = [each for each in alone if each["model"] == model]
                yield from _ratios(line, own, timed[:1])  # by the fewest threads
    yield from _learning_rate(runs[runs.model.isin(PAPER)])


def _of_model(line: Cells, own: pd.DataFrame) -> Iterator[Quantity]:
    name, n_runs = f"table1/{line['model']}", line["seeds"]
    about: dict[str, Any] = {
        "seeds": n_runs,
        "made_by": " && ".join(dict.fromkeys(own.command)),
    }
    note = (
        f"median; {line['cpu']}, {counted(line['threads'], 'thread')}; paper: Apple M1"
    )
    time = line["training_time_s"]
    if line["at_least_s"] is not None:
        time = f"> {number(line['at_least_s'])}"
    yield Quantity(f"{name}_training_time", time, n=n_runs, note=note, **about)
    if line["model"] == "hdc":
        share, n = estimates.share_of_one_sensor(own), line["n_test"]
        yield Quantity.of(f"{name}_test_accuracy", share, ONE_SENSOR, 100, n=n, **about)
        classes = line["n_classes"]
        yield Quantity("touch/labels", classes, made_by=f"{RUN}table1")
        return
    for kind, called, n in (
        ("train", "training", line["n_train"] * n_runs),
        ("test", "test", line["n_test"]),
    ):
        best = line[f"{kind}_accuracy_max"]
        final = line[f"{kind}_accuracy_final"]
        if best is not None:
            note = f"maximum of a run, as published; {100 * final:.4g} % at its end"
            told = {"n": n, "note": note, **about}
            yield Quantity(f"{name}_{called}_accuracy", 100 * best, **told)


def _learning_rate(runs: pd.DataFrame) -> Iterator[Quantity]:
    """That of the iterative models, where it is one."""
    rates = runs["model.lr"].dropna().unique() if "model.lr" in runs else []
    if len(rates) == 1:
        yield Quantity(
            "table1/learning_rate",
            float(rates[0]),
            note="softmax and CNNs",
            made_by=f"{RUN}table1",
        )


def _ratios(line: Cells, own: pd.DataFrame, timed: list[Any]) -> Iterator[Quantity]:
    """Training time relative to HDC, of the runs of Table I and of fits that are timed alone."""
    name = f"table1/{line['model']}_time_over_hdc"
    note = "" if line["model"] == "softmax" else "the network's sizes are ours"
    if line.get(RATIO) is not None:
        ratio, low, high = (line[f"{RATIO}{end}"] for end in ENDS)
        yield Quantity(
            name,
            ratio,
            low,
            high,
            "median over runs" if low is not None else "",
            "by default",
            n=len(own.dropna(subset="beside.hdc_s")),
            made_by=own.command.iloc[0],
            note=note,
        )
    for fits in timed:
        ratio, low, high = (fits.get(f"over_hdc{end}") for end in ENDS)
        yield Quantity(
            name,
            ratio,
            low,
            high,
            "measurements" if low is not None else "",
            f"fits, {counted(fits['threads'], 'thread')}",
            n=fits["fits"] - fits["disturbed"],
            made_by=f"{RUN}{times.NAME}",
            note=note,
        )


TABLE1 = Table(
    "table1",
    tables.table1,
    of=tables.OF,
    key=KEY,
    title=lambda data: caption(data, "Table I, published and measured"),
    note=note,
    shown=(
        *("model", "training_time_s", RATIO, "test_accuracy_at_target", AT_PAPERS),
        *("published_training_time_over_hdc", "published_test_accuracy"),
    ),
    columns={
        "training_time_s": Column(
            "Training time to 90 % (s)",
            cell=_time,
            note="Training time: an iterative model is timed until its training accuracy exceeds "
            "90 % at a checkpoint, as in the paper; a one-pass model until it is fitted. Times are "
            "medians over seeds.",
            of_machine=True,
        ),
        RATIO: Column(
            "relative to HDC",
            two_digits,
            cell=_ratio,
            note="Relative time: median over seeds of the ratio to HDC, trained just before and "
            "just after; its order-statistic interval, of fewer than six seeds the lowest and the "
            "highest. The whole row comes from one source, the runs whose accuracies it shows.",
        ),
        "test_accuracy_at_target": Column("Test accuracy there (%)", percent),
        AT_PAPERS: Column(
            "Test accuracy at the paper's training accuracy (%)",
            percent,
            cell=_at_papers,
            note="Accuracies: mean over seeds; 95 % interval by Student, never narrower than the "
            "test set allows; Wilson for one seed.",
        ),
        "published_training_time_over_hdc": Column(
            "Paper: relative time", "{:.0f}".format
        ),
        "published_test_accuracy": Column("Paper: accuracy", percent),
    },
    commands=[f"{RUN}table1", f"{RUN}table1_descent"],
)
EQUAL = Table(
    "equal_accuracy",
    tables.equal_accuracy,
    of=tables.OF,
    key=("model", "pixels"),
    title="Time to reach the test accuracy of HDC",
    note=cheaper,
    columns={
        "time": Column(
            "Time to the test accuracy of HDC, s", or_never, of_machine=True
        ),
        "ratio": Column("× HDC", or_never),
    },
    commands=[f"{RUN}table1", f"{RUN}table1_extended", f"{RUN}accuracy_vs_d"],
)
STUDY = Study(
    "table1",
    "Table I",
    "Is HDC more accurate than softmax regression and convolutional networks, and does it "
    "train in a hundredth of their time? Five labels, N = 400.",
    order=1,
    front=True,
    tables=[times.TABLE, TABLE1, EQUAL, times.BUSY_TABLE],
    figures=[figure.FIGURE],
    numbers=[Numbers(quantities, of=(RUNS, CHECKPOINTS, times.NAME))],
)
