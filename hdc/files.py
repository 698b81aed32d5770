"""Models on disk: a safetensors file, checked in every part before it is believed."""

from __future__ import annotations

import json
import os
import tempfile
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from hdc import bits, planes
from hdc.prototypes import Counters

if TYPE_CHECKING:
    from hdc.classifier import HDCClassifier

FORMAT = "hdc-classifier-1"


def save(model: HDCClassifier, path: Path) -> None:
    """Write a trained model: temporary file, flush to disk, rename."""
    from safetensors.torch import save as to_bytes

    labels = model.classes_.tolist()
    for label in labels:
        if not isinstance(label, str | int | float | bool):
            raise TypeError(
                f"{path}: expected labels of type str, int, float or bool, found {label!r}"
            )
    parameters = model.get_params() | {"seed": int(model.seed), "device": str(model.device)}
    parameters.pop("backend", None)  # of this machine; the model is the same with any
    header = {
        "format": FORMAT,
        "parameters": parameters,
        "classes": labels,
        "frame_shape": model.frame_shape_,
    }
    tensors = {
        "planes": model.counters_.planes.cpu().contiguous(),
        "n": model.counters_.n,
        "prototypes": model.prototypes_.cpu().contiguous(),
    }
    payload = to_bytes(tensors, metadata={"model": json.dumps(header)})
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(payload)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)  # as an ordinary new file; mkstemp makes it private
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def load(cls: type[HDCClassifier], path: Path) -> HDCClassifier:
    """Read a model; every damage gives a ValueError that names the file."""
    from safetensors import safe_open

    try:
        # Anything else that can be opened might never end, or never begin.
        if path.exists() and not path.is_file():
            raise ValueError("what is not a regular file")
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            names = set(file.keys())
            expected = {"planes", "n", "prototypes"}
            if names != expected:
                raise ValueError(f"expected tensors {sorted(expected)}, found {sorted(names)}")
            tensors = {name: file.get_tensor(name) for name in names}
        header = json.loads(metadata.get("model", "null"))
        return _build(cls, header, tensors)
    except FileNotFoundError:
        raise
    except Exception as error:  # a hostile header reaches torch and json in many ways
        raise ValueError(f"{path}: expected a saved HDCClassifier, found {error}") from error


def _build(
    cls: type[HDCClassifier], header: Any, tensors: dict[str, torch.Tensor]
) -> HDCClassifier:
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise ValueError(f"no header of format {FORMAT!r}")
    model = cls().set_params(**header["parameters"])
    model._check_parameters()
    if torch.device(model.device).type == "cuda" and not torch.cuda.is_available():
        warnings.warn(f"trained on {model.device!r}, which is not here: on the CPU", stacklevel=4)
        model.device = "cpu"
    torch.zeros(1, device=model.device).item()  # raises where the device is not to be had
    if not isinstance(model.seed, int):
        raise ValueError(f"seed {model.seed!r}")
    shape = header["frame_shape"]
    if not (isinstance(shape, list) and 1 <= len(shape) <= 2 and all(
            isinstance(s, int) and s > 0 for s in shape)):  # fmt: skip
        raise ValueError(f"frame shape {shape!r}")
    classes, dimension = header["classes"], int(np.prod(shape, dtype=object))
    counts, n, prototypes = tensors["planes"], tensors["n"], tensors["prototypes"]
    n_classes, width = len(classes), bits.words_for(dimension)
    if len(set(classes)) != n_classes or n_classes < 2:
        raise ValueError(f"classes {classes!r}")
    for name, tensor, wanted in (
        ("planes", counts, (n_classes, max((1, *counts.shape[1:2])), width)),
        ("n", n, (n_classes,)),
        ("prototypes", prototypes, (n_classes, width)),
    ):
        if tensor.dtype != torch.int64 or tuple(tensor.shape) != wanted:
            raise ValueError(
                f"{name}: {tensor.dtype} {tuple(tensor.shape)} instead of torch.int64 {wanted}"
            )
    inside = bits.pack(torch.ones(dimension, dtype=torch.bool))
    if ((counts & ~inside) != 0).any() or ((prototypes & ~inside) != 0).any():
        raise ValueError("bits beyond the last pixel")
    if (n < 1).any():
        raise ValueError(f"sample counts {n.tolist()}")
    if any(planes.greater(c, m).any() for c, m in zip(counts, n.tolist(), strict=True)):
        raise ValueError("a bit set in more samples than the class has")
    model.frame_shape_, model.dimension_ = tuple(shape), dimension
    model.counters_ = Counters(n_classes, dimension, model.device)
    model.counters_.planes, model.counters_.n = counts.to(model.device), n
    model._index = {label: i for i, label in enumerate(classes)}
    from hdc.classifier import _label_array

    model.classes_ = _label_array(classes, n_classes)
    model.counts_ = n.numpy().copy()
    model.prototypes_ = prototypes.to(model.device)
    return model
