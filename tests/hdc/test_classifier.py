"""The classifier: labels, batches, errors half way, and memory."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch

from hdc import HDCClassifier


def touches(
    n: int = 60, classes: int = 3, side: int = 12
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    labels = np.arange(n) % classes
    base = rng.integers(0, 200, (classes, side, side))
    return (base[labels] + rng.integers(0, 56, (n, side, side))).astype(
        np.uint8
    ), labels


def test_a_call_that_raises_leaves_the_model_of_before():
    frames, labels = touches(600)
    model = HDCClassifier().fit(frames, labels)
    before = model.distances(frames)
    bad = frames.astype(float)
    bad[500] = np.nan  # in the third chunk
    for call in (model.fit, model.partial_fit, model.recalibrate):
        with pytest.raises(ValueError, match="expected finite pixels"):
            call(bad, labels[::-1])
    assert (model.distances(frames) == before).all()


def test_threads_that_ask_a_fresh_model_agree_with_one():
    frames, labels = touches(300)
    queries = np.concatenate([frames[:40], 255 - frames[:40]])
    expected = HDCClassifier().fit(frames, labels).is_known(queries, 0.1).tolist()
    for _ in range(3):
        model = HDCClassifier().fit(frames, labels)
        with ThreadPoolExecutor(4) as pool:
            answers = list(pool.map(lambda m: m.is_known(queries, 0.1), [model] * 8))
        assert all(answer.tolist() == expected for answer in answers)


def test_errors_and_warnings_number_frames_from_the_first_of_all():
    frames, labels = touches(300)
    bad = frames.astype(np.float32)
    bad[290, 0, 0] = np.inf
    model = HDCClassifier().fit(frames, labels)
    for call in (model.predict, lambda f: HDCClassifier().fit(f, labels)):
        with pytest.raises(
            ValueError, match=r"frames\[290\]: expected finite pixels, found inf"
        ):
            call(bad)
    frames[290] = 7
    with pytest.warns(UserWarning, match="at index 290:"):
        model.predict(frames)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32"])
def test_same_bits_on_an_accelerator(dtype):
    frames, labels = touches()
    frames = frames.astype(dtype)
    here = HDCClassifier().fit(frames, labels)
    there = HDCClassifier(device="cuda").fit(frames, labels)
    assert torch.equal(here.prototypes_, there.prototypes_.cpu())
    assert np.array_equal(here.distances(frames), there.distances(frames))


ENCODERS = "median, quantile, levels, reference, reference_levels, deviation, smoothed"
READOUTS = "majority, counts, ridge, neighbours, lda, trained, kernel"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda f, y: HDCClassifier("x").fit(f, y), f"encoder: expected one of {ENCODERS}, or"),
        (lambda f, y: HDCClassifier(readout="x").fit(f, y),
         f"readout: expected one of {READOUTS}, or"),
        (lambda f, y: HDCClassifier().partial_fit([], []), "expected at least one frame"),
        (lambda f, y: HDCClassifier().partial_fit(f, None), "expected 60, one a .* None"),
        (lambda f, y: HDCClassifier().predict(f), "HDCClassifier: expected a trained model"),
        (lambda f, y: HDCClassifier(readout="ridge").fit(f[::3], y[::3]),
         r"at least two classes for Ridge\(.*, found one class, 0; .* 'majority'"),
    ],
)  # fmt: skip
def test_bad_input_gets_one_clear_error(call, message):
    with pytest.raises(ValueError, match=message):
        call(*touches())


# Classes and their prototypes --------------------------------------------------------------------


@pytest.mark.parametrize("readout", ["majority", "counts"])
def test_told_classes_are_known_and_never_predicted_without_samples(readout):
    frames, labels = touches()
    model = HDCClassifier(readout=readout)
    model.partial_fit(frames[labels == 1], labels[labels == 1], classes=[3, 0, 1, 2])
    assert model.classes_.tolist() == [0, 1, 2, 3]
    assert model.counts_.tolist() == [0, 20, 0, 0]
    queries = np.concatenate([frames, 255 - frames])
    assert (model.predict(queries) == 1).all()
    assert (model.distances(queries)[:, [0, 2, 3]] == 145).all()
    model.partial_fit(frames[labels != 1], labels[labels != 1], classes=[0, 1, 2, 3])
    assert not any(3 in labels for labels in model.predict_set(queries))
    whole = HDCClassifier(readout=readout).fit(frames, labels)
    assert torch.equal(model.prototypes_[:3], whole.prototypes_)
    message = r"labels: expected classes among \[0, 1\], found 2"
    with pytest.raises(ValueError, match=message):
        model.partial_fit(frames, labels, classes=[0, 1])
    assert model.counts_.tolist() == [20, 20, 20, 0]


# Parts --------------------------------------------------------------------------------------------


def test_what_cannot_be_merged_is_named():
    frames, labels = touches()
    model = HDCClassifier().fit(frames, labels)
    others = {
        "expected a trained model": HDCClassifier(),
        "expected a HDCClassifier .* found a Other": type(
            "Other", (HDCClassifier,), {}
        )(),
        r"expected shape \(12, 12\) as in training, found \(16, 9\)": HDCClassifier().fit(
            frames.reshape(60, 16, 9), labels
        ),
        "expected D = 144 pixels": HDCClassifier().fit(frames[:, :5], labels),
    }
    for message, other in others.items():
        with pytest.raises(ValueError, match=message):
            model.merge(other)
    assert model.counts_.tolist() == [20, 20, 20]


def test_an_untrained_model_that_takes_over_another_keeps_its_backend():
    pytest.importorskip("numba")
    frames, labels = touches()
    trained = HDCClassifier(backend="compiled").fit(frames, labels)
    assert HDCClassifier(backend="numpy").merge(trained).backend_ == "numpy"


def test_equal_distances_go_to_the_first_class():
    frames = np.array([[9, 0, 0, 9], [0, 9, 9, 0]], np.uint8)
    model = HDCClassifier().fit(frames, ["b", "a"])
    query = np.array([[9, 9, 0, 0]], np.uint8)
    assert model.distances(query).tolist() == [[2, 2]]
    assert model.predict(query).tolist() == ["a"]


# Parameters of parts ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change",
    [
        {"readout": "lda"},
        {"readout__random_state": 3},
        {"encoder": "levels"},
        {"encoder__ties": "raster"},
    ],
)
def test_parts_that_were_set_after_training_are_named(change):
    frames, labels = touches()
    other = HDCClassifier().fit(frames, labels)
    (name,) = change
    message = f"^{name.partition('__')[0]}: changed after training; call fit again$"
    for call in ("predict", "is_known", "decision_function", "partial_fit", "merge"):
        if change == {"readout": "lda"} and call in ("partial_fit", "merge"):
            continue  # which it has not
        model = HDCClassifier().fit(frames, labels).set_params(**change)
        given = {"partial_fit": (frames, labels), "merge": (other,)}
        with pytest.raises(ValueError, match=message):
            getattr(model, call)(*given.get(call, (frames,)))
    with pytest.raises(ValueError, match=message):
        other.merge(model)
    assert model.fit(frames, labels).score(frames, labels) > 0.9
