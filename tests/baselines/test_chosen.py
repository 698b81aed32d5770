"""Models that choose their form: the rule of one standard error, folds by group, the fixed form."""

import numpy as np
import pytest
import torch

from baselines.bank import Bank
from baselines.chosen import Chosen, simplest
from baselines.discriminant import GreysKernel, GreysLDA
from baselines.folds import folds
from baselines.smoothing import smoothed
from baselines.softmax_dual import DualSoftmaxRegression
from hdc import HDCClassifier
from hdc.encoders import Deviation, Smoothed
from hdc.encoders.smoothed import gaussian


def forms():
    """Forms of three kinds, which train alone and from a bank."""
    return {
        "greys": GreysLDA(),
        "smoothed greys": GreysLDA(smooth=2),
        "softmax": DualSoftmaxRegression(C=1e-5),
        "bits": HDCClassifier(Deviation(), "lda", backend="numpy"),
        "smoothed bits": HDCClassifier(
            Smoothed(Deviation(), 2), "lda", backend="numpy"
        ),
    }


def blurred(n=60, seed=2, grain=4):
    """Two patterns coarser than the noise, so that smoothing helps."""
    rng = np.random.default_rng(seed)
    patterns = rng.normal(0, 1, (2, 8, 8)).repeat(grain, 1).repeat(grain, 2)
    labels = np.arange(n) % 2
    noise = rng.normal(0, 9, (n, 8 * grain, 8 * grain))
    frames = np.clip(120 + 5 * (0.7 * patterns[labels] + noise), 0, 255)
    return torch.from_numpy(frames.astype(np.uint8)), labels


# The rule -----------------------------------------------------------------------------------------


def test_the_simpler_form_stays_unless_another_is_better_by_a_standard_error():
    simple = np.array([1, 1, 0, 0, 0, 0, 0, 0, 0, 0], float)
    better = np.zeros(10)
    # mean 0.2; deviation √(1.6/9) = 0.4216, so a standard error of 0.1333
    assert simplest({"a": simple, "b": better}, 1.0) == "b"
    assert simplest({"a": simple, "b": better}, 1.6) == "a"
    assert simplest({"a": simple, "b": simple}, 0.0) == "a"
    one = np.array([1, 0, 0, 0, 0, 0, 0, 0, 0, 0], float)  # mean and error are 0.1
    assert simplest({"a": one, "b": better}, 1.001) == "a"
    assert simplest({"a": one, "b": better}, 0.999) == "b"


def test_of_three_the_first_within_the_margin_is_taken():
    losses = {
        "a": np.array([1, 1, 1, 1, 1, 0, 0, 0], float),
        "b": np.array([1, 0, 0, 0, 0, 0, 0, 0], float),
        "c": np.zeros(8),
    }
    assert simplest(losses, 1.001) == "b"
    assert simplest(losses, 0.0) == "c"


# The choice ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "names", [("greys", "smoothed greys", "softmax"), ("bits", "smoothed bits")]
)
def test_the_choice_is_that_of_the_folds_and_the_model_that_of_the_form(names):
    frames, labels = blurred()
    bank = Bank(frames, labels, 2)
    train, test = np.arange(40), np.arange(40, 60)
    here = {name: forms()[name] for name in names}
    chosen = Chosen(forms=here, fixed=names[0], folds=4)
    form, _ = chosen.choose(bank, train)
    made, _ = folds(bank.labels, train, 4)
    assert len(made) == 4
    losses = {}
    for name in names:
        wrong = []
        for learnt, held in made:
            model = forms()[name].fit(frames[learnt], labels[learnt])
            wrong.append(model.predict(frames[held]) != labels[held])
        losses[name] = np.concatenate(wrong).astype(float)
    assert form == simplest(losses, 1.0)
    assert form != names[0]
    expected = forms()[form].fit(frames[train], labels[train]).predict(frames[test])
    assert (chosen.predict_from(bank, train, test) == expected).all()
    chosen.fit(frames[train], labels[train])
    assert chosen.form_ == form
    assert (chosen.predict(frames[test]) == expected).all()


