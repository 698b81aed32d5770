"""The paper's claims: the frozen rules, words of numbers whose answer is known and of records."""

import math
import subprocess

import msgspec
import numpy as np
import pandas as pd
import pytest
from omegaconf import OmegaConf

from experiments.records import configs
from experiments.records.files import ROOT
from experiments.records.results import Results
from experiments.records.rows import pack_labels
from experiments.reporting.estimates import Estimate
from experiments.studies.claims import (
    contest,
    faults,
    frozen,
    recalibration,
    recordings,
    rules,
    times,
    verdict,
    view,
)
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.piece import CONFIRMATORY, Piece, variance_of
from experiments.studies.claims.random_effects import Pooled
from experiments.studies.claims.rules import NO, PARTLY, UNDECIDED, YES
from experiments.studies.recordings import forest, values

NAN = math.nan
RULES = frozen.rules()
RAW, STANDARDISED = RULES.rivals


# The rules as data --------------------------------------------------------------------------------


def test_the_page_says_what_the_file_holds():
    page = " ".join((ROOT / "docs" / "claims.md").read_text(encoding="utf-8").split())
    assert f"Version {RULES.version}, " in page
    for claim in RULES.claims:
        assert f"| `{claim}` |" in page, claim
    for name in (*RULES.forms.values(), *RULES.rivals, *RULES.fitted):
        assert f"`{name}`" in page, name
    for name, recording in RULES.recordings.items():
        assert (f"`{name}`" in page) >= (recording.status == CONFIRMATORY), name


@pytest.mark.parametrize("name", RULES.recordings)
def test_recordings_have_the_split_and_the_laboratory_of_their_file(name):
    recording = RULES.recordings[name]
    shown = configs.scene_display(name)
    assert (shown["family"], shown["kind"]) == (recording.laboratory, recording.frames)
    split = configs.part("scene", name)["split"]
    assert {key: split[key] for key in recording.split} == recording.split


def test_the_mended_form_is_that_of_its_file():
    model = configs.part("model", RULES.forms["mended"])["model"]
    mended = RULES.mended
    assert model["encoder"]["thresholds"] == mended["thresholds"]
    assert model["encoder"]["lit"] == mended["lit"]
    assert model["readout"]["shrinkage"] == mended["shrinkage"]


def test_every_claim_has_a_reader_and_a_rule():
    for claim in RULES.claims.values():
        assert claim.experiment in view.READ
        assert bool(claim.paper) != bool(claim.ours)
        if claim.rule != "much_slower":
            rules.rule_of(claim.rule, RULES, claim.share)
    with pytest.raises(ValueError, match=r"rule: expected one of .*, found guess"):
        rules.rule_of("guess")


def test_a_file_with_an_unknown_key_is_refused(tmp_path):
    path = tmp_path / "rules.yaml"
    changed = OmegaConf.load(frozen.PATH)
    changed.recordings.gelsight.lab = "mine"
    OmegaConf.save(changed, path)
    with pytest.raises(ValueError, match=r"rules\.yaml: .*lab.*recordings"):
        frozen.rules(path)


def test_the_commit_that_is_named_holds_the_rules():
    assert len(frozen.commit()) == 12, "frozen.yaml has the digest of other rules"
    place = frozen.PATH.relative_to(ROOT).as_posix()
    words = ["git", "-C", str(ROOT), "show", f"{frozen.commit()}:{place}"]
    shown = subprocess.run(words, capture_output=True, check=False)
    if shown.returncode:
        pytest.skip("no checkout with its whole history")
    assert shown.stdout == frozen.PATH.read_bytes()


# Words of numbers ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("difference", "more", "at_least"),
    [
        ((0.05, 0.02, 0.08), YES, YES),
        ((0.01, 0.005, 0.015), NO, YES),  # ahead by less than the margin
        ((0.05, -0.01, 0.11), UNDECIDED, YES),
        ((0.00, -0.10, 0.10), UNDECIDED, UNDECIDED),
        ((-0.01, -0.02, 0.00), NO, YES),
        ((-0.05, -0.08, -0.02), NO, NO),
        ((0.05, NAN, NAN), UNDECIDED, UNDECIDED),
        ((0.00, NAN, 0.01), UNDECIDED, UNDECIDED),
        ((0.03, 0.01, 0.05), YES, YES),  # the margin itself counts as reached
        ((0.05, 0.00, 0.10), UNDECIDED, YES),  # an interval has to lie above zero
        ((0.00, -0.03, 0.03), UNDECIDED, UNDECIDED),
    ],
)
def test_accuracies_are_judged_by_interval_and_margin(difference, more, at_least):
    estimate = Estimate(*difference)
    assert rules.rule_of("more_accurate").of_one(estimate) == more
    assert rules.rule_of("at_least_as_accurate").of_one(estimate) == at_least


@pytest.mark.parametrize(
    ("rule", "mean", "few", "many"),
    [
        ("more_accurate", (0.05, 0.01, 0.09), UNDECIDED, YES),  # holds +3 points
        ("more_accurate", (0.08, 0.04, 0.12), YES, YES),
        ("more_accurate", (-0.05, -0.12, 0.02), NO, NO),
        ("at_least_as_accurate", (-0.05, -0.08, -0.02), UNDECIDED, NO),
        ("at_least_as_accurate", (-0.08, -0.12, -0.04), NO, NO),
        ("at_least_as_accurate", (0.0, -0.02, 0.02), YES, YES),
        ("more_accurate", (0.06, 0.03, 0.09), UNDECIDED, YES),  # the limit is held
        ("at_least_as_accurate", (-0.06, -0.09, -0.03), UNDECIDED, NO),
        ("restored", (0.7, 0.4, 1.0), UNDECIDED, UNDECIDED),
        ("restored", (0.7, 0.6, 0.8), YES, YES),
        ("restored", (0.3, 0.2, 0.4), NO, NO),
    ],
)
def test_few_laboratories_need_the_whole_interval_on_one_side(rule, mean, few, many):
    judged = rules.rule_of(rule, share=0.5)
    for units, expected in ((RULES.few_units - 1, few), (RULES.few_units, many)):
        pooled = Pooled(Estimate(*mean), NAN, NAN, 0.0, units)
        assert judged.across(pooled, RULES.few_units) == expected


