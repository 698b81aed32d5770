"""What was learned is a value: one size in memory, pickle and file, and no way to change it."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor, io
from hdc.readouts import READOUTS
from tests.hdc.own import Nearest

rng = np.random.default_rng(0)
LABELS = np.arange(160) % 4
BASE = rng.integers(0, 200, (4, 40, 50))
FRAMES = (BASE[LABELS] + rng.integers(0, 56, (160, 40, 50))).astype(np.uint8)
QUERIES = FRAMES[::7] // 2


def answers(model) -> list:
    return [
        model.predict(QUERIES).tolist(),
        model.p_values(QUERIES).tolist(),
        model.predict_proba(QUERIES).tolist(),
    ]


@pytest.mark.parametrize("readout", [*READOUTS, Nearest()], ids=str)
@pytest.mark.parametrize("encoder", ["levels", "deviation"])
def test_a_pickle_is_as_large_as_the_file_and_answers_alike(encoder, readout, tmp_path):
    model = HDCClassifier(encoder, readout).fit(FRAMES, LABELS)
    expected = answers(model)  # what is made when asked for is not kept
    model.save(tmp_path / "m")
    size = (tmp_path / "m").stat().st_size
    for found in (model, HDCClassifier.load(tmp_path / "m", ["tests.hdc.own.Nearest"])):
        pickled = pickle.dumps(found)
        assert len(pickled) < 1.2 * size + 5000
        assert answers(pickle.loads(pickled)) == expected
    needed = model.prediction_bytes_
    assert needed <= size
    if readout in ("lda", "ridge", "kernel"):
        assert size < 2 * needed + 30_000  # scores of left-out frames, and the header


def test_a_regressor_is_pickled_without_what_its_intervals_need():
    model = HDCRegressor().fit(FRAMES, np.arange(160.0))
    before = len(pickle.dumps(model))
    expected = model.predict(QUERIES, return_interval=True)
    assert len(pickle.dumps(model)) == before
    again = pickle.loads(pickle.dumps(model)).predict(QUERIES, return_interval=True)
    assert np.array_equal(again, expected)


@pytest.mark.parametrize("readout", ["majority", "neighbours"])
def test_a_copy_that_learns_leaves_the_model_as_it_was(readout):
    model = HDCClassifier(readout=readout).fit(FRAMES[:80], LABELS[:80])
    expected = answers(model)
    for other in (copy.copy(model), copy.deepcopy(model)):
        other.partial_fit(FRAMES[80:], LABELS[80:])
        other.recalibrate(FRAMES[:8], LABELS[:8])
        assert answers(model) == expected
        assert other.counts_.sum() != model.counts_.sum()


def test_a_parameter_that_is_set_to_an_equal_one_changes_nothing():
    model = HDCClassifier("".join(["med", "ian"])).fit(FRAMES, LABELS)
    expected = answers(model)
    model.set_params(encoder="".join(["medi", "an"]), device="".join(["c", "pu"]))
    assert answers(model) == expected
    assert answers(model.to("cpu")) == expected
    with pytest.raises(ValueError, match="device: expected 'cpu'"):
        model.to("gpu")


def test_a_file_says_its_revisions_and_loads_where_it_is_asked_to(
    tmp_path, monkeypatch
):
    path = tmp_path / "m"
    model = HDCClassifier("deviation", "lda").fit(FRAMES, LABELS)
    model.save(path)
    header, _ = io.read_model(path)
    assert header["revisions"] == {"encoder": 2, "readout": 1}
    assert HDCClassifier.load(path, device="cpu").device == "cpu"
    with pytest.raises(ValueError, match="device: expected 'cpu'"):
        HDCClassifier.load(path, device="gpu")
    monkeypatch.setattr(type(model.readout_), "revision", 2)
    message = r"made by revision 1 of the readout, now 2, .*; fit anew"
    with pytest.warns(UserWarning, match=message):
        HDCClassifier.load(path)


def test_sets_are_masks_on_request_and_words_stand_for_frames():
    model = HDCClassifier().fit(FRAMES, LABELS)
    words = model.encode(QUERIES)
    mask = model.predict_set(words, 0.1, mask=True)
    assert mask.dtype == bool
    sets = [model.classes_[row].tolist() for row in mask]
    assert [one.tolist() for one in model.predict_set(QUERIES, 0.1)] == sets
    best = model.predict(words)
    above = model.p_values(words, 0.1) > 0.1
    above[np.arange(len(best)), best] |= above.any(1)
    assert np.array_equal(mask, above)
    for name in ("predict", "is_known", "predict_proba", "decision_function"):
        ask = getattr(model, name)
        assert np.array_equal(ask(words), ask(QUERIES))
    again = HDCClassifier().partial_fit(model.encode(FRAMES), LABELS)
    assert torch.equal(again.prototypes_, model.prototypes_)


def test_frames_of_one_kind_need_no_labels(tmp_path):
    own = FRAMES[LABELS == 0]
    model = HDCClassifier().fit(own[:30])
    model.save(tmp_path / "m")
    others = FRAMES[LABELS > 0]
    for found in (model, HDCClassifier.load(tmp_path / "m")):
        assert found.classes_.tolist() == ["known"]
        assert found.is_known(own[30:], 0.1).mean() > 0.5
        assert not found.is_known(others, 0.1).any()
    with pytest.raises(ValueError, match="requires y to be passed"):
        HDCClassifier(readout="lda").fit(own)
