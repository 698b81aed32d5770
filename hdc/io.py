"""Files written whole or not at all, and the file of a saved model.

A model is one safetensors file: its tensors, and a header of JSON under the key ``"model"``.
"""

from __future__ import annotations

import json
import os
import secrets
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

FORMAT = "hdc-model-3"
FLOATS = {"scales", "intercepts", "penalty", "values", "residuals", "inverse", "means"}
LARGEST = 2**53
"""Integers of a header lie below this: every reader of JSON keeps them exactly."""


def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Write a file: under a temporary name beside it, flushed to disk, renamed.

    A reader sees the old file or the new one.

    Args:
        path: name of the file, in a folder that exists.
        content: text is written as UTF-8.

    Raises:
        FileNotFoundError: if the folder does not exist.
        OSError: if the file cannot be written; it is named.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path.parent}: expected a folder to save {path.name} in")
    temporary = path.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        raise OSError(
            f"{path}: expected a file to write, found: {error.strerror or error}"
        ) from error
    finally:
        temporary.unlink(missing_ok=True)


def check_replaceable(path: Path) -> None:
    """Refuse a name that is taken by anything but a saved model.

    Raises:
        FileExistsError: naming it.
    """
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise FileExistsError(
            f"{path}: expected a regular file or none, found another kind; not replaced"
        )
    if path.exists():
        try:
            read_model(path, tensors=False)
        except ValueError as error:
            raise FileExistsError(
                f"{path}: expected a saved model or no file, found another file; not replaced"
            ) from error


def write_model(path: Path, header: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> None:
    """Save the header (values that JSON has) and the tensors of a model.

    Raises:
        TypeError: for a header that JSON has not.
        FileExistsError: for a name that is taken by anything but a saved model.
        FileNotFoundError, OSError: as :func:`write_atomically`.
    """
    from safetensors.torch import save

    check_replaceable(path)
    try:
        text = json.dumps({"format": FORMAT, **header})
        json.dumps(header.get("metadata"), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise TypeError(
            f"{path}: metadata: expected values that JSON has, found: {error}"
        ) from error
    content = save({name: t.cpu().contiguous() for name, t in tensors.items()}, {"model": text})
    write_atomically(path, content)


def read_model(path: Path, tensors: bool = True) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """The header and the tensors (on the CPU) of a file that :func:`write_model` wrote.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: if it is not such a file, or damaged; says what was found.
    """
    from safetensors import safe_open

    # Anything else that can be opened might never end, or never begin.
    if path.exists() and not path.is_file():
        raise ValueError("what is not a regular file")
    try:
        with safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {}).get("model", "null"))
            names = file.keys() if tensors else ()
            content = {name: file.get_tensor(name) for name in names}
    except FileNotFoundError:
        raise
    except Exception as error:  # a hostile file reaches safetensors, torch and json in many ways
        raise ValueError(str(error)) from error
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise ValueError(f"no header of format {FORMAT!r}")
    return header, content


def check_tensors(tensors: Mapping[str, Tensor], shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Check the shapes of tensors, and that they are int64 or float64 and finite.

    Raises:
        ValueError: for the first that does not fit, or has no shape to fit.
    """
    for name, tensor in tensors.items():
        fits = tuple(tensor.shape) == shapes.get(name) and tensor.isfinite().all()
        if not fits or tensor.dtype != (torch.float64 if name in FLOATS else torch.int64):
            raise ValueError(f"{name}: {tensor.dtype} {tuple(tensor.shape)}")


def move_to_cpu_without_cuda(model: Any) -> None:
    """Have a model from a machine with CUDA compute on the CPU where there is none.

    Raises:
        RuntimeError: for another device that is not to be had.
    """
    if torch.device(model.device).type == "cuda" and not torch.cuda.is_available():
        warnings.warn(f"trained on {model.device!r}, which is not here: on the CPU", stacklevel=4)
        model.device = "cpu"
    torch.zeros(1, device=model.device).item()
