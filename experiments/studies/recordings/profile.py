"""The performance profile: how often is a model about as fast as the fastest that errs no more?"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments.reporting.forms import FORMS
from experiments.reporting.plot import (
    entry,
    handle,
    legend_below,
    look_of,
    plain_decades,
)
from experiments.reporting.study import Figure
from experiments.reporting.table import Table
from experiments.studies.recordings.figures import SPLIT
from experiments.studies.recordings.tables import COSTS_OF, at_most_frames

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

_OTHER: Any = {"marker": "", "color": "0.8", "lw": 0.8, "zorder": 1}


def profile(frame: pd.DataFrame) -> pd.DataFrame | None:
    """A row for each model and recording at the most frames per class.

    ``factor`` is its training time relative to the fastest model that errs no more, which may be
    itself; ``share`` is the share of recordings on which its factor is at most this one (Dolan and
    Moré, Math. Program. 91, 201 (2002)). Models that were not measured on all recordings are left
    out.
    """
    most = at_most_frames(frame)
    if not len(most):
        return None
    lines = pd.concat(
        [_factors(rows) for _, rows in most.groupby("recording", sort=False)]
    )
    every = lines.recording.nunique()
    whole = lines.groupby("model").recording.transform("nunique") == every
    lines = lines[whole].sort_values(["model", "factor"], kind="stable")
    rank = lines.groupby("model").factor.rank("max")
    return lines.assign(share=rank / every)[["model", "factor", "share"]]


def _factors(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of one recording with their factors."""
    seconds, errors = rows.fit_best_s.to_numpy(), rows.error.to_numpy()
    as_good = errors[None, :] <= errors[:, None]
    fastest = np.where(as_good, seconds[None, :], np.inf).min(axis=1)
    return rows.assign(factor=seconds / fastest)


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """A step line per model, from the left edge to the right one."""
    axes = figure.subplots()
    end = 1.5 * data.factor.max()
    for model, rows in data.groupby("model"):
        look = {**look_of(str(model)), "ms": 4} if model in FORMS else _OTHER
        factors = [1.0, *rows.factor, end]
        shares = [0.0, *rows.share, rows.share.max()]
        measured = slice(1, len(factors) - 1)
        axes.step(factors, shares, where="post", markevery=measured, **look)
    axes.set(xscale="log", xlim=(0.95, end), ylim=(0, 1.03))
    axes.set_xlabel("training time relative to\nthe fastest model of no more error")
    axes.set_ylabel("share of data sets")
    plain_decades(axes)
    names = [handle(model) for model in FORMS if model in set(data.model)]
    legend_below(figure, [*names, entry("other models", **_OTHER)], 2)


FIGURE = Figure(
    "performance_profile",
    Table("performance_profile", profile, of=COSTS_OF),
    draw,
    title="How often a model is fast for its accuracy",
    details=SPLIT,
    caption="Share of the data sets on which a model trains within a factor of the fastest model "
    "that errs no more than it does, at the most frames per class, with compiled kernels if they "
    "are faster. At a factor of 1, a model is the fastest of its accuracy.",
    size=(3.4, 3.4),
)
