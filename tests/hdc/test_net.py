"""Nothing moves: digests of all that models say, and models and words of earlier versions.

The files of an earlier version were written once, by the program tests/hdc/net/models.py that stood
here until commit bdb6476d.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor
from hdc.encoders import ENCODERS
from hdc.readouts import READOUTS, VALUE_READOUTS
from tests.hdc.net import digests
from tests.hdc.net.frames import frames_of
from tests.hdc.own import BACKENDS

PROCESSOR, CASES = digests.read()
MODELS = Path(__file__).parent / "net" / "models"
pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("encoder", ENCODERS)
def test_no_bit_moves(encoder, backend):
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


# Earlier versions --------------------------------------------------------------------------------


def answers(model):
    """What a model says of frames that it has not seen; None of what it cannot say."""
    asked, _ = frames_of("uint8", 12, seed=1)
    found = {"predict": model.predict(asked).tolist()}
    given = {"predict_set": [0.1], "predict_proba": [], "is_known": [0.05]}
    for name, alpha in given.items():
        try:
            each = getattr(model, name)(asked, *alpha)
            found[name] = [np.asarray(one).tolist() for one in each]
        except (AttributeError, ValueError):
            found[name] = None
    return found


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "path",
    sorted(MODELS.glob("*/*.hdc")),
    ids=lambda path: f"{path.parent.name}, {path.stem}",
)
def test_a_model_of_an_earlier_version_says_what_it_said(path):
    expected = json.loads((path.parent / "answers.json").read_text())[path.stem]
    kind = HDCRegressor if path.stem.startswith("numbers") else HDCClassifier
    model = kind.load(path)
    assert model.metadata_ == {"made by": path.parent.name}
    found = answers(model)
    if kind is HDCRegressor:
        assert found["predict"] == pytest.approx(expected["predict"], abs=1e-9)
    else:
        assert found["predict"] == expected["predict"]
        # by the rule of today, of frames in the file
        assert len(set(found["is_known"])) <= 2
        assert any(found["is_known"])
    if path.parent.name == "2.0.0":  # sets of then had other rules
        return
    assert found["predict_set"] == expected["predict_set"]
    if expected["predict_proba"] is not None:
        probabilities = np.array(found["predict_proba"])
        assert probabilities == pytest.approx(np.array(expected["predict_proba"]))


@pytest.mark.parametrize("form", ["quantile, ridge", "levels, lda"])
def test_a_file_of_version_2_0_says_where_it_lacks_scores_of_left_out_frames(form):
    model = HDCClassifier.load(MODELS / "2.0.0" / f"{form}.hdc")
    with pytest.raises(ValueError, match=r"saved by version 2\.0, of .*; fit anew"):
        model.predict_set(frames_of("uint8", 3)[0], 0.2)


def test_a_recalibration_without_labels_names_the_method_for_it():
    frames, labels = frames_of("uint8", 30)
    model = HDCClassifier("reference").fit(frames, labels)
    with pytest.raises(ValueError, match=r"^recalibrate: .*labels: rezero\(frames\)$"):
        model.recalibrate(frames)
