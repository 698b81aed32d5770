"""Eqs. 4 to 6: fast sums against numpy, and the double sum that stability compares them with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.protocol.settings import Split
from experiments.studies.correlation import measure
from experiments.studies.correlation.pairs import (
    CorrelationSums,
    pair_correlations_double_sum,
    standardise,
)
from hdc import bits
from hdc.encoders import Median

SPLIT = Split("random", 0.25)
pytestmark = pytest.mark.filterwarnings("ignore:split.kind=random")


def samples(n, d, seed=0):
    """Samples with something in common, float64 [n, d]."""
    rng = np.random.default_rng(seed)
    return 1.0 * rng.integers(0, 60, d) + rng.integers(0, 120, (n, d))


def test_samples_without_variance_are_counted_and_leave_other_classes_alone():
    sums = CorrelationSums()
    with np.errstate(all="raise"):
        for k in range(2):
            sums += CorrelationSums.of([*samples(2, 16, k), np.full(16, 0.1)])
    assert np.isfinite(sums.pair_means()[:2, :2]).all()
    assert np.isnan(sums.pair_means()[2]).all()
    assert (sums + sums).undefined.tolist() == [0, 0, 4]


@pytest.mark.parametrize(
    ("scale", "offset"), [(1.0, 2.0**51), (2.0**600, 0.0), (2.0**-600, 0.0)]
)
def test_the_mean_and_the_size_of_a_sample_leave_nothing_behind(scale, offset):
    """Factors are powers of two and sums are exact, so that nothing but the method differs."""
    values = samples(2, 100)
    with np.errstate(all="raise"):
        found = standardise(scale * values + offset)
    assert found == pytest.approx(standardise(values), abs=1e-15)
    assert found @ found.T == pytest.approx(np.corrcoef(values), abs=1e-14)
    assert found.sum(1) == pytest.approx([0, 0], abs=1e-14)


def test_every_row_is_the_mean_of_numpys_coefficients(make_scene):
    """Of pairs of other samples, and of the prototype of ``class_i`` with those of ``class_j``."""
    scene = make_scene(n=36, shape=(10, 10))
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
        i, j = ("abc".index(row[key]) for key in ("class_i", "class_j"))
        a, b = members[row["samples"]][[i, j]]
        if row["kind"] == "prototype":
            found = np.corrcoef(prototypes[i], ones[b])[0, 1:]
        else:
            x = frames if row["kind"] == "speckle" else ones
            every = np.corrcoef(x[a], x[b])[: len(a), len(a) :]
            found = every[~np.eye(len(a), dtype=bool)]
            slow = pair_correlations_double_sum(x[a], x[b])
            assert slow == pytest.approx(found.mean(), abs=1e-12)
        assert row["value"] == pytest.approx(found.mean(), abs=1e-12)
        expected = {"training": 9, "held-out": 3, "all": 12}
        assert row["n"] == len(a) == expected[row["samples"]]
    unequal = replace(scene, labels=np.maximum(scene.labels, scene.labels[::-1]))
    with pytest.raises(ValueError, match=r"as many training samples .* found"):
        measure.members_of(unequal, SPLIT, 0)
