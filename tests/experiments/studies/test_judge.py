"""Rules from version 4 on judge as they say, accuracies as well as times."""

import itertools
from pathlib import Path

import msgspec
import numpy as np
import pandas as pd
import pytest
import yaml

from experiments.records.rows import pack_labels
from experiments.reporting.table import records
from experiments.studies.claims import judge, view
from experiments.studies.claims import rules as written_rules

FOLDER = Path(judge.__file__).parent

# Rules from version 4 on --------------------------------------------------------------------------

OF = {"status": "exploratory", "split": "grouped"}
RECORDINGS = {
    "a": {"source": "one", **OF},
    "b": {"source": "one", **OF},
    "c": {"source": "two", **OF},
}


def rules(**changed):
    """Rules on three recordings of two sources."""
    about = {"says": "it keeps up", "by": "this repository", "experiment": "some"}
    models = {"form": "bits", "rival": "greys", "disturbed": "loaded", "split": "kind"}
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
        "claims": {"keeps_up": about | models | {"lines": {"split": "counts"}}},
    }
    return msgspec.convert(written | changed, written_rules.Rules)


def lines(right, scenes="abc", draws=4):
    """A line per recording, draw, size and model; right answers of 400 by size and model."""
    made = []
    for scene, draw, n in itertools.product(scenes, range(draws), (5, 50)):
        for model in ("bits", "greys"):
            count = right[n, model] + (draw % 2)
            line = {"experiment": "some", "scene": scene, "split": "counts", "seed": 0,
                    "draw": draw, "n": n, "model": model, "right": count, "n_test": 400,
                    "kind": "grouped", "loaded": False}  # fmt: skip
            made += [line, line | {"split": "random", "right": 0}]
    return pd.DataFrame(made)


EVEN = {(5, "bits"): 300, (5, "greys"): 380, (50, "bits"): 380, (50, "greys"): 380}


def test_a_draw_beyond_those_of_the_rules_moves_nothing():
    worse = lines({**EVEN, (50, "bits"): 100}, draws=6)
    later = pd.concat([lines(EVEN), worse[worse.draw >= 4]])
    asked = judge.judge(rules(), lines(EVEN))
    pd.testing.assert_frame_equal(judge.judge(rules(), later), asked)


def test_each_size_has_a_word_of_its_own():
    few, many = records(judge.judge(rules(), lines(EVEN)))
    assert (few["word"], many["word"]) == ("no", "yes")
    assert (few["size"], many["size"], many["sources"]) == (5, "largest", 2)
    assert few["equal"] == pytest.approx(-20)
    assert few["mean_low"] < few["mean"] < few["mean_high"] < -3 < many["mean"]
    assert few["probability"] < 0.05 < 0.95 < many["probability"]
    assert few["why"] == many["why"] == ""


