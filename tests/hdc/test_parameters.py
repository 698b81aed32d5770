"""Parameters by name, nested, and methods that are there only for some of them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor
from hdc.availability import UnavailableError
from hdc.described import describe, rebuild
from hdc.encoders import (
    ENCODERS,
    Deviation,
    Levels,
    Median,
    Quantile,
    Reference,
    Smoothed,
)
from hdc.parameters import Named
from hdc.readouts import (
    LDA,
    Counts,
    Kernel,
    Majority,
    Neighbours,
    NeighbourValues,
    Ridge,
    Trained,
)


def test_parameters_of_parts_of_parts():
    model = HDCClassifier(Reference(Quantile("1/3")))
    found = model.get_params()
    assert found["encoder__base__at"] == "1/3"
    assert found["readout__class_weight"] is None
    assert set(model.get_params(deep=False)) == {
        "encoder",
        "readout",
        "device",
        "backend",
    }
    model.set_params(encoder__base__ties="below", readout="lda", readout__shrinkage=0.5)
    assert repr(model.encoder) == (
        "Reference(base=Quantile(at='1/3', ties='below'), frame=None)"
    )
    assert repr(model.readout) == "LDA(shrinkage=0.5)"


def test_setting_leaves_the_object_that_was_given():
    mine = Majority()
    model = HDCClassifier(readout=mine).set_params(readout__ties="one")
    assert mine.ties == "zero"
    assert model.readout.ties == "one"


@pytest.mark.parametrize(
    "name", ["tie", "encoder__tie", "device__x", "encoder__base__at"]
)
def test_names_that_are_none_are_listed(name):
    with pytest.raises(ValueError, match=r"set_params: expected one of .*, found '"):
        HDCClassifier().set_params(**{name: 1})


@pytest.mark.parametrize(
    ("readout", "old", "value", "new"),
    [
        (Majority, "seed", 3, {"random_state": 3}),
        (Counts, "balance", True, {"class_weight": "balanced"}),
        (Counts, "balance", False, {"class_weight": None}),
        (Neighbours, "n_neighbours", 5, {"n_neighbors": 5}),
        (NeighbourValues, "n_neighbours", 5, {"n_neighbors": 5}),
    ],
)
def test_an_old_name_says_the_new_one_and_is_read_in_files(readout, old, value, new):
    (name,) = new
    model = HDCRegressor if readout is NeighbourValues else HDCClassifier
    message = f"^{readout.__name__}: expected {name}, found '{old}', its old name$"
    with pytest.raises(TypeError, match=message):
        readout(**{old: value})
    with pytest.raises(TypeError, match=message):
        model(readout=readout()).set_params(**{f"readout__{old}": value})
    known = model._known["readout"]
    described = describe(readout(), known)
    described["parameters"][old] = value
    del described["parameters"][name]
    assert rebuild(described, "readout", known).get_params().items() >= new.items()


SHARE = r"expected a share in \[0, 1\), found"
TIES = "ties: expected one of "
UNFIT = [
    *((HDCClassifier(encoder), message)
      for encoder, message in (
          (Median("half"), TIES + "spread, raster, below, found 'half'"),
          *((Quantile(at), r"^at: expected a quantile in \(0, 1\), found")
            for at in (0, 1, "1/0", None, float("nan"), True)),
          *((Levels(t), f"thresholds: expected an integer from 1 to 255, found {t}")
            for t in (0, 256, 2.0)),
          *((Levels(lit=lit), f"lit: {SHARE}") for lit in (1, -0.1, "x")),
          *((Deviation(t), "thresholds: expected a list of rising num")
            for t in ([], "012", [1, 0], [0, 0], [float("inf")], [True], [1 / 3], [2_000_000])),
          *((Smoothed(smooth=s), "smooth: expected an integer from 1 to") for s in (0, 17, 1.5)),
          (Smoothed("x"), "base: expected one of median, "),
          (Reference("x"), "base: expected one of median, "),
          (Reference(Levels(lit=0.5)), "base: expected an encoder that learns nothing"),
      )),
    *((HDCClassifier(readout=readout), message)
      for readout, message in (
          *((kind(**bad), message) for kind in (Majority, Counts) for bad, message in (
              ({"ties": "half"}, TIES + "zero, one, random, found 'half'"),
              ({"class_weight": "x"}, "expected one of None, balanced, found 'x'"),
              ({"random_state": 1.5}, "random_state: expected an integer, found 1.5"))),
          *((LDA(a), r"shrinkage: expected one of ledoit_wolf, oas, or a share in \[0, 1\]")
            for a in (-0.1, 1.1, "x", None, True, float("nan"))),
          *((Ridge(a), "penalty: expected a number above zero or None, found")
            for a in (0, -1, "x", float("inf"), True)),
          *((Kernel(**{name: a}), f"{name}: expected a list of numbers above")
            for name in ("scales", "penalties") for a in ([], [0], ["a"], 1)),
          *((Neighbours(k), "n_neighbors: expected an integer ≥ 1, found")
            for k in (0, 1.5, "x", None, True)),
          *((Trained(margin), f"margin: {SHARE}") for margin in (1, "x")),
          *((Trained(passes=n), "passes: expected an integer ≥ 0, found") for n in (-1, 1.0)),
      )),
    *((HDCRegressor(period=period), "period: expected a number above zero or")
      for period in (0, "a", True)),
    *((kind(device=device), r"^device: expected 'cpu'[^\n]*, found[^\n]*$")
      for kind in (HDCClassifier, HDCRegressor) for device in ("gpu", "cuda:99", "meta", 1.5)),
]  # fmt: skip


@pytest.mark.parametrize(("model", "message"), UNFIT, ids=repr)
def test_values_of_parameters_that_do_not_fit_are_named(model, message):
    with pytest.raises(ValueError, match=message):
        model.fit(np.arange(72).reshape(8, 3, 3), [0, 1] * 4)


@pytest.mark.parametrize(
    "readout",
    [Majority("random", random_state=np.int64(3)), Neighbours(np.int64(3)), LDA(np.float32(0.5)),
     LDA(0), LDA(1), Ridge(np.float32(10))],
    ids=repr,
)  # fmt: skip
def test_numbers_of_numpy_and_the_ends_of_a_share_fit(readout):
    frames = np.random.default_rng(0).normal(size=(80, 30))
    model = HDCClassifier(readout=readout).fit(frames, np.arange(80) % 4)
    assert (model.predict(frames) == np.arange(80) % 4).mean() > 0.4


def test_descriptions_rebuild_the_part():
    for part in (
        Median("below"),
        Quantile(Fraction(2, 3)),
        Quantile(np.float32(0.25)),
        Levels(np.int64(5), lit=0.5),
        Deviation((-1, Fraction(1, 3), "0.5")),
        Reference(Reference("levels")),
    ):
        described = describe(part, ENCODERS)
        again = rebuild(described, "encoder", ENCODERS)
        assert type(again) is type(part)
        assert describe(again, ENCODERS) == described
    assert describe(Quantile(Fraction(2, 3)), ENCODERS)["parameters"]["at"] == "2/3"


def test_arrays_are_shown_by_their_shape():
    assert repr(Reference(frame=np.zeros((40, 50)))) == (
        "Reference(base='median', frame=<ndarray of shape (40, 50)>)"
    )


def test_methods_that_are_there_for_some():
    """Where a part of the model has what they need."""
    model = HDCClassifier()
    assert callable(model.partial_fit)
    assert HDCClassifier.partial_fit.__doc__.startswith("Learn a further batch")
    model.readout = "lda"
    assert not hasattr(model, "partial_fit")
    assert getattr(model, "partial_fit", 7) == 7
    message = (
        r"^partial_fit: expected a read-out that learns batch by batch, found LDA\("
    )
    with pytest.raises(UnavailableError, match=message):
        model.partial_fit(None, None)
    model.readout = "ldda"
    with pytest.raises(UnavailableError, match=r"^partial_fit: readout: .* mean 'lda'"):
        model.partial_fit(None, None)
    assert issubclass(UnavailableError, AttributeError)
    assert issubclass(UnavailableError, ValueError)  # commands print these as one line


def test_a_name_is_known_without_the_import_of_its_class() -> None:
    known = Named({"bright": "no_such_module.Bright"})
    assert "bright" in known
    assert "Bright" not in known
