"""Where accuracy crosses 90 % in one experiment, and what theory says of the curve (Fig. 5(b))."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting import published
from experiments.reporting.estimates import Estimate, crossing, mean_interval, mean_share
from experiments.reporting.measured import with_places
from experiments.reporting.plot import (
    STYLE,
    WIDTH,
    errors,
    handle,
    head,
    panel,
    seeds_of,
    style_of,
)
from experiments.reporting.rows import display_name, frames_of
from experiments.reporting.study import Plot, Study
from experiments.reporting.table import Table, bounded, frame, number

LEVEL = 0.9
PUBLISHED = "accuracy_vs_n/n_for_90_percent"
# How the curve is read: at which N it is asked, and what counts. The paper sets N_s = N/L and says
# "exceeded"; the others are what its sentence may also mean.
READINGS = {
    "equal classes, exceeds": (True, False),
    "equal classes, reaches": (True, True),
    "every N, exceeds": (False, False),
    "every N, reaches": (False, True),
}
# Expectations by theory: name, line.
THEORY = {
    "theory": ("theory, skewed", "-"),
    "theory_gaussian": ("theory, Gaussian", (0, (1, 1))),
}


class Crossing(NamedTuple):
    """The first N at which one experiment has its accuracy above 90 %.

    Attributes:
        model: name of its config.
        reading: one of :data:`READINGS`.
        first: median over all experiments, and between which two N 95 % of them lie; infinite where
            the last N is not enough.
        p_at_most_published: probability of a first N up to the published; Student's interval over
            sensors.
        p_next: probability that it is the next N asked after the published, as the paper reports.
    """

    model: str
    reading: str
    first: Estimate
    p_at_most_published: Estimate
    p_next: Estimate


class Experiments(NamedTuple):
    """What was measured.

    Attributes:
        n: every N [K].
        accuracy: by model, float64 [sensors, draws, K].
        theory: by :data:`THEORY`, float64 [sensors, K].
        n_classes, n_test: L, and test samples of an experiment.
    """

    n: NDArray[np.int64]
    accuracy: Mapping[str, NDArray[np.float64]]
    theory: Mapping[str, NDArray[np.float64]]
    n_classes: int
    n_test: int

    @property
    def equal(self) -> NDArray[np.bool_]:
        """Where every class has as many samples [K]."""
        return self.n % self.n_classes == 0


def experiments(measured: Measured) -> Experiments:
    """The rows of a measurement as arrays."""
    asked = [row for row in measured.rows if "draw" in row]
    expected = [row for row in measured.rows if "theory" in row]
    n = np.unique([int(row["n"]) for row in asked])
    seeds = len({row["seed"] for row in asked})
    n_test = int(asked[0]["n_test"])

    def values(rows: Sequence[Mapping[str, str]], name: str, *shape: int) -> NDArray[np.float64]:
        return np.array([float(row[name]) for row in rows]).reshape(seeds, *shape, len(n))

    return Experiments(
        n,
        {name: values(asked, name, -1) / n_test for name in measured.record.config["models"]},
        {name: values(expected, name) for name in THEORY},
        len({row["class_i"] for row in measured.rows if "class_i" in row}),
        n_test,
    )


def crossings(results: Results, reading: str = next(iter(READINGS))) -> list[Crossing]:
    """One for each model, of the experiment's own frames; none where nothing was measured."""
    measured = results.measured("crossing")
    return [] if measured is None else _crossings(experiments(measured), reading)


def _crossings(found: Experiments, reading: str) -> list[Crossing]:
    published_n = published.numbers()[PUBLISHED].value
    later = found.n[_asked(found, reading) & (found.n > published_n)]
    result = []
    for model, accuracy in found.accuracy.items():
        first = firsts(found, accuracy, reading)
        # Every sensor has as many experiments; an infinity is no number to average.
        low, median, high = np.quantile(first, (0.025, 0.5, 0.975), method="inverted_cdf")
        shares = [first <= published_n, np.isin(first, later[:1])]
        result.append(
            Crossing(
                model,
                reading,
                Estimate(*map(float, (median, low, high))),
                *(mean_share(share.mean(1).tolist(), share.shape[1]) for share in shares),
            )
        )
    return result


def firsts(found: Experiments, accuracy: NDArray[np.float64], reading: str) -> NDArray[np.float64]:
    """The first N above the level of each curve [..., K]; infinite where none is."""
    _, reaches = READINGS[reading]
    # Shares of whole samples: half a sample beside the level nothing can lie.
    margin = (-0.5 if reaches else 0.5) / found.n_test
    above = (accuracy > LEVEL + margin) & _asked(found, reading)
    return np.where(above.any(-1), found.n[above.argmax(-1)], np.inf)


