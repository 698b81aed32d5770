"""Every encoder with every read-out, and parts from a folder outside the checkout."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor
from hdc.encoders import (
    ENCODERS,
    Levels,
    Quantile,
    Reference,
    RelativeEncoder,
    make_encoder,
)
from hdc.readouts import READOUTS, Updatable, make_readout
from tests.hdc.own import fitted

CHECKOUT = Path(__file__).parents[2]
PAIRS = [
    *((encoder, readout) for encoder in ENCODERS for readout in READOUTS),
    (Levels(3, lit=0.5), "majority"),
    (Reference("levels"), "lda"),
    (Reference(Quantile("1/3")), "counts"),
]


def touches(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    fields = np.random.default_rng(7).integers(0, 200, (4, 17, 13))
    rng = np.random.default_rng(seed)
    labels = np.arange(n) % 4
    noisy = fields[labels] + rng.normal(0, 60, (n, 17, 13))
    return np.clip(noisy, 0, 255).astype(np.uint8), np.array(list("dbca"))[labels]


@pytest.mark.parametrize(("encoder", "readout"), PAIRS, ids=repr)
def test_every_encoder_with_every_read_out(encoder, readout, tmp_path):
    pytest.importorskip("numba")
    (frames, labels), (queries, truth) = touches(80), touches(60, 1)
    model = HDCClassifier(encoder, readout, backend="numpy").fit(frames, labels)
    assert model.score(queries, truth) > 0.9
    sets = model.predict_set(queries, 0.1)
    assert np.mean([y in found for y, found in zip(truth, sets, strict=True)]) > 0.75
    assert model.is_known(queries, 0.1).mean() > 0.75
    compiled = HDCClassifier(encoder, readout, backend="compiled").fit(frames, labels)
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    expected = model.decision_function(queries)
    for other in (compiled, loaded):
        assert np.array_equal(other.decision_function(queries), expected)
        assert hasattr(other, "distances") == (readout in ("majority", "counts"))
        assert np.array_equal(other.is_known(queries), model.is_known(queries))
    loaded.save(tmp_path / "n")
    assert (tmp_path / "n").read_bytes() == (tmp_path / "m").read_bytes()
    assert 0 < model.prediction_bytes_ <= (tmp_path / "m").stat().st_size


@pytest.mark.parametrize("readout", READOUTS)
def test_a_class_without_frames_never_wins(readout):
    words = torch.from_numpy(np.random.default_rng(0).integers(0, 2**60, (20, 4)))
    rows = 2 * (torch.arange(20) % 2)
    model = fitted(make_readout(readout), words, rows, 4, 256)
    scores = model.scores(torch.cat((words, ~words & (2**60 - 1))))
    assert set(scores.argmax(1).tolist()) <= {0, 2}
    assert not scores.isnan().any()


@pytest.mark.parametrize(("encoder", "readout"), PAIRS, ids=repr)
def test_every_combination_goes_on_learning_or_says_why_not(encoder, readout):
    frames, labels = touches(80)
    queries, truth = touches(60, 1)
    first, second = (frames[:40], labels[:40]), (frames[40:], labels[40:])
    if not isinstance(make_readout(readout), Updatable):
        for name in ("partial_fit", "merge"):
            message = rf"^{name}: expected a read-out that learns batch by batch, found .*; fit"
            with pytest.raises(AttributeError, match=message):
                getattr(HDCClassifier(encoder, readout), name)
        return
    parts = HDCClassifier(encoder, readout).partial_fit(*first).partial_fit(*second)
    assert parts.counts_.tolist() == [20] * 4
    merged = HDCClassifier(encoder, readout).fit(*first)
    other = HDCClassifier(encoder, readout).fit(*second)
    if make_encoder(encoder).learns:  # two references, or other lit pixels
        with pytest.raises(
            ValueError,
            match=r"^merge: expected two encoders .* that have learned the same",
        ):
            merged.merge(other)
        assert parts.score(queries, truth) > 0.9
        return
    merged.merge(other)
    whole = HDCClassifier(encoder, readout).fit(frames, labels)
    expected = whole.decision_function(queries)
    for model in (parts, merged, HDCClassifier(encoder, readout).merge(whole)):
        assert np.array_equal(model.decision_function(queries), expected)


@pytest.mark.parametrize(("encoder", "readout"), PAIRS, ids=repr)
def test_every_combination_recalibrates_or_says_why_not(encoder, readout):
    frames, labels = touches(80)
    new, truth = touches(60, 1)
    new = np.roll(new, 2, axis=1)  # the sensor has moved
    model = HDCClassifier(encoder, readout).fit(frames, labels)
    zeroes = isinstance(make_encoder(encoder), RelativeEncoder)
    adapts = hasattr(make_readout(readout), "adapt")
    assert hasattr(model, "recalibrate") == adapts
    assert hasattr(model, "rezero") == zeroes
    if zeroes:
        model.rezero(new)
        assert not model._head.recalibrated
    if adapts:
        used = model.readout_.adapts_by
        given = {"p": 0.6, "method": "merge"}
        model.recalibrate(new, truth, **{k: given[k] for k in given if k in used})
        assert model.score(new, truth) > 0.8
        assert model.is_known(new, 0.2).mean() > 0.5
    else:
        with pytest.raises(
            AttributeError,
            match=r"^recalibrate: expected a read-out that adapts, found",
        ):
            model.recalibrate  # noqa: B018


# Parts of one's own -------------------------------------------------------------------------------


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
    "encoder", ["median", "laboratory.Bright", "laboratory.Corner"]
)
@pytest.mark.parametrize("readout", ["majority", "lda", "laboratory.First"])
def test_own_parts_by_dotted_name(own, encoder, readout, tmp_path):
    (frames, labels), (queries, truth) = touches(80), touches(60, 1)
    model = HDCClassifier(encoder, readout).fit(frames, labels)
    assert model.score(queries, truth) > 0.7
    assert model.is_known(queries, 0.2).mean() > 0.5
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m", OWN_NAMES)
    expected = model.decision_function(queries)
    assert np.array_equal(loaded.decision_function(queries), expected)
    if readout == "laboratory.First":
        words = model.encoder_.encode(torch.from_numpy(frames[:4]))
        assert torch.equal(model.state_.first, words[[3, 1, 2, 0]])
        assert not hasattr(model, "partial_fit")


def test_parameters_of_own_parts_are_kept_and_searched(own, tmp_path):
    frames, labels = touches(80)
    model = HDCClassifier("laboratory.Bright", "laboratory.First")
    assert model.get_params()["encoder__above"] == 100
    model.set_params(encoder__above=130, readout__place=1).fit(frames, labels)
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m", OWN_NAMES)
    assert (loaded.encoder.above, loaded.readout.place) == (130, 1)
    assert np.array_equal(loaded.predict(frames), model.predict(frames))


def test_own_read_outs_of_numbers_by_dotted_name(own, tmp_path):
    frames, _ = touches(80)
    model = HDCRegressor("laboratory.Bright", "laboratory.Mean")
    model.fit(frames, np.arange(80.0)).save(tmp_path / "m")
    loaded = HDCRegressor.load(tmp_path / "m", OWN_NAMES)
    assert loaded.predict(frames[:2]).tolist() == [39.5, 39.5]
    message = "interval: Mean has no leave-one-out predictions"
    with pytest.raises(ValueError, match=message):
        loaded.predict(frames, return_interval=True)


def test_where_the_module_is_missing_one_line_says_so(own, tmp_path):
    frames, labels = touches(80)
    HDCClassifier(readout="laboratory.First").fit(frames, labels).save(tmp_path / "m")
    code = (
        "import sys; from hdc import HDCClassifier\n"
        "try: HDCClassifier.load(sys.argv[1], ['laboratory.First'])\n"
        "except ValueError as error: print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "m"],
        capture_output=True,
        text=True,
        check=True,
        cwd=CHECKOUT,
    )
    assert done.stdout == (
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
        (Levels, TypeError, "expected an object, found the class Levels"),
    ],
)
def test_what_is_no_part_is_named(own, given, kind, message):
    frames, labels = touches(8)
    for name in ("encoder", "readout"):
        with pytest.raises(kind, match=f"^{name}: {message}") as caught:
            HDCClassifier(**{name: given}).fit(frames, labels)
        assert "\n" not in str(caught.value)


def test_a_subclass_of_ours_is_asked_through_its_own_methods():
    """Kernels that do several steps at once are for our own classes alone."""
    pytest.importorskip("numba")
    frames, labels = touches(80)
    plain = HDCClassifier(Inverted(), backend="compiled").fit(frames, labels)
    expected = HDCClassifier().fit(255 - frames, labels)
    assert np.array_equal(plain.distances(frames), expected.distances(255 - frames))


class Inverted(Quantile):
    def __init__(self):
        self.at, self.ties = "1/2", "spread"

    def encode(self, frames, first=0):
        return super().encode(255 - frames, first)
