"""Files: written whole or not at all, and never in place of anything but a model."""

import json
import os
import struct
import sys

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor
from hdc.encoders import Median
from hdc.readouts import Majority
from tests.hdc.own import Nearest

safetensors = pytest.importorskip("safetensors.torch")
posix = pytest.mark.skipif(os.name != "posix", reason="permissions and pipes of POSIX")

X = np.random.default_rng(0).integers(0, 255, (12, 5, 7), dtype=np.uint8)
Y = np.arange(12) % 3
QUERIES = np.random.default_rng(1).integers(0, 255, (9, 5, 7), dtype=np.uint8)


def trained(**parameters):
    return HDCClassifier(**parameters).fit(X, Y)


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
def test_only_regular_files_are_replaced_and_read(tmp_path):
    (tmp_path / "target").write_text("kept")
    (tmp_path / "link").symlink_to(tmp_path / "target")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name in ("link", "loop", "folder", "pipe", "/dev/null"):
        with pytest.raises(FileExistsError, match="not replaced"):
            trained().save(tmp_path / name)
    for name in ("folder", "pipe"):
        with pytest.raises(ValueError, match="found what is not a regular file"):
            HDCClassifier.load(tmp_path / name)
    assert (tmp_path / "target").read_text() == "kept"


def file_of(header, tensors=None):
    """A safetensors file as a model is, without a digest."""
    tensors = tensors or {"n": torch.ones(3)}
    return safetensors.save(tensors, {"model": json.dumps(header)})


FOREIGN = {
    "empty": b"",
    "an image": b"\x89PNG\r\n\x1a\n" + b"\0" * 100,
    "no metadata": struct.pack("<Q", 2) + b"{}",
    "no header": safetensors.save({"n": torch.ones(3)}),
    "no format": file_of({}),
    "an odd format": file_of({"format": []}),
}


@pytest.mark.parametrize("content", FOREIGN.values(), ids=FOREIGN)
def test_what_is_no_model_is_neither_loaded_nor_replaced(tmp_path, content):
    path = tmp_path / "0.png"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"0\.png: expected a saved HDCRegressor, fou"):
        HDCRegressor.load(path)
    with pytest.raises(FileExistsError, match=r"0\.png: expected a saved model or no"):
        trained().save(path)
    assert path.read_bytes() == content


@posix
def test_a_file_keeps_its_mode_and_may_have_a_long_name(tmp_path):
    path = tmp_path / ("m" * 255)
    trained().save(path)
    path.chmod(0o600)
    trained().save(path)
    assert path.stat().st_mode & 0o777 == 0o600


def test_names_that_no_model_can_have_are_refused_before_writing(tmp_path):
    """cracks: a file of a name that is not UTF-8 was saved, and could not be loaded."""
    path = tmp_path / os.fsdecode(b"m_\xff.safetensors")
    with pytest.raises(ValueError, match="expected a name in UTF-8"):
        trained().save(path)
    with pytest.raises(
        FileNotFoundError, match=r"gone: expected a folder to save m in"
    ):
        trained().save(tmp_path / "gone" / "m")
    with pytest.raises(FileNotFoundError):
        HDCClassifier.load(tmp_path / "gone")
    with pytest.raises(ValueError, match="expected a trained model"):
        HDCClassifier().save(tmp_path / "m")
    assert list(tmp_path.iterdir()) == []


def test_a_model_that_would_not_load_replaces_none(tmp_path, monkeypatch):
    class Mine(Median):
        pass

    trained().save(tmp_path / "m")
    before = (tmp_path / "m").read_bytes()
    # Another process has another ``__main__``.
    monkeypatch.setattr(Nearest, "__module__", "__main__")
    monkeypatch.setattr(sys.modules["__main__"], "Nearest", Nearest, raising=False)
    for name, part in (("encoder", Mine()), ("readout", Nearest())):
        message = f"m: a HDCClassifier that could not be loaded again: {name}: expected"
        with pytest.raises(ValueError, match=message):
            trained(**{name: part}).save(tmp_path / "m")
    assert (tmp_path / "m").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1
