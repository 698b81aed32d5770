"""The paper's claims: the rules on numbers whose answer is known, and verdicts of records."""

import math

import pytest

from experiments.records import configs
from experiments.records.files import REFERENCE
from experiments.records.results import Results
from experiments.reporting.estimates import Estimate
from experiments.reporting.measured import RIVAL
from experiments.studies.claims import phrases, rules, view
from experiments.studies.claims.rules import NO, PARTLY, UNDECIDED, YES

NAN = math.nan


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
    assert rules.more_accurate(Estimate(*difference)) == more
    assert rules.at_least_as_accurate(Estimate(*difference)) == at_least


@pytest.mark.parametrize(
    ("ratios", "expected"),
    [
        ([20, 30], YES),
        ([2, 3], NO),
        ([10, 12], YES),
        ([9, 11], UNDECIDED),
        ([20, math.inf], YES),  # a rival that never got there
        ([], UNDECIDED),
    ],
)
def test_times_are_judged_in_every_run(ratios, expected):
    assert rules.slower(ratios) == expected


@pytest.mark.parametrize(
    ("measured", "simulated", "expected"),
    [
        ([YES, UNDECIDED], [NO], YES),
        ([YES, NO], [], PARTLY),
        ([NO, NO], [YES], NO),
        ([], [YES], UNDECIDED),  # simulated frames rank nothing
        ([UNDECIDED], [NO, UNDECIDED], NO),  # and can refute
        ([], [YES, NO], UNDECIDED),
    ],
)
def test_simulated_frames_only_refute(measured, simulated, expected):
    assert rules.judge(measured, simulated) == expected


# Of records ---------------------------------------------------------------------------------------


@pytest.fixture
def judged(tmp_path):
    """judged(claim) → its verdict, and the values of its evidence by name."""

    def judge(claim):
        rows = view.evidence(Results(tmp_path))
        values = rows[rows.claim == claim].set_index("evidence")["value"].to_dict()
        return view.verdicts(rows).get(claim, UNDECIDED), values

    return judge


@pytest.fixture
def record(write_measurement):
    """record(scene, hdc, rival): a measured recording with these right of 100, in 20 draws."""

    def write(scene, hdc, rival, **more):
        of = {"split": "counts", "seed": 0, "n_test": 100, "n": [1, 5]}
        rows = [
            of | {"model": model, "draw": draw, "right": [right + draw % 2] * 2}
            for model, right in (("hdc", hdc), (RIVAL, rival))
            for draw in range(20)
        ]
        config = {"scene": configs.part("scene", scene)["scene"] | more, "seeds": [0]}
        write_measurement("recordings", rows, config=config, scene=scene)

    return write


@pytest.mark.parametrize(
    ("pairs", "accuracy", "few"),
    [
        ([(80, 60)], YES, YES),
        ([(60, 80)], NO, NO),
        ([(80, 79)], NO, YES),
        ([(80, 60), (60, 80)], PARTLY, PARTLY),
    ],
)
def test_recordings_decide_about_accuracy(record, judged, pairs, accuracy, few):
    for scene, pair in zip(("gelsight", "diffuser"), pairs, strict=False):
        record(scene, *pair)
    assert judged("accuracy")[0] == accuracy
    assert judged("few_samples")[0] == few
    assert judged("accuracy")[1]["gelsight"] == pytest.approx(pairs[0][0] - pairs[0][1])


def test_a_saturated_recording_decides_nothing(record, judged):
    record("gelsight", 80, 60, saturated="every model has all right")
    assert judged("accuracy") == (UNDECIDED, {})


@pytest.mark.parametrize(
    ("hdc", "rival", "expected"), [(30, 5, NO), (5, 30, UNDECIDED), (0, 0, UNDECIDED)]
)
def test_a_simulated_scene_refutes_or_ranks_nothing(
    write_run, judged, hdc, rival, expected
):
    for seed in range(3):
        write_run("hdc", seed=seed, wrong=range(hdc))
        write_run(RIVAL, seed=seed, wrong=range(rival))
    verdict, values = judged("accuracy")
    assert verdict == expected
    assert list(values.values()) == pytest.approx([rival - hdc])


