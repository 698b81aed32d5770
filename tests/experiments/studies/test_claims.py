"""Claims: frozen verdicts are those that were judged; rules from version 4 on judge as said."""

import csv
import hashlib
import itertools
import json
import re

import msgspec
import numpy as np
import pandas as pd
import pytest
import yaml
from rich.console import Console

from experiments.reporting.table import records
from experiments.reproduction import claim
from experiments.studies.claims import judge, view

FOLDER = view.HISTORY.parent


@pytest.fixture(scope="module")
def history():
    with view.HISTORY.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


# Frozen -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("version", "name"), [(2, "rules.yaml"), (3, "rules_3.yaml")])
def test_the_rules_are_those_that_judged(history, version, name):
    rows = [row for row in history if row["rules"] == str(version)]
    file = FOLDER / name
    digest = hashlib.sha256(file.read_bytes()).hexdigest()[:12]
    assert {row["digest"] for row in rows} == {digest}
    written = yaml.safe_load(file.read_text("utf-8"))
    assert {row["dated"] for row in rows} == {str(written["dated"])}
    assert {row["judged"] for row in rows} == {
        "d2b9112a2a45c681744fe3dc688de0ef001e70e3"
    }
    says = {row["claim"]: row["says"] for row in rows}
    claims = written.get("claims") or {"bits": {"ours": written["claim"]}}
    assert says == {k: v.get("paper") or v["ours"] for k, v in claims.items()}


def test_the_words_of_rules_1_are_those_of_their_file(history):
    (earlier,) = yaml.safe_load((FOLDER / "earlier.yaml").read_text("utf-8"))
    rows = [row for row in history if row["rules"] == "1"]
    assert {row["claim"]: row["word"] for row in rows} == earlier["words"]
    assert {row["judged"] for row in rows} == {earlier["commit"]}


def test_the_table_shows_every_verdict_that_says_something(committed):
    table = committed.table("claims")
    lines = view.HISTORY.read_text("utf-8").splitlines(keepends=True)
    assert table.csv() == "".join(line for line in lines if "-100,0," not in line)
    rows = zip(records(table.data), table.cells(), strict=True)
    shown = {tuple(row[key] or "" for key in table.key): cells for row, cells in rows}
    _, rival, word, mean, equal, predicted, *_ = shown[
        2, "accuracy_mended", "softmax_dual_standardised", ""
    ]
    assert rival == "Converged softmax, standardised"
    assert word == "Undecided (rules 2: yes)"
    assert (mean, equal) == ("+3.3 points [−2.8, +9.5]", "−0.2 points [−11, +11]")
    assert predicted == "−12 to +19 points"
    assert "×4.2 [4.1, 4.4]" in shown[2, "softmax", "softmax_dual", ""]
    assert "captured: Dome, objects" in shown[3, "bits", "greys_chosen", "visuotactile"]
    assert "dcbc15c1f131, frozen by commit 30faadaf0b63" in str(table.note)


def test_one_claim_says_its_words_its_verdicts_and_what_judged(
    capsys, monkeypatch, tmp_path
):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    claim.show("recalibration", Console(width=200, highlight=False))
    said = capsys.readouterr().out
    assert "the paper says: Recalibration restores accuracy (32 to 95 %)" in said
    assert "against its own loss: Undecided (rules 2: no), 40 % [32, 48]" in said
    assert "digest dcbc15c1f131" in said
    assert "d2b9112a2a45c681744fe3dc688de0ef001e70e3" in said
    assert "rules 4, as trained: open: the rules are not dated yet" in said
    claim.show("one_bit", Console(width=200, highlight=False))
    assert "rules 4, 20, unseen recordings: open" in capsys.readouterr().out
    with pytest.raises(
        ValueError, match=r"expected one of bits, accuracy.*, found nothing"
    ):
        claim.show("nothing", Console())


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
        "candidates": {"bits": ["hdc"], "greys": ["lda_greys"]},
        "recordings": RECORDINGS,
        "claims": {"keeps_up": about | models | {"lines": {"split": "counts"}}},
    }
    return msgspec.convert(written | changed, judge.Rules)


