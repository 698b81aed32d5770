"""Eqs. 4 to 6: fast sums against double sums and numpy, and contrasts over seeds."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.protocol.settings import Split
from experiments.studies.correlation import measure
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
pytestmark = pytest.mark.filterwarnings("ignore:split.kind=random")


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
    assert (sums + sums).undefined.tolist() == [0, 0, 4]
    assert np.isnan(standardise(np.full((1, 4), 1e6 + 0.1))).all()
    with pytest.raises(ValueError, match=r"samples\[1\]: expected finite values"):
        standardise([[1, 2], [3, np.inf]])


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
    """Along a row: Eq. 6 is not symmetric, row l is the prototype of class l."""
    matrix = np.array([[0.5, 0.3, 0.2], [0.3, 0.4, 0.6], [0.1, 0.6, 0.7]])
    assert contrast(matrix) == pytest.approx(0.6)  # of the third class, 0.7 and 0.1
    assert contrast(-matrix) == pytest.approx(0.6)
    assert contrast(matrix.T) == pytest.approx(0.5)  # 0.7 and 0.2


def scene_of(*per_class):
    rng = np.random.default_rng(0)
    labels = np.repeat(np.arange(3), per_class)
    base, noise = rng.integers(0, 80, (3, 10, 10)), (len(labels), 10, 10)
    frames = torch.from_numpy(base[labels] + rng.integers(0, 120, noise)).byte()
    return Frames(frames, labels, ("A", "B", "C"))


def test_every_row_is_the_mean_of_numpys_coefficients():
    """Of pairs of other samples, and of the prototype of ``class_i`` with those of ``class_j``."""
    scene = scene_of(12, 12, 12)
    members = measure.members_of(scene, SPLIT, 0)
    members["all"] = np.concatenate(list(members.values()), axis=1)
    words = Median().encode(scene.images)
    frames, ones = scene.images.flatten(1).numpy(), bits.unpack(words, 100).numpy()
    prototypes = [
        bits.unpack(bits.majority(words[of_class])[None], 100)[0].numpy()
        for of_class in members["training"]
    ]
    rows = list(measure.correlations(scene, SPLIT, 0))
    assert len(rows) == 3 * 3 * 3 * 3
    for row in rows:
        i, j = ("ABC".index(row[key]) for key in ("class_i", "class_j"))
        a, b = members[row["samples"]][[i, j]]
        if row["kind"] == "prototype":
            found = np.corrcoef(prototypes[i], ones[b])[0, 1:]
        else:
            x = frames if row["kind"] == "speckle" else ones
            every = np.corrcoef(x[a], x[b])[: len(a), len(a) :]
            found = every[~np.eye(len(a), dtype=bool)]
        assert row["value"] == pytest.approx(found.mean(), abs=1e-12)
        assert (
            row["n"]
            == len(a)
            == {"training": 9, "held-out": 3, "all": 12}[row["samples"]]
        )
    with pytest.raises(ValueError, match=r"as many training samples .* found \[6, 9"):
        measure.members_of(scene_of(12, 8, 12), SPLIT, 0)
