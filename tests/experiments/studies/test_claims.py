"""The paper's claims: every verdict follows its numbers, and what is missing says so."""

import re

import numpy as np
import pytest

from experiments.records.results import Results
from experiments.reporting.estimates import mean_share
from experiments.studies.claims import view
from experiments.studies.claims.view import STUDY, averaged


@pytest.fixture
def claims(tmp_path):
    """claims() → the rows of both tables by the function that makes them, cells by their heads."""

    def find():
        names = ("recognition", "time", "few", "contrast", "recalibration", "faults", "texture")
        found = {name: {} for name in names}
        for table in STUDY.tables(Results(tmp_path)):
            for name, row in zip(names, table.cells(), strict=True):
                found[name] |= dict(zip(table.heads, row, strict=True))
        return found

    return find


def epochs(*accuracies):
    return [
        {"training_s": 10.0 * k, "loss": 1.0, "train_accuracy": accuracy}
        for k, accuracy in enumerate(accuracies, 1)
    ]


def runs(write_run, model, wrong, seeds=3, **more):
    for seed in range(seeds):
        write_run(model, seed=seed, wrong=range(wrong), **more)


def test_what_is_missing_says_what_would_make_it(write_run, claims):
    write_run("hdc")
    found = claims()
    assert len(found) == 7
    for row in found.values():
        cells = list(row.values())
        assert all(cells)
        assert "not measured" in " ".join(cells[1:])
        assert re.search("not (decided|measured)", row["What holds"])
    assert "not measured yet (python -m experiments.run experiment=all_scenes scene=fibre" in str(
        found["recognition"]
    )
    assert "python -m experiments.run experiment=robustness" in str(found["faults"])


@pytest.mark.parametrize(
    ("hdc", "ridge", "expected"),
    [
        (0, 20, "simulated: holds on touch"),
        (20, 0, "simulated: does not hold on touch (Ridge read-out ahead)"),
        (5, 5, "simulated: none ahead on touch"),
    ],
)
def test_recognition_follows_the_records(write_run, claims, hdc, ridge, expected):
    runs(write_run, "hdc", hdc)
    runs(write_run, "ridge", ridge)
    row = claims()["recognition"]
    assert row["What holds"].startswith("measured fibre: not decided")
    assert row["What holds"].endswith(expected)
    assert (
        f"touch: HDC {100 - hdc} %, the best of 1 rivals over it: Ridge"
        in row["On simulated frames"]
    )


def test_one_rival_ahead_is_enough_and_all_must_be_behind(write_run, claims):
    runs(write_run, "hdc", 10)
    runs(write_run, "ridge", 30)
    runs(write_run, "softmax_dual", 10)
    assert claims()["recognition"]["What holds"].endswith("simulated: none ahead on touch")


@pytest.mark.parametrize(
    ("test", "expected"),
    [
        (0.9, "1 of 1 conditions explain the accuracies of softmax regression"),
        (1.0, "No condition explains the published accuracies of softmax regression"),
    ],
)
def test_recognition_says_what_would_have_to_be_true(
    write_measurement, write_run, claims, test, expected
):
    write_run("hdc")
    rows = [
        {"method": "GD", "pixels": "unit", "split": "random", "start": "linear", "role": "report",
         "intervention": "none", "sigma": 0.01, "hdc": 1.0, "r1_steps": 100 + seed,
         "r1_train": 0.99, "r1_test": test, "r1_projected": 1.0, "seed": seed}
        for seed in range(3)
    ]  # fmt: skip
    write_measurement("table1_conditions", rows, config={"starts": {}})
    assert expected in claims()["recognition"]["Theory or mechanism"]


@pytest.mark.parametrize(
    ("ordinary", "expected"),
    [
        (1.0, "Softmax: holds"),
        (50.0, "Softmax: an effect of how HDC is written"),
        (None, "Softmax: not decided without HDC by ordinary routes"),
    ],
)
def test_time_is_judged_by_both_ways_to_compute_hdc(
    write_run, write_measurement, claims, ordinary, expected
):
    runs(write_run, "hdc", 0, curve=[{"training_s": 0.5}])
    runs(write_run, "softmax", 0, curve=epochs(0.5, 0.95))
    if ordinary:
        write_measurement("benchmark", [{
            "operation": "train", "route": "torch.median, torchhd.multiset", "frames": "speckle",
            "n": 400, "d": 250_000, "l": 5, "median_s": ordinary, "status": "ok"}])  # fmt: skip
    row = claims()["time"]
    assert row["What holds"] == f"as trained here, {expected}"
    assert "HDC as written here: ×40.0 [40.0, 40.0]" in row["On simulated frames"]


def test_few_samples_is_a_question_of_all_n_together(write_run, claims, monkeypatch):
    monkeypatch.setattr(view, "FEW", 10)
    for n in (5, 10):
        for seed in range(3):
            write_run("hdc", seed=seed, n_train=n, wrong=range(30))
            write_run("ridge", seed=seed, n_train=n, wrong=range(20 + 5 * (n == 5) + seed))
    row = claims()["few"]
    # 5 and 10 points ahead, less 0, 1 and 2 of the seeds: 6.5 points on average.
    assert "mean of N = 5 to 10: Ridge read-out +6.5 [+4.0, +9.0]" in row["On simulated frames"]
    assert "simulated: does not hold (Ridge read-out ahead)" in row["What holds"]
    assert "measured fibre: not decided" in row["What holds"]


