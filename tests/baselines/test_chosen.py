"""Models that choose their form: the rule of one standard error, folds by group, the fixed form."""

import numpy as np
import pytest
import torch

from baselines.bank import Bank
from baselines.chosen import BitsChosen, GreysChosen, SoftmaxChosen, simplest
from baselines.discriminant import GreysKernel, GreysLDA
from baselines.folds import folds
from baselines.smoothing import smoothed
from baselines.softmax_dual import DualSoftmaxRegression
from hdc import HDCClassifier
from hdc.encoders import Deviation, Smoothed

FAMILIES = {"bits": BitsChosen, "greys": GreysChosen}


def family(name, **fields):
    if name == "bits":
        fields = {"encoder": Deviation(), "backend": "numpy", **fields}
    return FAMILIES[name](**fields)


def plain(name, readout, smooth):
    """A form without a family, as its parts are written."""
    if name == "greys":
        kind = GreysLDA if readout == "lda" else GreysKernel
        return kind(smooth=smooth)
    encoder = Smoothed(Deviation(), smooth) if smooth else Deviation()
    return HDCClassifier(encoder, readout, backend="numpy")


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
        ({"a": ONE, "b": NONE}, 1.001, "a"),  # mean and error are 0.1
        ({"a": ONE, "b": NONE}, 0.999, "b"),
        ({"a": FIRST[2], "b": ONE, "c": NONE}, 1.001, "b"),
        ({"a": FIRST[2], "b": ONE, "c": NONE}, 0.0, "c"),
    ],
)
def test_the_simpler_form_stays_unless_another_is_better_by_the_margin(
    losses, margin, chosen
):
    assert simplest(losses, margin) == chosen


# Both families ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FAMILIES)
def test_the_choice_is_that_of_the_folds_and_the_model_that_of_the_form(name):
    frames, labels = blurred()
    bank = Bank(frames, labels, 2)
    train, test = np.arange(40), np.arange(40, 60)
    whole = [f"{r}, smooth {n}".removesuffix(", smooth 0") for r in ("lda", "kernel")
             for n in (0, 1, 2, 4)]  # fmt: skip
    assert list(family(name).forms()) == whole
    chosen = family(name, smooth=(0, 2), folds=4)
    form, _ = chosen.choose(bank, train)
    made, _ = folds(bank.labels, train, 4)
    assert len(made) == 4
    losses = {}
    for readout in ("lda", "kernel"):
        for smooth in (0, 2):
            wrong = []
            for learnt, held in made:
                model = plain(name, readout, smooth)
                model.fit(frames[learnt], labels[learnt])
                wrong.append(model.predict(frames[held]) != labels[held])
            key = f"{readout}, smooth {smooth}" if smooth else readout
            losses[key] = np.concatenate(wrong).astype(float)
    assert form == simplest(losses, 1.0)
    assert form != "lda"
    readout, _, smooth = form.partition(", smooth ")
    expected = plain(name, readout, int(smooth or 0)).fit(frames[train], labels[train])
    expected = expected.predict(frames[test])
    assert (chosen.predict_from(bank, train, test) == expected).all()
    chosen.fit(frames[train], labels[train])
    assert chosen.form_ == form
    assert (chosen.predict(frames[test]) == expected).all()


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("n", [2, 40])
def test_one_frame_or_one_group_a_class_leaves_the_fixed_form(name, n):
    frames, labels = blurred()
    bank = Bank(frames, labels, 2, labels)  # each class is a group
    chosen = family(name, fixed="lda, smooth 1")
    assert chosen.choose(bank, np.arange(n))[0] == "lda, smooth 1"


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"fixed": "ridge"}, "fixed: expected .* found 'ridge'"),
        ({"readouts": ("ridge",)}, "readouts: expected .* found 'ridge'"),
        ({"margin": -1}, "margin: expected 0 or more, found -1"),
        ({"pixels": "bits"}, "pixels: expected .* found 'bits'"),
        ({"smooth": (0, 17)}, "smooth: expected .* found 17"),
    ],
)
def test_wrong_fields_are_named(fields, said):
    frames, labels = blurred(12)
    with pytest.raises(ValueError, match=said):
        GreysChosen(**fields).fit(frames, labels)


# What both see ------------------------------------------------------------------------------------


@pytest.mark.parametrize("smooth", [1, 2, 4])
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
    model = GreysKernel(pixels=pixels).fit(frames, labels)
    flat = frames.flatten(1).double().numpy()
    if pixels == "standardised":
        flat = (flat - flat.mean(1, keepdims=True)) / flat.std(1, keepdims=True)
    distances = np.linalg.norm(flat[:, None] - flat, axis=2)
    pairs = np.sort(distances[np.triu_indices(24, 1)])
    in_medians = model.reach_ / pairs[(len(pairs) - 1) // 2]
    assert np.isclose(in_medians, model.scales).sum() == 1
    expected = np.exp(-distances / model.reach_) @ model.dual_.numpy()
    expected += model.offsets_.numpy()
    bound = 1e-6 * np.abs(expected).max()
    assert np.allclose(model.scores(frames), expected, atol=bound)


# Softmax regression -------------------------------------------------------------------------------


def test_softmax_has_the_penalty_and_the_scaling_of_least_error_in_the_folds():
    frames, labels = blurred(40, grain=2)
    bank = Bank(frames, labels, 2)
    model = SoftmaxChosen(strengths=[1.0, 1e-5, 100.0])
    forms = model.forms()
    assert list(forms)[1:4] == [
        *("standardised, C = 1e-05", "standardised, C = 100", "unit, C = 1"),
    ]
    made, _ = folds(bank.labels, np.arange(40), 5)
    errors = dict.fromkeys(forms, 0)
    for name, (pixels, c) in forms.items():
        for train, test in made:
            one = DualSoftmaxRegression(pixels=pixels, C=c)
            one.fit(frames[train], labels[train])
            errors[name] += int((one.predict(frames[test]) != labels[test]).sum())
    assert len(set(errors.values())) > 1
    name, chosen = model.choose(bank, np.arange(40))
    assert name == min(errors, key=lambda form: errors[form])
    assert (chosen.pixels, chosen.C) == forms[name]
    alone = DualSoftmaxRegression(pixels=chosen.pixels, C=chosen.C).fit(frames, labels)
    assert (model.fit(frames, labels).predict(frames) == alone.predict(frames)).all()
    assert model.form_ == name
    assert model.choose(bank, np.arange(2))[0] == "standardised, C = 1"
    with pytest.raises(ValueError, match="fixed: expected one of unit, C = 1, found"):
        SoftmaxChosen(pixels=["unit"], strengths=[1]).choose(bank, np.arange(2))
