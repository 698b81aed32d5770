"""What a route is, and the list of all.

A route is one function of :mod:`experiments.studies.benchmark.routes`, registered under an
operation. Given a case (frames of one size) it prepares what its users would have at hand, and
returns the call that is timed and a function that brings the call's result into the operation's
common form, in which it is compared with a reference computed in plain numpy: bits packed into
bytes, distances, or predicted labels.

Ours is measured with both backends. The compiled one's kernels are compiled, or read from their
cache, when the route is built, so no time contains that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.studies.benchmark.cases import Case
from experiments.studies.benchmark.names import OURS, OURS_COMPILED
from hdc import bits

Form = Callable[[Any], np.ndarray | None]
Job = tuple[Callable[[], Any], Form]
Build = Callable[[Case], Job]

EVERY_TYPE = ("uint8", "uint16", "float32")


@dataclass(frozen=True)
class Route:
    """One way to carry out an operation.

    Attributes:
        operation: one of :data:`experiments.studies.benchmark.names.OPERATIONS`.
        name: what rows call it.
        build: makes the call of a case, and the form of its result.
        module: what has to be installed for it.
        anywhere: whether it runs on an accelerator too.
        types: pixels that it takes.
    """

    operation: str
    name: str
    build: Build
    module: str = "torch"
    anywhere: bool = False
    types: tuple[str, ...] = EVERY_TYPE


ROUTES: list[Route] = []


def route(operation: str, name: str, **attributes: Any) -> Callable[[Build], Build]:
    """Register a function as a :class:`Route` with these attributes."""

    def register(build: Build) -> Build:
        ROUTES.append(Route(operation, name, build, **attributes))
        return build

    return register


def ours(operation: str) -> Callable[[Callable[[Case, str], Job]], Callable[[Case, str], Job]]:
    """Register a function of a case and a backend for each of our backends."""

    def register(build: Callable[[Case, str], Job]) -> Callable[[Case, str], Job]:
        @route(operation, OURS, anywhere=True)
        def plain(case: Case) -> Job:
            return build(case, "numpy")

        @route(operation, OURS_COMPILED, module="numba")
        def compiled(case: Case) -> Job:
            bits.kernels("compiled", case.device)  # compiles
            return build(case, "compiled")

        return build

    return register
