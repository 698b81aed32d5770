"""Models in files: what comes back, and what is refused instead of loaded."""

import sys

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor, io
from hdc.encoders import Levels, Reference
from tests.hdc.test_io import QUERIES, X, Y, file_of, trained

# Models that come back ----------------------------------------------------------------------------


def test_a_loaded_model_does_not_live_on_its_file(tmp_path):
    path = tmp_path / "model"
    trained().save(path)
    loaded = HDCClassifier.load(path)
    before = loaded.predict(X)
    with path.open("r+b") as file:
        file.truncate(16)
    assert (loaded.predict(X) == before).all()


def test_a_file_says_its_revisions_and_loads_where_it_is_asked_to(tmp_path):
    model = trained(encoder="deviation", readout="lda")
    model.save(tmp_path / "m")
    header, _ = io.read_model(tmp_path / "m")
    assert header["revisions"] == {"encoder": 2, "readout": 1}
    moved = HDCClassifier.load(tmp_path / "m", device="cpu").to("cpu")
    assert np.array_equal(moved.p_values(QUERIES), model.p_values(QUERIES))
    for call in (model.to, lambda gpu: HDCClassifier.load(tmp_path / "m", device=gpu)):
        with pytest.raises(ValueError, match=r"^device: expected 'cpu'"):
            call("gpu")


def test_metadata_are_kept_with_the_model(tmp_path):
    metadata = {"crop": [10, 20, 500, 500], "camera": {"name": "µEye", "gain": 0.5}}
    trained().save(tmp_path / "m", metadata)
    loaded = HDCClassifier.load(tmp_path / "m")
    assert loaded.metadata_ == metadata
    for given, expected in ((None, metadata), ({}, {})):
        loaded.save(tmp_path / "n", given)
        assert HDCClassifier.load(tmp_path / "n").metadata_ == expected
    message = "n: metadata: expected values of JSON, found"
    with pytest.raises(TypeError, match=message):
        loaded.save(tmp_path / "n", {"gain": float("nan")})
    assert loaded.metadata_ == {}


def test_a_model_from_an_accelerator_loads_without_one(tmp_path):
    trained().save(tmp_path / "m")
    header, tensors = io.read_model(tmp_path / "m")
    header["parameters"]["device"] = "cuda"
    (tmp_path / "m").write_bytes(file_of(header, tensors))
    model = HDCClassifier.load(tmp_path / "m")
    assert model.device == "cpu"
    assert np.array_equal(model.predict(QUERIES), trained().predict(QUERIES))


def test_only_a_trusted_module_is_imported(tmp_path, monkeypatch):
    """Nor that of a part of a part."""
    code = "from hdc.encoders import Median\nclass Bits(Median): pass\n"
    (tmp_path / "mine.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    name = "mine.Bits"
    model = trained(encoder=Reference(name))
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
    trained().save(path, {"crop": [1, 2, 3, 4]})
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(300):
        content = bytearray(whole)
        content[rng.integers(len(content))] ^= int(rng.integers(1, 256))
        path.write_bytes(content)
        try:
            loaded = HDCClassifier.load(path)
        except ValueError as error:
            assert "bad.safetensors" in str(error)  # noqa: PT017
        else:
            loaded.save(tmp_path / "again")
            assert (tmp_path / "again").read_bytes() == whole


def refused(path, model, header, tensors, why=""):
    """A model saved with some of its header and tensors replaced is not loaded; as it is, it is."""
    model.fit(X, Y).save(path)
    old, old_tensors = io.read_model(path)
    path.write_bytes(file_of(old, old_tensors))
    type(model).load(path)
    parts = {name: header[name] for name in old["parameters"] if name in header}
    changed = old | {"parameters": old["parameters"] | parts} | header
    path.write_bytes(file_of(changed, old_tensors | tensors))
    message = f"m: expected a saved {type(model).__name__}, found {why}"
    with pytest.raises(ValueError, match=message):
        type(model).load(path)


def part(name, **parameters):
    return {"class": name, "parameters": parameters}


HEADERS = [
    {"format": "other"}, {"kind": "HDCRegressor"}, {"metadata": 3},
    {"seen": [4, 4]}, {"seen": [4, 4, -4]}, {"seen": [2**70] * 3},
    {"classes": [2, 1, 0]}, {"classes": [0, 1]},
    {"classes": [0.0, 1.0, float("nan")]},
    {"frame_shape": [5, 13]}, {"frame_shape": [-5, -7]},
    {"frame_shape": []}, {"frame_shape": [5, 7, 1]}, {"frame_shape": [True, 35]},
    {"parameters": None}, {"sharpness": -1.0}, {"sharpness": "1"},
    {"encoder": part("median", ties=["spread"])}, {"encoder": part("median", colour=1)},
    {"encoder": part("levels", thresholds=10**9)},
    {"encoder": part("os.system")}, {"encoder": part("majority")},
    {"readout": part("majority", balance=3)}, {"readout": part("ridge")},
]  # fmt: skip


@pytest.mark.parametrize("header", HEADERS, ids=repr)
def test_headers_that_do_not_fit_are_refused(tmp_path, header):
    refused(tmp_path / "m", HDCClassifier(), header, {})


def test_a_model_of_numbers_with_a_period_is_trained_again(tmp_path):
    why = "one with a period; train again on cosine and sine"
    refused(tmp_path / "m", HDCRegressor(), {"period": 360.0}, {}, why)


def long(*shape):
    return torch.zeros(shape, dtype=torch.int64)


OF_NUMBERS = [
    {"words": long(12, 1) - 1},
    {"values": torch.zeros(11, 1).double()},
    {"values": torch.full((12, 1), torch.nan).double()},
    {"extra": long(1)},
]
TENSORS = {  # of a model → tensors of which none fits it; those of -1 have ones beyond D
    HDCClassifier(): [
        {"readout.n": torch.tensor([4, -4, 4])},
        {"readout.n": long(3)},
        {"readout.prototypes": torch.zeros(3, 1)},
        {"readout.prototypes": long(3, 1) - 1},
        {"readout.planes": long(3, 0, 1)},
        {"sample": long(12, 1) - 1},
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
    HDCClassifier(readout="lda"): [{"known.frame": torch.tensor([3, 1])}],
    HDCClassifier(readout="kernel"): [{"readout.reach": torch.tensor(0.0).double()}],
    HDCClassifier(readout="ridge"): [{"readout.scales": torch.ones(3).double() / 0}],
    HDCClassifier("reference"): [
        {"encoder.reference": long(35) - 2**62},
        {"encoder.reference": torch.zeros(35)},
    ],
    HDCClassifier("smoothed"): [{"encoder.shape": torch.tensor([5, 8])}],
    HDCClassifier(Levels(3, 0.5)): [{"encoder.lit": long(1) - 1}],
    HDCRegressor(readout="ridge"): OF_NUMBERS,
    HDCRegressor(readout="neighbours"): OF_NUMBERS,
}


@pytest.mark.parametrize("model", TENSORS, ids=repr)
def test_tensors_that_do_not_fit_are_refused(tmp_path, model):
    for tensors in TENSORS[model]:
        refused(tmp_path / "m", model, {}, tensors)
