"""Nothing moves: digests of all that models say, and models that earlier versions saved."""

from __future__ import annotations

import json

import pytest

from hdc import HDCClassifier, HDCRegressor
from hdc.encoders import ENCODERS
from hdc.readouts import READOUTS, VALUE_READOUTS
from tests.hdc.net import digests, models

PROCESSOR, CASES = digests.read()
FILES = sorted(models.FOLDER.glob("*/*.hdc"))
pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("backend", digests.BACKENDS)
@pytest.mark.parametrize("encoder", ENCODERS)
def test_no_bit_moves(encoder, backend):
    if backend == "compiled":
        pytest.importorskip("numba")
    same = digests.processor() == PROCESSOR
    names = [n for n in CASES if n.startswith(f"{encoder},") and f" {backend}," in n]
    assert len(names) == len(digests.TYPES) * len([*READOUTS, *VALUE_READOUTS])
    moved = []
    for name in names:
        _, readout, _, kind = name.split(", ")
        if readout.endswith(" of numbers"):
            of = digests.of_numbers
        else:
            of = digests.of_classes
        found = of(encoder, readout.removesuffix(" of numbers"), backend, kind)
        for key, expected in CASES[name].items():
            exact = key in ("words", "prototypes") or (
                key == "scores" and readout in digests.EXACT
            )
            if found[key] != expected and (exact or same):
                moved.append(f"{name}: {key}")
    assert not moved


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "path", FILES, ids=lambda path: f"{path.parent.name}, {path.stem}"
)
def test_a_model_of_an_earlier_version_says_what_it_said(path):
    expected = json.loads((path.parent / "answers.json").read_text())[path.stem]
    kind = HDCRegressor if path.stem.startswith("numbers") else HDCClassifier
    model = kind.load(path)
    assert model.metadata_ == {"made by": path.parent.name}
    found = models.answers(model)
    if kind is HDCRegressor:
        assert found["predict"] == pytest.approx(expected["predict"], abs=1e-9)
    else:
        assert found["predict"] == expected["predict"]
    if kind is HDCClassifier:  # by the rule of today, of frames in the file
        assert len(set(found["is_known"])) <= 2
        assert any(found["is_known"])
    if path.parent.name == "2.0.0":  # sets of then had other rules
        return
    assert found["predict_set"] == expected["predict_set"]
    if expected["predict_proba"] is not None:
        for row, before in zip(
            found["predict_proba"], expected["predict_proba"], strict=True
        ):
            assert row == pytest.approx(before, abs=1e-9)
