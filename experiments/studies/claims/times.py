"""Evidence on training times: each way of computing a model against HDC computed the same way."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pandas as pd

from experiments.records.results import Results
from experiments.reporting.columns import display_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.study import RUN
from experiments.reporting.text import SIMULATED
from experiments.studies.claims.frozen import Claim, Rules
from experiments.studies.claims.piece import Piece
from experiments.studies.claims.rules import much_slower


def pieces(name: str, claim: Claim, frozen: Rules, results: Results) -> Iterator[Piece]:
    """A piece for each rival and way that was measured."""
    table = grid(results)
    if table is None:
        return
    for rival in frozen.rivals_of(name):
        of_rival = table[table.model == rival].set_index("way")
        for way in frozen.ways:
            if way not in of_rival.index:
                continue
            line = of_rival.loc[way]
            low, high = float(line.ratio_low), float(line.ratio_high)
            ratio = Estimate(float(line.ratio), low, high)
            runs = int(line.runs)
            is_range = runs < frozen.runs.least
            yield Piece(
                name,
                rival,
                way,
                "",
                SIMULATED,
                f"training time of {display_name(rival)} over that of HDC of the same way",
                ratio,
                math.nan,
                unit="×",
                n=f"{runs} runs",
                word=much_slower(ratio, runs, frozen),
                remark="too few runs for an interval: lowest to highest"
                if is_range
                else "",
                command=f"{RUN}{claim.experiment}",
                record=str(line.get("record", "")),
            )


def grid(results: Results) -> pd.DataFrame | None:
    """Of each way and model the median ``ratio`` of its training time over that of HDC of the same
    way, with ``ratio_low``, ``ratio_high`` and the number of ``runs``; None without any."""
    return None
