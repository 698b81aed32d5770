"""What read-outs know: sets, refusal, and models of one class."""

import numpy as np
import pytest

from hdc import HDCClassifier
from hdc.readouts import READOUTS
from tests.hdc.own import Nearest
from tests.hdc.speckle import Speckle, junk, share_of_right


@pytest.mark.parametrize("readout", [*READOUTS, Nearest()], ids=str)
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


@pytest.mark.parametrize("readout", ["ridge", "lda"])
def test_a_recalibration_without_frames_of_all_classes_leaves_no_sets(
    readout, tmp_path
):
    """Scores of before and of now are in two units."""
    speckle = Speckle(6)
    frames, labels = speckle.frames(100)
    model = HDCClassifier(readout=readout).fit(frames, labels)
    few = labels < 2
    with pytest.warns(
        UserWarning,
        match="no new frames of 2, 3, 4.* alike, frames of these classes will be",
    ):
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


@pytest.mark.parametrize("readout", ["majority", "counts", "neighbours"])
def test_frames_of_one_kind_need_no_labels(readout, tmp_path):
    speckle = Speckle(0, classes=1)
    frames, _ = speckle.frames(60)
    fresh, _ = speckle.frames(200)
    others, _ = speckle.frames(200, speckle.of_new_classes())
    HDCClassifier(readout=readout).fit(frames).save(tmp_path / "m")
    model = HDCClassifier.load(tmp_path / "m")
    assert 0.68 < model.is_known(fresh, 0.2).mean() < 0.9
    assert model.is_known(others, 0.2).mean() < 0.1
    assert set(model.predict(fresh)) == {"known"}
    model.partial_fit(others[:20], ["other"] * 20)
    assert model.score(others, ["other"] * 200) > 0.9