def correlation_rows(between, prototype_factor, seeds=3):
    """Same-class correlations of 0.15 and a little more, by seed; of prototypes a multiple."""
    for seed in range(seeds):
        for kind, samples, factor in (
            ("speckle", "all", 1.5), ("hypervector", "all", 1), ("hypervector", "training", 1),
            ("prototype", "all", 3), ("prototype", "held-out", prototype_factor),
            ("prototype", "training", 3),
        ):  # fmt: skip
            for i in "AB":
                for j in "AB":
                    value = factor * (0.15 + 0.001 * seed if i == j else between)
                    yield {"origin": "simulated", "seed": seed, "kind": kind, "samples": samples,
                           "class_i": i, "class_j": j, "value": value, "n": 80}  # fmt: skip


FACTOR = np.sqrt(2 / np.pi * 80 / (1 + 79 * 0.15))


@pytest.mark.parametrize(
    ("factor", "expected"),
    [
        (FACTOR, "simulated: holds, as an effect of averaging"),
        (3 * FACTOR, "simulated: holds, by more than averaging"),
        (0.85 * FACTOR, "simulated: holds, by less than averaging"),
        (1.25, "simulated: does not hold, below speckle, above hypervectors"),
        (0.5, "simulated: does not hold, below speckle and hypervectors"),
    ],
)
def test_contrast_beside_what_averaging_makes_of_it(write_measurement, claims, factor, expected):
    write_measurement("correlation", list(correlation_rows(0.05, factor)))
    assert claims()["contrast"]["What holds"] == expected


def test_the_law_of_averaging_on_random_signs():
    """Signs of Gaussian fields with one common part: the majority's correlation with others."""
    rng = np.random.default_rng(0)
    d, n = 200_000, 41
    common = rng.normal(size=d)
    signs = np.sign(0.5 * common + np.sqrt(0.75) * rng.normal(size=(n + 1, d)))
    correlation = np.corrcoef(signs[:9])[np.triu_indices(9, 1)].mean()
    majority = np.sign(signs[:n].sum(0))
    expected = averaged(np.array([[correlation]]), n)[0, 0]
    assert np.corrcoef(majority, signs[n])[0, 1] == pytest.approx(expected, abs=0.02)
    assert expected > 1.8 * correlation


@pytest.mark.parametrize(
    ("stored", "mixed", "alone", "expected"),
    [
        (30, 90, 60, "holds, by more than the new samples alone"),
        (30, 90, 90, "holds; nothing told beyond the new samples alone"),
        (30, 70, 90, "holds, but the new samples alone restore more"),
        (90, 30, 30, "does not hold"),
    ],
)
def test_recalibration_is_asked_for_what_retraining_does_not_do(
    write_measurement, claims, stored, mixed, alone, expected
):
    rows = []
    for seed in range(3):
        of = {"origin": "simulated", "seed": seed, "order": "time", "model": "hdc",
              "n_test_new": 100, "n_test_old": 100,
              "n_old": 400, "right_old": 50}  # fmt: skip
        rows.append({**of, "method": "stored", "n_new": 0, "right_new": stored + seed})
        for way, right in (
            ({"method": "replace", "parameter": 0.5}, mixed + seed),
            ({"method": "replace", "parameter": 0.75}, mixed + seed),
            ({"method": "new"}, alone - seed),
        ):
            rows.append({**of, **way, "n_new": 50, "draw": 0, "right_new": right})
    write_measurement("drift", rows)
    assert claims()["recalibration"]["What holds"].startswith(f"simulated: {expected} (")


def fault_rows(in_bytes):
    accuracies = {
        ("hdc", "none", 0): 100, ("hdc", "bit_flips", 1e-4): 100, ("hdc", "bit_flips", 0.1): 99,
        ("hdc", "bit_flips", 0.4): 90,
        ("ridge", "none", 0): 100,
        ("ridge", "bit_flips", 1e-4): 50, ("ridge", "bit_flips", 0.1): 20,
        ("ridge", "bit_flips_int8", 1e-4): 100, ("ridge", "bit_flips_int8", 1e-2): in_bytes,
        ("ridge", "bit_flips_int8", 0.1): in_bytes, ("ridge", "bit_flips_int8", 0.4): 20,
    }  # fmt: skip
    for (model, disturbance, level), right in accuracies.items():
        yield {"origin": "simulated", "model": model, "seed": 0, "disturbance": disturbance,
               "level": level, "draw": 0, "n_test": 100, "right": right, "accuracy": right / 100,
               "chance": 0.2, "model_bits": 8000}  # fmt: skip


@pytest.mark.parametrize(
    ("in_bytes", "expected"),
    [
        (100, "simulated: against float32 only: an effect of the number format"),
        (50, "simulated: holds; mostly an effect of the number format"),
    ],
)
def test_fault_tolerance_is_parted_from_the_number_format(
    write_measurement, claims, in_bytes, expected
):
    write_measurement("robustness", list(fault_rows(in_bytes)))
    row = claims()["faults"]
    assert row["What holds"] == expected
    assert "HDC as stored 0.1" in row["On simulated frames"]
    assert "Ridge read-out as stored below all that were tried" in row["On simulated frames"]


@pytest.mark.parametrize(
    ("texture", "depth", "expected"),
    [
        (60, 0, "does not hold, an effect of assumed thickness"),
        (2, 60, "holds"),
        (35, 30, "not decided"),
    ],
)
def test_texture_is_parted_from_thickness(texture, depth, expected):
    wrong = {"tactile": 1, "tactile_texture": texture, "tactile_depth": depth}
    found = {scene: mean_share([1 - n / 100] * 3, 100) for scene, n in wrong.items()}
    assert view._recognised(found, 1 / 3).endswith(expected)
    if texture == 60:
        found[view.PRECISE] = mean_share([0.95] * 3, 100)
        assert view._recognised(found, 1 / 3).endswith("more precisely than assumed")
