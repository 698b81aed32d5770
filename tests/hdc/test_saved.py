"""Models in files: what comes back, and what is refused instead of loaded."""

import sys

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor, io
from hdc.encoders import Levels, Reference
from tests.hdc.test_io import QUERIES, X, Y, file_of, trained

# Models that come back ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "names", [[0, 1], ["a\0", "é"], [0.5, float("inf")], [True, False], [2**70, -1]]
)
def test_labels_come_back_and_training_goes_on(tmp_path, names):
    model = HDCClassifier().fit(QUERIES[:6], names * 3)
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert loaded.classes_.tolist() == model.classes_.tolist()
    assert loaded.classes_.dtype == model.classes_.dtype
    for m in (model, loaded):
        m.partial_fit(QUERIES[:2], names)
    assert np.array_equal(loaded.p_values(QUERIES, 0.5), model.p_values(QUERIES, 0.5))


def test_a_loaded_model_does_not_live_on_its_file(tmp_path):
    path = tmp_path / "model"
    trained().save(path)
    loaded = HDCClassifier.load(path)
    before = loaded.predict(X)
    with path.open("r+b") as file:
        file.truncate(16)
    assert (loaded.predict(X) == before).all()


def test_metadata_are_kept_with_the_model(tmp_path):
    metadata = {"crop": [10, 20, 500, 500], "camera": {"name": "µEye", "gain": 0.5}}
    trained().save(tmp_path / "m", metadata)
    loaded = HDCClassifier.load(tmp_path / "m")
    assert loaded.metadata_ == metadata
    loaded.save(tmp_path / "n")
    assert HDCClassifier.load(tmp_path / "n").metadata_ == metadata
    loaded.save(tmp_path / "n", {})
    assert HDCClassifier.load(tmp_path / "n").metadata_ == {}
    for bad in (
        {"crop": np.arange(4)},
        {"gain": float("nan")},
        {1: "a", "1": "b"},  # keys that would become one
        {"a": [{2: 0}]},
    ):
        with pytest.raises(
            TypeError, match="n: metadata: expected values of JSON, fou"
        ):
            loaded.save(tmp_path / "n", bad)
    assert loaded.metadata_ == {}


@pytest.mark.skipif(torch.cuda.is_available(), reason="for machines without CUDA")
def test_a_model_from_an_accelerator_loads_without_one(tmp_path):
    trained().save(tmp_path / "m")
    header, tensors = io.read_model(tmp_path / "m")
    header["parameters"]["device"] = "cuda"
    (tmp_path / "m").write_bytes(file_of(header, tensors))
    with pytest.warns(UserWarning, match="trained on 'cuda', which is not here"):
        model = HDCClassifier.load(tmp_path / "m")
    assert model.device == "cpu"
    assert np.array_equal(model.predict(QUERIES), trained().predict(QUERIES))


