"""Frames and labels as users have them: taken for what they are, or refused in one line.

Complex, sparse, empty and one-dimensional ones, columns of labels and no labels at all are among
the checks of scikit-learn, in test_estimator.
"""

import numpy as np
import pandas
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor
from hdc.encoders import Levels
from tests.hdc.net.frames import frames_of

FRAMES, LABELS = frames_of("uint8", 60)
THREE = FRAMES[:3]  # one of each class


# Labels -------------------------------------------------------------------------------------------

BIG = 2**53 + 1
EXACT = {
    "large": [BIG, BIG - 1, 0],
    "mixed": [BIG, 0.5, 0],
    "infinite": [0.5, np.inf],
    "text": ["1", "1\0", ""],
    "bools": [True, False],
    "objects of numpy": np.array([np.int64(BIG), np.int64(3), 0], object),
    "uint64": np.array([2**64 - 1, 1, 0], np.uint64),
    "a tensor": torch.tensor([BIG, 1, 0]),
    "bfloat16": torch.tensor([2.0, 1, 0]).bfloat16(),
    "a mask that hides nothing": np.ma.array([2, 1, 0], mask=False),
    "Int64 of pandas": pandas.Series([BIG, BIG - 1], dtype="Int64"),
    "category of pandas": pandas.Series(["b", "a"], dtype="category"),
    "boolean of pandas": pandas.Series([True, False], dtype="boolean"),
}


@pytest.mark.parametrize("given", EXACT.values(), ids=EXACT)
def test_labels_are_exactly_those_given(given, tmp_path):
    frames = THREE[: len(given)]
    model = HDCClassifier().fit(frames, given)
    wanted = [label.item() if hasattr(label, "item") else label for label in given]
    model.save(tmp_path / "m")
    for some in (model, HDCClassifier.load(tmp_path / "m")):
        assert some.classes_.tolist() == sorted(wanted)
        found = some.predict(frames).tolist()
        assert found == wanted
        assert set(map(type, found)) == set(map(type, wanted))


NO_LABEL = r"labels\[\d\]: expected a str, int, float or bool, found"
TWO_KINDS = "labels: expected all text, all numbers or .* found .* beside"
NO_ORDER = "labels: expected a list or an array, found a"
NO_LABELS = {
    "too few": ([0, 1], "expected 3, one a frame, found 2"),
    "nan": (np.array([0, 1, np.nan]), NO_LABEL + " nan"),
    "days": (np.array([0, 1, 2], "M8[D]"), NO_LABEL),
    "times in a list": ([np.datetime64(1, "ns")] * 3, NO_LABEL),
    "rows": (np.zeros((3, 2)), NO_LABEL),
    "bool beside number": ([1, True, 2], TWO_KINDS),
    "text beside number": (["1", 1, 2], TWO_KINDS),
    "a set": ({"a", "b", "c"}, NO_ORDER),
    "a text of three letters": ("abc", NO_ORDER),
    "a number": (5, NO_ORDER),
    "a dictionary": ({"a": 0, "b": 1, "c": 2}, NO_ORDER),
    "masked": (
        np.ma.array([0, 1, 2], mask=[0, 1, 0]),
        "labels: expected all to have .* found masked",
    ),
    "sparse": (torch.eye(3)[0].to_sparse(), "labels: expected plain numbers, found a"),
    "infinite": ([np.inf, -np.inf, np.inf], "labels: expected classes, found inf"),
}


@pytest.mark.parametrize(("labels", "message"), NO_LABELS.values(), ids=NO_LABELS)
def test_labels_that_cannot_be_learnt_are_named(labels, message):
    with pytest.raises((TypeError, ValueError), match=message):
        HDCClassifier().fit(THREE, labels)


