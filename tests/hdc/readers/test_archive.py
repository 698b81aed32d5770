"""Arrays: labels and frames as saved, nothing unpickled."""

import pickle

import numpy as np
import pytest

from hdc.readers import BadFrame, SettingError, open_recording

LABELS = np.arange(12) % 3


@pytest.fixture
def save(tmp_path, pixels):
    def save(**changed):
        arrays = {"frames": pixels, "labels": LABELS, **changed}
        arrays = {key: value for key, value in arrays.items() if value is not None}
        np.savez(tmp_path / "x.npz", **arrays)
        return tmp_path / "x.npz"

    return save


@pytest.mark.parametrize(
    ("dtype", "order"),
    [("<u2", "C"), (">u2", "F"), ("u1", "F"), (">f4", "C"), (">i8", "C")],
)
def test_an_archive_is_a_recording(save, pixels, dtype, order):
    frames, times = np.asarray(pixels.astype(dtype), order=order), np.linspace(0, 1, 12)
    path = save(frames=frames, time=times, order=np.arange(12)[::-1], other=np.zeros(3))
    recording = open_recording(path, crop=[1, 2, 9, 8], subsample=2)
    assert recording.classes == ("0", "1", "2")
    assert np.array_equal(recording.labels, LABELS)
    (frame,) = recording.stream([5])
    native = np.dtype(dtype).newbyteorder("=")
    assert recording.frames([7, 2]).dtype == frame.dtype == recording.dtype == native
    assert np.array_equal(frame, frames[5, 2:10:2, 1:10:2])
    assert np.array_equal(recording.frames([7, 2]), frames[[7, 2], 2:10:2, 1:10:2])
    assert recording.frames([]).shape == (0, 4, 5)
    assert list(recording.samples) == ["order", "time"]
    assert np.array_equal(recording.samples["time"], times)
    assert recording.order.tolist() == list(range(12))[::-1]
    assert recording.place(3) == f"{path}, frame 3"
    values = open_recording(path, value_columns=["time"])
    assert np.array_equal(values.values[:, 0], times)


def test_classes_can_be_named_or_be_labels_themselves(save):
    names = np.array(["p9", "p10", "p2"])
    named = open_recording(save(classes=names))
    assert named.classes == ("p9", "p10", "p2")
    assert np.array_equal(named.labels, LABELS)
    texts = open_recording(save(labels=names[LABELS]))
    assert texts.classes == ("p2", "p9", "p10")
    assert texts.names == names[LABELS].tolist()
    both = open_recording(save(labels=names[LABELS], classes=names))
    assert np.array_equal(both.labels, LABELS)


def test_axes_of_an_array_are_named(tmp_path, pixels):
    path = tmp_path / "x.npy"
    np.save(path, pixels.reshape(3, 4, 20, 30))
    recording = open_recording(path, axes=("label", "order", "height", "width"))
    assert recording.names == [*"000011112222"]
    assert recording.order.tolist() == [0, 1, 2, 3] * 3
    assert np.array_equal(recording.frames([5, 0]), pixels[[5, 0]])
    values = open_recording(path, axes=["session", "value", "height", "width"])
    assert values.values[:, 0].tolist() == [0, 1, 2, 3] * 3
    assert values.session.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    for axes in (
        ["label", "label", "height", "width"],
        ["label", "order", "height", "feature"],
        ["x", "y", "height", "width"],
        ["label"],
    ):
        with pytest.raises(
            ValueError, match="axes: expected 4 different names among label, order"
        ):
            open_recording(path, axes=axes)


@pytest.mark.parametrize("named", [False, True])
def test_colour_becomes_luminance_and_other_channels_are_refused(save, named):
    """Of four that were named, the last was taken for blue; two ended in a traceback."""
    axes = ("frame", "height", "width", "channel")
    colour = np.random.default_rng(0).integers(0, 256, (12, 20, 30, 4), np.uint8)
    expected = colour[:, 2:10, 1:10, :3] @ [0.299, 0.587, 0.114]  # ITU-R BT.601
    settings = {"axes": axes if named else None, "crop": [1, 2, 9, 8]}
    recording = open_recording(save(frames=colour[..., :3]), **settings)
    assert np.abs(recording[:] - expected).max() <= 1
    floats = open_recording(save(frames=colour[..., :3].astype(float)), **settings)
    with pytest.raises(BadFrame, match=r"x.npz, frame 5: .* colour of uint8, uint16"):
        floats[5]
    for channels in (2, 4):
        with pytest.raises(SettingError, match=f"axes: .* found {channels}"):
            open_recording(save(frames=colour[..., :channels]), axes=axes)
    with pytest.raises(SettingError, match="axes: expected 3 different names"):
        open_recording(
            save(frames=colour[..., 0]), axes=("frame", "feature", "channel")
        )


