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
from tests.baselines.scaled import scaled


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


FIRST = np.eye(10)[:3].cumsum(0)  # losses of ten frames: 1, 2 and 3 of them wrong
ONE, TWO, NONE = FIRST[0], FIRST[1], np.zeros(10)


@pytest.mark.parametrize(
    ("losses", "margin", "chosen"),
    [
        # Of two: mean 0.2, deviation √(1.6/9) = 0.4216, so a standard error of 0.1333.
        ({"a": TWO, "b": NONE}, 1.0, "b"),
        ({"a": TWO, "b": NONE}, 1.6, "a"),
        ({"a": TWO, "b": TWO}, 0.0, "a"),
        ({"a": FIRST[2], "b": ONE, "c": NONE}, 1.001, "b"),
        ({"a": FIRST[2], "b": ONE, "c": NONE}, 0.0, "c"),
    ],
)
def test_the_simpler_form_stays_unless_another_is_better_by_the_margin(
    losses, margin, chosen
):
    assert simplest(losses, margin) == chosen


# The choice ---------------------------------------------------------------------------------------


def test_the_choice_is_that_of_the_folds_and_the_model_that_of_the_form():
    frames, labels = blurred()
    bank = Bank(frames, labels, 2)
    train, test = np.arange(40), np.arange(40, 60)
    chosen = Chosen(forms=forms(), fixed="greys", folds=4)
    form, _ = chosen.choose(bank, train)
    made, _ = folds(bank.labels, train, 4)
    losses = {}
    for name, model in forms().items():
        wrong = []
        for learnt, held in made:
            model.fit(frames[learnt], labels[learnt])
            wrong.append(model.predict(frames[held]) != labels[held])
        losses[name] = np.concatenate(wrong).astype(float)
    found = chosen._losses(bank, train)
    assert all((found[name] == losses[name]).all() for name in losses)
    assert form == simplest(losses, 1.0)
    assert form != "greys"
    expected = forms()[form].fit(frames[train], labels[train]).predict(frames[test])
    assert (chosen.predict_from(bank, train, test) == expected).all()


@pytest.mark.parametrize("of_one", ["frame", "group"])
def test_one_frame_or_one_group_a_class_leaves_the_fixed_form(of_one):
    frames, labels = blurred()
    groups = labels if of_one == "group" else np.arange(60)
    train = np.arange(40) if of_one == "group" else np.arange(2)
    chosen = Chosen(forms=forms(), fixed="softmax")
    assert chosen.choose(Bank(frames, labels, 2, groups), train)[0] == "softmax"


# What both see ------------------------------------------------------------------------------------


@pytest.mark.parametrize("smooth", [1, 4])
def test_greys_are_smoothed_as_bits_are(smooth):
    """To the rounding of 1/256 of a grey; the encoder's images have an oracle of their own."""
    frames = torch.from_numpy(
        np.random.default_rng(smooth).integers(0, 256, (2, 9, 21), dtype=np.uint8)
    )
    found, encoder = smoothed(frames, smooth), Smoothed("median", smooth).fit(frames)
    assert found.dtype == torch.uint16
    expected = encoder.images(frames).numpy() / 2**10
    assert np.abs(found.numpy() / 256 - expected).max() < 3e-3


@pytest.mark.parametrize("pixels", ["raw", "standardised"])
def test_the_kernel_is_that_of_the_euclidean_distances(pixels):
    frames, labels = blurred(24)
    model, x = GreysKernel(pixels=pixels).fit(frames, labels), scaled(frames, pixels)
    distances = np.linalg.norm(x[:, None] - x, axis=2)
    pairs = np.sort(distances[np.triu_indices(24, 1)])
    in_medians = model.reach_ / pairs[(len(pairs) - 1) // 2]
    assert np.isclose(in_medians, model.scales).sum() == 1
    expected = np.exp(-distances / model.reach_) @ model.dual_.numpy()
    expected += model.offsets_.numpy()
    bound = 1e-6 * np.abs(expected).max()
    assert np.allclose(model.scores(frames), expected, atol=bound)
