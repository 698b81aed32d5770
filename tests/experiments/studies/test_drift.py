"""Recalibration: what each way to update is, and that nobody tests on what it has seen."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import torch

from experiments.records import measurement
from experiments.records.results import Results
from experiments.studies.drift import measure as drift
from experiments.studies.drift import view
from experiments.studies.drift.measure import Sessions, updates, weighted_majority
from hdc import bits
from hdc.encode import encode
from hdc.prototypes import Counters, recalibrate
from scenes.frames import Frames

SPLIT = {"kind": "random", "test_fraction": 0.2, "n_train": None}


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    return tmp_path


def counters(n, dimension=130, classes=3, seed=0):
    rng = np.random.default_rng(seed)
    made = Counters(classes, dimension)
    words = encode(torch.from_numpy(rng.integers(0, 256, (n * classes, dimension), np.uint8)))
    made.add(words, torch.arange(n * classes) % classes)
    return made


def two_sessions(per_class=20, classes=3, side=12):
    """Frames whose classes look different in each session."""
    rng = np.random.default_rng(1)
    n = per_class * classes
    labels, session = np.tile(np.arange(n) % classes, 2), np.repeat([0, 1], n)
    base = rng.integers(0, 200, (2, classes, side, side))
    frames = base[session, labels] + rng.integers(0, 50, (2 * n, side, side))
    samples = {"session": session, "order": np.tile(np.arange(n), 2)}
    images = torch.from_numpy(frames.astype(np.uint8))
    return Frames(images, labels, tuple("ABC"), samples, "simulated")


@pytest.mark.parametrize("n", [(4, 3), (5, 2), (8, 1), (3, 4)])
def test_weights_of_zero_and_one_are_the_new_and_all_samples(n):
    old, new = counters(n[0]), counters(n[1], seed=1)
    assert torch.equal(weighted_majority(old, new, [Fraction(0)] * 3), new.majority())
    together = counters(n[0])
    together.merge(new)
    assert torch.equal(weighted_majority(old, new, [Fraction(1)] * 3), together.majority())


def test_a_weight_is_exact_where_votes_are_equal():
    # 0.1 · 30 − 3 is 4e-16 in floating point, and a tie gives 0.
    # Votes 30, 30 and 32 of 34 samples, −3, −1 and −3 of 3.
    old = Counters.from_counts(torch.tensor([[32, 32, 33]]), torch.tensor([34]))
    new = Counters.from_counts(torch.tensor([[0, 1, 0]]), torch.tensor([3]))
    found = weighted_majority(old, new, [Fraction("0.1")])
    assert bits.unpack(found, 3).tolist() == [[False, True, True]]


def test_negative_weights_are_refused():
    with pytest.raises(ValueError, match="expected numbers from 0, found -1"):
        weighted_majority(counters(2), counters(3), [Fraction(-1)] * 3)


@pytest.mark.parametrize("p", [0.25, 0.75])
def test_replacing_bits_is_averaging_distances(p):
    # The law behind the scheme: Ham(q, mixed) = (1 − p)·Ham(q, old) + p·Ham(q, new) on average,
    # with a deviation of √(p(1 − p)·(bits that differ)) at most.
    dimension = 100_000
    old, new, query = (bits.random_hypervector(dimension, seed)[None] for seed in range(3))
    mixed = recalibrate(old, new, dimension, p)
    expected = (1 - p) * bits.hamming(query, old) + p * bits.hamming(query, new)
    deviation = (p * (1 - p) * int(bits.hamming(old, new))) ** 0.5
    assert abs(float(bits.hamming(query, mixed) - expected)) < 4 * deviation


def test_nobody_is_tested_on_what_was_learnt():
    scene = two_sessions()
    sessions = Sessions(scene, SPLIT, n_test=30, seed=0)
    session = scene.samples["session"]
    assert sessions.old.n.tolist() == [16, 16, 16]
    assert (session[sessions.tests["old"]] == 0).all()
    assert (session[sessions.tests["new"]] == 1).all()
    assert len(sessions.tests["new"]) == 30
    subsets = sessions.subsets([3, 9, 30], draw=0)
    for n, chosen in subsets.items():
        assert len(chosen) == n
        assert not set(chosen) & set(sessions.tests["new"])
        assert (session[chosen] == 1).all()
        assert len(set(np.bincount(scene.labels[chosen]))) == 1
    assert set(subsets[3]) < set(subsets[9])
    other = sessions.subsets([9], draw=1)[9]
    assert set(other) != set(subsets[9])


def test_every_update_is_what_it_says():
    sessions = Sessions(two_sessions(), SPLIT, n_test=30, seed=0)
    new = sessions.count(sessions.subsets([30], 0)[30])
    found = {
        (row["method"], row.get("parameter")): row
        for row in updates(sessions, new, [0, 0.5, 1], [0, 1], [0, 1.6], draw=0)
    }
    scores = {key: (row["right_new"], row["right_old"]) for key, row in found.items()}
    stored, fresh = (
        tuple(sessions.score(prototypes)[f"right_{name}"] for name in ("new", "old"))
        for prototypes in (sessions.stored, new.majority())
    )
    assert stored[1] == found["both", None]["n_test_old"] == 12
    assert fresh[0] == found["both", None]["n_test_new"] == 30
    assert stored[0] < 30
    assert scores["replace", 0] == stored
    assert scores["replace", 1] == scores["weight", 0] == scores["balance", 0] == fresh
    # 16 old and 10 new samples a class: 1.6 of equal votes is a weight of one.
    assert scores["balance", 1.6] == scores["weight", 1]
    assert scores["both", None] == (30, 12)


def test_a_measurement_has_a_row_for_each_update(results, small_scene):
    small_scene["sessions"] = [
        {"_target_": "scenes.sensor.environment.Room", "offset": offset} for offset in (0, 0.5)
    ]
    folder = drift.run(
        small_scene, SPLIT, seeds=[0, 1], n_test=8, n_new=[2, 4], p=[0.5, 1], weight=[1],
        balance=[1], draws=2,
    )  # fmt: skip
    assert folder.parent == results / "measured"
    found = measurement.read(folder)
    assert found.record.status == "finished"
    assert len(found.rows) == 2 * (1 + 2 * 2 * (2 + 1 + 1 + 1))
    for row in found.rows:
        assert 0 <= int(row["right_new"]) <= int(row["n_test_new"]) == 8
        assert (row["method"] == "stored") == (row["n_new"] == "0") == ("draw" not in row)
        assert row["n_old"] == "13"


def test_too_many_test_samples_are_refused():
    with pytest.raises(ValueError, match=r"task\.n_test: expected 1 to 59 .* found 60"):
        Sessions(two_sessions(), SPLIT, n_test=60, seed=0)


def test_a_scene_of_one_session_is_refused():
    scene = two_sessions()
    first = Frames(scene.images[:60], scene.labels[:60], scene.classes)
    with pytest.raises(ValueError, match=r"expected one of the sessions \[0\], found 1"):
        Sessions(first, SPLIT, n_test=30, seed=0)


# What is shown ------------------------------------------------------------------------------------


@pytest.fixture
def recalibration(write_measurement):
    """A measurement of two seeds: stored 30 of 100 right, with p = 0.5 90 and 94, else 80."""
    methods = [("replace", p) for p in (0.25, 0.5, 0.75, 1)]
    methods += [("balance", r) for r in (0.5, 1)] + [("weight", 1), ("both", None)]
    tests = {"origin": "simulated", "n_test_new": 100, "n_test_old": 50, "n_old": 400}
    rows = []
    for seed in (0, 1):
        rows.append({"seed": seed, "method": "stored", "n_new": 0, "right_new": 30,
                     "right_old": 50, **tests})  # fmt: skip
        for draw in (0, 1):
            for n_new in (5, 50):
                for method, parameter in methods:
                    right = (90 + 4 * seed if parameter == 0.5 else 80) + (-1) ** draw
                    value = {} if parameter is None else {"parameter": parameter}
                    rows.append({
                        "seed": seed, "draw": draw, "n_new": n_new, "method": method,
                        "right_new": right, "right_old": 45, **value, **tests,
                    })  # fmt: skip
    write_measurement("drift", rows)


def test_draws_of_a_seed_are_not_independent_of_each_other(recalibration, number, results):
    stored = number(view.STUDY, "drift/stored_accuracy")
    assert (stored.value, stored.n, stored.seeds) == (30, 200, 2)
    assert stored.low < 30 < stored.high  # both seeds have 30 %, of 100 samples each
    found = number(view.STUDY, "drift/recovered_accuracy")
    assert found.value == pytest.approx((92 + 80) / 2)
    assert found.note == "mean of 92 % at p = 0.5 and 80 % at p = 0.75"
    p = (2 * 86 + 2) / 204
    variance = max(2, 1e4 * p * (1 - p) / 100)  # of 85 and 87 %, and of 100 samples of a seed
    assert found.low == pytest.approx(max(0, 86 - 12.706 * np.sqrt(1.5 * variance)), abs=0.01)
    assert found.high == 100  # an interval of fractions ends at one
    assert number(view.STUDY, "drift/remembered_accuracy").value == 90
    names = [(q.name, q.condition) for q in view.STUDY.quantities(Results(results))]
    assert len(set(names)) == len(names) == 6


@pytest.mark.filterwarnings("error")
def test_the_figure_says_what_it_is_of(recalibration, drawn):
    words = drawn(view.STUDY)["fig8_drift"]
    for expected in ("simulated frames, 2 seeds, 2 choices of the new samples each", "p = 0.75",
                     "old prototypes of 400 samples", "100 new and 50 old test samples", "paper:",
                     "both prototypes kept"):  # fmt: skip
        assert expected in words


def test_what_broke_off_is_not_shown(results, write_measurement):
    write_measurement("drift", [{"seed": 0, "method": "stored"}], status="failed", error="E: e")
    assert not list(view.STUDY.plots(Results(results)))
    assert not list(view.STUDY.quantities(Results(results)))
