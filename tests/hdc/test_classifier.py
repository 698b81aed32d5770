"""The classifier: batches, errors half way, merging, and parameters that change after training."""

import functools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch

from hdc import HDCClassifier
from hdc.encoders import Quantile, Reference
from hdc.readouts import Counts, Majority
from tests.hdc.net.frames import frames_of

touches = functools.partial(frames_of, "uint8")
FRAMES, LABELS = touches(60)


def trained(*parts, **parameters):
    return HDCClassifier(*parts, **parameters).fit(FRAMES, LABELS)


def test_a_call_that_raises_leaves_the_model_of_before():
    """Errors and warnings number frames from the first of all."""
    frames, labels = touches(600)
    model = HDCClassifier().fit(frames, labels)
    before = model.distances(frames)
    bad = frames.astype(float)
    bad[500, 0, 0] = np.inf  # in the second chunk
    learn = [model.fit, model.partial_fit, model.recalibrate]
    message = r"frames\[500\]: expected finite pixels, found inf"
    for call in (*learn, lambda given, _: model.predict(given)):
        with pytest.raises(ValueError, match=message):
            call(bad, labels[::-1])
    assert (model.distances(frames) == before).all()
    frames[290] = 7
    with pytest.warns(UserWarning, match="at index 290:"):
        model.predict(frames)


def test_threads_that_ask_a_fresh_model_agree_with_one():
    frames, labels = touches(300)
    queries = np.concatenate([frames[:40], 255 - frames[:40]])
    expected = HDCClassifier().fit(frames, labels).is_known(queries, 0.1).tolist()
    for _ in range(3):
        model = HDCClassifier().fit(frames, labels)
        with ThreadPoolExecutor(4) as pool:
            answers = list(pool.map(lambda m: m.is_known(queries, 0.1), [model] * 8))
        assert all(answer.tolist() == expected for answer in answers)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32"])
def test_same_bits_on_an_accelerator(dtype):
    frames = FRAMES.astype(dtype)
    here = HDCClassifier().fit(frames, LABELS)
    there = HDCClassifier(device="cuda").fit(frames, LABELS)
    assert torch.equal(here.prototypes_, there.prototypes_.cpu())
    assert np.array_equal(here.distances(frames), there.distances(frames))


ENCODERS = "median, quantile, levels, reference, reference_levels, deviation, smoothed"
READOUTS = "majority, counts, ridge, neighbours, lda, trained, kernel"
SHARE = r"alpha: expected a share in \(0, 1\), found"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: trained("x"), f"encoder: expected one of {ENCODERS}, or"),
        (lambda: trained(readout="x"), f"readout: expected one of {READOUTS}, or"),
        (lambda: HDCClassifier().partial_fit(FRAMES, None), "expected 60, one a .* None"),
        (lambda: trained().is_known(FRAMES, 0), SHARE),
        (lambda: trained().predict_set(FRAMES, 1.0), SHARE),
        (lambda: trained().p_values(FRAMES, "x"), SHARE),
        (lambda: trained().score(FRAMES[:0], []), "expected at least one frame"),
        (lambda: HDCClassifier(readout="lda").fit(FRAMES), "requires y to be passed"),
        (lambda: HDCClassifier().classes_, "expected a trained model; call fit first"),
        (lambda: HDCClassifier(readout="ridge").fit(FRAMES[::3], LABELS[::3]),
         r"at least two classes for Ridge\(.*, found one class, 0; .* 'majority'"),
    ],
)  # fmt: skip
def test_bad_input_gets_one_clear_error(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("readout", [Majority("one"), Counts("one")], ids=repr)
def test_given_classes_are_known_and_never_predicted_without_samples(readout):
    model = HDCClassifier(readout=readout)
    one = LABELS == 1
    model.partial_fit(FRAMES[one], LABELS[one], classes=[3, 0, 1, 2])
    assert model.classes_.tolist() == [0, 1, 2, 3]
    assert model.counts_.tolist() == [0, 20, 0, 0]
    queries = np.concatenate([FRAMES, 255 - FRAMES])
    assert (model.predict(queries) == 1).all()
    assert (model.distances(queries)[:, [0, 2, 3]] == 131).all()
    model.partial_fit(FRAMES[~one], LABELS[~one], classes=[0, 1, 2, 3])
    assert not any(3 in labels for labels in model.predict_set(queries))
    assert torch.equal(model.prototypes_[:3], trained(readout=readout).prototypes_)
    assert not model.prototypes_[3].any()
    message = r"labels: expected classes among \[0, 1\], found 2"
    with pytest.raises(ValueError, match=message):
        model.partial_fit(FRAMES, LABELS, classes=[0, 1])
    assert model.counts_.tolist() == [20, 20, 20, 0]


def test_words_move_to_a_device():
    words = trained().encode(FRAMES)
    assert words.to("meta").packed.device.type == "meta"
    assert torch.equal(words.to("cpu").packed, words.packed)


def test_words_of_another_encoder_are_refused():
    model = HDCClassifier("deviation").fit(FRAMES, LABELS)
    others = {
        "hypervectors: expected the encoder Dev": HDCClassifier("levels"),
        "that learned from the same frames, found .*; use this model's encode$": HDCClassifier(
            "deviation"
        ),
        "hypervectors: expected D = 910, found 130": HDCClassifier(),
    }
    for message, other in others.items():
        words = other.fit(FRAMES[5:], LABELS[5:]).encode(FRAMES)
        with pytest.raises(ValueError, match=message):
            model.predict(words)
    with pytest.raises(ValueError, match="hypervectors: expected the encoder Lev"):
        HDCClassifier("levels").fit(model.encode(FRAMES), LABELS)


def test_equal_distances_go_to_the_first_class():
    frames = np.array([[9, 0, 0, 9], [0, 9, 9, 0]], np.uint8)
    model = HDCClassifier().fit(frames, ["b", "a"])
    query = np.array([[9, 9, 0, 0]], np.uint8)
    assert model.distances(query).tolist() == [[2, 2]]
    assert model.predict(query).tolist() == ["a"]


def test_what_was_trained_is_saved_whatever_becomes_of_the_objects_given(tmp_path):
    base, readout = Quantile("3/4"), Majority("one")
    model = trained(Reference(base), readout)
    expected = model.distances(FRAMES)
    base.at, readout.ties = "1/4", "zero"
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert (loaded.distances(FRAMES) == expected).all()
    assert (loaded.encoder.base.at, loaded.readout.ties) == ("3/4", "one")
