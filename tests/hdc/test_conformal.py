"""Conformal sets and rejection: exact distances, and coverage on fresh frames."""

import warnings

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits, planes
from hdc.conformal import FEWEST, Conformal, Peers, _p_values
from hdc.encoders import Median
from hdc.readouts import HeldOut, Majority
from tests.hdc.own import fitted
from tests.hdc.speckle import Speckle


def learned(words, ties="zero", d=14):
    """A majority of each class, and the peers of its frames."""
    rows = torch.cat([torch.full((len(w),), c) for c, w in enumerate(words)])
    part = Majority(ties)
    model = fitted(part, torch.cat(words), rows, len(words), d)
    deciding = part.deciding(model.state)
    return model, [Peers.of(w, deciding[c]) for c, w in enumerate(words)]


def p_values(peers, prototypes, words, alpha):
    """Those of hypervectors, whatever their scores."""
    scores = torch.zeros(len(words), len(peers))
    known = {c: own for c, own in enumerate(peers) if own is not None}
    return Conformal(known, prototypes).p_values(words, scores, alpha)


def plain_p(peers, prototypes, words, alpha):
    """p-values by their definition, frame by frame."""
    p = np.zeros((len(words), len(peers)))
    for c, own in enumerate(peers):
        if own is None:
            continue
        distances = bits.hamming(words, prototypes)[:, c].tolist()
        for q, (d, d_i) in enumerate(zip(distances, own.compared(words), strict=True)):
            m = len(d_i)
            others = [
                e
                for b, x in enumerate(peers)
                if x and b != c and len(x) >= FEWEST
                for e in x.held_out - np.mean(x.held_out)
            ]
            if (m + 1) * alpha >= 1 or m < FEWEST:
                others = []
            larger = sum(x >= d for x in d_i)
            larger += sum(e >= d - (sum(d_i) + d) / (m + 1) for e in others)
            p[q, c] = (1 + larger) / (1 + m + len(others))
    return p


@pytest.mark.parametrize("alpha", [0.5, 0.2, 0.05, 0.025, 0.01])
@pytest.mark.filterwarnings("ignore:alpha=.* needs at least")
def test_p_values_are_shares_of_kept_frames_as_unlike_as_the_query(alpha):
    """Few bits, so that distances are often equal; classes of 19, 19, 3 and one frame, and none."""
    rng = np.random.default_rng(0)
    words = [torch.from_numpy(rng.integers(0, 2**14, (m, 1))) for m in (19, 19, 3, 1)]
    model, peers = learned(words)
    queries = torch.from_numpy(rng.integers(0, 2**14, (60, 1)))
    none = torch.zeros(1, 1, dtype=torch.int64)
    for known, prototypes in (
        ([None, *peers], torch.cat((none, model.prototypes))),
        (peers[:1], model.prototypes[:1]),
    ):
        np.testing.assert_allclose(
            p_values(known, prototypes, queries, alpha),
            plain_p(known, prototypes, queries, alpha),
        )


def test_a_frame_that_is_just_as_far_out_counts():
    """d of 2 is that of the mean of 1, 3 and itself, as the one of the other class is."""
    found = _p_values(np.array([2.0]), np.array([[1.0, 3.0]]), np.array([0.0]))
    assert found == [(1 + 1 + 1) / (1 + 2 + 1)]


def test_p_values_of_scores_and_the_label_of_the_prediction_in_its_set():
    """Left out, frames of class 0 score about 9, and those of class 1 from −100 to 100."""
    own = torch.linspace(-100, 100, 9).double()
    scores = torch.cat(
        [torch.stack([9 + own / 1000, -own], 1), torch.stack([own / 1000, own], 1)]
    )
    held_out = HeldOut(scores, torch.arange(18) // 9)
    known = Conformal.of_scores(held_out, torch.tensor([9, 9]))
    asked = torch.empty(2, 1), torch.tensor([[8.0, 5], [-500, -500]]), 0.2
    assert known.p_values(*asked) == pytest.approx(np.array([[0.1, 0.6], [0.1, 0.1]]))
    assert known.possible(*asked).tolist() == [[True, True], [False, False]]


def test_too_few_frames_of_a_class_are_named():
    frames, labels = Speckle(0).frames(15)
    model = HDCClassifier().fit(frames, labels)
    for alpha, needed in ((0.1, "4 stored frames of each class, found 3"),
                          (0.05, "19 stored frames, found 15")):  # fmt: skip
        text = f"^alpha={alpha} needs at least {needed}; no frame is refused"
        with pytest.warns(UserWarning, match=text):
            sets = model.predict_set(frames, alpha)
        assert {len(found) for found in sets} == {5}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sets = model.predict_set(frames, 0.3)  # more than a quarter: three are enough
    assert min(len(found) for found in sets) < 5


@pytest.mark.parametrize("ties", planes.TIES)
@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 12])
def test_distances_are_those_of_counting_anew(n, ties):
    """With the new frame in the place of a kept one, and with a kept one left out."""
    rng = np.random.default_rng(n)
    words = bits.pack(torch.from_numpy(rng.random((n + 3, 333)) < rng.random(333)))
    kept, fresh = words[:n], words[n:]
    model, (peers,) = learned([kept], ties, 333)
    d_i = peers.compared(fresh)
    majority = bits.majority(kept, ties)
    assert torch.equal(model.prototypes[0], majority)
    for i in range(n):
        others = torch.cat((kept[:i], kept[i + 1 :]))
        for q, x in enumerate(fresh):
            exchanged = bits.majority(torch.cat((others, x[None])), ties)
            assert d_i[q, i] == int(bits.hamming(kept[i : i + 1], exchanged[None]))
        if n > 1:
            without = bits.majority(others, ties)
            expected = int(bits.hamming(kept[i : i + 1], without[None]))
            assert peers.held_out[i] == expected


def test_recalibrated_models_compare_with_the_new_frames():
    """By exchanging frames in the second recalibration and counting anew."""
    speckle = Speckle(3)
    old, labels = speckle.frames(50)
    new, _ = speckle.frames(21, speckle.of_new_classes())
    new, x = new[:20], new[20:]
    for method in ("replace", "merge"):
        model = (
            HDCClassifier()
            .fit(old, labels)
            .recalibrate(new, labels[:20], 0.6, 1, method)
        )
        peers = model._head.conformal.peers[0]
        d_i = peers.compared(Median().encode(torch.from_numpy(x)))
        for i, place in enumerate(range(0, 20, 5)):
            exchanged = new.copy()
            exchanged[place] = x[0]
            again = HDCClassifier().fit(old, labels)
            again.recalibrate(exchanged, labels[:20], 0.6, 1, method)
            assert d_i[0, i] == again.distances(new[place : place + 1])[0, 0]
