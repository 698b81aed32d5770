"""Saved models: what comes back, what is refused, and that a failed write harms nothing."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, files
from hdc.online import OnlineHDCClassifier

safetensors = pytest.importorskip("safetensors.torch")


def trained(**parameters) -> HDCClassifier:
    frames = np.random.default_rng(0).integers(0, 255, (12, 5, 7), dtype=np.uint8)
    return HDCClassifier(**parameters).fit(frames, np.arange(12) % 3)


QUERIES = np.random.default_rng(1).integers(0, 255, (9, 5, 7), dtype=np.uint8)


@pytest.mark.parametrize("prototype", ["binary", "integer"])
@pytest.mark.parametrize(
    "names", [[0, 1], ["a\0", "é"], [0.5, float("inf")], [True, False], [1, "a"], [2**70, -1]]
)
def test_labels_that_json_can_hold_come_back(tmp_path: Path, prototype: str, names: list) -> None:
    frames = QUERIES[:6]
    model = HDCClassifier(prototype=prototype).fit(frames, names * 3)
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert loaded.classes_.tolist() == model.classes_.tolist()
    assert loaded.classes_.dtype == model.classes_.dtype
    assert loaded.frame_shape_ == (5, 7)
    assert np.array_equal(loaded._scores(QUERIES), model._scores(QUERIES))
    for m in (model, loaded):  # training goes on
        m.partial_fit(QUERIES[:2], names)
    assert torch.equal(loaded.prototypes_, model.prototypes_)


def test_numpy_labels_and_parameters_of_other_types_are_stored(tmp_path: Path) -> None:
    model = HDCClassifier(seed=np.int64(3), device=torch.device("cpu"))  # type: ignore[arg-type]
    model.fit(QUERIES[:4], [np.int64(1), np.int64(2)] * 2).save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert loaded.get_params() == {**HDCClassifier().get_params(), "seed": 3}
    assert loaded.classes_.tolist() == [1, 2]


@pytest.mark.parametrize("name", [("a", 1), None, frozenset({1})])
def test_labels_that_cannot_be_stored_are_named(tmp_path: Path, name) -> None:
    model = HDCClassifier().fit(QUERIES[:4], [name, "b"] * 2)
    with pytest.raises(TypeError, match="expected labels of type str, int, float or bool, found"):
        model.save(tmp_path / "m")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_failing_write_leaves_the_old_file(tmp_path: Path, monkeypatch, step: str) -> None:
    path = tmp_path / "m"
    trained().save(path)
    before = path.read_bytes()

    def fail(*_):
        raise OSError("no space left")

    monkeypatch.setattr(os, step, fail)
    with pytest.raises(OSError, match="no space left"):
        trained(ties="one").save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m"]


def test_every_truncation_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cut.safetensors"
    trained().save(path)
    whole = path.read_bytes()
    for n in range(len(whole)):
        path.write_bytes(whole[:n])
        with pytest.raises(ValueError, match=r"cut\.safetensors: expected a saved HDCClassifier"):
            HDCClassifier.load(path)


@pytest.mark.filterwarnings("ignore")
def test_flipped_bits_are_refused_or_harmless(tmp_path: Path) -> None:
    path = tmp_path / "bad.safetensors"
    trained().save(path)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(400):
        content = bytearray(whole)
        content[rng.integers(len(content))] ^= int(rng.integers(1, 256))
        path.write_bytes(content)
        try:
            model = HDCClassifier.load(path)
        except ValueError as error:
            assert "bad.safetensors" in str(error)  # noqa: PT017
            continue
        model.predict(QUERIES.reshape(9, *model.frame_shape_))
        model.set_params(prototype="integer").predict(QUERIES)


def content(model: HDCClassifier) -> tuple[dict, dict]:
    """Header and tensors of a model's file."""
    header = {
        "format": "hdc-classifier-2",
        "kind": "HDCClassifier",
        "parameters": {k: v for k, v in model.get_params().items() if k != "backend"},
        "classes": [0, 1, 2],
        "frame_shape": [5, 7],
        "recalibrated": False,
        "calibration": vars(model._calibrated()),
        "metadata": {},
    }
    tensors = {
        "planes": model.counters_.planes,
        "n": model.counters_.n,
        "prototypes": model.prototypes_,
    }
    return header, tensors