@pytest.mark.parametrize(
    ("ratio", "runs", "expected"),
    [
        ((20, 15, 30), 7, YES),
        ((3, 2, 4), 7, NO),
        ((12, 9, 14), 7, UNDECIDED),
        ((20, 15, 30), 5, UNDECIDED),  # too few for an interval, and not far beyond ten
        ((100, NAN, NAN), 1, YES),
        ((100, 31, 200), 3, YES),
        ((100, 29, 200), 3, UNDECIDED),  # the lowest of few runs counts
        ((2, 1, 3.4), 3, UNDECIDED),
        ((2, NAN, NAN), 1, NO),
        ((math.inf, math.inf, math.inf), 7, YES),  # a rival that never got there
    ],
)
def test_times_are_judged_by_the_interval_of_their_ratio(ratio, runs, expected):
    assert rules.much_slower(Estimate(*ratio), runs) == expected


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([YES, YES, YES], YES),
        ([NO, NO, NO], NO),
        ([YES, NO, NO], PARTLY),
        ([YES, UNDECIDED, YES], PARTLY),
        ([NO, UNDECIDED, NO], UNDECIDED),
        ([UNDECIDED] * 3, UNDECIDED),
    ],
)
def test_a_claim_on_times_needs_all_ways(words, expected):
    assert rules.by_all_ways(words) == expected


def test_scenes_that_differ_make_partly_and_simulated_ones_only_refute():
    assert rules.shared([YES, YES]) == YES
    assert rules.shared([YES, NO]) == rules.shared([YES, UNDECIDED]) == PARTLY
    assert rules.shared([]) == UNDECIDED
    assert rules.refuted([NO, NO]) == NO
    assert rules.refuted([YES]) == rules.refuted([NO, YES]) == UNDECIDED


def test_more_draws_of_one_recording_do_not_make_its_variance_smaller():
    values = np.random.default_rng(0).normal(0, 0.1, 40).tolist()
    spread = np.var(values, ddof=1)
    assert variance_of(values, 100, seeds=False) == pytest.approx(spread)
    assert variance_of(values, 100, seeds=True) == pytest.approx(spread / 40)
    # Equal draws vary as the test frames let them.
    alike = variance_of([0.1] * 5, 100, seeds=False)
    assert alike == pytest.approx((0.1 * 100 + 1) / 102 / 100)
    assert math.isnan(variance_of([0.1], 100, seeds=False))


# Verdicts of pieces -------------------------------------------------------------------------------


def piece(value=0.0, deviation=0.01, laboratory="one", **more):
    """A captured recording of a laboratory, with the number's standard error."""
    of = {"claim": "accuracy", "rival": RAW, "evidence": f"recording of {laboratory}",
          "frames": "captured", "quantity": "HDC less softmax"} | more  # fmt: skip
    return Piece(
        laboratory=laboratory,
        estimate=Estimate(value),
        variance=deviation**2,
        **of,
    )


def claim_of(rule, decide=("captured", "computed"), **more):
    return frozen.Claim(experiment="recordings", rule=rule, decide=decide, **more)


@pytest.mark.parametrize(
    ("rule", "laboratories", "value", "deviation", "word"),
    [
        ("more_accurate", 1, 0.10, 0.01, YES),
        ("more_accurate", 1, -0.10, 0.01, NO),
        ("more_accurate", 1, 0.05, 0.02, UNDECIDED),
        ("more_accurate", 5, 0.05, 0.02, YES),
        ("more_accurate", 1, 0.0, 0.6, UNDECIDED),
        ("at_least_as_accurate", 1, 0.0, 0.01, YES),
        ("at_least_as_accurate", 1, -0.05, 0.02, UNDECIDED),
        ("at_least_as_accurate", 5, -0.05, 0.02, NO),
    ],
)
def test_a_verdict_is_that_of_the_interval_over_laboratories(
    rule, laboratories, value, deviation, word
):
    pieces = [piece(value, deviation, name) for name in "abcdefg"[:laboratories]]
    found = verdict.verdict(claim_of(rule), pieces, RULES)
    assert found.word == word
    assert found.pooled.mean.value == pytest.approx(value)
    assert (found.frames, found.decided_by) == ("captured", pieces)


@pytest.mark.parametrize(
    ("value", "deviation", "word"),
    [(0.8, 0.1, YES), (0.2, 0.1, NO), (0.5, 2, UNDECIDED)],
)
def test_a_verdict_on_shares_has_the_limit_of_its_claim(value, deviation, word):
    claim = claim_of("restored", share=0.5)
    found = verdict.verdict(claim, [piece(value, deviation, unit="%")], RULES)
    assert found.word == word


def test_a_verdict_waits_for_the_laboratories_that_its_claim_needs():
    pieces = [piece(0.5, evidence="a"), piece(0.5, evidence="b", frames="computed")]
    found = verdict.verdict(claim_of("more_accurate", least_units=2), pieces, RULES)
    assert found.word == UNDECIDED
    assert (found.frames, found.decided_by) == ("captured, computed", pieces)
    two = [*pieces, piece(0.5, laboratory="another")]
    found = verdict.verdict(claim_of("more_accurate", least_units=2), two, RULES)
    assert found.word == YES
    assert found.frames == "captured, computed"


