"""Encoders and read-outs of one's own, from a folder outside the checkout."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor
from hdc.encoders import Levels
from tests.hdc.test_contract import FRAMES, LABELS, QUERIES, TRUTH

CHECKOUT = Path(__file__).parents[2]


OWN_NAMES = [f"laboratory.{name}" for name in ("Bright", "Corner", "First", "Mean")]
OWN = """
from dataclasses import dataclass

import torch
from torch import Tensor
from hdc import bits
from hdc.encoders import Encoder
from hdc.readouts import Readout, State, ValueReadout, ValueState


class Bright(Encoder):
    def __init__(self, above=100):
        self.above = above

    def encode(self, frames):
        return bits.pack(frames.flatten(1) > self.above)


class Corner(Encoder):
    learns = True

    def fit(self, frames):
        self.mean_ = torch.as_tensor(frames[:]).flatten(1).long().sum(0) // len(frames)
        return self

    def encode(self, frames):
        return bits.pack(frames.flatten(1)[:, :50] > self.mean_[:50])

    def dimension(self, n_pixels):
        return 50

    def state(self):
        return {"mean": self.mean_}

    def restore(self, tensors, n_pixels):
        self.mean_ = tensors["mean"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Firsts(State):
    first: Tensor


class First(Readout):
    State = Firsts

    def __init__(self, place=0):
        self.place = place

    def fit(self, words, rows, n_classes):
        chosen = [words.packed[rows == c][self.place] for c in range(n_classes)]
        return Firsts(first=torch.stack(chosen))

    def scores(self, state, words):
        return -bits.hamming(words.packed, state.first)


@dataclass(frozen=True, kw_only=True, eq=False)
class Means(ValueState):
    mean: Tensor


class Mean(ValueReadout):
    State = Means

    def fit(self, words, values):
        return Means(words=words, targets=values, mean=values.mean(0))

    def values(self, state, words):
        return state.mean.expand(len(words), -1)
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """The folder of a module with encoders and read-outs of a user's own, which can be imported."""
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "laboratory.py").write_text(OWN)
    monkeypatch.syspath_prepend(folder)
    yield folder
    sys.modules.pop("laboratory", None)


@pytest.mark.parametrize(
    ("encoder", "readout", "chosen"),
    [
        ("Bright", "laboratory.First", {"encoder__above": 130, "readout__place": 1}),
        ("Corner", "lda", {}),
    ],
)
def test_own_parts_by_dotted_name(own, encoder, readout, chosen, tmp_path):
    model = HDCClassifier(f"laboratory.{encoder}", readout)
    model.set_params(**chosen).fit(FRAMES, LABELS)
    assert model.score(QUERIES, TRUTH) > 0.7
    assert model.is_known(QUERIES, 0.2).mean() > 0.5
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m", OWN_NAMES)
    assert loaded.get_params().items() >= chosen.items()
    expected = model.decision_function(QUERIES)
    assert np.array_equal(loaded.decision_function(QUERIES), expected)
    if chosen:
        words = model.encoder_.encode(torch.from_numpy(FRAMES[4:8]))
        assert torch.equal(model.state_.first, words[[3, 1, 2, 0]])
        assert not hasattr(model, "partial_fit")


def test_own_read_outs_of_numbers_by_dotted_name(own, tmp_path):
    model = HDCRegressor("laboratory.Bright", "laboratory.Mean")
    model.fit(FRAMES, np.arange(80.0)).save(tmp_path / "m")
    loaded = HDCRegressor.load(tmp_path / "m", OWN_NAMES)
    assert loaded.predict(FRAMES[:2]).tolist() == [39.5, 39.5]
    message = "interval: Mean has no leave-one-out predictions"
    with pytest.raises(ValueError, match=message):
        loaded.predict(FRAMES, return_interval=True)


def test_where_the_module_is_missing_one_line_says_so(own, tmp_path):
    model = HDCClassifier(readout="laboratory.First").fit(FRAMES, LABELS)
    model.save(tmp_path / "m")
    code = (
        "import sys; from hdc import HDCClassifier\n"
        "try: HDCClassifier.load(sys.argv[1], ['laboratory.First'])\n"
        "except ValueError as error: print(error)"
    )
    command = [sys.executable, "-c", code, tmp_path / "m"]
    found = subprocess.check_output(command, text=True, cwd=CHECKOUT)
    assert found == (
        f"{tmp_path / 'm'}: expected a saved HDCClassifier, found readout: expected a class "
        "'laboratory.First', found: No module named 'laboratory'\n"
    )


@pytest.mark.parametrize(
    ("given", "kind", "message"),
    [
        ("nothing", ValueError, "expected one of .*, or a dotted name such as 'mod"),
        ("laboratory.Missing", ValueError, "expected a class 'laboratory.Missing', f"),
        ("missing.First", ValueError, "expected a class 'missing.First', found: No m"),
        ("laboratory.torch", ValueError, "expected a class, found 'laboratory.torch'"),
        ("laboratory.Mean", TypeError, "expected .* object of hdc.*'laboratory.Mean'$"),
        ("pathlib.Path", TypeError, "expected .* object of hdc.*found 'pathlib.Path'$"),
        (7, TypeError, r"expected .* object of hdc.*, found 7$"),
        (Levels, TypeError, "expected one of .*, or an object of .*, found <class"),
    ],
)
def test_what_is_no_part_is_named(own, given, kind, message):
    frames, labels = FRAMES[:8], LABELS[:8]
    for name in ("encoder", "readout"):
        with pytest.raises(kind, match=f"^{name}: {message}") as caught:
            HDCClassifier(**{name: given}).fit(frames, labels)
        assert "\n" not in str(caught.value)