@pytest.mark.parametrize(("updated", "expected"), [(90, UNDECIDED), (31, NO)])
def test_recalibration_is_what_an_update_gains(
    write_measurement, judged, updated, expected
):
    of = {"origin": "simulated", "order": "time", "model": "hdc", "n_test_new": 100,
          "n_test_old": 100, "n_old": 400, "right_old": 50, "draw": 0, "p": None}  # fmt: skip
    rows = []
    for seed in range(3):
        rows.append(
            of | {"seed": seed, "method": "stored", "n_new": 0, "right_new": 30 + seed}
        )
        for method, p in (("replace", 0.75), ("new", None)):
            way = {"seed": seed, "method": method, "p": p, "n_new": 50}
            rows.append(of | way | {"right_new": updated + seed})
    # Samples drawn from all of the session have no say: a user has the first in time.
    rows += [
        row | {"order": "random", "right_new": 100 - row["right_new"]} for row in rows
    ]
    write_measurement("drift", rows)
    verdict, values = judged("recalibration")
    assert verdict == expected
    assert values["drift, HDC, p = 0.75"] == pytest.approx(updated - 30)


@pytest.mark.parametrize(("prototype", "expected"), [(0.3, YES), (0.02, NO)])
def test_contrast_of_prototypes_is_held_against_that_of_speckle(
    write_measurement, judged, prototype, expected
):
    rows = [
        {"origin": "simulated", "seed": seed, "kind": kind, "samples": "held-out", "class_i": i,
         "class_j": j, "value": 0.2 + gain * (i == j), "n": 80}
        for seed in range(3) for kind, gain in (("speckle", 0.1), ("prototype", prototype))
        for i in "AB" for j in "AB"
    ]  # fmt: skip
    write_measurement("correlation", rows)
    assert judged("contrast")[0] == expected


@pytest.mark.parametrize(("flipped", "expected"), [(100, UNDECIDED), (50, NO)])
def test_flipped_bits_cost_accuracy_or_do_not(
    write_measurement, judged, flipped, expected
):
    rows = [
        {"origin": "simulated", "model": "hdc", "seed": seed, "disturbance": kind, "level": level,
         "draw": 0, "n_test": 1000, "right": right * 10, "n_classes": 5, "model_bytes": 1}
        for seed in range(5) for kind, level, right in (("none", 0.0, 100),
                                                        ("bit_flips", view.FLIPPED, flipped))
    ]  # fmt: skip
    write_measurement("robustness", rows)
    verdict, values = judged("faults")
    assert verdict == expected
    assert list(values.values()) == [pytest.approx(flipped - 100)]


def test_only_what_was_measured_has_a_row(tmp_path, write_run):
    write_run("hdc")
    assert view.claims(Results(tmp_path)) is None
    write_run("cnn1", curve=[{"training_s": 90.0, "loss": 1.0, "train_accuracy": 0.95}])
    results = Results(tmp_path)
    assert set(view.evidence(results).claim) == {"networks"}
    assert view.claims(results) is None  # HDC by ordinary routes was not timed


def test_every_claim_of_the_reference_has_one_of_four_words_and_numbers_after_it():
    table = view.claims(Results(REFERENCE))
    assert set(table.claim) == set(view.CLAIMS) - {"objects"}
    assert "Not tested: Touched objects" in table.attrs["note"]
    assert set(table.word) <= {YES, NO, PARTLY, UNDECIDED}
    assert set(table.claim) <= set(phrases.PHRASES)
    for row in table.to_dict("records"):
        assert row["verdict"].startswith(f"{row['word']}: ")
        assert (
            any(sign.isdigit() for sign in row["verdict"]) or row["claim"] == "contrast"
        )


def test_words_after_a_verdict_follow_the_numbers(record, tmp_path):
    def said():
        results = Results(tmp_path)
        return view.claims(results).set_index("claim").verdict["accuracy"]

    record("gelsight", 80, 60)
    assert "on 1 of 1 recording, behind by as much on 0" in said()
    record("diffuser", 60, 80)
    assert "on 1 of 2 recordings, behind by as much on 1" in said()