def test_pieces_that_do_not_enter_have_no_part_in_a_verdict():
    pieces = [piece(0.1), piece(-0.9, laboratory="another", enters=False)]
    found = verdict.verdict(claim_of("more_accurate"), pieces, RULES)
    assert (found.word, found.decided_by) == (YES, pieces[:1])
    assert verdict.verdict(claim_of("more_accurate"), pieces[1:], RULES) is None


def test_simulated_frames_alone_refute_without_a_number():
    pieces = [piece(-0.5, frames="simulated", enters=False, word=NO)] * 2
    found = verdict.verdict(claim_of("more_accurate"), pieces, RULES)
    assert found.columns(pieces[0]) == pytest.approx(
        {
            "word": NO, "unit": "points",
            "mean": NAN, "mean_low": NAN, "mean_high": NAN, "predicted_low": NAN,
            "predicted_high": NAN, "equal": NAN, "equal_low": NAN, "equal_high": NAN,
            "laboratories": None, "frames": "simulated",
        },
        nan_ok=True,
    )  # fmt: skip
    assert found.decided_by == []


def test_a_verdict_on_times_names_every_way_and_has_the_least_ratio():
    claim = claim_of("much_slower", decide=("times",))
    of = {"frames": "simulated", "unit": "×"}
    pieces = [
        piece(ratio, evidence=way, word=word, **of)
        for way, ratio, word in zip(
            RULES.ways, (30, 9, 50), (YES, NO, YES), strict=True
        )
    ]
    assert verdict.verdict(claim, pieces[:2], RULES) is None
    found = verdict.verdict(claim, pieces, RULES)
    columns = found.columns(pieces[0])
    assert (columns["word"], columns["mean"], columns["unit"]) == (PARTLY, 9, "×")
    assert (columns["laboratories"], columns["frames"]) == (None, "simulated")
    assert found.decided_by == pieces


def test_a_verdict_on_scenes_names_each_of_them_and_takes_no_mean():
    pieces = [
        piece(evidence="touch", word=YES, frames="simulated", unit="1"),
        piece(evidence="tactip", word=NO, unit="1"),
        piece(evidence="gelsight", word=YES, unit="1"),
    ]
    found = verdict.verdict(claim_of("sharper"), pieces, RULES)
    assert (found.word, found.frames) == (PARTLY, "simulated, captured")
    assert math.isnan(found.columns(pieces[0])["mean"])
    assert found.decided_by == pieces
    assert verdict.verdict(claim_of("sharper"), [], RULES) is None


def test_bounds_of_points_end_where_differences_do_and_those_of_shares_do_not():
    pooled = Pooled(Estimate(-0.5, -1.5, 0.5), -2.0, 1.0, 0.1, 3)
    one = piece(possible=(-1.0, 0.25))
    assert verdict.columns_of(pooled, one) == {
        "unit": "points", "mean": -50, "mean_low": -100, "mean_high": 25,
        "predicted_low": -100, "predicted_high": 25,
    }  # fmt: skip
    assert verdict.columns_of(pooled, piece(unit="%")) == {
        "unit": "%", "mean": -50, "mean_low": -150, "mean_high": 50,
        "predicted_low": -200, "predicted_high": 100,
    }  # fmt: skip
    assert verdict.columns_of(pooled, piece(unit="×"))["mean_low"] == -1.5


def test_what_cannot_decide_does_not_enter_and_says_why():
    unknown = {"deviation": NAN, "remark": "seen once"}
    accuracy, sharper = claim_of("more_accurate"), claim_of("sharper", ("simulated",))
    ranks = "simulated frames cannot rank models"
    spread = "of one draw or seed, or all agree, so its variance is unknown"
    for one, claim, enters, remark in (
        (piece(), accuracy, True, ""),
        (piece(frames="simulated"), accuracy, False, ranks),
        (piece(**unknown), accuracy, False, f"seen once; {spread}"),
        (piece(frames="simulated", **unknown), accuracy, False,
         f"seen once; {ranks}; {spread}"),
        (piece(enters=False, **unknown), accuracy, False, "seen once"),
        # Words are joined, no numbers: a variance is not needed.
        (piece(frames="simulated", **unknown), sharper, True, "seen once"),
        (piece(frames="simulated", **unknown), claim_of("much_slower", ("times",)),
         True, "seen once"),
    ):  # fmt: skip
        found = verdict.settled(one, claim)
        assert (found.enters, found.remark) == (enters, remark)
        assert found.estimate == one.estimate


def test_recordings_of_a_laboratory_are_one_unit():
    pieces = [
        piece(0.1, 0.01, "one", evidence="a"),
        piece(0.3, 0.01, "one", evidence="b"),
        piece(0.4, 0.1, "another", evidence="c"),
    ]
    found = verdict.pooled_over(pieces)
    # 0.2 and 0.4, with variances (0.1)² of two that differ by 0.2, and (0.1)².
    assert found.units == 2
    assert found.mean.value == pytest.approx(0.3)


def test_what_the_recordings_show_is_what_the_rules_name():
    assert RULES.rivals == values.RIVALS
    assert tuple(RULES.forms.values()) == values.CONFIRMATORY
    assert 100 * RULES.margin == forest.MARGIN


# Of records ---------------------------------------------------------------------------------------


@pytest.fixture
def judged(tmp_path):
    """judged(claim, rival) → the row of the table of claims; None where there is none."""

    def judge(claim, rival=RAW):
        rows = view.claims(Results(tmp_path).frame(*view.OF))
        if rows is None:
            return None
        found = rows[(rows.claim == claim) & (rows.rival == rival)].to_dict("records")
        return found[0] if found else None

    return judge


