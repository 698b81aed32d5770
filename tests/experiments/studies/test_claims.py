"""The paper's claims: the frozen rules, words of numbers whose answer is known and of records."""

import math
import re
import subprocess

import numpy as np
import pandas as pd
import pytest
from omegaconf import OmegaConf

from experiments.records import configs
from experiments.records.files import REFERENCE, ROOT
from experiments.records.results import Results
from experiments.reporting import frozen
from experiments.reporting.estimates import Estimate
from experiments.reporting.random_effects import Pooled
from experiments.studies.claims import recalibration, rules, view
from experiments.studies.claims.piece import CONFIRMATORY, variance_of
from experiments.studies.claims.rules import NO, PARTLY, UNDECIDED, YES

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


def test_words_of_the_version_before_are_shown_where_it_had_the_claim():
    assert frozen.earlier()[-1].version == RULES.version - 1
    assert frozen.earlier_word("networks_one_layer") == frozen.earlier_word(
        "networks_three_layers"
    )
    assert frozen.earlier_word("accuracy")
    assert frozen.earlier_word("accuracy_mended") == ""


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


# Of records ---------------------------------------------------------------------------------------


@pytest.fixture
def judged(tmp_path):
    """judged(claim, rival) → the row of the table of claims; None where there is none."""

    def judge(claim, rival=RAW):
        rows = view.claims(Results(tmp_path))
        if rows is None:
            return None
        found = rows[(rows.claim == claim) & (rows.rival == rival)].to_dict("records")
        return found[0] if found else None

    return judge


@pytest.fixture
def record(write_measurement):
    """record(scene, hdc, rival): a recording with these percent of 10,000 right, in 20 draws,
    at 1 and 5 frames a class."""

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
        assert "1 of the 2 laboratories" in judged(claim, STANDARDISED)["because"]


def test_recordings_of_one_laboratory_count_as_one(tmp_path, record, judged):
    record("tactip", 80, 50)
    record("tactip_edge", 70, 50)
    record("gelsight", 80, 50)
    row = judged("accuracy")
    assert row["laboratories"] == 2
    assert 25 < row["mean"] < 30  # of 30 and 20 in one laboratory, 30 in the other
    every = view.otherwise(Results(tmp_path))
    units = every[every.over == "recordings"].units
    assert set(units) == {3}


def test_what_was_unseen_is_judged_alone_too(tmp_path, record, judged):
    record("gelsight", 60, 80)
    record("gelsight_billets", 80, 50)
    record("rgb_fibres", 80, 49)
    row = judged("accuracy")
    assert (row["status"], row["laboratories"]) == ("exploratory", 3)
    table = view.confirmatory(Results(tmp_path))
    rows = table[table.claim == "accuracy"].set_index("recording")
    assert list(rows.index) == ["gelsight_billets", "rgb_fibres", view.JOINED]
    assert set(rows.word) == {YES}
    assert set(rows.status) == {CONFIRMATORY}
    assert rows["mean"].tolist() == pytest.approx([30, 31, 30.5], abs=0.1)


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
    evidence = view.evidence(Results(tmp_path))
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
    assert view.evidence(Results(tmp_path)) is None


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
    assert row["because"].startswith("2 laboratories, no bound")
    record("gelsight_billets", 41, 50)
    row = judged("objects", "published")
    assert -100 < row["mean_low"] < row["mean_high"] < 0
    assert row["because"] == "the interval lies below −3 points"


def drifted(write_measurement, updated, stored=30, old=90, seeds=3):
    of = {"origin": "computed", "order": "time", "model": "hdc", "n_test_new": 100,
          "n_test_old": 100, "n_old": 400, "draw": 0, "p": None}  # fmt: skip
    rows = []
    for seed in range(seeds):
        same = of | {"seed": seed, "right_old": old}
        rows.append(same | {"method": "stored", "n_new": 0, "right_new": stored + seed})
        for method, p in (("replace", 0.75), ("new", None)):
            way = {"method": method, "p": p, "n_new": 50, "right_new": updated + seed}
            rows.append(same | way)
    scene = configs.part("scene", "fibres_exchanged")["scene"]
    write_measurement("drift", rows, config={"scene": scene}, scene="fibres_exchanged")


@pytest.mark.parametrize(
    ("updated", "expected"), [(85, YES), (40, NO), (60, UNDECIDED)]
)
def test_recalibration_is_the_share_of_the_loss_that_comes_back(
    write_measurement, judged, updated, expected
):
    drifted(write_measurement, updated)
    row = judged("recalibration", "its own loss")
    assert row["word"] == expected
    shares = [100 * (updated - 30) / (90 - 30 - seed) for seed in range(3)]
    assert row["mean"] == pytest.approx(np.mean(shares))


def test_what_drift_has_not_cost_cannot_be_restored(
    tmp_path, write_measurement, judged
):
    drifted(write_measurement, 85, stored=80)
    assert judged("recalibration", "its own loss") is None
    evidence = view.evidence(Results(tmp_path))
    remark = evidence[evidence.rival == "its own loss"].remark.iloc[0]
    assert remark == "drift cost 9.0 points, less than the 20 to be restored"


