"""Parameters by name, nested, and methods that are there only for some of them."""

from fractions import Fraction

import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor
from hdc.availability import UnavailableError
from hdc.described import describe, rebuild
from hdc.encoders import (
    ENCODERS,
    Deviation,
    Encoder,
    Levels,
    Median,
    Quantile,
    Reference,
    Smoothed,
)
from hdc.parameters import Family
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

FRAMES, LABELS = np.arange(72).reshape(8, 3, 3), [0, 1] * 4


def test_parameters_of_parts_of_parts():
    model = HDCClassifier(Reference(Quantile("1/3")))
    found = model.get_params()
    assert found["encoder__base__at"] == "1/3"
    assert found["readout__class_weight"] is None
    own = ["encoder", "readout", "device", "backend"]
    assert list(model.get_params(deep=False)) == own
    model.set_params(encoder__base__at="1/4", readout="lda", readout__shrinkage=0.5)
    assert repr(model.encoder) == (
        "Reference(base=Quantile(at='1/4', ties='spread'), frame=None)"
    )
    assert repr(model.readout) == "LDA(shrinkage=0.5)"


def test_setting_leaves_the_object_that_was_given():
    mine = Majority()
    model = HDCClassifier(readout=mine).set_params(readout__ties="one")
    assert mine.ties == "zero"
    assert model.readout.ties == "one"


@pytest.mark.parametrize(
    ("parameters", "answer"),
    [
        ({"backend": "compield"}, "'compield'$"),
        ({"enocder": 1}, "'enocder'$"),
        ({"encoder": Reference(), "encoder__base__tise": 1}, "'encoder__base__tise'$"),
        ({"device__x": 1}, "'device__x'"),
        ({"encoder__base__at": 1}, "'encoder__base__at'"),
    ],
)  # fmt: skip
def test_a_name_that_is_none_is_answered_with_those_that_are(parameters, answer):
    with pytest.raises(ValueError, match=f"expected one of .*, found .*{answer}"):
        HDCClassifier().set_params(**parameters).fit(FRAMES, LABELS)


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
def test_an_old_name_is_read_in_files(readout, old, value, new):
    (name,) = new
    model = HDCRegressor if readout is NeighbourValues else HDCClassifier
    known = model.parts["readout"]
    described = describe(readout(), known)
    described["parameters"][old] = value
    del described["parameters"][name]
    assert rebuild(described, "readout", known).get_params().items() >= new.items()


SHARE = r"expected a share in \[0, 1\), found"
TIES = "ties: expected one of "
UNFIT = [
    *((HDCClassifier(encoder), message)
      for encoder, message in (
          (Median("half"), "ties: expected 'spread', .* found 'half'"),
          *((Quantile(at), r"^at: expected a quantile in \(0, 1\), found")
            for at in (0, 1, "1/0", None)),
          *((Levels(t), f"thresholds: expected an integer from 1 to 255, found {t}")
            for t in (0, 256, 2.0)),
          *((Levels(lit=lit), f"lit: {SHARE}") for lit in (1, -0.1, "x")),
          *((Deviation(t), "thresholds: expected a list of rising num")
            for t in ([], "012", [1, 0], [0, 0], [True], [1 / 3], [2_000_000])),
          *((Smoothed(smooth=s), "smooth: expected an integer from 1 to") for s in (0, 17, 1.5)),
          (Smoothed("x"), "base: expected one of median, "),
          (Reference("x"), "base: expected one of median, "),
          (Reference(Levels(lit=0.5)), "base: expected an encoder that learns nothing"),
      )),
    *((HDCClassifier(readout=readout), message)
      for readout, message in (
          *((kind(**bad), message) for kind in (Majority, Counts) for bad, message in (
              ({"ties": "half"}, TIES + "zero, one, found 'half'"),
              ({"class_weight": "x"}, "expected one of None, balanced, found 'x'"),
              ({"random_state": 1.5}, "random_state: expected an integer, found 1.5"))),
          *((LDA(a), r"shrinkage: expected 'ledoit_wolf', or a share in \[0, 1\]")
            for a in (-0.1, 1.1, "x", True)),
          *((Ridge(a), "penalty: expected a number above zero or None, found")
            for a in (0, -1, "x", float("inf"))),
          *((Kernel(**{name: a}), f"{name}: expected a list of numbers above")
            for name in ("scales", "penalties") for a in ([], [0], ["a"], 1)),
          *((Neighbours(k), "n_neighbors: expected an integer ≥ 1, found")
            for k in (0, 1.5, True)),
          *((Trained(margin), f"margin: {SHARE}") for margin in (1, "x")),
          *((Trained(passes=n), "passes: expected an integer ≥ 0, found") for n in (-1, 1.0)),
      )),
    *((kind(device=device), r"^device: expected 'cpu'[^\n]*, found[^\n]*$")
      for kind in (HDCClassifier, HDCRegressor) for device in ("gpu", "cuda:99", "meta", 1.5)),
]  # fmt: skip


@pytest.mark.parametrize(("model", "message"), UNFIT)
def test_values_of_parameters_that_do_not_fit_are_named(model, message):
    with pytest.raises(ValueError, match=message):
        model.fit(FRAMES, LABELS)


def test_numbers_of_numpy_and_the_ends_of_a_share_fit():
    for part in (Majority("one", random_state=np.int64(3)), Neighbours(np.int64(3)),
                 LDA(np.float32(0.5)), LDA(0), LDA(1), Ridge(np.float32(10))):  # fmt: skip
        part.check()


def test_descriptions_rebuild_the_part():
    for part in (
        Median(),
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
    for value in (np.zeros(3), {"a": 1}, [1, None]):
        with pytest.raises(
            ValueError, match=r"^Quantile\.at: expected .* a file keeps"
        ):
            describe(Quantile(value), ENCODERS)


def test_arrays_are_shown_by_their_shape():
    assert repr(Reference(frame=np.zeros((40, 50)))) == (
        "Reference(base='median', frame=<ndarray of shape (40, 50)>)"
    )


def test_methods_that_are_there_for_some():
    """Where a part of the model has what they need."""
    assert HDCClassifier.partial_fit.__doc__.startswith("Learn a further batch")
    model = HDCClassifier(readout="ldda")
    with pytest.raises(ValueError, match=r"^readout: expected one of .*, found 'ldda'"):
        model.partial_fit(None, None)
    assert issubclass(UnavailableError, AttributeError)
    assert issubclass(UnavailableError, ValueError)  # commands print these as one line


def test_a_name_is_known_without_the_import_of_its_class():
    known = Family("encoder", Encoder, {"bright": "no_such_module.Bright"})
    assert "bright" in known
    assert "Bright" not in known
