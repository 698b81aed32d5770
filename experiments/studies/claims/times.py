"""Evidence on training times: each way of computing a model against HDC computed the same way."""

from __future__ import annotations

from collections.abc import Iterator

from experiments.reporting.columns import display_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.text import SIMULATED
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import Claim, Rules
from experiments.studies.claims.piece import Piece, piece_of
from experiments.studies.claims.rules import much_slower
from experiments.studies.table1.times.grid import grid


def pieces(
    name: str, claim: Claim, frozen: Rules, evidence: Evidence
) -> Iterator[Piece]:
    """A piece for each baseline and implementation in the grid of times."""
    every = evidence.scenes(claim.experiment).values()
    own = [rows for rows in every if not rows.elsewhere.iloc[0]]
    if not own:
        return
    rows = own[0]
    table = grid(rows).to_dict("records")
    lines = {(line["model"], line["way"]): line for line in table}
    for rival in frozen.rivals_of(name):
        for way in frozen.ways:
            line = lines.get((rival, way))
            if line is None:
                continue
            ratio = Estimate(line["ratio"], line["ratio_low"], line["ratio_high"])
            runs, remark = int(line["turns"]), ""
            if runs < frozen.runs.least:
                remark = "too few runs for an interval: lowest and highest"
            yield piece_of(
                rows,
                name,
                rival,
                f"training time of {display_name(rival)} relative to HDC, same implementation",
                ratio,
                evidence=way,
                laboratory="",
                frames=SIMULATED,
                unit="×",
                n=f"{runs} runs",
                word=much_slower(ratio, runs, frozen),
                remark=remark,
            )