def _asked(found: Experiments, reading: str) -> NDArray[np.bool_]:
    return found.equal if READINGS[reading][0] else np.ones(len(found.n), bool)


def theory_error(found: Experiments, name: str) -> tuple[float, float]:
    """Mean and largest distance of a theory from HDC's mean accuracy, where classes are equal."""
    distance = np.abs(found.theory[name].mean(0) - found.accuracy["hdc"].mean((0, 1)))[found.equal]
    return float(distance.mean()), float(distance.max())


# Tables -------------------------------------------------------------------------------------------


def tables(results: Results) -> Iterator[Table]:
    """The first crossings by model and reading, and the curves behind them."""
    limit = published.numbers()[PUBLISHED].value
    for place, measured in with_places(results, "crossing"):
        found = experiments(measured)
        yield Table(
            f"crossing{place}",
            f"First N at which one experiment with {found.n_test} test samples exceeds, or "
            f"reaches, {100 * LEVEL:g} %, on {_frames(measured, found)}",
            frame(_row(one) for reading in READINGS for one in _crossings(found, reading)),
            {
                "Model": lambda row: display_name(row["model"]),
                "Reading": lambda row: row["reading"],
                "First N, median [95 % of experiments]": partial(bounded, "first", show=_whole),
                f"P(first N ≤ {limit:g}), % [95 %]": partial(bounded, "p_at_most_published"),
                f"P(first N is the next after {limit:g}), % [95 %]": partial(bounded, "p_next"),
            },
            f"The paper: the accuracy exceeded {100 * LEVEL:g} % only when N > {limit:g}. Equal "
            "classes: asked at multiples of the number of classes only, as the paper's N_s = N/L. "
            "First N: of single experiments, all sensors together, ∞ where the last N was not "
            "enough; P: Student over sensors. The N of one experiment are nested; whether the "
            "paper's were is not known. The simulated sensor was fitted to this published "
            "number, so that it lies within is no evidence.",
            [measured.record.command],
        )
        yield Table(
            f"crossing_accuracy{place}",
            f"Mean test accuracy, %, where every class has as many samples, on "
            f"{_frames(measured, found)}",
            frame(_curve_rows(found)),
            {
                "N": lambda row: str(row["n"]),
                **{display_name(m): partial(bounded, m) for m in found.accuracy},
                **{f"HDC by {label}": partial(bounded, m) for m, (label, _) in THEORY.items()},
            },
            f"Student, 95 %, over sensors, each the mean of its experiments. {_theory_note(found)}",
            [measured.record.command],
        )


def _row(one: Crossing) -> dict[str, Any]:
    row: dict[str, Any] = {"model": one.model, "reading": one.reading}
    for name in ("first", "p_at_most_published", "p_next"):
        row |= getattr(one, name).columns(name)
    return row


def _curve_rows(found: Experiments) -> Iterator[dict[str, Any]]:
    curves = {model: mean_curve(found, model) for model in found.accuracy}
    curves |= {
        name: [mean_interval(column).within(0, 1) for column in values.T.tolist()]
        for name, values in found.theory.items()
    }
    for k in np.flatnonzero(found.equal):
        row: dict[str, Any] = {"n": int(found.n[k])}
        for name, values in curves.items():
            row |= values[k].columns(name)
        yield row


def mean_curve(found: Experiments, model: str) -> list[Estimate]:
    """Mean accuracy at every N; the test samples of a sensor are those of all its experiments."""
    by_n = found.accuracy[model].mean(1).T.tolist()
    tested = found.n_test * found.accuracy[model].shape[1]
    return [mean_share(of_sensors, tested) for of_sensors in by_n]


def _whole(n: float) -> str:
    return "∞" if np.isinf(n) else f"{n:g}"


def _frames(measured: Measured, found: Experiments) -> str:
    sensors, draws = next(iter(found.accuracy.values())).shape[:2]
    return f"{frames_of(measured.rows)}, {seeds_of(sensors)} with {draws} experiments each"


