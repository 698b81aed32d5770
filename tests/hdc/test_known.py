"""What read-outs with scores of their own know, and models of one class."""

from __future__ import annotations

import numpy as np
import pytest

from hdc import HDCClassifier
from hdc.readouts import LDA, Kernel
from tests.hdc.own import Nearest
from tests.hdc.speckle import Speckle, junk, noisy, share_of_right

FORMS = [
    "majority", "counts", "ridge", "lda", "kernel", "trained", "neighbours", Nearest(),
]  # fmt: skip


@pytest.mark.parametrize("readout", FORMS, ids=str)
@pytest.mark.parametrize("per_class", [8, 25])
def test_sets_and_rejection_hold_about_what_is_asked(readout, per_class):
    covered, refused, unknown = [], [], []
    for seed in range(6):
        speckle = Speckle(seed)
        model = HDCClassifier(readout=readout).fit(*speckle.frames(5 * per_class))
        frames, labels = speckle.frames(200)
        covered.append(share_of_right(model.predict_set(frames, 0.2), labels))
        refused.append(1 - model.is_known(frames, 0.2).mean())
        others, _ = speckle.frames(50, speckle.of_new_classes())
        unknown.append(1 - model.is_known(others, 0.2).mean())
        assert not model.is_known(junk(), 0.2).any()
    assert 0.72 < np.mean(covered) < 0.93, covered
    assert 0.1 < np.mean(refused) < 0.28, refused
    assert np.mean(unknown) > 0.5, unknown


@pytest.mark.parametrize("readout", FORMS, ids=str)
def test_a_set_that_is_not_empty_has_the_label_of_the_prediction(readout):
    """Of classes of unlike noise 29 of 240 labels lay outside their own set."""
    draw, labels = noisy(0, [1, 3, 9]), np.repeat([0, 1, 2], 25)
    model = HDCClassifier(readout=readout).fit(draw(labels), labels)
    queries = draw(np.repeat([0, 1, 2], 80))
    sets = model.predict_set(queries, 0.2)
    assert sum(map(len, sets)) > 0
    assert min(map(len, sets)) == 0
    for label, found in zip(model.predict(queries), sets, strict=True):
        assert len(found) == 0 or label in found


@pytest.mark.parametrize("readout", ["ridge", "lda", "trained"])
def test_p_values_of_scores_are_shares_of_left_out_frames_with_lower_ones(readout):
    speckle = Speckle(2, classes=2)
    model = HDCClassifier(readout=readout).fit(*speckle.frames(40))
    words = model.encode(speckle.frames(30)[0])
    left_out, rows = model._head.held_out
    scores = model._head.scores(words)
    found = model.p_values(words, 0.2)
    for c in range(2):
        own = left_out[rows == c, c]
        lower = (own <= scores[:, c, None]).sum(1)
        assert found[:, c] == pytest.approx((1 + lower.numpy()) / (1 + len(own)))
    assert len(np.unique(found)) > 5


@pytest.mark.parametrize("readout", [LDA(), Kernel([1], [0.1])])
def test_a_rare_class_is_not_in_every_set(readout):
    """Of 400 frames that are scored without themselves, evenly spread, it has two or three."""
    speckle = Speckle(4, classes=2)
    many, labels = speckle.frames(2400)
    rare = np.flatnonzero(labels)[:8]
    rows = np.concatenate([np.flatnonzero(labels == 0), rare])
    model = HDCClassifier(readout=readout).fit(many[rows], labels[rows])
    frames, truth = speckle.frames(100)
    found = model.predict_set(frames, 0.2)
    assert np.mean([1 in one for one in found]) < 0.8
    held = [label in one for label, one in zip(truth, found, strict=True)]
    assert np.mean(held) > 0.7
    assert model.is_known(junk(), 0.2).mean() < 0.5


@pytest.mark.parametrize("readout", ["ridge", "lda", "kernel"])
def test_a_recalibration_without_frames_of_all_classes_leaves_no_sets(
    readout, tmp_path
):
    """Scores of before and of now are in two units."""
    speckle = Speckle(6)
    frames, labels = speckle.frames(100)
    model = HDCClassifier(readout=readout).fit(frames, labels)
    few = labels < 2
    with pytest.warns(UserWarning, match="no new frames of 2, 3, 4"):
        model.recalibrate(frames[few], labels[few])
    model.predict(frames)
    for ask in (model.predict_set, model.is_known, model.predict_proba):
        with pytest.raises(
            ValueError, match=r"recalibrated.* or .*; fit anew, .* of all classes"
        ):
            ask(frames)
    model.recalibrate(frames[::2], labels[::2]).save(tmp_path / "m")
    assert model.is_known(frames, 0.2).mean() > 0.5
    assert model.is_known(junk(), 0.2).mean() < 0.5


# One class ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("readout", ["majority", "counts", "neighbours"])
def test_one_class_is_told_from_what_is_unknown(readout, tmp_path):
    speckle = Speckle(0, classes=1)
    frames, _ = speckle.frames(60)
    fresh, _ = speckle.frames(200)
    others, _ = speckle.frames(200, speckle.of_new_classes())
    HDCClassifier(readout=readout).fit(frames, ["touch"] * 60).save(tmp_path / "m")
    model = HDCClassifier.load(tmp_path / "m")
    assert 0.1 < 1 - model.is_known(fresh, 0.2).mean() < 0.32
    assert model.is_known(others, 0.2).mean() < 0.1
    assert set(model.predict(fresh)) == {"touch"}
    assert (model.predict_proba(fresh) == 1).all()
    model.partial_fit(others[:20], ["other"] * 20)
    assert model.score(others, ["other"] * 200) > 0.9