@pytest.mark.parametrize(
    ("made", "why"),
    [
        (lines(EVEN, "ab"), "not measured: c"),
        (lines(EVEN, draws=3), "3 of 4 draws measured: a, b, c"),
        (lines(EVEN).assign(loaded=lambda f: f.scene == "b"), "disturbed: b"),
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
def test_what_is_disturbed_or_not_measured_leaves_a_claim_open_and_says_why(made, why):
    for row in records(judge.judge(rules(), made)):
        assert (row["word"], row["why"]) == ("open", why)


def test_a_recording_may_have_fewer_groups_than_draws_and_not_every_size():
    few_groups = {name: {**of, "groups": 3} for name, of in RECORDINGS.items()}
    few_groups["d"] = {"source": "three", "sizes": ["largest"], **OF}
    few, many = records(judge.judge(rules(recordings=few_groups), lines(EVEN, draws=3)))
    assert few["word"] == "no"
    assert many["why"] == "not measured: d"


@pytest.mark.parametrize(
    ("right", "of_one"),
    [
        ([380, 372, 376, 384], np.var([0, -8, -4, 4], ddof=1) / 400**2),
        ([380, 380, 380, 380], 1 / 402 / 400),  # the least that 400 frames leave
    ],
)
def test_the_variance_of_a_recording_is_that_of_draws_that_share_frames(right, of_one):
    made = [
        {"seed": 0, "draw": draw, "form": form, "share": count / 400, "n_test": 400}
        for form, counts in ((True, right), (False, [380] * 4))
        for draw, count in enumerate(counts)
    ]
    of = rules()
    one = msgspec.structs.replace(of.claims["keeps_up"], disturbed="")
    found = judge.difference(of, of.recordings["a"], one, pd.DataFrame(made))
    assert found.mean == pytest.approx((np.mean(right) - 380) / 400)
    assert found.variance == pytest.approx(of_one * (1 / 4 + 0.25))


def test_recordings_of_one_source_are_one_unit():
    found = {
        name: judge.Difference(mean, 1e-4) for name, mean in (("a", 0.0), ("b", 0.1))
    }
    values, variances = judge.by_source(
        rules(), found | {"c": judge.Difference(0.2, 4e-4)}
    )
    assert values == pytest.approx([0.05, 0.2])
    assert variances == pytest.approx(
        [0.005 / 2, 4e-4]
    )  # that between a and b is the larger


def test_a_recording_that_was_unseen_has_a_row_of_its_own():
    unseen = {**RECORDINGS, "c": {**RECORDINGS["c"], "status": "confirmatory"}}
    good, bad = lines(EVEN, "ab"), lines({**EVEN, (50, "bits"): 100}, "c")
    every, alone = records(
        judge.judge(rules(recordings=unseen, sizes=["largest"]), pd.concat([good, bad]))
    )
    assert (every["status"], every["sources"]) == ("all", 2)
    assert (alone["status"], alone["sources"]) == ("confirmatory", 1)
    assert alone["equal"] == pytest.approx(-70)
    assert alone["word"] == "no"


def test_two_sides_of_one_model_are_told_apart_by_columns_of_their_own():
    made = [
        {"experiment": "some", "scene": "a", "seed": seed, "model": "bits", **side}
        for seed in range(4)
        for side in (
            {"level": 0.0, "old": 90, "n_old": 100, "right": 1, "n_test": 50},
            {"level": 0.1, "old": 2, "n_old": 100, "right": 30, "n_test": 50},
        )
    ]
    one = {
        "says": "it is restored",
        "by": "the paper",
        "experiment": "some",
        "form": "bits",
        "rival": "bits",
        "of_form": {"level": 0.1},
        "of_rival": {"level": 0.0},
        "rival_right": "old",
        "rival_asked": "n_old",
        "recordings": ["a"],
        "sizes": ["as trained"],
    }
    (row,) = records(judge.judge(rules(claims={"restored": one}), pd.DataFrame(made)))
    assert row["equal"] == pytest.approx(60 - 90)
    assert row["word"] == "open"  # one source says too little of others


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


# Rules 4 ------------------------------------------------------------------------------------------


RULES_4 = written_rules.read(written_rules.RULES)


def test_rules_4_are_of_models_and_recordings_that_there_are(tmp_path):
    of = RULES_4
    configs = FOLDER.parents[2] / "configs"
    for each in of.claims.values():
        assert set(each.recordings) <= set(of.recordings)
    for family, candidates in of.candidates.items():
        written = yaml.safe_load((configs / "model" / f"{family}.yaml").read_text())
        assert tuple(written["model"]["forms"]) == candidates
    models = {name for each in of.claims.values() for name in (each.form, each.rival)}
    models |= {name for each in of.times.values() for name in (each.model, each.over)}
    for group, names in (("model", models), ("scene", of.recordings)):
        assert set(names) <= {path.stem for path in (configs / group).glob("*.yaml")}
    path = tmp_path / "rules.yaml"
    path.write_text(written_rules.RULES.read_text("utf-8") + "fudge: 1")
    with pytest.raises(ValueError, match=r"rules\.yaml: .*fudge"):
        written_rules.read(path)


def test_every_claim_has_its_verdicts(committed_results):
    found = view.verdicts(committed_results.frame(*view.VERDICTS.experiments))
    assert not found[list(view.VERDICTS.key)].duplicated().any()
    assert set(found.claim) == {*RULES_4.claims, *RULES_4.times, *RULES_4.choices}
    flips = found.set_index("claim").loc["flips"]
    assert flips["why"] or abs(flips["mean"]) < 5  # of lines without a draw and n


def test_recalibration_is_judged_on_what_each_session_has_right():
    same = {"experiment": "drift", "scene": "wedge_days", "model": "hdc", "share": np.nan,
            "old_split.kind": "leave_group_out", "n_test_new": 160, "n_test_old": 80,
            "labels": pack_labels([1] * 240)}  # fmt: skip

    def predicted(new, old):
        """Of each session so many are right: class 1, as all are."""
        of_new, of_old = [1] * new + [0] * (160 - new), [1] * old + [0] * (80 - old)
        return {"predicted": pack_labels(of_new + of_old)}

    rows = []
    for seed in range(10):
        before = {"seed": seed, "method": "stored", "p": np.nan, "n_new": 0}
        after = {"seed": seed, "method": "replace", "p": 0.75, "n_new": 50}
        rows += [same | before | predicted(30, 80), same | after | predicted(144, 10)]
    found = view.verdicts(pd.DataFrame(rows)).set_index("claim").loc["recalibration"]
    assert (found.why, found.equal) == ("", pytest.approx(-10))  # 90 % after 100 %


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
    made = [
        {"experiment": "some", "scene": scene, "kind": "grouped", "draw": draw, "n": 5,
         "model": model, "right": count, "n_test": 400}
        for scene, draw in itertools.product("ac", range(4))
        for model, count in measured.items() if count
    ]  # fmt: skip
    (row,) = records(judge.judge(of, pd.DataFrame(made)))
    assert row["word"] == word
    assert row["why"] == ("0 of 4 draws measured: a, c" if word == "open" else "")
    assert word == "open" or row["equal"] == pytest.approx(
        (measured[word] - right[0]) / 4
    )
