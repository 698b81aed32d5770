"""What is known: distances of left-out frames by their definition, and where they are kept."""

import pickle

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits, planes
from hdc.readouts import LDA, Counts, Majority
from tests.hdc.speckle import Speckle, junk

pytestmark = pytest.mark.filterwarnings("ignore:alpha=.* needs at least")
LABELS = np.repeat([0, 1, 2], [11, 8, 7])
GROUPS = np.array([*"aaabbbbcccc", *"aabbbbdd", *"ccccccc"])  # the last is in one


def frames(seed=0):
    """Those of the first and the last class share a field."""
    rng = np.random.default_rng(seed)
    base = rng.integers(0, 60, (3, 100))
    base[2] = base[0]
    return (base[LABELS] + rng.integers(0, 90, (26, 100))).astype(np.uint8)


def left_out(model, words, together):
    """Distances of the frames to the nearest majority of all that are not left out with them."""
    found = []
    for i in range(len(words)):
        near = {}
        for c in range(3):
            kept = words[(c == LABELS) & (together != together[i])]
            if len(kept):
                prototype = bits.majority(kept, getattr(model.readout_, "ties", "zero"))
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
    together, unit = np.arange(26), "frame"
    if grouped:
        together, unit = GROUPS, "group"
        with pytest.warns(UserWarning, match="groups: expected two .* found one of 2;"):
            model.fit(given, LABELS, groups=GROUPS)
    else:
        model.fit(given, LABELS)
    words = model.encode(given).packed
    expected = left_out(model, words, together)
    rejection = model._head.rejection
    assert len(expected) == (19 if grouped else 26)
    assert rejection.distances.tolist() == expected
    assert model.left_out_ == unit
    queries = frames(1)
    ties = getattr(readout, "ties", "zero")
    whole = [bits.majority(words[c == LABELS], ties) for c in range(3)]
    asked = model.encode(queries).packed
    distances = bits.hamming(asked, torch.stack(whole)).amin(1)
    for alpha, place in ((0.05, 1), (0.1, 2), (0.5, 10 if grouped else 13)):
        assert rejection.threshold(alpha) == expected[-place]
        known = (distances <= expected[-place]).tolist()
        assert model.is_known(queries, alpha).tolist() == known


def test_batches_and_lengths_of_groups_change_nothing():
    speckle = Speckle(1)
    given, labels = speckle.frames(600)  # three chunks of frames
    groups = np.arange(600) // 50
    model = HDCClassifier().fit(given, labels, groups=groups)
    words = model.encode(given)
    again = HDCClassifier(readout="lda").fit(words, labels, groups=groups.astype(str))
    found = (model._head.rejection, again._head.rejection)
    assert len(found[0].distances) == 5 * 100
    assert torch.equal(found[0].distances, found[1].distances)
    with pytest.raises(ValueError, match="groups: expected 600"):
        HDCClassifier().fit(words, labels, groups=groups[:-1])


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


def test_classes_of_a_single_group_or_frame_calibrate_nothing():
    given = frames()
    with pytest.warns(UserWarning, match="found one of 0, 1, 2; is_known is not"):
        model = HDCClassifier().fit(given, LABELS, groups=LABELS)
    assert model.left_out_ == "frame"
    single = HDCClassifier().fit(given[[0, 11, 20]], [0, 1, 2])
    text = "^alpha=0.2 needs at least 4 training frames to leave out, found 0; no frame"
    with pytest.warns(UserWarning, match=text):
        assert single.is_known(junk()[:, :100], 0.2).all()
