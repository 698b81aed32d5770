"""Files: written whole or not at all, nothing foreign replaced, and models that come back."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor, io
from hdc.encoders import Levels
from hdc.readouts import Majority

safetensors = pytest.importorskip("safetensors.torch")
posix = pytest.mark.skipif(os.name != "posix", reason="permissions and pipes of POSIX")


def trained(**parameters) -> HDCClassifier:
    frames = np.random.default_rng(0).integers(0, 255, (12, 5, 7), dtype=np.uint8)
    return HDCClassifier(**parameters).fit(frames, np.arange(12) % 3)


QUERIES = np.random.default_rng(1).integers(0, 255, (9, 5, 7), dtype=np.uint8)


# Writing ------------------------------------------------------------------------------------------


def test_whatever_step_of_a_write_fails_the_old_or_the_new_model_loads(
    tmp_path, full_disk
):
    path = tmp_path / "m"
    models = [trained(), trained(readout=Majority("one", random_state=1))]
    for k in range(100):
        models[0].save(path)
        if (error := full_disk(k, lambda: models[1].save(path))) is None:
            break
        assert "No space left" in str(error)
        loaded = HDCClassifier.load(path)
        expected = models[loaded.get_params()["readout__random_state"]]
        assert loaded.readout.get_params() == expected.readout_.get_params()
        assert np.array_equal(loaded.distances(QUERIES), expected.distances(QUERIES))
        assert len(list(tmp_path.iterdir())) == 1 or k == 4  # the temporary file stays
    assert k == 5  # folder, file, flush, name, and the temporary file


@posix
def test_only_regular_files_are_replaced(tmp_path):
    (tmp_path / "target").write_text("kept")
    (tmp_path / "link").symlink_to(tmp_path / "target")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name in ("link", "loop", "folder", "pipe", "/dev/null"):
        with pytest.raises(FileExistsError, match="not replaced"):
            trained().save(tmp_path / name)
    assert (tmp_path / "target").read_text() == "kept"
    assert not Path("/dev/null").is_file()


@pytest.mark.parametrize(
    "content",
    [b"", b"\x89PNG\r\n\x1a\n" + b"\0" * 100, b"notes", struct.pack("<Q", 2) + b"{}"],
)
def test_a_model_replaces_models_only(tmp_path, content):
    (tmp_path / "0.png").write_bytes(content)
    with pytest.raises(
        FileExistsError, match=r"0\.png: expected a saved model or no file"
    ):
        trained().save(tmp_path / "0.png")
    assert (tmp_path / "0.png").read_bytes() == content


@posix
def test_a_file_keeps_its_mode_and_may_have_a_long_name(tmp_path):
    path = tmp_path / ("m" * 255)
    trained().save(path)
    path.chmod(0o600)
    trained().save(path)
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(
        FileNotFoundError, match=r"missing: expected a folder to save m\.st in$"
    ):
        trained().save(tmp_path / "missing" / "m.st")


# Models that come back ----------------------------------------------------------------------------


@pytest.mark.parametrize("readout", ["majority", "counts"])
@pytest.mark.parametrize(
    "names", [[0, 1], ["a\0", "é"], [0.5, float("inf")], [True, False], [2**70, -1]]
)
def test_labels_come_back(tmp_path, readout, names):
    frames = QUERIES[:6]
    model = HDCClassifier(readout=readout).fit(frames, names * 3)
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert loaded.classes_.tolist() == model.classes_.tolist()
    assert loaded.classes_.dtype == model.classes_.dtype
    assert loaded.frame_shape_ == (5, 7)
    found = loaded.decision_function(QUERIES)
    assert np.array_equal(found, model.decision_function(QUERIES))
    for m in (model, loaded):  # training goes on
        m.partial_fit(QUERIES[:2], names)
    assert torch.equal(loaded.prototypes_, model.prototypes_)
    assert np.array_equal(loaded.is_known(QUERIES, 0.2), model.is_known(QUERIES, 0.2))


def test_metadata_are_kept_with_the_model(tmp_path):
    metadata = {
        "crop": [10, 20, 500, 500],
        "subsample": 2,
        "camera": {"name": "µEye", "gain": 0.5},
    }
    trained().save(tmp_path / "m", metadata)
    loaded = HDCClassifier.load(tmp_path / "m")
    assert loaded.metadata_ == metadata
    loaded.save(tmp_path / "n")
    assert HDCClassifier.load(tmp_path / "n").metadata_ == metadata
    loaded.save(tmp_path / "n", {})
    assert HDCClassifier.load(tmp_path / "n").metadata_ == {}
    for bad in ({"crop": np.arange(4)}, {"gain": float("nan")}):
        with pytest.raises(
            TypeError, match="n: metadata: expected values of JSON, found"
        ):
            loaded.save(tmp_path / "n", bad)
    assert loaded.metadata_ == {}


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


def rewrite(path: Path, tensors: dict | None = None, **changes) -> None:
    """Save a model and replace some of its header and tensors."""
    trained().save(path)
    header, content = io.read_model(path)
    content |= tensors or {}
    path.write_bytes(safetensors.save(content, {"model": json.dumps(header | changes)}))


BAD_HEADERS = [
    {"format": "other"}, {"format": "hdc-classifier-2"}, {"kind": None}, {"metadata": 3},
    {"seen": [2**70] * 3}, {"seen": [4, 4]}, {"seen": [4, 4, -4]}, {"seen": [4, 4, 2.5]},
    {"classes": [2, 1, 0]}, {"classes": [0, 1]}, {"classes": [0, 1, 1]}, {"classes": 3},
    {"classes": [[0], [1], [2]]}, {"classes": [0.0, 1.0, float("nan")]}, {"classes": None},
    {"frame_shape": [5, 13]}, {"frame_shape": [5, -7]}, {"frame_shape": [10**30, 10**30]},
    {"frame_shape": []}, {"frame_shape": "57"}, {"frame_shape": [5.0, 7.0]},
    {"frame_shape": [True, 35]}, {"parameters": None},
    {"parameters": {"colour": 1}}, {"parameters": {}}, {"columns": 3, "kind": "Model"},
    {"recalibrated": None, "seen": None},
]  # fmt: skip
PARAMETERS = {
    "device": "cpu",
    "encoder": {"class": "median", "parameters": {"ties": "spread"}},
    "readout": {
        "class": "majority",
        "parameters": {"ties": "zero", "balance": False, "seed": 0},
    },
}
BAD_PARTS = [
    ("encoder", "median", {"ties": "never"}), ("encoder", "median", {"ties": ["spread"]}),
    ("encoder", "median", {"colour": 1}), ("encoder", "nothing", {}),
    ("encoder", "os.system", {}), ("encoder", "pathlib.Path", {}), ("encoder", "no.such.Thing", {}),
    ("encoder", "levels", {"thresholds": 10**9}), ("encoder", "majority", {}),
    ("encoder", "hdc.HDCClassifier", {}), ("encoder", None, {}),
    ("readout", "majority", {"ties": "never"}), ("readout", "majority", {"seed": "x"}),
    ("readout", "majority", {"balance": 3}), ("readout", "median", {}), ("readout", "ridge", {}),
    ("readout", "counts", {"seed": 1.5}),
]  # fmt: skip


@pytest.mark.parametrize("changes", BAD_HEADERS, ids=repr)
def test_headers_that_do_not_fit_are_refused(tmp_path, changes):
    rewrite(tmp_path / "m", **changes)
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found"):
        HDCClassifier.load(tmp_path / "m")


def test_the_parts_of_these_headers_fit(tmp_path):
    """The tests around refuse what they change, not what they write."""
    rewrite(tmp_path / "m", parameters=PARAMETERS)
    assert np.array_equal(
        HDCClassifier.load(tmp_path / "m").predict(QUERIES), trained().predict(QUERIES)
    )


@pytest.mark.parametrize(("part", "name", "parameters"), BAD_PARTS, ids=repr)
def test_parts_that_do_not_fit_are_refused(tmp_path, part, name, parameters):
    described = {part: {"class": name, "parameters": parameters}}
    rewrite(tmp_path / "m", parameters=PARAMETERS | described)
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found"):
        HDCClassifier.load(tmp_path / "m")


@pytest.mark.parametrize("device", ["nowhere", "meta", 3, None])
def test_devices_without_memory_are_refused(tmp_path, device):
    rewrite(tmp_path / "m", parameters=PARAMETERS | {"device": device})
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found"):
        HDCClassifier.load(tmp_path / "m")


def test_a_model_of_version_1_0_is_refused_by_its_version(tmp_path):
    header = {"format": "hdc-model-3", "kind": "HDCClassifier", "metadata": {}}
    content = safetensors.save({"n": torch.ones(3)}, {"model": json.dumps(header)})
    (tmp_path / "old").write_bytes(content)
    for model in (HDCClassifier, HDCRegressor):
        with pytest.raises(ValueError, match="train it again") as caught:
            model.load(tmp_path / "old")
        assert str(caught.value) == (
            f"{tmp_path / 'old'}: expected a saved {model.__name__}, found a model of version 1.0, "
            "which this one cannot ask; train it again"
        )
    trained().save(tmp_path / "old")  # a model replaces models, of any version
    assert HDCClassifier.load(tmp_path / "old").score(QUERIES[:2], [0, 1]) >= 0


@pytest.mark.parametrize("found", [[], {}, 3, None])
def test_a_header_of_an_odd_format_is_no_model(tmp_path, found):
    content = safetensors.save(
        {"n": torch.ones(3)}, {"model": json.dumps({"format": found})}
    )
    (tmp_path / "m").write_bytes(content)
    with pytest.raises(
        ValueError, match="m: expected a saved HDCClassifier, found no header"
    ):
        HDCClassifier.load(tmp_path / "m")
    with pytest.raises(FileExistsError, match="m: expected a saved model or no file"):
        trained().save(tmp_path / "m")


def long(*shape: int) -> torch.Tensor:
    return torch.zeros(shape, dtype=torch.int64)


BAD_TENSORS = {
    "negative counts": {"readout.n": torch.tensor([4, -4, 4])},
    "no counts": {"readout.n": long(3)},
    "other type": {"readout.prototypes": torch.zeros(3, 1)},
    "too wide": {"readout.prototypes": long(3, 2)},
    "bits beyond D": {"readout.prototypes": long(3, 1) - 1},
    "planes with bits beyond D": {"readout.planes": long(3, 3, 1) - 1},
    "no planes": {"readout.planes": long(3, 0, 1)},
    "a sample with bits beyond D": {"sample": long(12, 1) - 1},
    "a sample too short": {"sample": long(11, 1)},
    "another tensor": {"extra": long(1)},
    "another tensor of the read-out": {"readout.extra": long(1)},
    "another read-out": {"majority.n": long(3)},
    "an encoder that learned": {"encoder.lit": long(1)},
}
OTHER_PARTS = {
    "a row that is no class": ("median", "neighbours", {"readout.rows": long(12) - 1}),
    "a row beyond": ("median", "neighbours", {"readout.rows": long(12) + 3}),
    "no frames": (
        "median",
        "neighbours",
        {"readout.rows": long(0), "readout.frames": long(0, 1)},
    ),
    "weights beyond D": ("median", "lda", {"readout.weights": long(3, 4, 1) - 1}),
    "a scale of text": ("median", "lda", {"readout.scales": torch.zeros(3)}),
    "no reach": ("median", "kernel", {"readout.reach": torch.tensor(0.0).double()}),
    "not finite": (
        "median",
        "lda",
        {"readout.shrinkage": torch.tensor(torch.nan).double()},
    ),
    "seven planes": ("median", "ridge", {"readout.weights": long(3, 7, 1)}),
    "an endless scale": (
        "median",
        "ridge",
        {"readout.scales": torch.full((3,), torch.inf).double()},
    ),
    "prototypes beyond D": (
        "median",
        "trained",
        {"readout.prototypes": long(3, 1) - 1},
    ),
    "a small reference": ("reference", "majority", {"encoder.reference": long(34)}),
    "a reference of floats": (
        "reference",
        "majority",
        {"encoder.reference": torch.zeros(35)},
    ),
    "lit pixels beyond D": (Levels(3, 0.5), "majority", {"encoder.lit": long(1) - 1}),
}


@pytest.mark.parametrize("what", OTHER_PARTS)
def test_tensors_of_other_parts_are_checked(tmp_path, what):
    encoder, readout, changes = OTHER_PARTS[what]
    for tensors in ({}, changes):
        trained(encoder=encoder, readout=readout).save(tmp_path / "m")
        header, content = io.read_model(tmp_path / "m")
        assert set(changes) <= set(content)
        text = {"model": json.dumps(header)}
        (tmp_path / "m").write_bytes(safetensors.save(content | tensors, text))
        if not tensors:
            HDCClassifier.load(tmp_path / "m")
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found"):
        HDCClassifier.load(tmp_path / "m")


@pytest.mark.parametrize("readout", ["ridge", "neighbours"])
@pytest.mark.parametrize(
    "tensors",
    [
        {"words": long(12, 1) - 1},
        {"words": long(11, 1)},
        {"values": torch.zeros(11, 1).double()},
        {"values": torch.full((12, 1), torch.nan).double()},
        {"readout.residuals": torch.zeros(3, 1).double()},
        {"extra": long(1)},
    ],
    ids=repr,
)
def test_tensors_of_a_regressor_are_checked(tmp_path, tensors, readout):
    frames = np.random.default_rng(0).integers(0, 255, (12, 5, 7), dtype=np.uint8)
    HDCRegressor(readout=readout).fit(frames, np.arange(12.0)).save(tmp_path / "m")
    header, content = io.read_model(tmp_path / "m")
    text = {"model": json.dumps(header)}
    (tmp_path / "m").write_bytes(safetensors.save(content | tensors, text))
    with pytest.raises(ValueError, match=r"m: expected a saved HDCRegressor, found"):
        HDCRegressor.load(tmp_path / "m")


def test_a_model_that_would_not_load_replaces_none(tmp_path):
    class Mine(Majority):
        pass

    trained().save(tmp_path / "m")
    before = (tmp_path / "m").read_bytes()
    with pytest.raises(
        ValueError,
        match=r"m: a HDCClassifier that could not be loaded again: readout: expected a cl",
    ):
        trained(readout=Mine()).save(tmp_path / "m")
    assert (tmp_path / "m").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("what", BAD_TENSORS)
def test_tensors_that_do_not_fit_are_refused(tmp_path, what):
    rewrite(tmp_path / "m", BAD_TENSORS[what])
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found"):
        HDCClassifier.load(tmp_path / "m")


@posix
def test_folders_pipes_and_missing_files(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "."):
        with pytest.raises(
            ValueError, match="expected a saved HDCClassifier, found what is not a"
        ):
            HDCClassifier.load(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        HDCClassifier.load(tmp_path / "nothing")
    with pytest.raises(ValueError, match="expected a trained model"):
        HDCClassifier().save(tmp_path / "m")


@pytest.mark.skipif(torch.cuda.is_available(), reason="for machines without CUDA")
def test_a_model_from_an_accelerator_loads_without_one(tmp_path):
    rewrite(tmp_path / "m", parameters=PARAMETERS | {"device": "cuda"})
    with pytest.warns(UserWarning, match="trained on 'cuda', which is not here"):
        model = HDCClassifier.load(tmp_path / "m")
    assert model.device == "cpu"
    assert np.array_equal(model.predict(QUERIES), trained().predict(QUERIES))


def test_a_name_that_is_not_utf_8_is_refused_before_it_is_written(tmp_path):
    """cracks: such a file was saved, and could not be loaded."""
    path = tmp_path / os.fsdecode(b"m_\xff.safetensors")
    with pytest.raises(ValueError, match="expected a name in UTF-8"):
        io.check_replaceable(path)
    model = HDCClassifier().fit(np.eye(8, dtype=np.uint8), [0, 1] * 4)
    with pytest.raises(ValueError, match="expected a name in UTF-8"):
        model.save(path)
    assert list(tmp_path.iterdir()) == []