class Trap:
    """Fails the test if it is unpickled."""

    def __reduce__(self):
        return (pytest.fail, ("it was unpickled",))


def test_nothing_is_unpickled(save, tmp_path):
    objects = np.array([Trap()] * 12, dtype=object)
    for key in ("frames", "labels", "classes"):
        with pytest.raises(
            ValueError,
            match=r"x.npz: .* holds Python objects, which are not opened here",
        ):
            open_recording(save(**{key: objects}))
    (tmp_path / "x.npz").write_bytes(pickle.dumps({"frames": 1}))
    with pytest.raises(ValueError, match=r"x.npz: expected an intact .npz"):
        open_recording(tmp_path / "x.npz")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            {"frames": None},
            r"expected an array of frames \[N, H, W\] or .*labels \(12,\)",
        ),
        ({"labels": None}, "expected arrays frames and labels, found no labels"),
        (
            {"frames": np.zeros((12, 5, 2, 2), np.uint8)},
            r"\[frames\]: expected shape \[N, H, W\] or \[N, D\]",
        ),
        (
            {"frames": np.zeros((0, 5, 5), np.uint8)},
            r"\[frames\]: expected shape \[N, H, W\]",
        ),
        (
            {"frames": np.zeros((12, 5, 5), bool)},
            r"\[frames\]: expected integers or floats, found bool",
        ),
        (
            {"labels": LABELS[:5]},
            r"\[frames\]: expected shape .* with N = 5, as there are labels",
        ),
        ({"labels": LABELS / 2}, r"\[labels\]: .* found float64"),
        (
            {"labels": LABELS * 0},
            r": expected two classes or more, found only '0'",
        ),
        (
            {"classes": np.array(["a", "b"])},
            r": expected one of the 2 classes, found",
        ),
        (
            {"classes": np.array(["a", "a", "b"])},
            r"\[classes\]: expected different names",
        ),
        (
            {"order": LABELS.astype("M8[s]")},
            r"12 numbers in the column order, found datetime64",
        ),
        ({"session": LABELS[:5]}, r"12 numbers in the column session, found .*\(5,\)"),
        (
            {"group": LABELS[:, None]},
            r"12 numbers in the column group, found .*\(12, 1\)",
        ),
        (
            {"labels": np.array(["a", "", "b"] * 4)},
            r": expected a label of each frame, found none of frame 1",
        ),
    ],
)
def test_arrays_of_another_kind_are_named(save, changed, message):
    with pytest.raises(ValueError, match=rf"x.npz.*{message}"):
        open_recording(save(**changed))


def test_vectors_have_no_crop(save, pixels):
    recording = open_recording(save(frames=pixels.reshape(12, 600)), subsample=7)
    assert recording.frame_shape == (86,)
    assert np.array_equal(recording.frames([3]), pixels.reshape(12, 600)[3:4, ::7])
    with pytest.raises(ValueError, match="crop: expected null for frames that are vec"):
        open_recording(save(frames=pixels.reshape(12, 600)), crop=[0, 0, 5, 1])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_named(save, pixels, bad):
    """cracks: a nan in session held nothing out, without a word."""
    for key in ("session", "order"):
        numbers = np.arange(12.0)
        numbers[4] = bad
        message = rf"x.npz, frame 4: expected a number in {key}, found {bad}"
        with pytest.raises(ValueError, match=message):
            open_recording(save(**{key: numbers}))
    values = np.arange(12.0)
    values[7] = bad
    with pytest.raises(ValueError, match=r"x.npz, frame 7: expected a number in"):
        open_recording(save(labels=None, values=values))
    frames = pixels.astype(float)
    frames[3, 0, 0] = bad
    recording = open_recording(save(frames=frames))
    assert len(recording.frames([2, 4])) == 2
    with pytest.raises(ValueError, match=r"x.npz, frame 3: expected finite numbers"):
        recording.frames([2, 3])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            {"values": np.zeros((11, 2))},
            r"\[frames\]: .* N = 11, as there are labels or",
        ),
        ({"values": np.zeros((12, 2, 1))}, r"\[values\]: expected shape \(12, k\)"),
        ({"value_names": ["x"]}, r"\[value_names\]: expected 2 different names, .*'x'"),
        ({"value_names": ["x", "x"]}, r"\[value_names\]: expected 2 different names"),
        ({"value_units": ["N"]}, r"\[value_units\]: expected 2 units, .*'N'"),
        (
            {"values": np.full((12, 2), "a")},
            r", frame 0: expected a number in value_0",
        ),
    ],
)
def test_values_that_do_not_fit_are_named(save, changed, message):
    arrays = {"labels": None, "values": np.zeros((12, 2)), **changed}
    with pytest.raises(ValueError, match=rf"x.npz{message}"):
        open_recording(save(**arrays))
