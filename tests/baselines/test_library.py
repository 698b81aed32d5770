"""The library's classifiers as the harness trains and asks them."""

import numpy as np
import pytest
import torch

from baselines import library
from baselines.bank import Bank
from hdc import HDCClassifier
from tests.hdc.test_classifier import touches


def test_training_yields_once_all_classes_have_been_seen():
    frames, labels = touches(900)
    order = np.argsort(labels == 2, kind="stable")  # the third class comes last
    model = HDCClassifier()
    seen = []
    for report in library.train(model, frames[order], labels[order]):
        seen.append(report["samples_seen"])
        first = order[: seen[-1]]
        expected = HDCClassifier().fit(frames[first], labels[first])
        assert torch.equal(model.prototypes_, expected.prototypes_)
        assert model.counts_.sum() == seen[-1]
    assert seen == [768, 900]


@pytest.mark.parametrize("readout", ["ridge", "lda", "trained"])
def test_a_read_out_that_wants_all_frames_has_them_once(readout):
    frames, labels = touches(600)
    model = HDCClassifier(readout=readout)
    assert [r["samples_seen"] for r in library.train(model, frames, labels)] == [600]
    whole = HDCClassifier(readout=readout).fit(frames, labels)
    found, expected = model.decision_function(frames), whole.decision_function(frames)
    assert np.array_equal(found, expected)


def test_a_bank_is_asked_without_a_change_of_the_model():
    frames, labels = touches(90)
    bank, model = Bank(torch.from_numpy(frames), labels, 3), HDCClassifier()
    train, asked = np.arange(60)[::-1], np.arange(50, 90)
    expected = HDCClassifier().fit(frames[train], labels[train])
    for _ in range(2):
        found = library.predict_from(model, bank, train, asked)
        assert np.array_equal(found, expected.predict(frames[asked]))
    assert not hasattr(model, "state_")
    state = library.state_tensors(expected)
    assert sum(t.nbytes for t in state.values()) == expected.prediction_bytes_