@pytest.mark.parametrize("of_one", ["frame", "group"])
def test_one_frame_or_one_group_a_class_leaves_the_fixed_form(of_one):
    frames, labels = blurred()
    groups = labels if of_one == "group" else np.arange(60)
    train = np.arange(40) if of_one == "group" else np.arange(2)
    chosen = Chosen(forms=forms(), fixed="softmax")
    assert chosen.choose(Bank(frames, labels, 2, groups), train)[0] == "softmax"


def test_frames_of_one_group_are_in_one_fold():
    frames, labels = blurred()
    groups = np.arange(60) // 10
    seen = []

    class Watching:
        def predict_from(self, bank, train, test):
            seen.append(set(groups[train]) & set(groups[test]))
            return bank.labels[test]

    chosen = Chosen(forms={"a": Watching(), "b": Watching()}, fixed="a")
    chosen.choose(Bank(frames, labels, 2, groups), np.arange(60))
    assert len(seen) == 2 * 5
    assert not any(seen)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"fixed": "ridge"}, "fixed: expected .* found 'ridge'"),
        ({"margin": -1}, "margin: expected 0 or more, found -1"),
        ({"forms": {"softmax": GreysLDA(pixels="bits")}}, "pixels: .* found 'bits'"),
        ({"forms": {"softmax": GreysLDA(smooth=17)}}, "smooth: .* found 17"),
    ],
)
def test_wrong_fields_are_named(fields, said):
    frames, labels = blurred(12)
    with pytest.raises(ValueError, match=said):
        Chosen(**{"forms": forms(), "fixed": "softmax", **fields}).fit(frames, labels)


# What both see ------------------------------------------------------------------------------------


@pytest.mark.parametrize("smooth", [1, 2, 4])
def test_greys_are_smoothed_as_bits_are(smooth):
    """A direct sum over the mirrored image, with the encoder's weights."""
    rng = np.random.default_rng(smooth)
    frames = torch.from_numpy(rng.integers(0, 256, (2, 9, 21), dtype=np.uint8))
    weights = np.array(gaussian(smooth)) / 4096
    reach = len(weights) // 2
    expected = np.zeros((2, 9, 21))
    for k, image in enumerate(frames.numpy().astype(float)):
        padded = np.pad(image, reach, mode="reflect")
        rows = sum(w * padded[i : i + 9] for i, w in enumerate(weights))
        expected[k] = sum(w * rows[:, i : i + 21] for i, w in enumerate(weights))
    found = smoothed(frames, smooth)
    assert found.dtype == torch.uint16
    assert np.abs(found.numpy() / 256 - expected).max() < 0.6 / 256
    encoder = Smoothed("median", smooth).fit(frames)
    assert np.abs(encoder.images(frames).numpy() / 2**10 - expected).max() < 1e-2


@pytest.mark.parametrize("pixels", ["raw", "standardised"])
def test_the_kernel_is_that_of_the_euclidean_distances(pixels):
    frames, labels = blurred(24)
    model = GreysKernel(pixels=pixels).fit(frames, labels)
    flat = frames.flatten(1).double().numpy()
    if pixels == "standardised":
        flat = (flat - flat.mean(1, keepdims=True)) / flat.std(1, keepdims=True)
    distances = np.linalg.norm(flat[:, None] - flat, axis=2)
    pairs = np.sort(distances[np.triu_indices(24, 1)])
    median = pairs[(len(pairs) - 1) // 2]
    assert model.reach_ / median == pytest.approx(
        min(model.scales, key=lambda s: abs(s - model.reach_ / median))
    )
    expected = np.exp(-distances / model.reach_) @ model.dual_.numpy()
    expected += model.offsets_.numpy()
    found = model.scores(frames).numpy()
    assert np.allclose(found, expected, atol=1e-6 * np.abs(expected).max())
