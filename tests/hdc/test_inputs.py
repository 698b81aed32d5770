"""Frames and labels as users have them."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import torch
from scipy import sparse

from hdc import HDCClassifier, HDCRegressor


def touches(
    n: int = 60, classes: int = 3, shape=(12, 10)
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    labels = np.arange(n) % classes
    base = rng.integers(0, 200, (classes, *shape))
    return (base[labels] + rng.integers(0, 56, (n, *shape))).astype(np.uint8), labels


# Labels -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "kind", ["array", "tensor", "scalars", "tensors", "series", "objects"]
)
def test_integer_labels_in_any_container(kind: str) -> None:
    frames, labels = touches()
    if kind == "series":
        given = pytest.importorskip("pandas").Series(labels)
    else:
        given = {
            "array": labels.astype(np.uint8),
            "tensor": torch.from_numpy(labels),
            "scalars": list(labels),
            "tensors": list(torch.from_numpy(labels)),
            "objects": labels.astype(object),
        }[kind]
    model = HDCClassifier().fit(frames, given)
    assert model.classes_.tolist() == [0, 1, 2]
    assert type(model.classes_.tolist()[0]) is int
    assert model.score(frames, given) == 1


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        (None, "expected 3, one a frame, found None"),
        ([0, 1], "expected 3, one a frame, found 2"),
        (np.zeros((3, 2)), r"labels\[0\]: expected a str, .* found \[0.0, 0.0\]"),
        (["a", float("nan"), "b"], r"labels\[1\]: expected a str, .* found nan"),
        (np.array([0, 1, np.nan]), r"labels\[2\]: expected a str, .* found nan"),
        ([0, 1j, 1], "labels: .*Complex data not supported"),
        (
            np.array(["2024-01-01", "NaT", "2024-01-02"], "M8[D]"),
            r"labels\[0\]: expected a str, int",
        ),
        (
            [0, np.datetime64("NaT"), 1],
            r"labels\[1\]: expected a str, int, float or bool",
        ),
        ([0, None, 1], r"labels\[1\]: expected a str, int, float or bool, found None"),
        ([1, "a", 1], "labels: expected all text or all numbers, found both"),
        ([7, 7, 7], "expected at least two classes, found one class, 7"),
    ],
)
def test_labels_that_cannot_be_learnt_are_named(labels, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        HDCClassifier().fit(touches()[0][:3], labels)


# Frames -------------------------------------------------------------------------------------------


def test_arrays_as_files_give_them() -> None:
    """Foreign byte order, read-only, reversed, Fortran order, lists, numbers held as objects."""
    frames, labels = touches()
    wide = frames.astype(np.uint16) * 3
    expected = HDCClassifier().fit(wide, labels).prototypes_
    frozen = wide.copy()
    frozen.flags.writeable = False
    backwards = wide[:, ::-1].copy()[:, ::-1]
    reversed_ = wide[::-1].copy()[::-1]
    for same in (
        wide.astype(">u2"),
        frozen,
        backwards,
        reversed_,
        np.asfortranarray(wide),
        list(wide),
        wide.astype(object),
    ):
        assert torch.equal(HDCClassifier().fit(same, labels).prototypes_, expected)


@pytest.mark.parametrize(
    ("frames", "error", "message"),
    [
        (
            np.full((60, 2, 2), "a"),
            TypeError,
            "expected real or integer pixels, found dtype <U1",
        ),
        (
            np.full((60, 2), {}, object),
            TypeError,
            "argument must be a string or a real number",
        ),
        (np.full((60, 2, 2), 1j), ValueError, "Complex data not supported"),
        (np.ones((60, 0)), ValueError, r"found 0 feature\(s\) \(shape=\(60, 0\)\)"),
        (
            np.ones(60),
            ValueError,
            r"expected shape \[N, H, W\] or \[N, D\], found \(60,\); Resh",
        ),
        (sparse.eye_array(60), TypeError, "expected a dense array, found a sparse one"),
        (
            [np.ones((3, 4)), np.ones((3, 5))],
            ValueError,
            "frames of one shape",
        ),
        (
            np.ma.masked_less(np.eye(60), 1),
            ValueError,
            "expected all pixels, found masked ones",
        ),
    ],
)
def test_frames_that_are_none_are_named(frames, error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        HDCClassifier().fit(frames, touches()[1])


@pytest.mark.parametrize("kind", [np.asarray, torch.from_numpy, np.ndarray.tolist])
def test_a_single_image_is_a_batch_of_one(kind) -> None:
    frames, labels = touches()
    model = HDCClassifier().fit(frames, labels)
    for i in range(3):
        one = kind(frames[i])
        assert model.predict(one).tolist() == [i]
        assert (model.distances(one) == model.distances(frames[i : i + 1])).all()
        assert model.is_known(one).shape == (1,)
    streamed = HDCClassifier().partial_fit(frames[:1], labels[:1])
    for frame, label in zip(frames[1:], labels[1:], strict=True):
        streamed.partial_fit(kind(frame), [label])
    assert torch.equal(streamed.prototypes_, model.prototypes_)


def test_images_of_another_shape_are_refused_and_flat_ones_taken() -> None:
    frames, labels = touches()
    model = HDCClassifier().fit(frames, labels)
    message = r"frames: expected shape \(12, 10\) as in training, found \(10, 12\)"
    for call in (
        lambda f: model.predict(f),
        lambda f: model.partial_fit(f, labels),
        lambda f: model.recalibrate(f, labels),
    ):
        with pytest.raises(ValueError, match=message):
            call(frames.transpose(0, 2, 1))
    flat = frames.reshape(60, -1)
    assert (model.predict(flat) == labels).all()
    assert (HDCClassifier().fit(flat, labels).predict(frames) == labels).all()
    message = "expected D = 120 pixels as in training .*found 50: X has 50 features, but HDCClass"
    with pytest.raises(ValueError, match=message):
        model.predict(frames[:, :5])
    assert model.n_features_in_ == model.dimension_ == 120


def test_columns_of_a_data_frame_are_pixels_in_their_order() -> None:
    pandas = pytest.importorskip("pandas")
    frames, labels = touches()
    table = pandas.DataFrame(frames.reshape(60, -1), index=np.linspace(0, 1, 60))
    model = HDCClassifier().fit(table, labels)
    assert torch.equal(
        model.prototypes_, HDCClassifier().fit(frames, labels).prototypes_
    )
    assert model.score(table, labels) == 1


@pytest.mark.parametrize("streamed", [False, True])
def test_other_columns_are_refused_after_any_training(streamed: bool, tmp_path) -> None:
    pandas = pytest.importorskip("pandas")
    frames, labels = touches()
    table = pandas.DataFrame(frames.reshape(60, -1))
    other = table[table.columns[::-1]]
    train = HDCClassifier().partial_fit if streamed else HDCClassifier().fit
    (model := train(table, labels)).save(tmp_path / "m")
    models = [model, HDCClassifier.load(tmp_path / "m"), HDCClassifier().merge(model)]
    models.append(HDCRegressor().fit(table, labels))
    for some in models:
        for call in (
            some.predict,
            *(partial(f, y=labels) for f in (some.partial_fit, some.score)),
        ):
            with pytest.raises(
                ValueError, match="expected the columns of training in its order"
            ):
                call(other)
    for call in (model.recalibrate, model.partial_fit):
        with pytest.raises(
            ValueError, match="expected the columns of training in its order"
        ):
            call(other, labels)
    with pytest.raises(
        ValueError, match="expected the columns of training in its order"
    ):
        model.merge(HDCClassifier().fit(other, labels))
    assert (
        model.score(frames, labels)
        == model.fit(other, labels).score(other, labels)
        == 1
    )
    assert (
        HDCClassifier().fit(frames, labels).score(other, labels) < 1
    )  # an array has no names
