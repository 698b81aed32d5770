"""Table I, and error against run time.

Table I and training times that are measured alone rest on other records, and have a file each:
``tables`` and ``times``. ``cold`` is run as a process of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from experiments.records.results import RUNS
from experiments.reporting import estimates
from experiments.reporting.columns import Column, display_name
from experiments.reporting.study import RUN, Quantity, Study
from experiments.reporting.table import Table, records
from experiments.reporting.text import number, percent, two_digits
from experiments.reporting.trained import caption
from experiments.studies.table1 import figure, tables, times
from experiments.studies.table1.tables import (
    AT_LEAST,
    AT_PAPERS,
    DISTURBED,
    PAPER,
    RATIO,
)

KEY = ("scene", "model", "n_train", "pixels")
# The rules that end a training before its loss has converged.
NOT_FINISHED = ("budget", "steps", "diverged")
Cells = Mapping[str, Any]


# Cells --------------------------------------------------------------------------------------------


def _time(cells: Cells) -> str:
    """Seconds; of a training that never reached 90 %, how long it was given, and where it stood;
    why they do not count, if something disturbed them."""
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
    got_there = cells["seeds_at_papers"]
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
    """Below Table I: what the paper's training accuracies are, and how the models end."""
    levels = [
        f"{display_name(model)} {percent(level)} %"
        for model in PAPER
        if (level := tables.papers_training_accuracy(model))
    ]
    ends = [f"{display_name(row['model'])} {_at_end(row)}" for row in records(data)]
    return (
        f"The paper's training accuracies: {'; '.join(levels)}. "
        f"Test accuracy at the end of training (%): {'; '.join(ends)}."
    )


def quantities(runs: pd.DataFrame) -> Iterator[Quantity]:
    """The test accuracy of HDC."""
    own = tables.on_scene(runs[runs.model == "hdc"])
    if len(own):
        share = estimates.share_of_one_sensor(own)
        yield Quantity(
            "table1/hdc_test_accuracy", share, int(own.n_test.sum()), len(own)
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
STUDY = Study(
    "table1",
    "Table I",
    "Is HDC more accurate than softmax regression and convolutional networks, and does it "
    "train in a hundredth of their time? Five labels, N = 400.",
    order=1,
    front=True,
    tables=[times.TABLE, TABLE1, times.BUSY_TABLE],
    figures=[figure.FIGURE],
    numbers={RUNS: quantities, times.NAME: times.quantities},
)
