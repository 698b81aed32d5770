"""Tables of training times: the medians of the fits that nothing disturbed, relative to HDC."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from experiments.records.results import of_experiment, own_frames
from experiments.reporting.columns import Column, display_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.study import RUN, Quantity
from experiments.reporting.table import ENDS, Table
from experiments.reporting.text import counted, number, percent, two_digits
from experiments.reporting.trained import same
from experiments.studies.table1.tables import PAPER

NAME, BUSY = "times", "times_busy"
_ROW = ["model", "threads"]
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
    fits = every[~every.cold]
    quiet = fits[fits.disturbed == ""]
    parts = (every, fits, quiet, every[every.cold])
    of_all, of_fits, of_quiet, of_cold = (of.groupby(_ROW, sort=False) for of in parts)
    columns = {
        "fit_s": of_quiet.fit_s.median(),
        "least_s": of_quiet.fit_s.min(),
        "cpu_s": of_quiet.cpu_s.median(),
        "train_accuracy": of_fits.train_accuracy.mean(),
        "fits": of_fits.size(),
        "disturbed": of_fits.disturbed.agg(lambda why: (why != "").sum()),
        "measurements": of_all.record.nunique(),
        "cpu": of_all.cpu.agg(same),
        "cold_s": of_cold.fit_s.median(),
    }
    of_record = quiet.groupby([*_ROW, "record"]).fit_s
    for kind, seconds in (("", of_record.median()), ("least_", of_record.min())):
        for name, hdc in RATIOS.items():
            columns |= _ratios(seconds, hdc).add_prefix(f"{kind}{name}").items()
    return pd.DataFrame(columns, index=of_all.size().index).reset_index()


def _ratios(seconds: pd.Series, hdc: str) -> pd.DataFrame:
    """Ratios to a form of HDC by as many threads, over the measurements that have both."""
    by_model = seconds.unstack("model")
    of_hdc = by_model.reindex(columns=[hdc])[hdc]
    ratios = by_model.div(of_hdc, axis="index").stack().dropna()
    by_row = ratios.groupby(_ROW)
    several = by_row.size() > 1
    mean = np.exp(np.log(ratios).groupby(_ROW).mean())
    ends = (by_row.min().where(several), by_row.max().where(several))
    return pd.concat([mean, *ends], axis="columns", keys=ENDS)


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


def quantities(frame: pd.DataFrame) -> Iterator[Quantity]:
    """Training times relative to HDC of fits that are timed alone, by the fewest threads."""
    table = times(frame).dropna(subset="over_hdc").drop_duplicates("model")
    of_paper = table[table.model.isin(PAPER) & (table.model != "hdc")]
    for line in of_paper.itertuples():
        yield Quantity(
            f"table1/{line.model}_time_over_hdc",
            Estimate(line.over_hdc, line.over_hdc_low, line.over_hdc_high),
            n=line.fits - line.disturbed,
            note=counted(line.threads, "thread"),
        )


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


NOTE = (
    "The clock counts what a model does until its training accuracy exceeds 90 % (one that "
    "learns in one pass or is solved: until it is done); it stops while frames are made and "
    "while the model is tested. Each model learns noise before, so that the clock counts no "
    "loading and no compiling. Medians of fits that nothing else on the machine disturbed; a "
    "ratio of two measurements is their geometric mean [lower, higher]. HDC by NumPy computes "
    "with one thread whatever it is given."
)


TABLE = Table(
    NAME,
    times,
    of=NAME,
    key=("model", "threads"),
    title=lambda data: f"Training times on the frames of Table I, {data.cpu.iloc[0]}",
    note=NOTE,
    shown=(
        *("model", "threads", "fit_s", "cpu_s", *RATIOS),
        *("fits", "cold_s"),
    ),
    columns={
        "threads": Column("Threads"),
        "fit_s": Column("Time, s", two_digits, of_machine=True),
        "cpu_s": Column("of the processor, s", two_digits, of_machine=True),
        **{name: _ratio(name) for name in RATIOS},
        "fits": Column("Fits", cell=_fits),
        "cold_s": Column(
            "In a process of its own, s",
            two_digits,
            note="A process of its own: from its start, with reading the frames and no pause.",
            of_machine=True,
        ),
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
