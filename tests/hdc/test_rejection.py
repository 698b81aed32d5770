"""What is known: distances of left-out frames by their definition, and where they are kept."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits, planes
from hdc.prototypes import tie_breaker
from hdc.readouts import LDA, Counts, Majority
from tests.hdc.own import Nearest
from tests.hdc.speckle import Speckle, junk

pytestmark = pytest.mark.filterwarnings("ignore:alpha=.* needs at least")
FORMS = ["majority", "counts", "neighbours", "lda", "ridge", "trained", Nearest()]
LABELS = np.repeat([0, 1, 2], [11, 8, 7])
GROUPS = np.array([*"aaabbbbcccc", *"aabbbbdd", *"eeeeeee"])  # the last is alone


def frames(seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    base = rng.integers(0, 60, (3, 100))
    return (base[LABELS] + rng.integers(0, 90, (26, 100))).astype(np.uint8)


def left_out(
    model: HDCClassifier, given: np.ndarray, together: np.ndarray
) -> list[int]:
    """Distances of the frames to the nearest majority of all that are not left out with them."""
    counting = model.readout_
    ties, seed = "zero", 0
    if isinstance(counting, Majority | Counts):
        ties, seed = counting.ties, counting.random_state
    words = model.encode(given).packed
    found = []
    for i in range(len(given)):
        near = {}
        for c in range(3):
            kept = words[(c == LABELS) & (together != together[i])]
            if len(kept):
                breaker = tie_breaker(model.dimension_, seed, c)
                prototype = bits.majority(kept, ties, breaker)
                near[c] = int(bits.hamming(words[i : i + 1], prototype[None]))
        if LABELS[i] in near:
            found.append(min(near.values()))
    return sorted(found)


@pytest.mark.parametrize("grouped", [False, True])
@pytest.mark.parametrize(
    "readout",
    [*(Majority(ties) for ties in planes.TIES), Counts("one"), LDA()],
    ids=repr,
)
def test_distances_are_those_of_majorities_without_the_frame_or_its_group(
    readout, grouped
):
    given = frames()
    model = HDCClassifier(readout=readout)
    if grouped:
        with pytest.warns(UserWarning, match="groups: expected two .* found one of 2;"):
            model.fit(given, LABELS, groups=GROUPS)
        expected = left_out(model, given, GROUPS)
        assert len(expected) == 19
    else:
        model.fit(given, LABELS)
        expected = left_out(model, given, np.arange(26))
    rejection = model._head.rejection
    assert rejection.distances.tolist() == expected
    assert model.left_out_ == rejection.unit == ("group" if grouped else "frame")
    for alpha, place in ((0.05, 1), (0.1, 2), (0.5, 10)):
        if not grouped:
            place = int(round(alpha * 100) * 27 // 100)
        threshold = expected[-place]
        assert rejection.threshold(alpha) == threshold
        queries = frames(1)
        whole = torch.stack(
            [bits.majority(model.encode(given[c == LABELS]).packed, *breaker(model, c))
             for c in range(3)]
        )  # fmt: skip
        distances = bits.hamming(model.encode(queries).packed, whole).amin(1)
        expected_known = (distances <= threshold).tolist()
        assert model.is_known(queries, alpha).tolist() == expected_known


def breaker(model, c):
    counting = model.readout_
    if not isinstance(counting, Majority | Counts):
        return ("zero",)
    return counting.ties, tie_breaker(model.dimension_, counting.random_state, c)


def test_a_class_of_the_group_that_is_left_out_is_near_to_no_frame():
    near, far = np.random.default_rng(0).integers(0, 256, (2, 400))
    given, labels = np.stack([near, far, near, near]), [0, 0, 1, 1]
    with pytest.warns(UserWarning, match="found one of 1;"):
        model = HDCClassifier().fit(given, labels, groups=[*"abaa"])
    assert model._head.rejection.distances.min() > 100


def test_batches_and_lengths_of_groups_change_nothing():
    speckle = Speckle(1)
    given, labels = speckle.frames(600)  # three chunks of frames
    groups = np.arange(600) // 50
    model = HDCClassifier().fit(given, labels, groups=groups)
    words = HDCClassifier().fit(given, labels).encode(given)
    again = HDCClassifier().fit(words, labels, groups=groups.astype(str))
    found = (model._head.rejection, again._head.rejection)
    assert len(found[0].distances) == 5 * 100
    assert torch.equal(found[0].distances, found[1].distances)
    whole = HDCClassifier(readout="lda").fit(words, labels, groups=groups)
    assert torch.equal(whole._head.rejection.distances, found[0].distances)
    with pytest.raises(ValueError, match="groups: expected 600"):
        HDCClassifier().fit(words, labels, groups=groups[:-1])


def sessions_of(n: int, base: np.ndarray, rng) -> tuple[np.ndarray, ...]:
    """Frames of n groups of each class: those of a group, five, share an offset."""
    labels = np.tile(np.repeat([0, 1, 2], 5), n)
    groups = np.repeat(np.arange(3 * n), 5)
    moved = base[labels] + rng.normal(0, 0.8, (3 * n, 400))[groups]
    return moved + rng.normal(0, 0.4, moved.shape), labels, groups


@pytest.mark.parametrize("readout", FORMS, ids=str)
def test_another_group_is_refused_as_often_as_asked_where_groups_are_known(readout):
    """Single frames that are left out look near."""
    refused = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        base = rng.normal(0, 1, (3, 400))
        given, labels, groups = sessions_of(8, base, rng)
        queries, *_ = sessions_of(12, base, rng)
        models = [
            HDCClassifier(readout=readout).fit(given, labels, groups=known)
            for known in (groups, None)
        ]
        refused.append([1 - model.is_known(queries, 0.1).mean() for model in models])
    by_group, by_frame = np.mean(refused, 0)
    assert by_group < 0.2
    assert by_frame > by_group + 0.1


def test_what_is_learnt_later_is_left_out_frame_by_frame(tmp_path):
    """Groups of frames that came by are not kept; files and pickles know what was left out."""
    speckle = Speckle(0)
    given, labels = speckle.frames(100)
    model = HDCClassifier().fit(given, labels, groups=np.arange(100) // 10)
    model.save(tmp_path / "m")
    for change in ("partial_fit", "recalibrate"):
        loaded = HDCClassifier.load(tmp_path / "m")
        for changed in (loaded, pickle.loads(pickle.dumps(model))):
            assert changed.left_out_ == "group"
            assert (changed.is_known(given, 0.1) == model.is_known(given, 0.1)).all()
            getattr(changed, change)(given, labels)
            assert changed.left_out_ == "frame"
    assert model.merge(model).left_out_ == "frame"


def test_classes_of_a_single_group_or_frame_calibrate_nothing():
    given = frames()
    with pytest.warns(UserWarning, match="found one of 0, 1, 2; is_known is not"):
        model = HDCClassifier().fit(given, LABELS, groups=LABELS)
    assert model.left_out_ == "frame"
    single = HDCClassifier().fit(given[[0, 11, 20]], [0, 1, 2])
    text = "^alpha=0.2 needs at least 4 training frames to leave out, found 0; no frame"
    with pytest.warns(UserWarning, match=text):
        assert single.is_known(junk()[:, :100], 0.2).all()
