"""Evidence on the contrast of prototypes, against that of hypervectors and of the speckle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from experiments.records import configs
from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.estimates import mean_interval
from experiments.reporting.measured import matrices
from experiments.reporting.text import number
from experiments.studies.claims.frozen import Claim, Rules
from experiments.studies.claims.piece import Piece, measured_by_scene, place_of
from experiments.studies.claims.rules import rule_of
from experiments.studies.correlation.pairs import contrast

PROTOTYPE = "prototype"


def pieces(name: str, claim: Claim, frozen: Rules, results: Results) -> Iterator[Piece]:
    """A piece for each scene and for each of what prototypes are held against."""
    for measured in _first_of_scenes(results, claim.experiment):
        kinds = set(measured.frame.kind)
        for rival in frozen.rivals_of(name):
            if {PROTOTYPE, rival} <= kinds:
                yield _piece(name, claim, frozen, rival, measured)


def _first_of_scenes(results: Results, experiment: str) -> Iterator[Measured]:
    """A measurement of each scene that has contrasts to compare."""
    for found in measured_by_scene(results, experiment).values():
        yield found[0]


def _piece(
    name: str, claim: Claim, frozen: Rules, rival: str, measured: Measured
) -> Piece:
    """The contrast of prototypes less that of the rival, a number a seed."""
    of_prototypes, of_rival = (
        _by_seed(measured, kind, claim.samples) for kind in (PROTOTYPE, rival)
    )
    less = mean_interval((of_prototypes - of_rival).tolist())
    shown = configs.scene_display(measured.record.scene)
    before, after = (number(each.mean()) for each in (of_rival, of_prototypes))
    return Piece(
        name,
        rival,
        measured.record.scene,
        str(shown["family"]),
        str(shown["kind"]),
        f"contrast of prototypes less that of {rival}, {before} to {after}",
        less,
        unit="1",
        n=f"{len(of_prototypes)} seeds",
        word=rule_of(claim.rule, frozen).of_one(less),
        command=measured.record.command,
        record=place_of(measured),
    )


def _by_seed(measured: Measured, kind: str, samples: str) -> np.ndarray:
    """The contrast of each seed."""
    _, values, _ = matrices(measured.frame, kind, samples)
    return np.array([contrast(matrix) for matrix in values])