@pytest.mark.parametrize(
    ("parameters", "name"),
    [
        ({"encoder": "mine.Bits"}, "mine.Bits"),
        ({"readout": "mine.Votes"}, "mine.Votes"),
        ({"encoder": Reference("mine.Bits")}, "mine.Bits"),
    ],
)
def test_only_a_trusted_module_is_imported(parameters, name, tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(
        "from hdc.encoders import Median\nfrom hdc.readouts import Majority\n"
        "class Bits(Median): pass\nclass Votes(Majority): pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    model = trained(**parameters)
    model.save(tmp_path / "m")
    del sys.modules["mine"]
    for trusted in ((), ["mine"], ["mine.Other"], f"yours.or.{name}"):
        with pytest.raises(ValueError, match=rf"m: .*trusted=\['{name}'\]") as caught:
            HDCClassifier.load(tmp_path / "m", trusted=trusted)
        assert "\n" not in str(caught.value)
    assert "mine" not in sys.modules
    for trusted in ([name], name):
        loaded = HDCClassifier.load(tmp_path / "m", trusted=trusted)
        assert (loaded.predict(X) == model.predict(X)).all()
    del sys.modules["mine"]


# Files that are not such ones ---------------------------------------------------------------------


def test_flipped_bits_are_refused_or_harmless(tmp_path):
    path = tmp_path / "bad.safetensors"
    (good := trained()).save(path, {"crop": [1, 2, 3, 4]})
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(300):
        content = bytearray(whole)
        content[rng.integers(len(content))] ^= int(rng.integers(1, 256))
        path.write_bytes(content)
        try:
            model = HDCClassifier.load(path)
        except ValueError as error:
            assert "bad.safetensors" in str(error)  # noqa: PT017
            continue
        assert torch.equal(model.prototypes_, good.prototypes_)
        assert torch.equal(model.state_.planes, good.state_.planes)
        assert repr(model.readout) == repr(good.readout_)
        assert model.metadata_ == good.metadata_


def refused(path, model, header, tensors):
    """A model saved with some of its header and tensors replaced is not loaded; as it is, it is."""
    model.fit(X, Y).save(path)
    old, old_tensors = io.read_model(path)
    path.write_bytes(file_of(old, old_tensors))
    type(model).load(path)
    parts = {name: header[name] for name in old["parameters"] if name in header}
    changed = old | {"parameters": old["parameters"] | parts} | header
    path.write_bytes(file_of(changed, old_tensors | tensors))
    message = f"m: expected a saved {type(model).__name__}, found"
    with pytest.raises(ValueError, match=message):
        type(model).load(path)


def part(name, **parameters):
    return {"class": name, "parameters": parameters}


HEADERS = [
    {"format": "other"}, {"kind": None}, {"kind": "HDCRegressor"}, {"metadata": 3},
    {"seen": [4, 4]}, {"seen": [4, 4, -4]}, {"seen": [4, 4, 2.5]}, {"seen": [2**70] * 3},
    {"classes": [2, 1, 0]}, {"classes": [0, 1]}, {"classes": None},
    {"classes": [[0], [1], [2]]}, {"classes": [0.0, 1.0, float("nan")]},
    {"frame_shape": [5, 13]}, {"frame_shape": [-5, -7]}, {"frame_shape": [10**30, 10**30]},
    {"frame_shape": []}, {"frame_shape": [5, 7, 1]}, {"frame_shape": [True, 35]},
    {"recalibrated": None, "seen": None}, {"parameters": None},
    {"device": "meta"}, {"device": None}, {"encoder": part("median", ties="never")},
    {"encoder": part("median", ties=["spread"])}, {"encoder": part("median", colour=1)},
    {"encoder": part("levels", thresholds=10**9)}, {"encoder": part("nothing")},
    {"encoder": part("os.system")}, {"encoder": part("majority")}, {"encoder": part(None)},
    {"readout": part("majority", seed="x")}, {"readout": part("majority", balance=3)},
    {"readout": part("counts", seed=1.5)}, {"readout": part("ridge")},
]  # fmt: skip


@pytest.mark.parametrize("header", HEADERS, ids=repr)
def test_headers_that_do_not_fit_are_refused(tmp_path, header):
    refused(tmp_path / "m", HDCClassifier(), header, {})


def long(*shape):
    return torch.zeros(shape, dtype=torch.int64)


NAN, INFINITE = torch.tensor(torch.nan).double(), torch.full((3,), torch.inf).double()
OF_NUMBERS = [
    {"words": long(12, 1) - 1},
    {"values": torch.zeros(11, 1).double()},
    {"values": NAN.repeat(12, 1)},
    {"readout.residuals": torch.zeros(3, 1).double()},
    {"extra": long(1)},
]
TENSORS = {  # of a model → tensors of which none fits it; those of -1 have ones beyond D
    HDCClassifier(): [
        {"readout.n": torch.tensor([4, -4, 4])},
        {"readout.n": long(3)},
        {"readout.prototypes": torch.zeros(3, 1)},
        {"readout.prototypes": long(3, 2)},
        {"readout.prototypes": long(3, 1) - 1},
        {"readout.planes": long(3, 3, 1) - 1},
        {"readout.planes": long(3, 0, 1)},
        {"sample": long(12, 1) - 1},
        {"sample": long(11, 1)},
        {"extra": long(1)},
        {"readout.extra": long(1)},
        {"majority.n": long(3)},
        {"encoder.lit": long(1)},
    ],
    HDCClassifier(readout="neighbours"): [
        {"readout.rows": long(12) - 1},
        {"readout.rows": long(12) + 3},
        {"readout.rows": long(0), "readout.frames": long(0, 1)},
    ],
    HDCClassifier(readout="lda"): [
        {"readout.weights": long(3, 4, 1) - 1},
        {"readout.scales": torch.zeros(3)},
        {"readout.shrinkage": NAN},
        {"known.frame": torch.tensor([3, 1])},
    ],
    HDCClassifier(readout="kernel"): [{"readout.reach": torch.tensor(0.0).double()}],
    HDCClassifier(readout="ridge"): [
        {"readout.weights": long(3, 7, 1)},
        {"readout.scales": INFINITE},
    ],
    HDCClassifier(readout="trained"): [{"readout.prototypes": long(3, 1) - 1}],
    HDCClassifier("reference"): [
        {"encoder.reference": long(34)},
        {"encoder.reference": torch.zeros(35)},
    ],
    HDCClassifier(Levels(3, 0.5)): [{"encoder.lit": long(1) - 1}],
    HDCRegressor(readout="ridge"): OF_NUMBERS,
    HDCRegressor(readout="neighbours"): OF_NUMBERS,
}


@pytest.mark.parametrize("model", TENSORS, ids=repr)
def test_tensors_that_do_not_fit_are_refused(tmp_path, model):
    for tensors in TENSORS[model]:
        refused(tmp_path / "m", model, {}, tensors)