@pytest.fixture
def record(write_measurement):
    """record(scene, hdc, rival): a recording with these percent of 10,000 right, in 20 draws,
    at 1 and 5 frames per class."""

    def write(scene, hdc, rival, models=("hdc", RAW), split=None, **more):
        of = {"split": "counts", "seed": 0, "n_test": 10_000, "n": [1, 5]}
        rows = [
            of | {"model": model, "draw": draw, "right": [100 * right - draw % 2] * 2}
            for model, right in zip(models, (hdc, rival), strict=True)
            for draw in range(20)
        ]
        part = configs.part("scene", scene)
        config = {
            "scene": part["scene"] | more,
            "seeds": [0],
            "splits": {"counts": split or part["split"]},
        }
        write_measurement("recordings", rows, config=config, scene=scene)

    return write


@pytest.mark.parametrize(
    ("pairs", "accuracy", "few"),
    [
        ([(80, 50), (80, 49)], YES, YES),
        ([(50, 80), (50, 81)], NO, NO),
        ([(80, 60), (60, 80)], UNDECIDED, UNDECIDED),
    ],
)
def test_recordings_decide_about_accuracy(record, judged, pairs, accuracy, few):
    for scene, pair in zip(("gelsight", "diffuser"), pairs, strict=True):
        record(scene, *pair)
    row = judged("accuracy")
    assert row["word"] == accuracy
    assert judged("few_samples")["word"] == few
    less = np.mean([a - b for a, b in pairs])
    assert row["mean"] == pytest.approx(less, abs=0.1)
    assert row["mean_low"] < row["mean"] < row["mean_high"]
    assert (row["frames"], row["laboratories"]) == ("captured", 2)
    assert row["status"] == "exploratory"
    assert row["digest"] == frozen.digest()
    assert row["command"].endswith("--claim accuracy")
    assert math.isnan(row["predicted_low"])  # of two laboratories
    assert judged("accuracy", STANDARDISED) is None  # was not measured


def test_each_rival_and_each_form_has_a_word_of_its_own(record, judged):
    mended = RULES.forms["mended"]
    for scene, claim in (("gelsight", "accuracy"), ("tactip", "accuracy_mended")):
        assert judged(claim) is None
        form = "hdc" if claim == "accuracy" else mended
        record(scene, 80, 60, (form, STANDARDISED))
        assert judged(claim, RAW) is None
        assert judged(claim, STANDARDISED)["word"] == UNDECIDED


def test_recordings_of_one_laboratory_count_as_one(record, judged):
    record("tactip", 80, 50)
    record("tactip_edge", 70, 50)
    record("gelsight", 80, 50)
    row = judged("accuracy")
    assert row["laboratories"] == 2
    assert 25 < row["mean"] < 30  # of 30 and 20 in one laboratory, 30 in the other


@pytest.mark.parametrize(
    ("what", "remark"),
    [
        ({"split": {"kind": "random", "test_fraction": 0.5}}, "another split"),
        ({"n_fields": 4}, "seen through 4 input fields"),
    ],
)
def test_what_the_rules_do_not_list_is_shown_and_enters_nothing(
    tmp_path, record, judged, what, remark
):
    scene = "fibre_4_fields" if "n_fields" in what else "gelsight"
    record(scene, 80, 60, **what)
    assert judged("accuracy") is None
    evidence = view.evidence(Results(tmp_path).frame(*view.OF))
    of_claim = evidence[evidence.claim == "accuracy"]
    assert of_claim.remark.str.startswith(remark).all()
    assert set(of_claim.enters) == {"no"}


def test_a_recording_where_both_have_all_right_gives_no_evidence(record, judged):
    record("gelsight", 100, 100)
    assert judged("accuracy") is None


def test_sizes_that_a_draw_cannot_fill_do_not_count(
    tmp_path, write_measurement, judged
):
    rows = [
        {"split": "counts", "seed": 0, "n_test": 100, "draw": draw, "model": model,
         "n": [1, 5] if draw else [1], "right": [right, right] if draw else [right]}
        for model, right in (("hdc", 60), (RAW, 50)) for draw in range(3)
    ]  # fmt: skip
    config = {"scene": configs.part("scene", "gelsight")["scene"], "seeds": [0]}
    write_measurement("recordings", rows, config=config, scene="gelsight")
    assert view.evidence(Results(tmp_path).frame(*view.OF)) is None


@pytest.mark.parametrize(
    ("hdc", "rival", "expected"), [(30, 5, NO), (5, 30, UNDECIDED), (0, 0, None)]
)
def test_a_simulated_scene_refutes_or_ranks_nothing(
    write_run, judged, hdc, rival, expected
):
    for seed in range(3):
        write_run("hdc", seed=seed, wrong=range(hdc))
        write_run(RAW, seed=seed, wrong=range(rival))
    row = judged("accuracy")
    assert (row and row["word"]) == expected


def test_objects_are_held_against_the_papers_accuracy(record, judged):
    record("gelsight", 60, 50)
    row = judged("objects", "published")
    assert row["word"] == NO
    assert row["mean"] == pytest.approx(-40, abs=0.1)
    record("diffuser", 100, 50)  # no objects
    assert judged("objects", "published")["laboratories"] == 1


def test_no_bound_of_objects_lies_above_the_papers_accuracy(record, judged):
    """Two laboratories 40 points apart: Student with one degree of freedom reaches further than
    accuracies do, which is said."""
    record("gelsight", 40, 50)
    record("gelsight_billets", 80, 50)
    row = judged("objects", "published")
    assert (row["mean_low"], row["mean_high"]) == (-100, 0)
    assert row["word"] == UNDECIDED
    record("gelsight_billets", 41, 50)
    row = judged("objects", "published")
    assert -100 < row["mean_low"] < row["mean_high"] < 0
    assert row["word"] == NO


