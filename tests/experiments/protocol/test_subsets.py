"""Models trained on subsets say what they say when trained on the frames themselves."""

import numpy as np
import pytest
import torch

from baselines.correlation import CorrelationClassifier
from baselines.ridge import RidgeReadout
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol.subsets import Products, models_of


@pytest.fixture
def frames(frames_and_labels):
    images, labels = frames_and_labels(40, 4, 16)
    return torch.from_numpy(images), labels


@pytest.mark.parametrize("kind", [RidgeReadout, DualSoftmaxRegression, CorrelationClassifier])
@pytest.mark.parametrize("train", [np.arange(9), np.array([3, 6, 1, 0, 11, 0, 0])])
def test_a_subset_is_trained_as_its_frames_are(frames, kind, train):
    images, labels = frames
    found = Products(images, labels, 4, n_train=12).scores(kind(), train, np.arange(40))
    model = kind()
    for _ in model.train(images[train], labels[train]):
        pass
    assert found.shape == (40, 4)
    predicted = model.predict(images)
    assert (found.argmax(1).numpy() == predicted).mean() >= 0.975  # scores there are float32
    assert len(set(predicted)) == 4
    if kind is not CorrelationClassifier:
        expected = model.scores(images.float()).double()
        torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-4)


def test_frames_of_16_bits_are_refused():
    with pytest.raises(ValueError, match=r"expected uint8, found torch\.uint16"):
        Products(torch.zeros(2, 4, 4, dtype=torch.uint16), np.array([0, 1]), 2)


@pytest.mark.parametrize(
    ("model", "found"),
    [
        ({"_target_": "baselines.ridge.RidgeReadout", "pixels": "raw"}, "ridge.pixels: .*'raw'"),
        ({"_target_": "hdc.HDCClassifier", "prototype": "integer"}, "prototype: .*'integer'"),
        ({"_target_": "baselines.softmax.SoftmaxRegression"}, "SoftmaxRegression"),
    ],
)
def test_a_model_that_learns_otherwise_is_refused(model, found):
    with pytest.raises(ValueError, match=rf"task\.models\.ridge.*{found.split('ridge.')[-1]}"):
        models_of({"ridge": {"model": model}})
