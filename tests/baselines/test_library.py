"""The library's classifiers as the harness trains them."""

import numpy as np
import pytest
import torch

from baselines import library
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
    state = library.state_tensors(whole)
    assert sum(tensor.nbytes for tensor in state.values()) == whole.prediction_bytes_
