"""Eqs. 4 to 6: fast sums against double sums and numpy, and contrasts over seeds."""

from __future__ import annotations

import base64

import cv2
import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.protocol.experiment import Run
from experiments.protocol.settings import Split
from experiments.studies.correlation import measure, view
from experiments.studies.correlation.pairs import (
    CorrelationSums,
    contrast,
    mean_pair_correlations,
    pair_correlations_double_sum,
    standardise,
)
from hdc import bits
from hdc.encoders import Median
from scenes.frames import Frames

SPLIT = Split("random", 0.25)


def samples(n, d, seed=0, dtype=np.uint8):
    """Samples with something in common."""
    rng = np.random.default_rng(seed)
    return (rng.integers(0, 60, d) + rng.integers(0, 120, (n, d))).astype(dtype)


@given(
    n=st.integers(2, 6), d=st.integers(2, 40), seed=st.integers(0, 99),
    dtype=st.sampled_from([np.uint8, np.uint16, np.int64, np.float32, np.float64]),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_class_sums_give_the_double_sum(n, d, seed, dtype):
    a, b = samples(n, d, seed, dtype), samples(n, d, seed + 1, dtype)
    for pair in ((a, b), (b, a), (a, a)):
        fast, slow = mean_pair_correlations(*pair), pair_correlations_double_sum(*pair)
        assert fast == pytest.approx(slow, abs=1e-12, nan_ok=True)


def test_samples_without_variance_are_counted_and_leave_other_classes_alone():
    sums = CorrelationSums(3, 16)
    with np.errstate(all="raise"):
        for k in range(2):
            sums.add([samples(1, 16, k)[0], samples(1, 16, k + 9)[0], np.full(16, 0.1)])
    assert np.isfinite(sums.pair_means()[:2, :2]).all()
    assert np.isnan(sums.pair_means()[2]).all()
    assert sums.undefined.tolist() == [0, 0, 2]
    assert np.isnan(standardise(np.full((1, 4), 1e6 + 0.1))).all()
    with pytest.raises(ValueError, match=r"samples\[1\]: expected finite values"):
        standardise([[1, 2], [3, np.inf]])


def sums_of(classes, dtype=np.float64):
    """Sums of classes [L, N_s, D]."""
    sums = CorrelationSums(len(classes), classes.shape[2], dtype)
    for one_of_each in classes.swapaxes(0, 1):
        sums.add(one_of_each)
    return sums


def test_means_are_those_of_numpys_coefficients():
    """Of pairs k ≠ k′, of two parts that were counted apart, and with other frames."""
    classes = np.stack([samples(5, 30, seed) for seed in range(3)])
    sums = sums_of(classes[:, :2]) + sums_of(classes[:, 2:])
    assert sums.n == 5
    others = ~np.eye(5, dtype=bool)
    pairs = np.array(
        [[np.corrcoef(a, b)[:5, 5:][others].mean() for b in classes] for a in classes]
    )
    assert sums.pair_means() == pytest.approx(pairs, abs=1e-12)
    prototypes = samples(2, 30, 7)
    with_samples = np.array(
        [[np.corrcoef(one, a)[0, 1:].mean() for a in classes] for one in prototypes]
    )
    assert sums.means_with(prototypes) == pytest.approx(with_samples, abs=1e-12)


def test_float32_rounds_each_standardised_sample_once():
    classes = samples(2, 30)[:, None]
    rounded = standardise(classes[:, 0], np.float32)
    assert rounded.dtype == np.float32
    exact = standardise(classes[:, 0])
    assert exact.dtype == np.float64
    assert (rounded == exact.astype(np.float32)).all()
    sums = sums_of(classes, np.float32)
    assert sums.sums.dtype == np.float64
    assert (sums.sums == rounded).all()
    assert ((sums + sums).means_with(classes[:, 0]).dtype) == np.float64
    assert (sums.sums != sums_of(classes).sums).any()


def test_correlations_need_samples():
    sums = CorrelationSums(2, 30)
    with pytest.raises(ValueError, match=r"samples: .*one of each class, found 0"):
        sums.means_with(samples(1, 30))
    sums.add(samples(2, 30))
    assert np.isfinite(sums.means_with(samples(1, 30))).all()
    with pytest.raises(ValueError, match=r"samples: .*two of each class, found 1"):
        sums.pair_means()
    sums.add(samples(2, 30))
    assert np.isfinite(sums.pair_means()).all()


@pytest.mark.parametrize(
    ("scale", "offset"), [(1.0, 2.0**51), (2.0**600, 0.0), (2.0**-600, 0.0)]
)
def test_the_mean_and_the_size_of_a_sample_leave_nothing_behind(scale, offset):
    """Factors are powers of two and sums are exact, so that nothing but the method differs."""
    values = samples(2, 100, dtype=np.float64)
    with np.errstate(all="raise"):
        found = standardise(scale * values + offset)
    assert found == pytest.approx(standardise(values), abs=1e-15)
    assert found @ found.T == pytest.approx(np.corrcoef(values), abs=1e-14)
    assert found.sum(1) == pytest.approx([0, 0], abs=1e-14)


def test_the_contrast_is_the_largest_distance_from_a_classs_own_correlation():
    matrix = np.array([[0.5, 0.3, 0.2], [0.3, 0.4, 0.6], [0.2, 0.9, 0.7]])
    assert contrast(matrix) == pytest.approx(0.5)  # of the third class, 0.7 and 0.2
    assert contrast(-matrix) == pytest.approx(0.5)
    assert contrast(np.array([[0.1, 0.4], [0.4, 0.3]])) == pytest.approx(0.3)


def a_scene(per_class=(12, 12, 12)):
    rng = np.random.default_rng(0)
    labels = np.repeat(np.arange(3), per_class)
    frames = rng.integers(0, 80, (3, 10, 10))[labels] + rng.integers(
        0, 120, (len(labels), 10, 10)
    )
    return Frames(torch.from_numpy(frames.astype(np.uint8)), labels, ("A", "B", "C"))


def test_every_row_is_the_mean_of_numpys_coefficients():
    scene = a_scene()
    members = measure.members_of(scene, SPLIT, 0)
    frames = scene.images.flatten(1).numpy().astype(float)
    ones = bits.unpack(Median().encode(scene.images), 100).numpy().astype(float)
    rows = list(measure.correlations(scene, SPLIT, 0))
    assert len(rows) == 3 * 3 * 3 * 3
    for row in rows:
        parts = (
            ["training", "held-out"] if row["samples"] == "all" else [row["samples"]]
        )
        i, j = ("ABC".index(row[key]) for key in ("class_i", "class_j"))
        a, b = (np.concatenate([members[part][c] for part in parts]) for c in (i, j))
        assert (
            row["n"]
            == len(a)
            == {"training": 9, "held-out": 3, "all": 12}[row["samples"]]
        )
        if row["kind"] == "prototype":
            majority = bits.majority(
                Median().encode(scene.images[members["training"][i]])
            )
            prototype = bits.unpack(majority, 100).numpy().astype(float)
            expected = np.mean([np.corrcoef(prototype, ones[k])[0, 1] for k in b])
        else:
            x = frames if row["kind"] == "speckle" else ones
            pairs = np.corrcoef(x[a], x[b])[: len(a), len(a) :]
            expected = pairs[~np.eye(len(a), dtype=bool)].mean()
        assert row["value"] == pytest.approx(expected, abs=1e-12)
    with pytest.raises(
        ValueError, match=r"as many training samples of every class, found \[6, 9"
    ):
        measure.members_of(a_scene((12, 8, 12)), SPLIT, 0)


def test_experiments(small_scene):
    rows = pd.DataFrame(measure.correlation.rows(Run(), small_scene, SPLIT, [0, 1]))
    assert len(rows) == 2 * 3 * 3 * 4
    with pytest.raises(
        ValueError, match=r"task\.kinds: expected among .* found \['speckles'\]"
    ):
        next(measure.correlation.rows(Run(), small_scene, SPLIT, [0], ["speckles"]))
    with_pictures = measure.correlation.rows(
        Run(), small_scene, SPLIT, [0], ["speckle"], ["all"], crop=[0, 8, 20]
    )
    pictures = [row for row in with_pictures if "png" in row]
    assert [row["picture"] for row in pictures] == [
        "speckle",
        "hypervector",
        "prototype",
    ] * 2
    for row in pictures:
        image = cv2.imdecode(np.frombuffer(base64.b64decode(row["png"]), np.uint8), -1)
        assert (image.shape, image.dtype) == ((20, 20), np.uint8)
        assert row["picture"] == "speckle" or set(np.unique(image)) == {0, 255}


def test_the_contrast_of_prototypes_is_along_their_rows():
    """Eq. 6 is not symmetric: row l is the prototype of class l with the samples of each class."""
    rng = np.random.default_rng(5)
    matrix = rng.uniform(-1, 1, (4, 4))
    differences = [abs(matrix[i, i] - matrix[i, j]) for i in range(4) for j in range(4)]
    assert contrast(matrix) == max(differences)
    assert contrast(matrix) != contrast(matrix.T)


def test_eq_6_has_a_row_a_prototype_and_a_column_a_class():
    rng = np.random.default_rng(6)
    samples, prototypes = rng.normal(size=(5, 3, 40)), rng.normal(size=(2, 40))
    sums = CorrelationSums(3, 40)
    for each in samples:
        sums.add(each)
    found = sums.means_with(prototypes)
    assert found.shape == (2, 3)
    for p, prototype in enumerate(prototypes):
        for k in range(3):
            every = [np.corrcoef(prototype, x)[0, 1] for x in samples[:, k]]
            assert found[p, k] == pytest.approx(np.mean(every), abs=1e-12)


def test_contrasts_are_means_over_seeds():
    rows = pd.DataFrame([
        {"seed": seed, "kind": kind, "samples": part, "class_i": a, "class_j": b,
         "value": 0.2 + 0.1 * seed if a == b else 0.1, "n": 100}
        for seed in (0, 1) for kind in ("speckle", "hypervector", "prototype")
        for part in ("training", "held-out", "all") for a in "AB" for b in "AB"
    ])  # fmt: skip
    numbers = {quantity.name: quantity for quantity in view.quantities(rows)}
    assert numbers["correlation/max_same_class_speckle"].value == pytest.approx(0.25)
    contrast = numbers["correlation/contrast_prototype"]
    # ΔC is 0.1 and 0.2; t(0.975, 1)·0.0707·√1.5 = 1.1
    assert contrast.value == pytest.approx(0.15)
    assert contrast.high == pytest.approx(0.15 + 1.1004, abs=1e-3)
    assert (contrast.seeds, contrast.n) == (2, 2 * 2 * 100)