def write(path: Path, tensors: dict | None = None, **changes) -> None:
    """The file of a trained model with some of its header or tensors replaced."""
    header, content_ = content(trained())
    header |= changes
    text = json.dumps(header)
    path.write_bytes(safetensors.save(content_ | (tensors or {}), {"model": text}))


def test_the_file_written_here_is_the_one_saved(tmp_path: Path) -> None:
    write(tmp_path / "m")
    trained().save(tmp_path / "n")
    assert (tmp_path / "m").read_bytes() == (tmp_path / "n").read_bytes()


def test_files_of_the_first_format_are_read(tmp_path: Path) -> None:
    """They have no kind, calibration or metadata; whether they were recalibrated is found out."""
    model = trained()
    header, tensors = content(model)
    for key in ("kind", "recalibrated", "calibration", "metadata"):
        del header[key]
    header = json.dumps(header | {"format": "hdc-classifier-1"})
    (tmp_path / "m").write_bytes(safetensors.save(tensors, {"model": header}))
    loaded = HDCClassifier.load(tmp_path / "m")
    assert np.array_equal(loaded.distances(QUERIES), model.distances(QUERIES))
    assert loaded.metadata_ == {}
    with pytest.raises(ValueError, match="call calibrate"):
        loaded.is_known(QUERIES)
    loaded.partial_fit(QUERIES[:2], [0, 1])
    tensors["prototypes"] = model.prototypes_ ^ 1
    (tmp_path / "m").write_bytes(safetensors.save(tensors, {"model": header}))
    with pytest.raises(ValueError, match="found one that was recalibrated"):
        HDCClassifier.load(tmp_path / "m").partial_fit(QUERIES[:2], [0, 1])


BAD_HEADERS = [
    {"format": "other"}, {"format": "hdc-classifier-3"}, {"kind": None}, {"recalibrated": 3},
    {"metadata": []}, {"calibration": 1}, {"calibration": {}}, {"classes": [2, 1, 0]},
    {"classes": [0, 1]}, {"classes": [0, 1, 1]}, {"classes": 3},
    {"classes": [[0], [1], [2]]}, {"classes": [0.0, 1.0, float("nan")]}, {"classes": None},
    {"frame_shape": [5, 13]}, {"frame_shape": [5, -7]}, {"frame_shape": [10**30, 10**30]},
    {"frame_shape": []}, {"frame_shape": "57"}, {"frame_shape": [5.0, 7.0]}, {"parameters": None},
    {"parameters": {"ties": "never"}}, {"parameters": {"colour": 1}}, {"parameters": {"seed": "x"}},
    {"parameters": {"device": "meta"}}, {"parameters": {"device": "nowhere"}},
    {"parameters": {"device": "mps"}}, {"parameters": {"device": 10**30}},
    {"parameters": {"ties": ["zero"]}},
]  # fmt: skip


@pytest.mark.parametrize("changes", BAD_HEADERS, ids=repr)
def test_headers_that_do_not_fit_are_refused(tmp_path: Path, changes: dict) -> None:
    write(tmp_path / "m", **changes)
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found"):
        HDCClassifier.load(tmp_path / "m")


@pytest.mark.parametrize(
    "changes",
    [
        {"means": [1.0, 1.0]}, {"means": [1.0, 1.0, float("nan")]}, {"numbers": [1, 2.5, 3]},
        {"spread": -1.0}, {"spread": "1"}, {"freedom": 0}, {"temperature": 0}, {"extra": 1},
    ],
    ids=repr,
)  # fmt: skip
def test_calibrations_that_do_not_fit_are_refused(tmp_path: Path, changes: dict) -> None:
    write(tmp_path / "m", calibration=vars(trained()._calibrated()) | changes)
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found calibration"):
        HDCClassifier.load(tmp_path / "m")


def long(*shape: int) -> torch.Tensor:
    return torch.zeros(shape, dtype=torch.int64)


