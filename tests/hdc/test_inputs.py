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


@pytest.mark.parametrize("kind", [np.uint8, object, torch.from_numpy])
def test_integer_labels_in_any_container(kind):
    frames, labels = touches()
    given = kind(labels) if kind is torch.from_numpy else labels.astype(kind)
    model = HDCClassifier().fit(frames, given)
    assert model.classes_.tolist() == [0, 1, 2]
    assert type(model.classes_.tolist()[0]) is int
    assert model.score(frames, given) == 1


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        ([0, 1], "expected 3, one a frame, found 2"),
        (["a", float("nan"), "b"], r"labels\[1\]: expected a str, .* found nan"),
        (np.array([0, 1, np.nan]), r"labels\[2\]: expected a str, .* found nan"),
        ([0, 1j, 1], "labels: .*Complex data not supported"),
        ([0, None, 1], r"labels\[1\]: expected a str, int, float or bool, found None"),
        (
            [1, "a", 1],
            "labels: expected all text, all numbers or .*, found 1 beside 'a'",
        ),
    ],
)
def test_labels_that_cannot_be_learnt_are_named(labels, message):
    with pytest.raises(ValueError, match=message):
        HDCClassifier().fit(touches()[0][:3], labels)


# Frames -------------------------------------------------------------------------------------------


def test_arrays_as_files_give_them():
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
def test_frames_that_are_none_are_named(frames, error, message):
    with pytest.raises(error, match=message):
        HDCClassifier().fit(frames, touches()[1])


@pytest.mark.parametrize("kind", [np.asarray, torch.from_numpy, np.ndarray.tolist])
def test_a_single_image_is_a_batch_of_one(kind):
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


def test_images_of_another_shape_are_refused_and_flat_ones_taken():
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


def test_columns_of_a_data_frame_are_pixels_in_their_order():
    pandas = pytest.importorskip("pandas")
    frames, labels = touches()
    table = pandas.DataFrame(frames.reshape(60, -1), index=np.linspace(0, 1, 60))
    model = HDCClassifier().fit(table, labels)
    assert torch.equal(
        model.prototypes_, HDCClassifier().fit(frames, labels).prototypes_
    )
    assert model.score(table, labels) == 1


@pytest.mark.parametrize("streamed", [False, True])
def test_other_columns_are_refused_after_any_training(streamed, tmp_path):
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


def test_names_of_columns_are_kept():
    pandas = pytest.importorskip("pandas")
    frames, labels = touches()
    names = [f"pixel {j}" for j in range(120)]
    table = pandas.DataFrame(frames.reshape(60, -1), columns=names)
    for model in (HDCClassifier(), HDCRegressor(), HDCClassifier("levels", "lda")):
        assert not hasattr(model, "feature_names_in_")
        model.fit(table, labels)
        assert model.feature_names_in_.tolist() == names
        assert model.feature_names_in_.dtype == object
        model.fit(frames, labels)
        assert not hasattr(model, "feature_names_in_")
    model.fit(pandas.DataFrame(frames.reshape(60, -1)), labels)  # named by numbers
    assert not hasattr(model, "feature_names_in_")


# Masked values ------------------------------------------------------------------------------------


class Slices:
    """A source of frames whose slices are masked from frame 40 on."""

    def __init__(self, frames: np.ndarray) -> None:
        self.frames, self.shape = frames, frames.shape

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index):
        part = np.ma.array(self.frames)[index]
        places = np.arange(len(self.frames))[index]
        part[places >= 40] = np.ma.masked
        return part


@pytest.mark.parametrize("encoder", ["median", "reference"])
@pytest.mark.parametrize("kind", ["array", "list", "source"])
def test_masked_frames_are_refused(kind, encoder):
    frames, labels = touches()
    masked = np.ma.array(frames)
    masked[7, 3, 3] = np.ma.masked
    given = {"array": masked, "list": list(masked), "source": Slices(frames)}[kind]
    message = "frames: expected all pixels, found masked ones"
    for model in (HDCClassifier(encoder), HDCRegressor(encoder)):
        with pytest.raises(ValueError, match=message):
            model.fit(given, labels)
        model.fit(frames, labels)
        with pytest.raises(ValueError, match=message):
            model.predict(given)


def test_masked_labels_and_targets_are_refused():
    """A masked −9999 is a missing value, no depth."""
    frames, labels = touches()
    mask = np.arange(60) == 5
    with pytest.raises(
        ValueError, match="labels: expected all labels, found masked ones"
    ):
        HDCClassifier().fit(frames, np.ma.array(labels, mask=mask))
    values = np.ma.array(np.where(mask, -9999.0, labels), mask=mask)
    for targets in (values, list(values[:, None])):
        with pytest.raises(
            ValueError, match="targets: expected all numbers, found masked"
        ):
            HDCRegressor().fit(frames, targets)
    model = HDCRegressor().fit(frames, labels)
    for call in (model.partial_fit, model.recalibrate, model.score):
        with pytest.raises(
            ValueError, match="targets: expected all numbers, found masked"
        ):
            call(frames, values)
    unmasked = np.ma.array(labels, mask=False)
    assert HDCClassifier().fit(np.ma.array(frames), unmasked).score(frames, labels) == 1


# What scikit-learn asks of labels -----------------------------------------------------------------


def test_labels_in_a_column_are_taken_with_a_warning():
    frames, labels = touches()
    with pytest.warns(
        UserWarning, match="A column-vector y was passed when a 1d array"
    ):
        model = HDCClassifier().fit(frames, labels[:, None])
    assert model.predict(frames).tolist() == labels.tolist()
    with pytest.raises(ValueError, match=r"labels\[0\]: expected a str"):
        HDCClassifier().fit(frames, np.stack([labels, labels], 1))


def test_depths_are_labels_and_a_continuous_quantity_is_none():
    frames, labels = touches()
    depths = labels / 4 + 0.1
    assert (
        HDCClassifier().fit(frames, depths).predict(frames).tolist() == depths.tolist()
    )
    few = np.arange(30) / 8 + 0.1  # one frame a depth
    assert HDCClassifier().fit(frames[:30], few).classes_.tolist() == few.tolist()
    many = np.arange(60) / 8 + 0.1
    message = "labels: expected classes, found 60 different numbers for 60 frames .*continuous"
    with pytest.raises(ValueError, match=message):
        HDCClassifier().fit(frames, many)
    assert (
        len(HDCClassifier().fit(frames, np.arange(60.0)).classes_) == 60
    )  # whole numbers
    streamed = HDCClassifier()
    for start in range(0, 60, 20):
        batch = slice(start, start + 20)
        streamed.partial_fit(frames[batch], many[batch])
    assert len(streamed.classes_) == 60