@pytest.fixture
def drifted(write_measurement, predicting):
    """drifted(updated, …) leaves a measurement of drift on exchanged fibres."""

    def write(updated, stored=30, old=90, seeds=3):
        of = {"origin": "computed", "model": "hdc", "n_test_new": 100, "n_test_old": 100,
              "n_old": 400, "p": None}  # fmt: skip
        rows = []
        for seed in range(seeds):
            same = of | {"seed": seed, "right_old": old, "n_new": 50}
            before = {"method": "stored", "n_new": 0, "right_new": stored + seed}
            after = {"right_new": updated + seed}
            rows += [
                same | before,
                same | after | {"method": "replace", "p": 0.75},
                same | after | {"method": "new"},
            ]
        config = {"scene": configs.part("scene", "fibres_exchanged")["scene"]}
        packed = map(predicting, rows)
        write_measurement("drift", packed, config=config, scene="fibres_exchanged")

    return write


def test_what_drift_has_not_cost_cannot_be_restored(tmp_path, drifted, judged):
    drifted(85, stored=80)
    assert judged("recalibration", "its own loss") is None
    evidence = view.evidence(Results(tmp_path).frame(*view.OF))
    remark = evidence[evidence.rival == "its own loss"].remark.iloc[0]
    assert remark == "drift cost 9.0 points, less than the 20 to be restored"


def test_a_claim_on_times_waits_for_every_way(
    tmp_path, write_measurement, write_run, judged
):
    def write(ratios, seeds=7):
        rows = [
            {"origin": "simulated", "seed": seed, "way": way, "turn": seed, "model": model,
             "seconds": seconds, "hdc_seconds": 0.5, "status": "ok",
             "train_accuracy": 1.0, "test_accuracy": 1.0}
            for way, ratio in ratios.items() for seed in range(seeds)
            for model, seconds in (("hdc", 0.5), ("cnn1", ratio * (0.5 + seed / 1000)))
        ]  # fmt: skip
        write_measurement("times_grid", rows, scene="touch")

    write({"libraries": 12, "tuned": 40})
    assert judged("networks_one_layer", "cnn1") is None
    for seed in range(7):
        report = {"training_s": 50.0 + seed, "loss": 1.0, "train_accuracy": 0.95}
        write_run("cnn1", seed=seed, curve=[report], beside_s={"hdc": 0.5})
    row = judged("networks_one_layer", "cnn1")
    assert (row["word"], row["unit"]) == (YES, "×")
    # Of the way with the least ratio: median, lowest and highest of seven.
    values = row["mean"], row["mean_low"], row["mean_high"]
    assert values == pytest.approx((12 * 1.006, 12, 12 * 1.012))
    write({"libraries": 8, "tuned": 40})
    assert judged("networks_one_layer", "cnn1")["word"] == PARTLY
    write({"libraries": 12, "tuned": 40}, seeds=1)
    assert judged("networks_one_layer", "cnn1")["word"] == PARTLY
    evidence = view.evidence(Results(tmp_path).frame(*view.OF))
    assert evidence.word.tolist() == [UNDECIDED, YES, YES]
    few = evidence.remark.str.startswith("too few runs").tolist()
    assert few == [True, False, True]


# Complete rows ------------------------------------------------------------------------------------


@pytest.fixture
def row_of(tmp_path):
    """row_of(claim, rival, evidence) → the row of the table of evidence."""

    def find(claim, rival, evidence):
        rows = view.evidence(Results(tmp_path).frame(*view.OF)).set_index(
            ["claim", "rival", "evidence"], drop=False
        )
        return rows.loc[[(claim, rival, evidence)]].to_dict("records")[0]

    return find


def equals(**row):
    """A row with these texts and, nearly, these numbers; nothing else is in it."""
    return {
        key: pytest.approx(value, rel=1e-4, nan_ok=True)
        if isinstance(value, int | float)
        else value
        for key, value in row.items()
    }


def least_error(difference, n):
    """Points that a difference of shares of n test frames varies at least, with one more frame on
    which they disagree."""
    return 100 * math.sqrt((n * abs(difference) + 1) / (n + 2) / n)


def write_contrasts(write_measurement, gains):
    """Two classes whose correlations with each other are 0.2 less than `gains` by kind and seed."""
    rows = [
        {"origin": "simulated", "seed": seed, "kind": kind, "samples": samples,
         "class_i": i, "class_j": j, "n": 80,
         "value": 0.2 + (gain if samples == "held-out" else 0.0) * (i == j)}
        for kind, of_seeds in gains.items() for seed, gain in enumerate(of_seeds)
        for samples in ("training", "held-out") for i in "AB" for j in "AB"
    ]  # fmt: skip
    return write_measurement("correlation", rows, scene="touch")


def test_the_whole_row_of_a_contrast(tmp_path, write_measurement, row_of, judged):
    gains = {"speckle": (0.1, 0.1), "prototype": (0.3, 0.32)}
    entry = write_contrasts(write_measurement, gains)
    half = 12.7062 * 0.01  # t(0.975, 1), and the standard error of 0.2 and 0.22
    where = {"record": entry["id"]}
    assert row_of("contrast", "speckle", "touch") == equals(
        claim="contrast", rival="speckle", evidence="touch", status="exploratory",
        laboratory="simulated touch sensor", frames="simulated",
        quantity="contrast of prototypes minus that of speckle, 0.100 to 0.310",
        value=0.21, value_low=0.21 - half, value_high=0.21 + half, standard_error=NAN,
        unit="1", n="2 seeds", word=YES, enters="yes", remark="",
        command="python -m experiments.run experiment=correlation", **where,
    )  # fmt: skip
    assert judged("contrast", "speckle") == equals(
        claim="contrast", says=RULES.claims["contrast"].paper, by="the paper",
        rival="speckle", word=YES, unit="1", mean=NAN,
        mean_low=NAN, mean_high=NAN, predicted_low=NAN, predicted_high=NAN,
        equal=NAN, equal_low=NAN, equal_high=NAN,
        laboratories=None, frames="simulated", by_scene="Touch: 0.21 [0.083, 0.34]",
        status="exploratory", rules=RULES.version,
        frozen=frozen.commit(), digest=frozen.digest(),
        command="python -m experiments.reproduce --full --claim contrast", **where,
    )  # fmt: skip
    # Hypervectors were not measured.
    assert set(view.evidence(Results(tmp_path).frame(*view.OF)).rival) == {"speckle"}