BAD_TENSORS = {
    "too few classes": {"n": torch.ones(2).long()},
    "an empty class": {"n": torch.tensor([4, 0, 4])},
    "a count above the samples": {"planes": torch.full((3, 3, 1), 1)},
    "other type": {"prototypes": torch.zeros(3, 1)},
    "too wide": {"prototypes": long(3, 2)},
    "no planes": {"planes": long(3, 0, 1)},
    "flat planes": {"planes": long(3, 1)},
    "scalar planes": {"planes": torch.tensor(1)},
    "bits beyond D": {"prototypes": torch.full((3, 1), -1)},
    "another tensor": {"extra": long(1)},
}


@pytest.mark.parametrize("what", BAD_TENSORS)
def test_tensors_that_do_not_fit_are_refused(tmp_path: Path, what: str) -> None:
    write(tmp_path / "m", BAD_TENSORS[what])
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found"):
        HDCClassifier.load(tmp_path / "m")


@pytest.mark.parametrize(
    "content",
    [
        b"", b"\0" * 7, b"\xff" * 8, struct.pack("<Q", 2**63), struct.pack("<Q", 99_999_999),
        struct.pack("<Q", 100_000) + b"[" * 100_000, struct.pack("<Q", 2) + b"{}",
        struct.pack("<Q", 4) + b"null", b"\x89PNG\r\n\x1a\n" + b"\0" * 100,
    ],
)  # fmt: skip
def test_hostile_files_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "m").write_bytes(content)
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found"):
        HDCClassifier.load(tmp_path / "m")


LAYOUTS = {
    "beyond the end": {"data_offsets": [0, 2**62]},
    "backwards": {"data_offsets": [24, 0]},
    "negative": {"data_offsets": [-8, 16]},
    "more values than bytes": {"shape": [3, 1, 2**20]},
    "a size that overflows": {"shape": [2**32, 2**32, 2**32]},
    "an unknown type": {"dtype": "O"},
    "no type": {"dtype": None},
}


@pytest.mark.parametrize("what", LAYOUTS)
def test_a_layout_that_does_not_fit_is_refused(tmp_path: Path, what: str) -> None:
    path = tmp_path / "m"
    trained().save(path)
    data = path.read_bytes()
    (length,) = struct.unpack_from("<Q", data)
    header = json.loads(data[8 : 8 + length])
    header["planes"] |= LAYOUTS[what]
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + data[8 + length :])
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found"):
        HDCClassifier.load(path)


def test_of_a_parameter_twice_one_counts_or_it_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "m"
    header, tensors = content(trained())
    text = json.dumps(header)
    twice = text.replace('"frame_shape": [5, 7]', '"frame_shape": "x", "frame_shape": [7, 5]')
    assert twice != text
    path.write_bytes(safetensors.save(tensors, {"model": twice}))
    assert HDCClassifier.load(path).frame_shape_ == (7, 5)
    path.write_bytes(safetensors.save(tensors, {"model": twice[:-1]}))
    with pytest.raises(ValueError, match=r"m: expected a saved HDCClassifier, found"):
        HDCClassifier.load(path)


def test_deeply_nested_metadata_is_refused(tmp_path: Path) -> None:
    _, tensors = content(trained())
    (tmp_path / "m").write_bytes(safetensors.save(tensors, {"model": "[" * 200_000}))
    with pytest.raises(ValueError, match="expected a saved HDCClassifier"):
        HDCClassifier.load(tmp_path / "m")


