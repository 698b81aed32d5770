"""Trained models on disk: a safetensors file whose header says in JSON how they are put together.

Whatever a model keeps in tensors and numbers is saved, by the names of its attributes, so that a
new model needs no code for it. A network is built anew, and its parameters are put into it.
"""

from __future__ import annotations

import json
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from baselines.inputs import choose
from baselines.pixels import PixelScaling

if TYPE_CHECKING:
    from baselines.base import Classifier

FORMAT = "baselines-classifier-1"
FRAME_TYPES = {"uint8": torch.uint8, "uint16": torch.uint16}
LABEL_KINDS = "biufUO"  # NumPy's letters for bool, integers, floats, text and mixed objects

T = TypeVar("T", bound="Classifier")


def save(model: Classifier, path: Path) -> None:
    """Write a trained model; a file of that name is replaced when the new one is complete.

    Raises:
        TypeError: naming the class and the part of it that is neither tensors nor JSON.
        FileNotFoundError: if there is no such folder.
    """
    from safetensors.torch import save as to_bytes

    tensors: dict[str, Tensor] = {}
    parameters = model.get_params()
    known = {*parameters, "classes_", "shape_", "frame_dtype_"}
    header = {
        "format": FORMAT,
        "class": type(model).__name__,
        "parameters": {name: _plain(model, name, value) for name, value in parameters.items()},
        "classes": _labels(model),
        "label_type": model.classes_.dtype.str,
        "frame_shape": model.shape_,
        "frame_type": str(model.frame_dtype_).removeprefix("torch."),
        "learnt": {
            name: _taken_apart(model, name, value, tensors)
            for name, value in vars(model).items()
            if name not in known
        },
    }
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: expected the folder {path.parent}, found none")
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        with open(partial, "wb") as file:
            file.write(to_bytes(tensors, metadata={"model": json.dumps(header)}))
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def load(cls: type[T], path: Path) -> T:
    """Read a model; every damage gives a ValueError that names the file."""
    from safetensors import safe_open

    try:
        # Anything else that can be opened might never end, or never begin.
        if path.exists() and not path.is_file():
            raise ValueError("what is not a regular file")
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        return _built(cls, json.loads(metadata.get("model", "null")), tensors)
    except FileNotFoundError:
        raise
    except Exception as error:  # a damaged header reaches torch and json in many ways
        found = " ".join(str(error).split())  # torch writes a list of what does not fit
        raise ValueError(f"{path}: expected a saved {cls.__name__}, found {found}") from error


def _built(cls: type[T], header: Any, tensors: dict[str, Tensor]) -> T:
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise ValueError(f"no header of format {FORMAT!r}")
    if header["class"] != cls.__name__:
        raise ValueError(f"a saved {header['class']}")
    model = cls(**header["parameters"])
    if torch.device(model.device).type == "cuda" and not torch.cuda.is_available():
        warnings.warn(f"trained on {model.device!r}, which is not here: on the CPU", stacklevel=4)
        model.device = "cpu"
    classes, label_type = header["classes"], np.dtype(header["label_type"])
    if len(classes) < 2 or len(set(classes)) != len(classes) or label_type.kind not in LABEL_KINDS:
        raise ValueError(f"classes {classes!r} of type {label_type}")
    model.classes_ = np.fromiter(classes, object, len(classes)).astype(label_type)
    height, width = header["frame_shape"]
    if not all(isinstance(side, int) and side > 0 for side in (height, width)):
        raise ValueError(f"frame shape {header['frame_shape']!r}")
    model.shape_ = (height, width)
    model.frame_dtype_ = choose("frame_type", header["frame_type"], FRAME_TYPES)
    for name, part in header["learnt"].items():
        setattr(model, name, _put_together(model, part, tensors))
    # Whatever does not fit together shows itself in a first prediction.
    dark = torch.zeros(1, height, width, dtype=torch.uint8, device=model.device)
    with torch.inference_mode():
        found = model.scores(dark if model.frame_dtype_ == torch.uint8 else dark.to(torch.int32))
    if tuple(found.shape) != (1, len(classes)):
        raise ValueError(f"scores of shape {list(found.shape)} for {len(classes)} classes")
    return model


def _taken_apart(model: Classifier, name: str, value: Any, tensors: dict[str, Tensor]) -> Any:
    """What the header says of an attribute; its tensors are added to the others."""
    if isinstance(value, Tensor):
        tensors[name] = value.detach().cpu().clone(memory_format=torch.contiguous_format)
        return {"tensor": name}
    if isinstance(value, PixelScaling):
        parts = vars(value).items()
        return {"scaling": {k: _taken_apart(model, f"{name}.{k}", v, tensors) for k, v in parts}}
    if isinstance(value, nn.Module):
        parts = value.state_dict().items()
        return {"network": {k: _taken_apart(model, f"{name}.{k}", v, tensors) for k, v in parts}}
    return {"value": _plain(model, name, value)}


def _put_together(model: Any, part: dict[str, Any], tensors: dict[str, Tensor]) -> Any:
    """The attribute that :func:`_taken_apart` took apart."""
    ((kind, content),) = part.items()
    if kind == "tensor":
        return tensors[content].to(model.device)
    if kind == "value":
        return content
    parts = {name: _put_together(model, inner, tensors) for name, inner in content.items()}
    return PixelScaling(**parts) if kind == "scaling" else model.network_of(parts)


def _plain(model: Classifier, name: str, value: Any) -> Any:
    """The value itself, if JSON has it."""
    if isinstance(value, list | tuple):
        return [_plain(model, name, inner) for inner in value]
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, str | int | float):
        return value
    raise TypeError(
        f"{type(model).__name__}: expected tensors and numbers to save, "
        f"found {name} of class {type(value).__name__}"
    )


def _labels(model: Classifier) -> list[Any]:
    """The classes as JSON has them."""
    labels, label_type = model.classes_.tolist(), model.classes_.dtype
    strange = [repr(label) for label in labels if not isinstance(label, str | int | float)]
    if label_type.kind not in LABEL_KINDS:
        strange = [str(label_type)]
    if strange:
        raise TypeError(
            f"{type(model).__name__}: expected labels of type str, int, float or bool to save, "
            f"found {strange[0]}"
        )
    return labels
