"""Rules from version 4 on judge as they say, accuracies as well as times.

Of the committed records the verdicts are those of a table, byte by byte (test_report.py): sizes,
unseen recordings, groups fewer than draws, two sides of one model.
"""

import itertools

import msgspec
import numpy as np
import pandas as pd
import pytest
import yaml

from experiments.records.configs import CONFIGS
from experiments.reporting.table import records
from experiments.studies.claims import judge
from experiments.studies.claims import rules as written_rules

OF = {"status": "exploratory", "split": "grouped"}
RECORDINGS = {
    "a": {"source": "one", **OF},
    "b": {"source": "one", **OF},
    "c": {"source": "two", **OF},
}


def rules(**changed):
    """Rules on three recordings of two sources."""
    about = {"says": "it keeps up", "by": "this repository", "experiment": "some"}
    models = {"form": "bits", "rival": "greys", "split": "kind"}
    written = {
        "version": 4,
        "dated": "2026-12-01",
        "margin": 0.03,
        "sure": 0.95,
        "sizes": [5, "largest"],
        "draws": 4,
        "shared": 0.25,
        "prior": {"freedom": 4, "mean": 0.1, "between": 0.05},
        "candidates": {"bits": ["hdc"], "greys": ["lda_greys"]},
        "recordings": RECORDINGS,
        "claims": {"keeps_up": about | models},
    }
    return msgspec.convert(written | changed, written_rules.Rules)


def lines(right, scenes="abc", draws=4):
    """A line per recording, draw, size and model; right answers of 400 by size and model."""
    made = []
    for scene, draw, (n, model) in itertools.product(scenes, range(draws), right):
        line = {"experiment": "some", "scene": scene, "seed": 0, "draw": draw, "n": n,
                "model": model, "n_test": 400, "right": right[n, model] + draw % 2,
                "kind": "grouped"}  # fmt: skip
        made += [line, line | {"kind": "random", "right": 0}]
    return pd.DataFrame(made)


EVEN = {(5, "bits"): 300, (5, "greys"): 380, (50, "bits"): 380, (50, "greys"): 380}


def test_a_draw_beyond_those_of_the_rules_moves_nothing():
    worse = lines({**EVEN, (50, "bits"): 100}, draws=6)
    later = pd.concat([lines(EVEN), worse[worse.draw >= 4]])
    asked = judge.judge(rules(), lines(EVEN))
    pd.testing.assert_frame_equal(judge.judge(rules(), later), asked)


@pytest.mark.parametrize(
    ("made", "why"),
    [
        (lines(EVEN, "ab"), "not measured: c"),
        (lines(EVEN, draws=3), "3 of 4 draws measured: a, b, c"),
        (lines(EVEN)[lambda f: f.model == "bits"], "0 of 4 draws measured: a, b, c"),
        (
            lines(EVEN).assign(
                kind=lambda f: np.where(f.scene == "b", "random", f.kind)
            ),
            "not measured: b",
        ),
        (pd.DataFrame(), "not measured: a, b, c"),
    ],
)
def test_what_is_not_measured_leaves_a_claim_open_and_says_why(made, why):
    for row in records(judge.judge(rules(), made)):
        assert (row["word"], row["why"]) == ("open", why)


# Times --------------------------------------------------------------------------------------------


def fits(slow, quick=(1.0, 1.1, 1.2), records=("r1", "r2"), disturbed=(), threads=1):
    """A line per fit of two models, in each of some records."""
    return pd.DataFrame(
        {
            "experiment": "times",
            "record": record,
            "model": model,
            "threads": threads,
            "fit_s": seconds,
            "disturbed": "others took 9%" if (record, model) in disturbed else "",
        }
        for record in records
        for model, every in (("slow", slow), ("quick", quick))
        for seconds in every
    )


SLOW = (11.0, 12.1, 13.2)  # 11 times by the medians and by the minima


@pytest.mark.parametrize(
    ("made", "word", "why"),
    [
        (fits(SLOW), "yes", ""),
        (fits((9.0, 9.9, 10.8)), "no", ""),
        (fits((9.0, 12.1, 13.2)), "open", ""),  # 9 times by the minima
        (
            pd.concat([fits(SLOW, records=["r1"]), fits((5.0,) * 3, records=["r2"])]),
            "open",
            "",
        ),
        (fits(SLOW, records=["r1"]), "open", "1 of 2 measurements"),
        (fits(SLOW, threads=2), "open", "0 of 2 measurements"),
        (pd.DataFrame(), "open", "0 of 2 measurements"),
        (
            fits(SLOW, disturbed=[("r2", "slow")]),
            "open",
            "disturbed: 0 of 3 fits of slow",
        ),
        (fits(SLOW[:2]), "open", "disturbed: 2 of 3 fits of slow"),
        # A third measurement moves nothing.
        (
            pd.concat([fits(SLOW), fits((1.0, 1.0, 1.0), records=["r3"])]),
            "yes",
            "",
        ),
    ],
)
def test_a_ratio_of_times_needs_both_statistics_of_both_measurements(made, word, why):
    of = {
        "says": "it is slow",
        "by": "the paper",
        "experiment": "times",
        "model": "slow",
        "over": "quick",
        "at_least": 10,
        "threads": 1,
        "fits": 3,
        "measurements": 2,
    }
    (row,) = records(judge.judge(rules(claims={}, times={"slow": of}), made))
    assert (row["word"], row["why"]) == (word, why)
    if word == "yes":
        assert row["mean"] == pytest.approx(11)
        assert row["mean_low"] == pytest.approx(row["mean_high"])


def test_rules_4_are_of_models_and_recordings_that_there_are(tmp_path):
    of = written_rules.read(written_rules.RULES)
    for each in of.claims.values():
        assert set(each.recordings) <= set(of.recordings)
    for family, candidates in of.candidates.items():
        written = yaml.safe_load((CONFIGS / "model" / f"{family}.yaml").read_text())
        assert tuple(written["model"]["forms"]) == candidates
    models = {name for each in of.claims.values() for name in (each.form, each.rival)}
    models |= {name for each in of.times.values() for name in (each.model, each.over)}
    for group, names in (("model", models), ("scene", of.recordings)):
        assert set(names) <= {path.stem for path in (CONFIGS / group).glob("*.yaml")}
    path = tmp_path / "rules.yaml"
    path.write_text(written_rules.RULES.read_text("utf-8") + "fudge: 1")
    with pytest.raises(ValueError, match=r"rules\.yaml: .*fudge"):
        written_rules.read(path)


@pytest.mark.parametrize(
    ("right", "word"),
    [
        ((300, 380, 390), "lda"),  # 2.5 points below the best
        ((300, 370, 390), "levels"),  # 5 points below
        ((380, 370, 390), "hdc"),
        ((300, 380, None), "open"),
    ],
)
def test_the_simplest_form_within_the_margin_of_the_best_is_chosen(right, word):
    choice = {"says": "the default", "by": "this repository", "experiment": "some",
              "split": "kind", "among": ["hdc", "lda", "levels"], "recordings": ["a", "c"],
              "size": 5}  # fmt: skip
    of = rules(choices={"default": choice}, claims={})
    measured = dict(zip(choice["among"], right, strict=True))
    made = lines({(5, model): n for model, n in measured.items() if n}, "ac")
    (row,) = records(judge.judge(of, made))
    assert row["word"] == word
    assert row["why"] == ("0 of 4 draws measured: a, c" if word == "open" else "")
    assert word == "open" or row["equal"] == pytest.approx(
        (measured[word] - right[0]) / 4
    )
