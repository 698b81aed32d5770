"""Evidence on the contrast of prototypes, against that of hypervectors and of the speckle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from experiments.reporting.estimates import mean_interval
from experiments.reporting.measured import matrices
from experiments.reporting.text import number
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import Claim, Rules
from experiments.studies.claims.piece import Piece, piece_of
from experiments.studies.claims.rules import rule_of
from experiments.studies.correlation.pairs import contrast

PROTOTYPE = "prototype"


def pieces(
    name: str, claim: Claim, frozen: Rules, evidence: Evidence
) -> Iterator[Piece]:
    """A piece for each scene and for each of what prototypes are compared with."""
    for rows in evidence.scenes(claim.experiment).values():
        kinds = set(rows.kind)
        for rival in frozen.rivals_of(name):
            if {PROTOTYPE, rival} <= kinds:
                yield _piece(name, claim, frozen, rival, rows)


def _piece(
    name: str, claim: Claim, frozen: Rules, rival: str, rows: pd.DataFrame
) -> Piece:
    """The contrast of prototypes minus that of the baseline, a number per seed."""
    of_prototypes, of_rival = (
        _by_seed(rows, kind, claim.samples) for kind in (PROTOTYPE, rival)
    )
    less = mean_interval((of_prototypes - of_rival).tolist())
    before, after = (number(each.mean()) for each in (of_rival, of_prototypes))
    return piece_of(
        rows,
        name,
        rival,
        f"contrast of prototypes minus that of {rival}, {before} to {after}",
        less,
        unit="1",
        n=f"{len(of_prototypes)} seeds",
        word=rule_of(claim.rule, frozen).of_one(less),
    )


def _by_seed(rows: pd.DataFrame, kind: str, samples: str) -> np.ndarray:
    """The contrast of each seed."""
    _, values, _ = matrices(rows, kind, samples)
    return np.array([contrast(matrix) for matrix in values])