def lines(right, scenes="abc", draws=4):
    """A line per recording, draw, size and model; right answers of 400 by size and model."""
    made = []
    for scene, draw, n in itertools.product(scenes, range(draws), (5, 50)):
        for model in ("bits", "greys"):
            count = right[n, model] + (draw % 2)
            line = {"experiment": "some", "scene": scene, "split": "counts", "seed": 0}
            line |= {
                "draw": draw,
                "n": n,
                "model": model,
                "right": count,
                "n_test": 400,
                "kind": "grouped",
            }
            made += [line | {"loaded": False}, line | {"split": "random", "right": 0}]
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


def test_a_file_of_rules_names_what_is_wrong(tmp_path):
    path = tmp_path / "rules.yaml"
    right = json.loads(msgspec.json.encode(rules()))
    path.write_text(yaml.safe_dump(right))
    assert judge.read(path) == rules()
    path.write_text(yaml.safe_dump(right | {"candidates": {"bits": list("abcdefg")}}))
    with pytest.raises(ValueError, match=r"rules\.yaml: .*length <= 6.*candidates"):
        judge.read(path)
    path.write_text(yaml.safe_dump(right | {"fudge": 1}))
    with pytest.raises(ValueError, match=r"rules\.yaml: .*fudge"):
        judge.read(path)


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


def test_rules_4_are_of_models_and_recordings_that_there_are():
    of = judge.read(FOLDER / "rules_4.yaml")
    configs = FOLDER.parents[2] / "configs"
    for name in of.recordings:
        assert (configs / "scene" / f"{name}.yaml").is_file(), name
    for each in of.claims.values():
        assert set(each.recordings) <= set(of.recordings)
    for family, candidates in of.candidates.items():
        written = yaml.safe_load((configs / "model" / f"{family}.yaml").read_text())
        assert tuple(written["model"]["forms"]) == candidates
    named = {each.form for each in of.claims.values()} | {
        each.rival for each in of.claims.values()
    }
    named |= {each.model for each in of.times.values()}
    named |= {each.over for each in of.times.values()}
    for model in named:
        assert (configs / "model" / f"{model}.yaml").is_file(), model


def test_verdicts_are_open_without_numbers_until_the_rules_are_dated(
    committed_results, monkeypatch, tmp_path
):
    rules = (FOLDER / "rules_4.yaml").read_text("utf-8")
    written = tmp_path / "rules.yaml"
    monkeypatch.setattr(view, "RULES", written)
    frame = committed_results.frame(*view.VERDICTS.experiments)
    written.write_text(re.sub(r"(?m)^dated: .*$", "dated: null", rules))
    undated = view.verdicts(frame)
    assert set(undated.word) == {"open"}
    assert undated.why.str.startswith(view.UNDATED).all()
    assert undated[["mean", "probability"]].isna().all(axis=None)
    keys = undated[list(view.VERDICTS.key)]
    assert not keys.duplicated().any()
    of = judge.read(written)
    assert set(keys.claim) == {*of.claims, *of.times}
    written.write_text(re.sub(r"(?m)^dated: .*$", "dated: 2026-12-01", rules))
    flips = view.verdicts(frame).set_index("claim").loc["flips"]
    assert abs(flips["mean"]) < 5  # from lines that have no draw and no n


def test_recalibration_is_judged_on_what_each_session_has_right(
    predicting, monkeypatch, tmp_path
):
    rules = (FOLDER / "rules_4.yaml").read_text("utf-8")
    (tmp_path / "rules.yaml").write_text(re.sub(r"(?m)^dated: .*$", "dated: 1", rules))
    monkeypatch.setattr(view, "RULES", tmp_path / "rules.yaml")
    same = {"experiment": "drift", "scene": "wedge_days", "model": "hdc", "share": np.nan,
            "old_split.kind": "leave_group_out", "n_test_new": 160, "n_test_old": 80}  # fmt: skip
    rows = []
    for seed in range(10):
        before = {"method": "stored", "p": np.nan, "n_new": 0, "right_new": 30}
        after = {"method": "replace", "p": 0.75, "n_new": 50, "right_new": 144}
        rows += [
            predicting({"seed": seed, **same, **before, "right_old": 80}),
            predicting({"seed": seed, **same, **after, "right_old": 10}),
        ]
    found = view.verdicts(pd.DataFrame(rows)).set_index("claim").loc["recalibration"]
    assert (found.why, found.equal) == ("", pytest.approx(-10))  # 90 % after 100 %


