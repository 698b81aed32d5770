"""Evidence on training times: a model relative to HDC in the same implementation.

The rules name the experiment times_grid. Since 25 November 2026 its way by default is Table I
itself, so that both show one number.
"""

from __future__ import annotations

from collections.abc import Iterator

from experiments.reporting.columns import display_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.text import SIMULATED
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import Claim, Rules
from experiments.studies.claims.piece import Piece
from experiments.studies.claims.rules import much_slower
from experiments.studies.table1.times.grid import every_line


def pieces(
    name: str, claim: Claim, frozen: Rules, evidence: Evidence
) -> Iterator[Piece]:
    """A piece for each baseline and implementation in the grid of times."""
    every = every_line(evidence.frame)
    lines = {(line["model"], line["way"]): line for line in every}
    for rival in frozen.rivals_of(name):
        for way in frozen.ways:
            line = lines.get((rival, way))
            if line is None:
                continue
            ratio = Estimate(line["ratio"], line["ratio_low"], line["ratio_high"])
            runs, remark = line["runs"], ""
            if runs < frozen.runs.least:
                remark = "too few runs for an interval: lowest and highest"
            yield Piece(
                name,
                rival,
                evidence=way,
                laboratory="",
                frames=SIMULATED,
                quantity=f"training time of {display_name(rival)} relative to HDC, same "
                "implementation",
                estimate=ratio,
                unit="×",
                n=f"{runs} runs",
                word=much_slower(ratio, runs, frozen),
                remark=remark,
                command=line["command"],
                record=line["record"],
            )
