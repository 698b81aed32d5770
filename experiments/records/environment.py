"""Machine, library versions and code digests, stored with every time that is measured."""

from __future__ import annotations

import functools
import importlib.metadata
import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.records import sources

_PACKAGES = (
    "torch",
    "numpy",
    "scipy",
    "scikit-learn",
    "hydra-core",
    "numkong",
    "numba",
)


def environment(device: str, threads: int, config: Mapping[str, Any]) -> dict[str, Any]:
    """Machine, versions, commit, and digests of the code that computes what the config asks for."""
    files = sources.sources(config)
    name = device
    if device.startswith("cuda"):
        import torch

        name = f"{device}: {torch.cuda.get_device_name(device)}"
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "threads": threads,
        "device": name,
        "packages": {name: _version(name) for name in _PACKAGES},
        "code": sources.code_hash(files),
        "sources": files,
        **_git(),
    }


def command() -> str:
    """The command line that started this process, as a user would type it."""
    return shlex.join(["python", "-m", "experiments.run", *sys.argv[1:]])


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


@functools.cache
def cpu_model() -> str:
    """What the system calls its processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(
            line.split(":", 1)[1].strip() for line in lines if "model name" in line
        )
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


@functools.cache
def _git() -> dict[str, Any]:
    def ask(*words: str) -> str | None:
        command = ["git", "-C", str(sources.ROOT), *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return None if done.returncode else done.stdout.strip()

    if shutil.which("git") is None:
        return {"commit": None, "dirty": None}
    # Results are written while runs go on; only code and configs make a tree dirty.
    changed = ask("status", "--porcelain", "--", *sources.PACKAGES, "configs")
    return {
        "commit": ask("rev-parse", "HEAD"),
        "dirty": None if changed is None else bool(changed),
    }
