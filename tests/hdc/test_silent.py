"""What once answered silently wrong, or not at all: refused, or right."""

import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor
from hdc.encoders import Median, Quantile, Reference
from hdc.readouts import Majority

X = np.random.default_rng(0).integers(0, 255, (12, 8, 8)).astype("u1")
Y = [0, 1] * 6
KINDS = [HDCClassifier, HDCRegressor]


# Parts and parameters that change after training -------------------------------------------------


def test_what_was_trained_is_saved_whatever_becomes_of_the_objects_given(tmp_path):
    base, readout = Quantile("3/4"), Majority("one")
    model = HDCClassifier(Reference(base), readout).fit(X, Y)
    expected = model.distances(X)
    base.at, readout.ties = "1/4", "zero"
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert (loaded.distances(X) == expected).all()
    assert (loaded.encoder.base.at, loaded.readout.ties) == ("3/4", "one")


@pytest.mark.parametrize(
    ("model", "change", "advice"),
    [
        (HDCClassifier(), {"device": "gpu"}, r"to\(device\) moves it$"),
        (HDCRegressor(), {"device": "gpu"}, r"to\(device\) moves it$"),
        (HDCRegressor(period=360), {"period": None}, "call fit"),
        (HDCRegressor(period=360), {"period": 180}, "call fit"),
    ],
)
def test_a_parameter_that_is_set_after_training_is_refused(model, change, advice):
    (name,) = change
    before = getattr(model, name)
    model.fit(X, Y).set_params(**change)
    for call in (model.predict, lambda frames: model.recalibrate(frames, Y)):
        with pytest.raises(ValueError, match=f"^{name}: changed after .*; .*{advice}"):
            call(X)
    model.set_params(**{name: before})
    assert model.predict(X).shape == (12,)
    same = type(before)(str(before))  # another object
    assert model.set_params(**{name: same}).predict(X).shape == (12,)


def test_a_period_of_numpy_is_saved(tmp_path):
    model = HDCRegressor(period=np.float32(360)).fit(X, np.arange(12.0))
    model.save(tmp_path / "m")
    loaded = HDCRegressor.load(tmp_path / "m")
    assert (loaded.predict(X) == model.predict(X)).all()


def test_hypervectors_are_found_in_a_list():
    first, second = (HDCClassifier().fit(X, Y).encode(X) for _ in range(2))
    assert [first, second].index(second) == 1


@pytest.mark.parametrize("call", ["partial_fit", "recalibrate"])
def test_angles_below_zero_that_are_learnt_later_are_predicted(call):
    model = HDCRegressor(period=360).fit(X, np.arange(12.0))
    getattr(model, call)(255 - X, np.arange(12.0) - 40)
    assert (model.predict(255 - X[:1]) < 0).all()


# Whole or nothing --------------------------------------------------------------------------------


def test_a_merge_that_fails_halfway_changes_nothing(monkeypatch):
    mine, untrained = (HDCClassifier(readout="neighbours") for _ in range(2))
    other = HDCClassifier(readout="neighbours").fit(255 - X, [1, 2] * 6)
    mine.fit(X, Y)
    before = mine._head

    def fail(*_):
        raise MemoryError

    monkeypatch.setattr(type(mine.readout_), "merge", fail)
    for model in (mine, untrained):
        with pytest.raises(MemoryError):
            model.merge(other)
    assert not hasattr(untrained, "classes_")
    assert mine.classes_.tolist() == [0, 1]
    assert mine._head is before


def test_an_untrained_model_does_not_take_over_another_encoder():
    trained = HDCClassifier().fit(X, Y)
    with pytest.raises(ValueError, match=r"merge: expected the encoder Levels\(.*Medi"):
        HDCClassifier("levels").merge(trained)


# Recalibration -----------------------------------------------------------------------------------


def test_frames_of_a_class_without_any_are_not_lost_by_replacing_bits():
    model = HDCClassifier().partial_fit(X[:8], Y[:8], classes=[0, 1, 2])
    before = model.predict(X)
    with pytest.raises(ValueError, match=r"^recalibrate: expected classes with tr"):
        model.recalibrate(X[8:], [0, 1, 2, 2])
    assert (model.predict(X) == before).all()
    model.recalibrate(X[8:], [0, 1, 2, 2], method="merge")
    assert (model.predict(X[10:]) == 2).all()


@pytest.mark.parametrize("readout", ["lda", "kernel"])
def test_new_frames_of_one_class_do_not_take_the_place_of_all(readout):
    model = HDCClassifier(readout=readout).fit(X, [0, 1, 2] * 4)
    before = model.predict(X)
    with (
        pytest.warns(UserWarning, match="no new frames of 0, 2"),
        pytest.raises(ValueError, match=r"^p: expected a share below 1 with new fra"),
    ):
        model.recalibrate(X[1::3], [1] * 4, p=1)
    assert (model.predict(X) == before).all()


# Memory and names --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "readout", "expected", "found"),
    [
        (HDCClassifier, "ridge", "11 frames or 11 bits", "12 frames of 64 bits"),
        (HDCRegressor, "ridge", "11 frames or 11 bits", "12 frames of 64 bits"),
        (HDCClassifier, "lda", "11 frames or 11 bits", "12 frames of 64 bits"),
        (HDCClassifier, "kernel", "11 frames", "12"),
    ],
)
def test_more_frames_than_memory_holds_are_refused(
    kind, readout, expected, found, monkeypatch
):
    """Of few bits ridge and lda are solved among these."""
    monkeypatch.setattr("hdc.readouts.discriminant.MOST_FRAMES", 11)
    message = f"^{readout}: expected at most {expected}, found {found}, which need . ma"
    with pytest.raises(ValueError, match=message):
        kind(readout=readout).fit(X, Y)
    kind(readout="neighbours").fit(X, Y)
    if readout != "kernel":
        kind(readout=readout).fit(X[:, :1], Y)


@pytest.mark.parametrize(
    ("parameters", "meant"),
    [
        ({"encoder": "medain"}, "'median'"),
        ({"readout": Majority("zeros")}, "'zero'"),
        ({"encoder": Median("spraed")}, "'spread'"),
        ({"backend": "compield"}, "'compiled'"),
        ({"enocder": 1}, "'encoder'"),
        ({"readout__class_weigth": 1}, "'readout__class_weight'"),
        ({"encoder": Reference(), "encoder__base__tise": 1}, "'encoder__base__ties'"),
    ],
)
def test_a_name_that_is_much_like_another_is_answered_with_it(parameters, meant):
    with pytest.raises(ValueError, match=rf"Did you mean {meant}\?"):
        HDCClassifier().set_params(**parameters).fit(X, Y)
    with pytest.raises(ValueError, match=r"expected one of .*, found 'xyz'$"):
        HDCClassifier("xyz").fit(X, Y)
