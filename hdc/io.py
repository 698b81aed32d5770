"""Atomic writing of files, and the file format of a saved model.

A model is one safetensors file: its tensors, and under the key ``"model"`` a header of JSON, which
ends with the SHA-256 of all the rest. Equal models make equal files. The header names a user's own
encoder or read-out by its module, which is imported only if the caller trusts that name. The
SHA-256 detects damage; it does not prove who wrote the file.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor

FORMAT = "hdc-model-4"


def write_atomically(path: Path, content: str | bytes) -> None:
    """Write a file under a temporary name in the same folder, flush it to disk, and rename it.

    A reader sees the old file or the new one. Missing folders are created; text becomes UTF-8.

    Raises:
        OSError: naming the file; the old one is untouched.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileNotFoundError):  # which keeps a private file private
            shutil.copymode(path, temporary)
        os.replace(temporary, path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


def _is_model(path: Path) -> bool:
    """Whether a file claims to be a saved model."""
    try:
        header, _ = _read(path, tensors=False)
    except ValueError:
        return False
    return header.get("format") == FORMAT


def check_replaceable(
    path: Path,
    what: str = "a saved model",
    is_own: Callable[[Path], bool] = _is_model,
) -> None:
    """Check that a file may be written here: in an existing folder, over no file of another kind.

    Args:
        path: the file.
        what: files that are replaced, in words.
        is_own: whether an existing file is one of them.

    Raises:
        ValueError: for a name that is not UTF-8.
        FileNotFoundError: if the folder does not exist.
        FileExistsError: for any other file; it is never replaced.
    """
    if not path.parent.is_dir():
        raise FileNotFoundError(
            f"{path.parent}: expected a folder to save {path.name} in"
        )
    try:
        str(path).encode()
    except UnicodeEncodeError as error:  # it could not be opened again
        raise ValueError(
            f"{path}: expected a name in UTF-8, found bytes that are none"
        ) from error
    if path.is_symlink() or (path.exists() and not path.is_file()):
        expected = "expected a regular file or none"
        raise FileExistsError(f"{path}: {expected}, found another kind; not replaced")
    if path.exists() and not is_own(path):
        expected = f"expected {what} or no file"
        raise FileExistsError(f"{path}: {expected}, found another; not replaced")


def write_model(
    path: Path,
    header: Mapping[str, Any],
    tensors: Mapping[str, Tensor],
) -> None:
    """Save the header and the tensors of a model.

    Args:
        path: name of the file.
        header: JSON values; "metadata" are the user's.
        tensors: tensors by name.

    Raises:
        TypeError: for metadata that JSON cannot hold.
        FileNotFoundError, FileExistsError: as :func:`check_replaceable`.
        OSError: as :func:`write_atomically`.
    """
    from safetensors.torch import save

    check_replaceable(path)
    try:
        json.dumps(header["metadata"], allow_nan=False)
    except (TypeError, ValueError) as error:
        raise TypeError(
            f"{path}: metadata: expected values of JSON, found: {error}"
        ) from error
    header = {"format": FORMAT, **header}
    stored = {name: t.cpu().contiguous() for name, t in tensors.items()}
    text = json.dumps({**header, "sha256": _digest(header, stored)})
    write_atomically(path, save(stored, {"model": text}))


def _digest(header: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> str:
    digest = hashlib.sha256(json.dumps(header).encode())
    for name in sorted(tensors):
        digest.update(name.encode())
        digest.update(tensors[name].numpy().tobytes())
    return digest.hexdigest()


def read_model(
    path: Path, tensors: bool = True
) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """The header and the tensors (on the CPU) of a file that :func:`write_model` wrote.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: saying what was found instead of an undamaged model.
    """
    header, content = _read(path, tensors)
    if header.get("format") != FORMAT:
        raise ValueError(f"no header of format {FORMAT!r}")
    if tensors and header.pop("sha256", None) not in (None, _digest(header, content)):
        raise ValueError("other bytes than were saved: its SHA-256 differs")
    return header, content


def _read(path: Path, tensors: bool) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """The header and, if asked for, the tensors of a safetensors file; ValueError for other files.

    The header is empty unless it names a format, which may be any text.
    """
    from safetensors import safe_open

    if path.exists() and not path.is_file():
        raise ValueError("what is not a regular file")
    try:
        with safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {}).get("model", "null"))
            names = file.keys() if tensors else ()
            # Copies: a tensor of a mapped file changes, or ends the process, with the file.
            content = {name: file.get_tensor(name).clone() for name in names}
    except FileNotFoundError:
        raise
    # A hostile file reaches safetensors, torch and json in many ways.
    except Exception as error:
        raise ValueError(str(error)) from error
    if not isinstance(header, dict) or not isinstance(header.get("format"), str):
        return {}, content
    return header, content
