"""Tables of training times: the medians of the fits that nothing disturbed, relative to HDC."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from experiments.records.results import of_experiment, own_frames
from experiments.reporting.columns import Column, display_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.study import RUN
from experiments.reporting.table import Table, records
from experiments.reporting.table import frame as table_of
from experiments.reporting.text import number, percent, two_digits
from experiments.reporting.trained import same

NAME, BUSY = "times", "times_busy"
SLOWEST = "cnn3"  # the model of which a fit takes minutes
RATIOS = {"over_hdc": "hdc", "over_compiled": "hdc_compiled"}
Line = Mapping[str, Any]


def times(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each model and number of threads.

    ``fit_s``, ``least_s`` and ``cpu_s`` are the median and the least time of the undisturbed fits,
    and the median of the processor's; ``cold_s`` that of a process of its own. A ratio is that of
    medians of one measurement, ``least_…`` that of minima; of several measurements the geometric
    mean, from the lowest to the highest.
    """
    every = own_frames(of_experiment(frame, NAME))
    rows = []
    for (model, threads), lines in every.groupby(["model", "threads"], sort=False):
        fits = lines[~lines.cold]
        undisturbed = fits[fits.disturbed == ""]
        row = {"model": model, "threads": threads} | {
            "fit_s": undisturbed.fit_s.median(),
            "least_s": undisturbed.fit_s.min(),
            "cpu_s": undisturbed.cpu_s.median(),
            "train_accuracy": fits.train_accuracy.mean(),
            "fits": len(fits),
            "disturbed": len(fits) - len(undisturbed),
            "measurements": lines.record.nunique(),
            "cpu": same(lines.cpu),
            "cold_s": lines.fit_s[lines.cold].median(),
        }
        rows.append(row | dict(_ratios(every, model, threads)))
    return table_of(rows)


def _ratios(every: pd.DataFrame, model: str, threads: int) -> Iterator[Any]:
    """Ratios to each form of HDC by as many threads, over the measurements that have both."""
    fits = every[(every.threads == threads) & ~every.cold & (every.disturbed == "")]
    by_record = fits.groupby(["model", "record"]).fit_s
    for kind, seconds in (("", by_record.median()), ("least_", by_record.min())):
        by_model = seconds.unstack("model")
        for name, hdc in RATIOS.items():
            if not {model, hdc} <= set(by_model):
                continue
            ratios = (by_model[model] / by_model[hdc]).dropna()
            if len(ratios):
                mean = float(np.exp(np.log(ratios).mean()))
                ends = [ratios.min(), ratios.max()] if len(ratios) > 1 else []
                yield from Estimate(mean, *ends).columns(f"{kind}{name}").items()


def busy(frame: pd.DataFrame) -> pd.DataFrame:
    """Medians beside processes that keep ``busy`` cores busy: a row for each model and number of
    threads, with the measured load, and by how much the ratio to HDC is inflated."""
    lines = own_frames(of_experiment(frame, BUSY))
    keys = ["threads", "busy", "model"]
    load = [name for name in lines if name.startswith("yardstick_")]
    table = lines.groupby(keys)[["others", *load, "fit_s", "cpu_s"]].median()
    is_hdc = table.index.get_level_values("model") == "hdc"
    hdc = table.fit_s[is_hdc].droplevel("model")
    table["over_hdc"] = table.fit_s / hdc.reindex(table.index.droplevel("model")).values
    quiet = table.over_hdc.groupby(["threads", "model"]).transform("first")
    table["inflation"] = table.over_hdc / quiet
    return table.reset_index()


# Shown --------------------------------------------------------------------------------------------


def _ratio(name: str) -> Column:
    """A ratio of medians, and that of minima in brackets behind it."""

    def cell(line: Line) -> str:
        text = Column("", two_digits).text(name, line)
        least = line.get(f"least_{name}")
        return text if least is None else f"{text} (minima {two_digits(least)})"

    return Column(f"Relative to {display_name(RATIOS[name])}", cell=cell)


def _fits(line: Line) -> str:
    disturbed = f", {line['disturbed']} disturbed" if line["disturbed"] else ""
    return f"{line['fits']}{disturbed}"


def note(data: pd.DataFrame) -> str:
    """The rules of the clock, and the times of processes of their own."""
    cold = [
        f"{display_name(line['model'])} {two_digits(line['cold_s'])} s"
        for line in records(data)
        if line["threads"] == 1 and line["cold_s"] is not None
    ]
    slowest = data.threads[data.model == SLOWEST]
    by_two = (
        "; three layers are timed by two threads only" if set(slowest) == {2} else ""
    )
    rules = (
        "The clock counts what a model does until its training accuracy exceeds 90 % (one that "
        "learns in one pass or is solved: until it is done); it stops while frames are made and "
        "while the model is tested. Each model learns noise before, so that the clock counts no "
        "loading and no compiling. Medians of fits that nothing else on the machine disturbed; a "
        "ratio of two measurements is their geometric mean [lower, higher]. HDC by NumPy computes "
        f"with one thread whatever it is given{by_two}."
    )
    if not cold:
        return rules
    return (
        f"{rules} In a process of its own, from its start with reading the frames and without a "
        f"pause, by one thread: {'; '.join(cold)}."
    )


TABLE = Table(
    NAME,
    times,
    of=NAME,
    key=("model", "threads"),
    title=lambda data: f"Training times on the frames of Table I, {data.cpu.iloc[0]}",
    note=note,
    shown=(
        *("model", "threads", "fit_s", "cpu_s", *RATIOS),
        *("train_accuracy", "fits"),
    ),
    columns={
        "threads": Column("Threads"),
        "fit_s": Column("Time, s", two_digits, of_machine=True),
        "cpu_s": Column("of the processor, s", two_digits, of_machine=True),
        **{name: _ratio(name) for name in RATIOS},
        "train_accuracy": Column("Training accuracy, %", percent),
        "fits": Column("Fits", cell=_fits),
    },
    commands=(f"{RUN}{NAME}", f"{RUN}{NAME} task.measurement=2"),
)
BUSY_TABLE = Table(
    BUSY,
    busy,
    of=BUSY,
    title="Training times on the frames of Table I beside busy processes",
    note="Medians over all fits. Inflation: of the ratio to HDC, relative to none busy. The limits "
    "from which on a group of fits counts as disturbed follow from this table.",
    shown=(
        "threads",
        "busy",
        "model",
        "others",
        "fit_s",
        "cpu_s",
        "over_hdc",
        "inflation",
    ),
    columns={
        "threads": Column("Threads"),
        "busy": Column("Cores kept busy", number),
        "others": Column("Measured share of others, %", percent),
        "fit_s": Column("Time, s", two_digits, of_machine=True),
        "cpu_s": Column("of the processor, s", two_digits, of_machine=True),
        "over_hdc": Column("Relative to HDC", two_digits),
        "inflation": Column("Inflation", two_digits),
    },
)