# The hierarchical model ---------------------------------------------------------------------------


FREEDOM = 4


def drawn(rng, sources, n):
    """From the prior: μ, and the truths of sources."""
    mu = rng.normal(0, 0.10, n)
    between = abs(rng.normal(0, 0.05, n))
    truths = rng.normal(mu[..., None], between[..., None], (*n, sources))
    return mu, truths


@pytest.mark.parametrize(
    ("values", "errors"),
    [
        ([0.02], [0.01]),  # one source
        ([-0.05], [0.05]),
        ([-0.04, 0.01, -0.02], [0.01, 0.02, 0.005]),
        ([0.01, 0.01, 0.01], [0.01, 0.01, 0.01]),  # equal values
        ([0.01, 0.0, -0.12], [0.02, 0.02, 0.02]),  # one far from the others
    ],
)
def test_the_posterior_is_the_integral_of_the_model(values, errors):
    """Over the truths of sources, on a grid of its own and with the density of Student's t."""
    mu = (np.arange(-100, 100) + 0.5) * 0.005
    between = (np.arange(40) + 0.5) * 0.006
    truth = np.arange(-800, 800) * 0.001
    squares = ((truth - mu[:, None, None]) / between[:, None]) ** 2
    normal = np.exp(-squares / 2) / between[:, None]
    weights = np.exp(-((mu[:, None] / 0.10) ** 2) / 2 - (between / 0.05) ** 2 / 2)
    for value, error in zip(values, errors, strict=True):
        squares = ((value - truth) / error) ** 2
        weights *= normal @ (1 + squares / FREEDOM) ** (-(FREEDOM + 1) / 2)
    of_each = weights.sum(axis=1)
    found = judge.Joined(values, np.square(errors))
    assert found.mean().value == pytest.approx(
        np.average(mu, weights=of_each), abs=1e-3
    )
    above = np.average(mu > -0.03, weights=of_each)
    assert found.above(-0.03) == pytest.approx(above, abs=5e-3)


def test_intervals_hold_the_truth_and_words_are_as_sure_as_they_say():
    rng = np.random.default_rng(2)
    held, said = [], []
    mu, truths = drawn(rng, 5, (250,))
    errors = rng.uniform(0.005, 0.03, truths.shape)
    seen = truths + errors * rng.standard_t(FREEDOM, truths.shape)
    for truth, values, of_each in zip(mu, seen, errors, strict=True):
        found = judge.Joined(values, of_each**2)
        _, low, high = found.mean()
        held.append(low <= truth <= high)
        if judge.word_of(found.above(-0.03), 0.95) != judge.OPEN:
            said.append((found.above(-0.03) > 0.5) == (truth > -0.03))
    assert np.mean(held) == pytest.approx(0.95, abs=0.04)
    assert len(said) > 100
    assert np.mean(said) > 0.95


def test_a_source_that_gains_or_a_wider_margin_never_makes_a_loss_more_likely():
    rng = np.random.default_rng(3)
    for _ in range(20):
        values, variances = rng.normal(-0.03, 0.02, 4), rng.uniform(1e-5, 1e-3, 4)
        found = judge.Joined(values, variances)
        likely = [found.above(-margin) for margin in (0.01, 0.02, 0.03, 0.05)]
        assert likely == sorted(likely)
        all_gain = judge.Joined(values + 0.01, variances)
        assert all_gain.above(-0.03) > likely[2]
        assert all_gain.mean().value > found.mean().value


def test_more_sources_that_agree_are_surer():
    likely = [judge.Joined([0.0] * k, [1e-4] * k).above(-0.03) for k in (1, 2, 4, 8)]
    assert likely == sorted(likely)
    assert 0.5 < likely[0] < 0.95 < likely[-1]


@pytest.mark.parametrize(
    ("likely", "word"), [(0.95, "yes"), (0.949, "open"), (0.051, "open"), (0.05, "no")]
)
def test_the_words_of_a_probability(likely, word):
    assert judge.word_of(likely, 0.95) == word
