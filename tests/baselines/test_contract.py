"""What every competitor promises, whatever it does inside."""

import copy
from dataclasses import replace

import numpy as np
import pytest
import torch
from hydra.utils import instantiate

from baselines import library
from baselines.bank import Bank
from baselines.base import Classifier
from baselines.correlation import CorrelationClassifier
from baselines.mean_image import MeanImage
from baselines.nearest_neighbour import NearestNeighbour
from baselines.training import IterativeClassifier
from experiments.protocol.evaluate import evaluate, train_until
from experiments.protocol.model import Model
from experiments.protocol.stop import StopRule
from experiments.records.configs import CONFIGS
from hdc import HDCClassifier
from hdc.encoders import ENCODERS
from hdc.readouts import READOUTS, Neighbours
from tests.experiments.composed import tree

ALL = sorted(path.stem for path in (CONFIGS / "model").glob("*.yaml"))
# Variants of a recipe that differ in a number only.
VARIANTS = {"cnn3"}
SLOW = {"bits_chosen", "greys_chosen"}
NAMES = [name for name in ALL if not name.startswith("hdc") and name not in VARIANTS]


def make(name):
    """The model of a config, quick enough for small frames."""
    model = instantiate(tree(f"model={name}").model, _convert_="all")
    if isinstance(model, IterativeClassifier):
        return replace(model, lr=1e-2, max_epochs=20)
    return model


@pytest.fixture(params=NAMES)
def model(request):
    return make(request.param)


def same_state(a, b):
    x, y = a.state_tensors(), b.state_tensors()
    return x.keys() == y.keys() and all(torch.equal(x[name], y[name]) for name in x)


@pytest.mark.parametrize("name", ALL)
def test_a_config_makes_a_model_and_says_how_it_is_shown(name):
    config = tree(f"model={name}", "seed.init=5")
    assert {*config.display} == {"name", "colour", "marker", "line", "group"}
    assert config.display.group in ("paper", "fast", "beyond", "other")
    model = instantiate(config.model, _convert_="all")
    assert model.device == "cpu"
    assert getattr(model, "seed", 5) == 5
    of_library = config.model._target_.startswith("hdc.")
    assert isinstance(model, HDCClassifier if of_library else Classifier)


def test_two_trainings_of_one_seed_agree_to_the_last_bit(model, small, speckle):
    other = replace(model).fit(*speckle(12, (8, 9), 3))
    other.fit(*small)  # the second training starts anew
    torch.manual_seed(1)
    expected = torch.rand(3)
    torch.manual_seed(1)
    assert same_state(model.fit(*small), other)
    assert torch.equal(torch.rand(3), expected)  # other random numbers are left alone
    assert (model.predict(small[0]) == other.predict(small[0])).all()


def test_can_be_asked_after_every_yield_in_any_batch(model, small, monkeypatch):
    frames, labels = small
    seen = 0
    for row in model.train(frames, labels):
        assert row["samples_seen"] > seen
        seen = row["samples_seen"]
        whole = model.predict(frames)
        assert model.state_tensors()
    assert seen >= len(frames)
    monkeypatch.setattr(type(model), "prediction_batch", 7)
    assert (model.predict(frames) == whole).all()
    assert whole.dtype == np.int64
    assert model.predict(frames[:0]).shape == (0,)


def test_learns_frames_of_16_bits_and_labels_as_they_are(model, speckle):
    assert isinstance(model, Model)  # as the runner wants it
    frames, labels = speckle(30, (16, 15), 3)
    with pytest.raises(RuntimeError, match="needs train or fit first"):
        model.predict(frames)
    named = np.array(["left", "right", "far away"])[labels]
    wide = (frames.to(torch.int32) * 257).to(torch.uint16)
    right = model.fit(wide, named.tolist()).predict(wide) == named
    assert right.mean() > 0.9
    assert model.predict(wide[0]).shape == (1,)
    for asked, message in (
        (frames, r"expected torch\.uint16 as in training, found .*uint8"),
        (wide.transpose(1, 2), r"expected shape \(16, 15\).*found \(15, 16\)"),
    ):
        with pytest.raises(ValueError, match=message):
            model.predict(asked)


class Lazy:
    """A FrameSource that makes its frames only when indexed."""

    def __init__(self, images):
        self._images, self.shape = images, tuple(images.shape)

    def __len__(self):
        return len(self._images)

    def __getitem__(self, index):
        assert isinstance(index, slice | torch.Tensor)
        return self._images[index].clone()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["correlation", "ridge", "knn_greys", "softmax"])
def test_frames_made_on_request_give_the_model_of_the_tensor(name, small):
    (frames, labels), model = small, make(name)
    other = replace(model).fit(Lazy(frames), labels)
    assert same_state(model.fit(frames, labels), other)
    assert (model.predict(frames) == other.predict(Lazy(frames))).all()