def test_the_whole_row_of_flipped_bits_and_of_what_stands_beside(
    write_measurement, row_of
):
    of = {"origin": "computed", "n_test": 1000, "n_classes": 5, "model_bytes": 1}
    clean = ("none", 0.0)
    rows = [
        of | {"model": model, "seed": seed, "disturbance": kind, "level": level,
              "draw": draw, "right": right - 20 * draw}
        for model, (kind, level), by_seed in (
            ("hdc", clean, (910, 810)),
            ("hdc", ("bit_flips", 0.01), (890, 770)),
            ("hdc", ("bit_flips", 0.2), (100, 100)),
            ("hdc", ("noise", 0.01), (100, 100)),
            (RAW, clean, (700, 700)),
            (RAW, ("bit_flips", 0.01), (500, 520)),
            (RAW, ("bit_flips_int8", 0.01), (600, 620)),
        )
        for seed, right in enumerate(by_seed) for draw in (0, 1)
    ]  # fmt: skip
    # A seed without flips has no part, and flips without a seed that is as it was have none.
    rows.append({**rows[0], "seed": 9})
    scene = configs.part("scene", "fibre")["scene"]
    entry = write_measurement(
        "robustness", rows, config={"scene": scene}, scene="fibre"
    )
    same = {
        "claim": "faults", "evidence": "fibre", "laboratory": "wavefrontshaping",
        "frames": "computed", "status": "exploratory", "unit": "points", "n": "2 seeds",
        "command": "python -m experiments.run experiment=robustness",
        "record": entry["id"],
    }  # fmt: skip
    half = 12.7062  # of two seeds 2 points apart, whose standard error is 1
    assert row_of("faults", "unflipped at 1 %", "fibre") == equals(
        **same, rival="unflipped at 1 %", quantity="HDC: change by 1 % flipped bits",
        value=-3, value_low=-3 - half, value_high=-3 + half, standard_error=1,
        word=UNDECIDED, enters="yes", remark="",
    )  # fmt: skip
    beside = {"word": "", "enters": "no", "remark": "beside, without a word"}
    assert row_of("faults", f"{RAW} at 1 %", "fibre") == equals(
        **same, **beside, rival=f"{RAW} at 1 %",
        quantity="Converged softmax: change by 1 % flipped bits",
        value=-19, value_low=-19 - half, value_high=-19 + half, standard_error=1,
    )  # fmt: skip
    assert row_of("faults", f"{RAW}_int8 at 1 %", "fibre") == equals(
        **same, **beside, rival=f"{RAW}_int8 at 1 %",
        quantity="Converged softmax, weights of 8 bits: change by 1 % flipped bits",
        value=-9, value_low=-9 - half, value_high=-9 + half, standard_error=1,
    )  # fmt: skip
    assert faults.lost(pd.DataFrame(rows), "hdc", 0.1) == []


@pytest.mark.parametrize(
    ("scene", "interval", "divided"), [("fibre", True, 5), ("gelsight", False, 1)]
)
def test_seeds_on_one_recording_are_no_sensors(
    write_measurement, row_of, scene, interval, divided
):
    """Five fibres make the variance of their mean a fifth; five draws of the flips do not."""
    of = {"model": "hdc", "n_test": 10_000, "n_classes": 5, "model_bytes": 1}
    lost = [0, 1000, 2000, 3000, 4000]
    rows = [
        of | {"seed": seed, "disturbance": kind, "level": level, "right": right}
        for seed, less in enumerate(lost)
        for kind, level, right in (("none", 0, 9000), ("bit_flips", 0.01, 9000 - less))
    ]
    config = {"scene": configs.part("scene", scene)["scene"]}
    write_measurement("robustness", rows, config=config, scene=scene)
    row = row_of("faults", "unflipped at 1 %", scene)
    deviation = np.std(lost, ddof=1) / 100
    assert row["value"] == pytest.approx(-20)
    assert row["standard_error"] == pytest.approx(deviation / math.sqrt(divided))
    assert math.isnan(row["value_low"]) != interval


def test_the_whole_rows_of_a_recalibration(tmp_path, write_measurement, predicting):
    """HDC falls from 90 to 40 and 30 %, and the rule's update wins half and three quarters of that
    back; others do not count."""
    of = {"origin": "computed", "n_test_new": 100, "n_test_old": 100, "n_old": 400,
          "p": None, "right_old": 90}  # fmt: skip
    rule = ("replace", 0.75, 50)
    ways = (
        ("hdc", ("stored", None, 0), (40, 30)),
        ("hdc", rule, (65, 75)),
        ("hdc", ("replace", 0.5, 50), (10, 10)),
        ("hdc", ("replace", 0.75, 5), (11, 11)),
        ("hdc", ("pooled", None, 50), (71, 73)),
        ("hdc", ("pooled", None, 90), (99, 99)),
        ("correlation", ("stored", None, 0), (20, 20)),
        ("correlation", ("new", None, 50), (99, 90)),
    )
    rows = [
        of | {"model": model, "method": method, "p": p, "n_new": n,
              "seed": seed, "right_new": right}
        for model, (method, p, n), by_seed in ways
        for seed, right in enumerate(by_seed)
    ]  # fmt: skip
    scene = "fibres_exchanged"
    config = {"scene": configs.part("scene", scene)["scene"]}
    packed = map(predicting, rows)
    entry = write_measurement("drift", packed, config=config, scene=scene)
    found = view.evidence(Results(tmp_path).frame(*view.OF)).to_dict("records")
    same = {
        "claim": "recalibration", "laboratory": "wavefrontshaping",
        "frames": "computed", "status": "exploratory", "unit": "%", "n": "2 seeds",
        "command": "python -m experiments.run experiment=drift",
        "record": entry["id"],
    }  # fmt: skip
    half = 12.7062 * 12.5
    (share,) = found
    assert share == equals(
        **same, rival="its own loss", evidence=scene,
        quantity="share of the loss regained by bits replaced with p = 0.75, 50 new frames",
        value=62.5, value_low=62.5 - half, value_high=62.5 + half, standard_error=12.5,
        word=UNDECIDED, enters="yes", remark="drift cost 55.0 points",
    )  # fmt: skip