@pytest.mark.parametrize("call", ["partial_fit", "recalibrate", "score"])
def test_labels_of_another_kind_are_refused_by_every_call(call):
    """A score of 0.0 would say that every answer is wrong."""
    model = HDCClassifier().fit(FRAMES, LABELS)
    with pytest.raises(ValueError, match=TWO_KINDS):
        getattr(model, call)(THREE, ["0", "1", "2"])
    assert model.score(FRAMES, [5] * 60) == 0.0


def test_depths_are_labels_and_a_continuous_quantity_is_none():
    depths = np.arange(60) / 8 + 0.1  # one frame a depth
    assert HDCClassifier().fit(FRAMES[:30], depths[:30]).classes_.size == 30
    assert HDCClassifier().fit(FRAMES, np.arange(60.0)).classes_.size == 60
    assert HDCClassifier().fit(FRAMES, LABELS + 0.1).classes_.size == 3
    message = "labels: expected classes, found 60 different numbers for 60 .*HDCRegressor predicts"
    with pytest.raises(ValueError, match=message):
        HDCClassifier().fit(FRAMES, depths)


# Frames -------------------------------------------------------------------------------------------


def frozen(frames):
    frames = frames.copy()
    frames.flags.writeable = False
    return frames


SAME = {
    "foreign byte order": lambda x: x.astype(">u2"),
    "read-only": frozen,
    "reversed rows": lambda x: x[:, ::-1].copy()[:, ::-1],
    "Fortran's order": np.asfortranarray,
    "a list": list,
    "objects": lambda x: x.astype(object),
    "uint16 of torch": torch.from_numpy,
}


@pytest.mark.parametrize("kind", SAME)
@pytest.mark.parametrize(
    "encoder", ["median", Levels(3, lit=0.5), "reference", "deviation"]
)
def test_frames_of_any_container_are_the_same_frames(encoder, kind):
    frames = FRAMES.astype(np.uint16)
    expected = HDCClassifier(encoder).fit(frames, LABELS)
    given = SAME[kind](frames)
    model = HDCClassifier(encoder).fit(given, LABELS)
    assert (model.predict(given) == expected.predict(frames)).all()
    if encoder == "median":
        assert torch.equal(model.prototypes_, expected.prototypes_)


class Slices:
    """A source of frames whose slices are masked from frame 40 on."""

    shape = FRAMES.shape

    def __len__(self):
        return len(FRAMES)

    def __getitem__(self, index):
        return np.ma.masked_array(FRAMES, mask=np.zeros(FRAMES.shape) + HIDDEN)[index]


HIDDEN = (np.arange(60) >= 40)[:, None, None]
ONE_HIDDEN = np.ma.array(
    FRAMES, mask=np.arange(FRAMES.size).reshape(FRAMES.shape) == 873
)
ALL_PIXELS = "frames: expected all to have a value, found masked"
DENSE = "frames: expected plain numbers, found "
NO_FRAMES = {
    "channels": (np.ones((60, 2, 2, 3)), r"found \(60, 2, 2, 3\); take one channel"),
    "a number": (5, "frames: expected shape .* found 5"),
    "without axes": (np.array(5.0), r"frames: expected shape .* found \(\); Reshape"),
    "of two shapes": ([np.ones((3, 4)), np.ones((3, 5))], "frames of one shape"),
    "meta": (torch.empty(60, 8, 8, device="meta"), DENSE + "a meta tensor"),
    "sparse of torch": (torch.eye(60).to_sparse(), DENSE + "a sparse tensor"),
    "a loader": (
        torch.utils.data.DataLoader(torch.from_numpy(FRAMES)),
        "frames: expected a dense array, found a loader of batches",
    ),
    "none": (FRAMES[:0], "frames: expected at least one frame, found none"),
    "masked": (ONE_HIDDEN, ALL_PIXELS),
    "masked slices": (Slices(), ALL_PIXELS),
}
if np.dtype(np.longdouble).itemsize > 8:
    wide = FRAMES.astype(np.longdouble)
    NO_FRAMES["long doubles"] = (wide, "at most 64 bits, found dtype (float|longd)")


