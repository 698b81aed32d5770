"""The frozen verdicts of rules 1 to 3."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

HISTORY = Path(__file__).with_name("history.csv")


def history() -> pd.DataFrame:
    """The frozen verdicts, a row per version of the rules, claim, baseline and, where a recording
    was unseen when they were written, recording."""
    of_text = dict.fromkeys(("frozen", "digest", "judged"), str)
    return pd.read_csv(HISTORY, dtype=of_text)


def frozen() -> pd.DataFrame:
    """The frozen verdicts whose interval is not all that a difference can be."""
    every = history()
    says_nothing = (every.mean_low <= -100) & (every.mean_high >= 0)
    return every[~says_nothing]