def test_the_whole_row_of_a_recording(record, row_of, judged):
    record("gelsight", 80, 60)
    same = {
        "evidence": "gelsight", "laboratory": "Yc1007942", "frames": "captured",
        "status": "exploratory", "unit": "points", "enters": "yes", "remark": "",
        "command": "python -m experiments.run experiment=recordings scene=gelsight",
        "record": judged("objects", "published")["record"],
    }  # fmt: skip
    assert same["record"].startswith("recordings-")
    # Equal draws vary as their test frames let them.
    assert row_of("accuracy", RAW, "gelsight") == equals(
        **same, claim="accuracy", rival=RAW, quantity="HDC minus Converged softmax",
        value=20, value_low=20, value_high=20, n="20 draws, 5 frames per class",
        standard_error=least_error(0.2, 10_000), word=YES,
    )  # fmt: skip
    assert row_of("few_samples", RAW, "gelsight")["n"] == (
        "20 draws, 1 and 5 frames per class"
    )
    assert row_of("objects", "published", "gelsight") == equals(
        **same, claim="objects", rival="published",
        quantity="HDC minus the paper's 100 %", value=-20.005, value_low=-20.01,
        value_high=-20, n="20 draws, 5 frames per class",
        standard_error=least_error(0.20005, 10_000), word=NO,
    )  # fmt: skip


def test_a_record_that_does_not_say_its_split_is_not_of_that_of_the_rules():
    listed = RULES.recordings["gelsight"]
    said = {"splits": {"counts": dict(listed.split)}}
    for config, expected in ((said, True), ({}, False), ({"splits": None}, False)):
        assert (
            recordings.is_split(pd.DataFrame({"config": [config]}), listed) == expected
        )


def test_the_largest_size_that_is_open_counts():
    """At 50 frames of each class both models are saturated."""
    means = {5: (0.6, 0.5), 20: (0.9, 1.0), 50: (0.995, 1.0)}
    units = {n: np.array([of] * 2).T for n, of in means.items()}
    limit = RULES.saturated
    assert recordings._largest_open(units, limit) == [20]
    assert recordings._largest_open({5: units[5]}, limit) == [5]
    assert recordings._largest_open({50: units[50]}, limit) == []


def test_what_was_predicted_is_held_against_the_classes_of_its_draw(
    tmp_path, write_measurement, row_of
):
    """The row with the classes may be of a model that is not compared."""
    truth = np.arange(10)
    rows = []
    for draw in (0, 1):
        of = {"split": "counts", "seed": 0, "n_test": 10, "draw": draw, "n": [5]}
        for model, wrong in (("ridge", 0), ("hdc", 3), (RAW, 5)):
            said = np.where(np.arange(10) < wrong, 9 - truth, truth)
            row = of | {"model": model, "predicted": [pack_labels(said)]}
            if model == "ridge":
                row["labels"] = pack_labels(truth)
            rows.append(row)
    part = configs.part("scene", "gelsight")
    config = {"scene": part["scene"], "splits": {"counts": part["split"]}}
    write_measurement("recordings", rows, config=config, scene="gelsight")
    row = row_of("accuracy", RAW, "gelsight")
    assert (row["value"], row["n"]) == (
        pytest.approx(20),
        "2 draws, 5 frames per class",
    )
    assert math.isnan(row["value_low"])  # of fewer than ten draws


@pytest.mark.parametrize(
    ("scene", "classes", "wrong", "remark"),
    [
        ("touch", 5, (5, 30), ""),
        ("touch", 5, (0, 0), "saturated"),
        ("finger", 7, (5, 30), "fitted to HDC's own accuracy"),
    ],
)
def test_the_whole_row_of_a_simulated_scene(
    write_run, row_of, scene, classes, wrong, remark
):
    names = [str(k) for k in range(classes)]
    for seed in range(2):
        for model, of_model in zip(("hdc", RAW), wrong, strict=True):
            at = range(of_model)
            write_run(model, scene=scene, classes=names, seed=seed, wrong=at)
    row = row_of("accuracy", RAW, scene)
    low, high = row.pop("value_low"), row.pop("value_high")
    less = wrong[1] - wrong[0]
    assert low < less < high or less == 0
    ranks = "simulated frames cannot rank models"
    shown = configs.scene_display(scene)
    assert row == equals(
        claim="accuracy", rival=RAW, evidence=scene, laboratory=shown["family"],
        frames="simulated", status="exploratory", value=less,
        quantity="HDC minus Converged softmax", unit="points", n="2 seeds",
        standard_error=least_error(less / 100, 2 * 100), enters="no",
        remark=remark or ranks, word="" if remark else row["word"],
        command=f"python -m experiments.run experiment=all_scenes scene={scene}",
        record="records.jsonl",
    )  # fmt: skip
    assert remark or row["word"]


