"""Evidence on training times: each way of computing a model against HDC computed the same way."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pandas as pd

from experiments.records.results import Results
from experiments.reporting.columns import display_name
from experiments.reporting.estimates import median_interval
from experiments.reporting.text import SIMULATED
from experiments.studies.claims.frozen import Claim, Rules
from experiments.studies.claims.piece import Piece, place_of
from experiments.studies.claims.rules import much_slower

HDC = "hdc"


def pieces(name: str, claim: Claim, frozen: Rules, results: Results) -> Iterator[Piece]:
    """A piece for each rival and way that was measured."""
    measured = results.measured(claim.experiment)
    if measured is None:
        return
    ratios = ratios_of(measured.frame)
    for rival in frozen.rivals_of(name):
        for way in frozen.ways:
            runs = ratios.get((way, rival))
            if runs is None:
                continue
            ratio, remark = median_interval(runs), ""
            if len(runs) < frozen.runs.least:
                ratio = ratio._replace(low=min(runs), high=max(runs))
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
                n=f"{len(runs)} runs",
                word=much_slower(ratio, len(runs), frozen),
                remark=remark,
                command=measured.record.command,
                record=place_of(measured),
            )


def ratios_of(rows: pd.DataFrame) -> dict[tuple[str, str], list[float]]:
    """By way and model: the training time of each run over that of HDC of the same way in the same
    turn; infinite where the model did not get there."""
    rivals = rows[rows.model != HDC]
    seconds = rivals.seconds.astype(float).fillna(math.inf)
    ratios = seconds / rivals.hdc_seconds.astype(float)
    found = {}
    for key, of_model in ratios.groupby([rivals.way, rivals.model], sort=False):
        found[key] = of_model.tolist()
    return found