def test_state_is_the_model_itself(model, small):
    frames, labels = small
    before = model.fit(frames, labels).scores(model.read(frames, slice(0, 40)))
    for name, tensor in model.state_tensors().items():
        flat = tensor.view(-1)  # no copy: a change here is a change of the model
        if name == "labels":
            flat.zero_()
        elif tensor.is_floating_point():
            flat.mul_(-1)
        elif tensor.dtype in (torch.uint8, torch.int64):
            flat[::2] ^= 255
    after = model.scores(model.read(frames, slice(0, 40)))
    assert not torch.equal(before, after)


@pytest.mark.parametrize(
    ("dtype", "labels", "message"),
    [
        (torch.float32, [0, 1, 0, 1], "expected uint8 or uint16, found torch.float32"),
        (torch.uint8, [1, 1, 1, 1], "two classes, found one class, 1"),
    ],
)
def test_what_cannot_be_learnt_is_named(dtype, labels, message):
    with pytest.raises(ValueError, match=message):
        CorrelationClassifier().fit(torch.zeros(4, 6, 6, dtype=dtype), labels)


def awkward(speckle, dtype):
    """Frames of which some are equal: within a class, and across classes."""
    frames, labels = speckle(90, (16, 12), 3, seed=4)
    frames[30:33] = frames[30]  # one frame of each of three classes is the same
    frames[[36, 70]] = frames[[6, 9]]  # a class has a frame twice; or a query
    frames[40:44] //= 16  # few grey levels: equal distances, equal pixels
    frames[80:83] //= 16
    if dtype == torch.uint16:
        frames = (frames.to(torch.int32) * 257).to(torch.uint16)
    return frames, labels


def plainly(model, bank, train, queries, stop):
    """Labels by a copy of the model trained on the frames themselves."""
    trained = copy.deepcopy(model)
    train_until(trained, stop, bank.frames[train], bank.labels[train])
    return trained.predict(bank.frames[queries])


# Not those with random ties, whose prototypes of equal classes differ, nor networks.
TIED = [
    *("hdc", "hdc_integer", "hdc_neighbours", "knn_greys", "correlation"),
    *("mean_image", "ridge", "ridge_standardised"),
    *("softmax_dual", "softmax_dual_standardised"),
]
STOP = StopRule(least_steps=2, most_steps=3)
COMBINATIONS = {
    f"{encoder} {readout}": HDCClassifier(encoder, readout)
    for encoder in ENCODERS
    for readout in READOUTS
}
COMBINATIONS |= {
    "median neighbours 3": HDCClassifier(readout=Neighbours(3)),
    "knn 3": NearestNeighbour(k=3),
    "mean_image standardised": MeanImage(pixels="standardised"),
}


WIDE = [*(set(NAMES) - SLOW), *(f"{encoder} trained" for encoder in ENCODERS)]


@pytest.mark.parametrize(
    ("name", "dtype"),
    [
        *((name, torch.uint8) for name in (*ALL, *COMBINATIONS)),
        *((name, torch.uint16) for name in sorted(WIDE)),
    ],
    ids=str,
)
def test_the_fast_way_says_what_the_trained_model_says(name, dtype, speckle):
    """For every model, with few and many frames, equal frames and a class that is absent."""
    model = COMBINATIONS[name] if name in COMBINATIONS else make(name)
    if not library.has_predict_from(model):
        pytest.skip("it has one way, which is training")
    frames, labels = awkward(speckle, dtype)
    bank, queries = Bank(frames, labels, 3), np.arange(60, 90)
    order = np.random.default_rng(0).permutation(60)
    two_classes = order[labels[order] != 1]
    repeated = np.concatenate([order[:20], order[:10]])
    everything = np.arange(90)
    trainings = [order[:6], order, np.arange(30, 37), two_classes, repeated]
    if name in SLOW:
        trainings = [order[:6], two_classes]
    if not hasattr(model, "predict_from"):  # a copy is trained; once is enough
        trainings, queries = [two_classes[:12]], queries[:10]
        everything = queries
    for train in trainings:
        for asked in (queries, everything):
            said = evaluate(model, bank, train, asked)
            assert (said == plainly(model, bank, train, asked, STOP)).all()
            assert set(said) <= set(labels[train])
    assert not hasattr(model, "classes_"), "the model is left as it was"


@pytest.mark.parametrize("name", TIED)
def test_classes_of_the_same_frames_are_told_apart_by_their_order_alone(name, speckle):
    """Every frame of one class is also one of the other: each query is a tie."""
    frames, _ = speckle(20, (16, 12), 2)
    bank = Bank(torch.cat([frames, frames]), np.repeat([0, 1], 20), 2)
    train, queries = np.r_[0:10, 20:30], np.arange(10, 20)
    model = make(name)
    assert not evaluate(model, bank, train, queries).any()
    assert not plainly(model, bank, train, queries, STOP).any()
