"""Tensors and a header of JSON in one safetensors file, written whole or not at all."""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from torch import Tensor


def write(path: Path, header: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> None:
    """Write a file: under a temporary name, flushed to disk, renamed.

    Args:
        path: name of the file; its permissions are those of any new file (the process's umask).
        header: values that JSON has.
        tensors: tensors by name, from any device.

    Raises:
        FileNotFoundError: if its folder does not exist; the folder is named.
    """
    from safetensors.torch import save

    text = json.dumps(header)
    payload = save({name: t.cpu().contiguous() for name, t in tensors.items()}, {"model": text})
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path.parent}: expected a folder to save {path.name} in")
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(payload)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def read(path: Path) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """The header and the tensors (on the CPU) of a file that :func:`write` wrote.

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
            text = (file.metadata() or {}).get("model", "null")
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        header = json.loads(text)
    except FileNotFoundError:
        raise
    except Exception as error:  # a hostile file reaches safetensors, torch and json in many ways
        raise ValueError(str(error)) from error
    if not isinstance(header, dict):
        raise ValueError("no header")
    return header, tensors