def test_evidence_is_judged_by_the_rules_that_are_given(
    tmp_path, record, write_measurement
):
    record("gelsight", 80, 60)
    rows = [
        {"origin": "simulated", "seed": 0, "way": "tuned", "turn": 0,
         "model": model, "seconds": seconds, "hdc_seconds": 0.5,
         "status": "ok", "train_accuracy": 1.0, "test_accuracy": 1.0}
        for model, seconds in (("hdc", 0.5), ("cnn1", 50))
    ]  # fmt: skip
    write_measurement("times_grid", rows, scene="touch")
    frame = Results(tmp_path).frame(*view.OF)
    listed = msgspec.structs.replace(
        RULES.recordings["gelsight"], laboratory="another", frames="computed"
    )
    others = msgspec.structs.replace(
        RULES, margin=0.5, times=1000, recordings={"gelsight": listed}
    )
    of = Evidence(frame)
    (found,) = recordings.pieces("accuracy", others.claims["accuracy"], others, of)
    assert (found.laboratory, found.frames) == ("another", "computed")
    for given, word in ((RULES, YES), (others, NO)):
        for module, name in ((recordings, "accuracy"), (times, "networks_one_layer")):
            (found,) = module.pieces(name, given.claims[name], given, of)
            assert found.word == word
        judged = verdict.verdict(claim_of("more_accurate"), [piece(0.2)], given)
        assert judged.word == word


# Cells --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rival", "shown"),
    [
        ("published", "the paper's accuracy"),
        ("unflipped at 10 %", "itself without flips at 10 %"),
        ("hypervector", "hypervectors"),
        ("speckle", "the speckle"),
        ("softmax_dual", "Converged softmax"),
        ("softmax_dual at 1 %", "Converged softmax at 1 %"),
        (
            "softmax_dual_int8 at 1 %",
            "Converged softmax, weights of 8 bits at 1 %",
        ),
    ],
)
def test_rivals_in_words(rival, shown):
    assert view.rival_name(rival) == shown


@pytest.mark.parametrize(
    ("unit", "numbers", "mean", "predicted"),
    [
        ("points", (-5.0, -12.34, 2.26), "−5.0 points [−12, +2.3]", "−12 to +2.3 points"),
        ("%", (62.5, 10.0, 100.0), "62 % [10, 100]", "10 to 100 %"),
        ("×", (12.3, 11.0, 14.0), "×12 [11, 14]", "11 to 14 ×"),
        ("1", (0.21, 0.083, 0.34), "0.21 [0.083, 0.34]", "0.083 to 0.34 1"),
        ("points", (0.0, -1.0, 1.0), "0 points [−1.0, +1.0]", "−1.0 to +1.0 points"),
        ("points", (5.0, NAN, NAN), "+5.0 points", "–"),
        ("points", (5.0, -1.0, NAN), "+5.0 points", "–"),
        ("%", (NAN, NAN, NAN), "–", "–"),
    ],
)  # fmt: skip
def test_numbers_are_shown_in_their_unit_with_their_interval(
    unit, numbers, mean, predicted
):
    value, low, high = numbers
    row = {"unit": unit, "mean": value, "mean_low": low, "mean_high": high,
           "predicted_low": low, "predicted_high": high}  # fmt: skip
    assert view._number(row) == mean
    assert view._range(row) == predicted


@pytest.mark.parametrize("commit", ["0123456789ab", ""])
def test_the_note_names_the_rules_and_the_commit_that_froze_them(
    record, tmp_path, monkeypatch, commit
):
    monkeypatch.setattr(view, "commit", lambda: commit)
    record("gelsight_billets", 80, 60)
    of_commit = f", frozen by commit {commit}" if commit else ""
    frame = Results(tmp_path).frame(*view.OF)
    (made,) = view.STUDY.tables[0].made(frame)
    assert made.note.endswith(
        f"Rules: docs/claims.md, version {RULES.version} of {RULES.dated}, "
        f"digest {frozen.digest()}{of_commit}."
    )


def test_the_note_says_that_most_recordings_had_been_seen(record, tmp_path):
    record("gelsight", 95, 60)
    record("gelsight_billets", 80, 60)
    record("spr", 99, 60)  # the rules do not list it
    frame = Results(tmp_path).frame(*view.OF)
    every = next(view.STUDY.tables[0].made(frame)).note
    assert "Verdicts are exploratory" in every
    sentence = (
        "With 5 frames per class published HDC exceeds 90 % on 1 of 2 recordings."
    )
    assert sentence in every
    for name, reading in contest.rules().readings.items():
        assert f"{name}: {reading}." in every


def test_a_claim_of_ours_is_said_to_be_ours(record, judged):
    record("gelsight", 80, 60, (RULES.forms["mended"], RAW))
    row = judged("accuracy_mended")
    assert (row["by"], row["says"]) == (
        "this repository",
        RULES.claims["accuracy_mended"].ours,
    )


# Of the reference ---------------------------------------------------------------------------------


def test_every_row_of_the_reference_has_a_word_and_a_command(committed):
    made = {table.name: table for table in committed.tables["claims"]}
    table = made["claims"].data
    assert not table.duplicated(["claim", "rival"]).any()
    assert set(table.word) <= {YES, NO, PARTLY, UNDECIDED}
    assert (table.command == view.COMMAND + " " + table.claim).all()
    for each in made.values():
        assert "<br>" not in each.markdown()


def test_seeds_that_all_agree_join_no_estimate_and_break_no_table(drifted, judged):
    drifted(90, stored=30, old=90, seeds=1)
    assert judged("recalibration", "its own loss") is None
    assert math.isnan(recalibration._variance(pd.Series([1.0, 1.0, 1.0])))
    assert recalibration._variance(pd.Series([0.9, 1.0, 1.1])) == pytest.approx(
        0.01 / 3
    )


def test_a_verdict_is_shown_as_rules_3_read_it():
    for name, word in view.READ_AS.items():
        assert word in contest.rules().readings[name]
    shown = view.COLUMNS["word"].cell
    assert shown({"claim": "recalibration", "word": "no"}) == (
        "Undecided (rules 2: no)"
    )
    assert shown({"claim": "recalibration", "word": "undecided"}) == "Undecided"
    assert shown({"claim": "contrast", "word": "no"}) == "No"