def _theory_note(found: Experiments) -> str:
    if "hdc" not in found.accuracy:
        return ""
    n = found.n[found.equal].tolist()

    def crosses(curve: NDArray[np.float64]) -> str:
        return f"crosses {LEVEL:.0%} at N = {number(crossing(n, curve[found.equal].tolist()))}"

    said = [f"HDC's mean {crosses(found.accuracy['hdc'].mean((0, 1)))}"]
    for name, (label, _) in THEORY.items():
        mean, most = theory_error(found, name)
        said.append(
            f"{label}: {number(100 * mean, 2)} points from it on average, {number(100 * most, 2)} "
            f"at most, {crosses(found.theory[name].mean(0))}"
        )
    return (
        "Theory: from correlations of hypervectors and their scatter on the same sensors, no "
        "number fitted to an accuracy; skewness was taken in after the Gaussians had missed "
        f"on seed 0. {'; '.join(said)}."
    )


# Figure -------------------------------------------------------------------------------------------


def plots(results: Results) -> Iterator[Plot]:
    """Curves, theory and the distribution of the first crossing."""
    for place, measured in with_places(results, "crossing"):
        yield Plot(
            f"crossing{place}",
            "Test accuracy against every N, with HDC's by theory, and the share of experiments "
            "that have exceeded 90 % by then (Fig. 5(b)).",
            partial(figure, measured),
            [measured.record.command],
        )


def figure(measured: Measured) -> Figure:
    """(a) equal classes, with theory; (b) every N; (c) cumulative distribution of the first N."""
    found = experiments(measured)
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(3, 1, figsize=(WIDTH, 6.9), sharex=True, layout="constrained")
        equal, every, first = panels
        for model in found.accuracy:
            _curve(equal, found, model, found.equal)
        for model in ("hdc", "ridge"):
            if model in found.accuracy:
                _curve(every, found, model, np.ones(len(found.n), bool))
        for axes, chosen in ((equal, found.equal), (every, np.ones(len(found.n), bool))):
            for name, (_, line) in THEORY.items():
                mean = 100 * found.theory[name].mean(0)
                axes.plot(found.n[chosen], mean[chosen], color="black", ls=line, lw=0.9, zorder=4)
            axes.axhline(100 * LEVEL, color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
            axes.set_ylabel("test accuracy (%)")
        panel(equal, "a", "as many samples of every class")
        panel(every, "b", "every N: some classes have one more")
        for model, accuracy in found.accuracy.items():
            _distribution(first, found, model, accuracy)
        first.set_ylabel("experiments that have\nexceeded 90 % (%)")
        first.set_xlabel("training samples of all classes, N")
        panel(first, "c", "first N above 90 %, as many samples of every class")
        limit = published.numbers()[PUBLISHED].value
        for axes in panels:
            axes.axvline(limit, color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
            axes.set_xlim(found.n[0] - 1, found.n[-1] + 1)
        first.text(limit + 0.7, 3, f"paper: > 90 % only for N > {limit:g}", fontsize=6, color="0.3")
        lines = [
            Line2D([], [], color="black", ls=line, label=f"HDC by {label}")
            for label, line in THEORY.values()
        ]
        handles = [*map(handle, found.accuracy), *lines]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        head(
            figure,
            "Where one experiment's accuracy crosses 90 % (Fig. 5(b))",
            [
                f"{_frames(measured, found)}, {found.n_test} test samples; bands: 95 % over "
                "sensors; theory is from correlations alone",
            ],
        )
    return figure


def _curve(axes: Axes, found: Experiments, model: str, chosen: NDArray[np.bool_]) -> None:
    """Mean accuracy with its band over sensors."""
    colour, marker, line = style_of(model)
    n = found.n[chosen]
    value, spread = errors([mean_curve(found, model)[k] for k in np.flatnonzero(chosen)], 100)
    axes.plot(n, value, color=colour, marker=marker, ms=2.2, ls=line, lw=0.9)
    axes.fill_between(n, value - spread[0], value + spread[1], color=colour, alpha=0.13, lw=0)


def _distribution(
    axes: Axes, found: Experiments, model: str, accuracy: NDArray[np.float64]
) -> None:
    """Share of experiments with a first N up to each N asked."""
    colour, marker, line = style_of(model)
    first = firsts(found, accuracy, next(iter(READINGS)))
    n = found.n[found.equal]
    share = [100 * (first <= one).mean() for one in n]
    axes.step(n, share, where="post", color=colour, ls=line, lw=0.9)
    axes.plot(n, share, color=colour, marker=marker, ms=2.2, ls="")


STUDY = Study(
    "crossing",
    "Few samples, in one experiment",
    "At which N does one experiment exceed 90 %, how sure is that number, and what does theory say "
    "before a frame is classified?",
    2.5,
    tables,
    plots,
)