def test_a_folder_and_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected a saved HDCClassifier"):
        HDCClassifier.load(tmp_path)
    with pytest.raises(FileNotFoundError):
        HDCClassifier.load(tmp_path / "nothing")
    with pytest.raises(ValueError, match="expected a trained model"):
        HDCClassifier().save(tmp_path / "m")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_refused_without_waiting_for_a_writer(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    message = r"pipe: expected a saved HDCClassifier, found what is not a regular file"
    with pytest.raises(ValueError, match=message):
        HDCClassifier.load(tmp_path / "pipe")


@pytest.mark.skipif(torch.cuda.is_available(), reason="for machines without CUDA")
def test_a_model_from_an_accelerator_loads_without_one(tmp_path: Path) -> None:
    write(tmp_path / "m", parameters={"device": "cuda"})
    with pytest.warns(UserWarning, match="trained on 'cuda', which is not here"):
        model = HDCClassifier.load(tmp_path / "m")
    assert model.device == "cpu"
    assert np.array_equal(model.predict(QUERIES), trained().predict(QUERIES))


def test_a_loaded_model_is_apart_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / "m"
    trained().save(path)
    before = path.read_bytes()
    model = HDCClassifier.load(path)
    model.state_tensors()["prototypes"][0, 0] ^= 1
    assert path.read_bytes() == before
    assert np.abs(model.distances(QUERIES) - trained().distances(QUERIES)).sum() == 9


def test_a_recalibrated_model_comes_back(tmp_path: Path) -> None:
    model = trained(seed=5).recalibrate(QUERIES, np.arange(9) % 3, p=0.5)
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert loaded.get_params() == model.get_params()
    assert np.array_equal(loaded.distances(QUERIES), model.distances(QUERIES))
    assert torch.equal(loaded.counters_.counts(), model.counters_.counts())
    assert loaded._calibrated() == model._calibrated()


def test_what_is_known_comes_back_and_stays_until_there_is_a_new_class(tmp_path: Path) -> None:
    model = trained()
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert np.array_equal(loaded.is_known(QUERIES, 0.1), model.is_known(QUERIES, 0.1))
    assert np.array_equal(loaded.predict_proba(QUERIES), model.predict_proba(QUERIES))
    loaded.partial_fit(QUERIES[:3], [0, 1, 2]).is_known(QUERIES)
    with pytest.raises(ValueError, match="call calibrate"):
        loaded.partial_fit(QUERIES[:1], [7]).is_known(QUERIES)


def test_metadata_are_kept_with_the_model(tmp_path: Path) -> None:
    metadata = {"crop": [10, 20, 500, 500], "subsample": 2, "camera": {"name": "µEye", "gain": 0.5}}
    trained().save(tmp_path / "m", metadata)
    loaded = HDCClassifier.load(tmp_path / "m")
    assert loaded.metadata_ == metadata
    loaded.save(tmp_path / "n")
    assert HDCClassifier.load(tmp_path / "n").metadata_ == metadata
    loaded.save(tmp_path / "n", {})
    assert HDCClassifier.load(tmp_path / "n").metadata_ == {}
    for bad in ({"crop": np.arange(4)}, {"gain": float("nan")}):
        with pytest.raises(TypeError, match="n: metadata: expected values that JSON has, found"):
            loaded.save(tmp_path / "n", bad)
    assert loaded.metadata_ == {}


def test_a_model_of_another_class_is_named(tmp_path: Path) -> None:
    frames, labels = QUERIES, np.arange(9) % 3
    OnlineHDCClassifier().fit(frames, labels).save(tmp_path / "online")
    trained().save(tmp_path / "plain")
    message = "expected a saved HDCClassifier, found a saved OnlineHDCClassifier; load it with"
    with pytest.raises(ValueError, match=message):
        HDCClassifier.load(tmp_path / "online")
    message = "expected a saved OnlineHDCClassifier, found a saved HDCClassifier; load it with"
    with pytest.raises(ValueError, match=message):
        OnlineHDCClassifier.load(tmp_path / "plain")


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"missing: expected a folder to save m\.st in$"):
        trained().save(tmp_path / "missing" / "m.st")


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
@pytest.mark.parametrize("umask", [0o022, 0o077, 0o002])
def test_permissions_are_those_of_any_new_file(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        trained().save(tmp_path / "m")
    finally:
        os.umask(before)
    assert (tmp_path / "m").stat().st_mode & 0o777 == 0o666 & ~umask


def test_reading_and_writing_know_no_classifier(tmp_path: Path) -> None:
    header, tensors = {"a": [1, "µ"]}, {"x": torch.arange(6).reshape(2, 3).T}
    files.write(tmp_path / "f", header, tensors)
    again, found = files.read(tmp_path / "f")
    assert again == header
    assert list(found) == ["x"]
    assert torch.equal(found["x"], tensors["x"])
