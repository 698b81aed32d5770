"""Evidence on training times: each way of computing a model against HDC computed the same way."""

from __future__ import annotations

from collections.abc import Iterator

from experiments.records.results import Results
from experiments.reporting.columns import display_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.text import SIMULATED
from experiments.studies.claims.frozen import Claim, Rules
from experiments.studies.claims.piece import Piece, place_of
from experiments.studies.claims.rules import much_slower
from experiments.studies.table1.times.grid import grid


def pieces(name: str, claim: Claim, frozen: Rules, results: Results) -> Iterator[Piece]:
    """A piece for each rival and way that was measured, as the grid of times has it."""
    measured = results.measured(claim.experiment)
    if measured is None:
        return
    table = grid(measured.frame).to_dict("records")
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
            yield Piece(
                name,
                rival,
                way,
                "",
                SIMULATED,
                f"training time of {display_name(rival)} over that of HDC of the same way",
                ratio,
                unit="×",
                n=f"{runs} runs",
                word=much_slower(ratio, runs, frozen),
                remark=remark,
                command=measured.record.command,
                record=place_of(measured),
            )
