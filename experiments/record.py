"""Records: one folder a run with record.json and curve.csv, written whole or not at all."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import json
import math
import os
import platform
import shlex
import stat
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments import sources

ROOT = sources.ROOT
SCHEMA = 2
# Keys of a config that say how a run is carried out, not what it computes.
NOT_IDENTITY = ("force", "cache", "exclusive", "task")
STATUSES = ("running", "finished", "failed", "interrupted")
_PACKAGES = ("torch", "numpy", "scipy", "scikit-learn", "hydra-core", "numkong", "numba")
MOST_BYTES = 2**22
"""Of a record; those of runs and measurements have some thousand. As Python objects it takes up to
twenty times as many."""
MOST_ROW_BYTES = 2**21
"""Of a table of rows or a curve: some ten thousand rows. As Python objects they take up to a
hundred times as many."""


def results_dir() -> Path:
    """Where results go: $RESULTS_DIR, or results/ of the checkout; never the current directory."""
    return Path(os.environ.get("RESULTS_DIR") or ROOT / "results").resolve()


def run_id(scene: str, model: str, config: Mapping[str, Any], fingerprint: str) -> str:
    """Name of a run: what it is, and a hash of everything that determines it."""
    payload = json.dumps([SCHEMA, config, fingerprint], sort_keys=True)
    return f"{scene}-{model}-{hashlib.sha256(payload.encode()).hexdigest()[:12]}"


def write_atomically(path: Path, text: str) -> None:
    """Write a file whole or not at all: temporary file beside it, flush to disk, rename."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException as error:
        Path(temporary).unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename is None:  # a full disk
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files that a kill left here; for whoever has the folder to itself."""
    for path in folder.glob(".*.*.*"):
        path.unlink(missing_ok=True)


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Write record.json; numbers that JSON lacks (NaN, infinities) become null."""
    text = json.dumps(_plain(record), indent=1, sort_keys=True, allow_nan=False) + "\n"
    write_atomically(folder / "record.json", text)


def read_record(folder: Path) -> dict[str, Any] | None:
    """The record in a folder, or None if there is none yet.

    Raises:
        ValueError: if there is a file that is no record of this schema; it is named.
    """
    path = folder / "record.json"
    try:
        record = json.loads(
            read_text(path, MOST_BYTES), object_pairs_hook=_unique, parse_constant=_no_number
        )
    except FileNotFoundError:
        return None
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: expected a record in JSON, found {error}") from error
    if not isinstance(record, dict) or record.get("schema") != SCHEMA:
        found = record.get("schema") if isinstance(record, dict) else type(record).__name__
        raise ValueError(f"{path}: expected a record of schema {SCHEMA}, found {found!r}")
    if record.get("status") not in STATUSES:
        raise ValueError(
            f"{path}: expected a status among {', '.join(STATUSES)}, found {record.get('status')!r}"
        )
    return record


def read_text(path: Path, most_bytes: int) -> str:
    """The text of a regular file of at most so many bytes; a pipe would be waited for.

    Raises:
        FileNotFoundError: there is none.
        ValueError: it is none, is larger or is not UTF-8.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode) or status.st_size > most_bytes:
        raise ValueError(f"no file, or one of more than {most_bytes} bytes")
    return path.read_text(encoding="utf-8")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object of JSON; of two equal keys, readers differ in which counts."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key twice in one object")
    return found


def _no_number(text: str) -> Any:
    raise ValueError(f"{text}, which JSON lacks")


def write_curve(folder: Path, rows: Sequence[Mapping[str, float]]) -> None:
    """Write curve.csv: one row a report of the model."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    lines = [",".join(columns)]
    lines += [",".join(_cell(row.get(column)) for column in columns) for row in rows]
    write_atomically(folder / "curve.csv", "\n".join(lines) + "\n")


def environment(device: str, threads: int, config: Mapping[str, Any]) -> dict[str, Any]:
    """Everything about the machine and the code that a reader of a time wants to know."""
    files = sources.sources(config)
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpu": _cpu_model(),
        "cores": os.cpu_count(),
        "threads": threads,
        "device": _device_name(device),
        "packages": {name: _version(name) for name in _PACKAGES},
        "code": sources.code_hash(files),
        "sources": files,
        **_git(),
    }


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if hasattr(value, "tolist"):  # numpy scalars and arrays, tensors
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _cell(value: Any) -> str:
    return "" if value is None else repr(value.item() if hasattr(value, "item") else value)


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


@functools.cache
def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _device_name(device: str) -> str:
    if device.startswith("cuda"):
        import torch

        return f"{device}: {torch.cuda.get_device_name(device)}"
    return device


@functools.cache
def _git() -> dict[str, Any]:
    def ask(*words: str) -> str | None:
        command = ["git", "-C", str(ROOT), *words]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10)
            return done.stdout.strip()
        except (OSError, subprocess.SubprocessError):
            return None

    # Results are written while runs go on; only code and configs make a tree dirty.
    changed = ask("status", "--porcelain", "--", *sources.PACKAGES, "configs")
    return {"commit": ask("rev-parse", "HEAD"), "dirty": None if changed is None else bool(changed)}


def command() -> str:
    """The command line that started this process, as a user would type it."""
    start = ["python"]
    if "TORCHELASTIC_RUN_ID" in os.environ:
        start = ["torchrun", f"--nproc-per-node={os.environ.get('LOCAL_WORLD_SIZE')}"]
    return shlex.join([*start, "-m", "experiments.run", *sys.argv[1:]])
