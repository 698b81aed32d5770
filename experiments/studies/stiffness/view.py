"""Stiffness of softmax regression: stable learning rates, and what each method costs."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.measured import machine, with_places
from experiments.reporting.study import Plot, Study
from experiments.reporting.table import Table, frame
from experiments.studies.stiffness import view_limits, view_methods


def tables(results: Results) -> Iterator[Table]:
    """Stability limits, and times of the methods for one objective."""
    for place, measured in with_places(results, "stiffness"):
        rows = view_limits.limits(measured)
        yield Table(
            f"stiffness{place}",
            f"Largest stable learning rates, {_frames(measured)}",
            frame(rows),
            view_limits.COLUMNS,
            " ".join([view_limits.NOTE, view_limits.published_rate(rows), *_made(measured)]),
            [measured.record.command],
        )
    for place, measured in with_places(results, "softmax_methods"):
        yield Table(
            f"softmax_methods{place}",
            "Softmax regression by explicit, adaptive and second-order methods, "
            + _frames(measured),
            frame(view_methods.methods(measured)),
            view_methods.COLUMNS,
            " ".join([view_methods.NOTE, *_made(measured)]),
            [measured.record.command],
        )


def plots(results: Results) -> Iterator[Plot]:
    """Loss against the rate, the spectra, and error against time."""
    for name, experiment, caption, draw in (
        (
            "stiffness_limit",
            "stiffness",
            "Highest loss against the learning rate in units of the predicted limit.",
            view_limits.stability_limit,
        ),
        (
            "stiffness_spectrum",
            "stiffness",
            "Eigenvalues of the Hessian of softmax regression.",
            view_limits.spectrum,
        ),
        (
            "softmax_methods",
            "softmax_methods",
            "Loss gap and test error of methods for softmax regression against training time.",
            view_methods.error_against_time,
        ),
    ):
        for place, measured in with_places(results, experiment):
            drawing = partial(draw, measured, _frames(measured))
            yield Plot(f"{name}{place}", caption, drawing, [measured.record.command])


def _frames(measured: Measured) -> str:
    target = measured.record.config["scene"]["_target_"]
    return "simulated frames" if target.startswith("scenes.sensor.") else f"frames of {target}"


def _made(measured: Measured) -> Iterator[str]:
    """The machine, and what was changed of the experiment's config."""
    yield f"Measured on {machine(measured)}."
    if measured.overrides:
        changed = (f"{key}={value}" for key, value in measured.overrides.items())
        yield f"Changed: {', '.join(changed)}."


STUDY = Study(
    "stiffness",
    "Stiffness of training",
    "Which learning rates are stable, as gradient descent is the explicit Euler method? And how "
    "long do explicit, adaptive and second-order methods take to the same optimum?",
    11,
    tables,
    plots,
)