@pytest.mark.parametrize(("prototype", "expected"), [(0.3, YES), (0.02, NO)])
def test_contrast_is_held_against_that_of_hypervectors_and_of_the_speckle(
    write_measurement, judged, prototype, expected
):
    gains = {"speckle": 0.1, "hypervector": 0.15, "prototype": prototype}
    rows = [
        {"origin": "simulated", "seed": seed, "kind": kind, "samples": "held-out", "class_i": i,
         "class_j": j, "value": 0.2 + (gain + seed / 1000 * gain) * (i == j), "n": 80}
        for seed in range(3) for kind, gain in gains.items()
        for i in "AB" for j in "AB"
    ]  # fmt: skip
    write_measurement("correlation", rows, scene="touch")
    for rival in ("hypervector", "speckle"):
        row = judged("contrast", rival)
        assert row["word"] == expected
        assert row["because"] == f"touch: {expected}"
        assert math.isnan(row["mean"])
        less = prototype - gains[rival]
        steps = 1 + np.array([0, 0.001, 0.002])
        half = 4.30265 * less * np.std(steps, ddof=1) / math.sqrt(3)
        low, high = sorted([less * 1.001 - half, less * 1.001 + half])
        numbers = [
            float(text)
            for text in re.findall(r"[-\d.]+\d", row["by_scene"].replace("−", "-"))
        ]
        assert numbers == pytest.approx([less * 1.001, low, high], rel=0.03)
        assert view._number(row) == row["by_scene"]


@pytest.mark.parametrize(("flipped", "expected"), [(100, YES), (50, NO)])
def test_flipped_bits_cost_accuracy_or_do_not(
    tmp_path, write_measurement, judged, flipped, expected
):
    levels = RULES.claims["faults"].levels
    rows = [
        {"origin": "computed", "model": model, "seed": seed, "disturbance": kind, "level": level,
         "draw": 0, "n_test": 1000, "right": right * 10, "n_classes": 5, "model_bytes": 1}
        for seed in range(5) for model in ("hdc", RAW)
        for kind, level, right in (("none", 0.0, 100), *(("bit_flips", x, flipped) for x in levels))
    ]  # fmt: skip
    scene = configs.part("scene", "fibre")["scene"]
    write_measurement("robustness", rows, config={"scene": scene}, scene="fibre")
    for level in levels:
        row = judged("faults", f"unflipped at {100 * level:g} %")
        assert row["word"] == expected
        assert row["mean"] == pytest.approx(flipped - 100)
    assert judged("faults", f"{RAW} at 1 %") is None  # beside, without a word
    assert f"{RAW} at 1 %" in set(view.evidence(Results(tmp_path)).rival)


def test_a_claim_on_times_waits_for_every_way(tmp_path, write_measurement, judged):
    def write(ratios, turns=7):
        rows = [
            {"origin": "simulated", "seed": 0, "way": way, "route": "torch", "turn": turn,
             "model": model, "seconds": seconds, "hdc_seconds": 0.5, "status": "ok",
             "train_accuracy": 1.0, "test_accuracy": 1.0}
            for way, ratio in zip(RULES.ways, ratios, strict=False) for turn in range(turns)
            for model, seconds in (("hdc", 0.5), ("cnn1", ratio * (0.5 + turn / 1000)))
        ]  # fmt: skip
        write_measurement("times_grid", rows, scene="touch")

    write([12, 100])
    assert judged("networks_one_layer", "cnn1") is None
    write([12, 100, 40])
    row = judged("networks_one_layer", "cnn1")
    assert (row["word"], row["unit"]) == (YES, "×")
    # Of the way with the least ratio: median, lowest and highest of seven.
    values = row["mean"], row["mean_low"], row["mean_high"]
    assert values == pytest.approx((12 * 1.006, 12, 12 * 1.012))
    write([8, 100, 40])
    assert judged("networks_one_layer", "cnn1")["word"] == PARTLY
    write([12, 100, 40], turns=1)
    assert judged("networks_one_layer", "cnn1")["word"] == PARTLY
    evidence = view.evidence(Results(tmp_path))
    assert evidence.word.tolist() == [UNDECIDED, YES, YES]
    assert evidence.remark.str.startswith("too few runs").all()


# Of the reference ---------------------------------------------------------------------------------


def test_every_row_of_the_reference_has_a_word_and_a_command():
    results = Results(REFERENCE)
    table = view.claims(results)
    assert not table.duplicated(["claim", "rival"]).any()
    assert set(table.word) <= {YES, NO, PARTLY, UNDECIDED}
    assert table.because.all()
    assert (table.command == view.COMMAND + " " + table.claim).all()
    for made in view.STUDY.tables_of(results):
        assert "<br>" not in made.markdown()


def test_seeds_that_all_agree_join_no_estimate_and_break_no_table(
    write_measurement, judged
):
    drifted(write_measurement, 90, stored=30, old=90, seeds=1)
    assert judged("recalibration", "its own loss") is None
    assert math.isnan(recalibration._variance(pd.Series([1.0, 1.0, 1.0])))
    assert recalibration._variance(pd.Series([0.9, 1.0, 1.1])) == pytest.approx(
        0.01 / 3
    )