@pytest.mark.parametrize(("frames", "message"), NO_FRAMES.values(), ids=NO_FRAMES)
@pytest.mark.parametrize("model", [HDCClassifier("reference"), HDCRegressor()])
def test_frames_that_are_none_are_named(model, frames, message):
    with pytest.raises((TypeError, ValueError), match=message):
        model.fit(frames, LABELS)
    if message is ALL_PIXELS:
        with pytest.raises(ValueError, match=message):
            model.fit(FRAMES, LABELS).predict(frames)


@pytest.mark.parametrize("kind", [np.asarray, torch.from_numpy, np.ndarray.tolist])
def test_a_single_image_is_a_batch_of_one(kind):
    model = HDCClassifier().partial_fit(FRAMES[1:], LABELS[1:])
    model.partial_fit(kind(FRAMES[0]), LABELS[:1])
    for frame, label in zip(FRAMES[:9], LABELS[:9], strict=True):
        assert model.predict(kind(frame)).tolist() == [label]
    rows = FRAMES[:, :1]  # of one row: [N, D] are as many frames
    assert HDCClassifier().fit(rows, LABELS).predict(rows[:, 0]).shape == (60,)


def test_images_of_another_shape_are_refused_and_flat_ones_taken():
    model = HDCClassifier().fit(FRAMES, LABELS)
    turned = FRAMES.transpose(0, 2, 1)
    message = r"frames: expected shape \(13, 10\) as in training, found \(10, 13\)"
    for call in (model.score, model.partial_fit, model.recalibrate):
        with pytest.raises(ValueError, match=message):
            call(turned, LABELS)
    message = "expected D = 130 pixels as .*found 50: X has 50 features, but it is "
    with pytest.raises(ValueError, match=message):
        model.predict(FRAMES[:, :5])
    flat = FRAMES.reshape(60, -1)
    assert (model.predict(flat) == LABELS).all()
    assert (HDCClassifier().fit(flat, LABELS).predict(FRAMES) == LABELS).all()


# Data frames --------------------------------------------------------------------------------------


def test_columns_of_a_data_frame_are_pixels_in_their_order(tmp_path):
    table = pandas.DataFrame(FRAMES.reshape(60, -1), index=np.linspace(0, 1, 60))
    other = table[table.columns[::-1]]
    model = HDCClassifier().fit(table, LABELS)
    assert (model.p_values(FRAMES) == model.p_values(table)).all()
    model.save(tmp_path / "m")
    regressor = HDCRegressor().fit(table, LABELS)
    for some in (model, HDCClassifier.load(tmp_path / "m"), regressor):
        more = () if some is regressor else (some.partial_fit,)
        for call in (some.score, some.recalibrate, *more):
            with pytest.raises(
                ValueError, match="the columns of training in its order"
            ):
                call(other, LABELS)
    assert model.fit(other, LABELS).score(other, LABELS) == 1


# More than memory holds ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("readout", "expected", "found"),
    [
        ("ridge", "59 frames or bits", "60"),
        ("lda", "59 frames or bits", "60"),
        ("kernel", "59 frames", "60"),
    ],
)
def test_more_frames_than_memory_holds_are_refused(
    readout, expected, found, monkeypatch
):
    """Of few bits ridge and lda are solved among these."""
    monkeypatch.setattr("hdc.readouts.discriminant.MOST_FRAMES", 59)
    told = f"expected at most {expected}, found {found}; train on f"
    message = f"^{readout}: {told}.* such as 'neighbours'$"
    with pytest.raises(ValueError, match=message):
        HDCClassifier(readout=readout).fit(FRAMES, LABELS)
    HDCClassifier(readout="neighbours").fit(FRAMES, LABELS)
    if readout != "kernel":
        HDCClassifier(readout=readout).fit(FRAMES[:, :1], LABELS)
