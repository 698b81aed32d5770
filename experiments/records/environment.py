"""Machine, library versions and state of the checkout, stored with everything that is measured."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import os
import platform
import shutil
import subprocess
from pathlib import Path

import msgspec

from experiments.records import files, revision

_PACKAGES = (
    "torch",
    "numpy",
    "scipy",
    "scikit-learn",
    "hydra-core",
    "numkong",
    "numba",
)
# The variable with the command line as a user typed it; workers of a launcher inherit it.
COMMAND = "EXPERIMENTS_COMMAND"
_CPUINFO = Path("/proc/cpuinfo")
_NUMBERS = ("cpu family", "model", "stepping")


class Environment(msgspec.Struct, kw_only=True, omit_defaults=True):
    """The code and the machine that made a record.

    Attributes:
        cpu: what the system calls its processor.
        processor: its family, model, stepping and a digest of its flags; None where the system does
            not say.
        blas: kernels that compute products of matrices, by library.
        cores: of the machine.
        threads: of torch.
        device: as torch names it, a GPU with its model.
        packages: versions of the libraries.
        commit: of the checkout; None where it is no checkout.
        changes: digest of what differed in the code; None where nothing did.
        exclusive: whether it was timed alone.
    """

    python: str | None = None
    platform: str | None = None
    cpu: str
    processor: str | None = None
    blas: dict[str, str] = {}
    cores: int | None = None
    threads: int
    device: str | None = None
    packages: dict[str, str | None] = {}
    commit: str | None = None
    changes: str | None = None
    exclusive: bool = True

    @property
    def machine(self) -> str:
        """The processor and its kernels, as far as they are known: times compare where these are
        equal."""
        kernels = (f"{kernel} by {name}" for name, kernel in self.blas.items())
        about = ", ".join(filter(None, [self.processor, *kernels]))
        return f"{self.cpu} ({about})" if about else self.cpu

    @property
    def short_commit(self) -> str:
        """Twelve digits of the commit."""
        return (self.commit or "")[:12]

    @property
    def is_of_a_commit(self) -> bool:
        """Whether others can have the code that made it."""
        return self.commit is not None and self.changes is None


def environment(device: str, threads: int) -> Environment:
    """Machine, versions of libraries, commit and what differs from it."""
    name = device
    if device.startswith("cuda"):
        import torch

        name = f"{device}: {torch.cuda.get_device_name(device)}"
    return Environment(
        python=platform.python_version(),
        platform=platform.platform(),
        cpu=cpu_model(),
        processor=processor(),
        blas=blas(),
        cores=os.cpu_count(),
        threads=threads,
        device=name,
        packages={name: _version(name) for name in _PACKAGES},
        commit=commit(),
        changes=changes(),
    )


def cpu_model() -> str:
    """The system's name of its processor."""
    unknown = platform.processor() or platform.machine()
    return _cpuinfo().get("model name", unknown)


def processor() -> str | None:
    """Family, model, stepping and a digest of the flags of the processor, where Linux says them."""
    known = _cpuinfo()
    if "flags" not in known:
        return None
    flags = " ".join(sorted(known["flags"].split()))
    digest = hashlib.sha256(flags.encode()).hexdigest()[:8]
    family, model, stepping = (known[key] for key in _NUMBERS)
    return f"family {family} model {model} stepping {stepping} flags {digest}"


@functools.cache
def blas() -> dict[str, str]:
    """The kernels that torch and OpenBLAS have chosen for this processor."""
    import torch
    from threadpoolctl import threadpool_info

    found = {"torch": str(torch.backends.cpu.get_cpu_capability())}
    for library in threadpool_info():
        if "architecture" in library:
            found[library["internal_api"]] = library["architecture"]
    return found


@functools.cache
def _cpuinfo() -> dict[str, str]:
    """Fields of the first processor in Linux's ``/proc/cpuinfo``; empty elsewhere."""
    try:
        first = _CPUINFO.read_text().partition("\n\n")[0]
    except OSError:
        return {}
    pairs = (line.partition(":") for line in first.splitlines())
    return {name.strip(): value.strip() for name, _, value in pairs}


@functools.cache
def changes(*packages: str) -> str | None:
    """Digest of what differs from the commit in the code of these packages, or of all of them.

    None where nothing does, or where this is no checkout.
    """
    folders = packages or revision.PACKAGES
    tracked = _ask_git("diff", "HEAD", "--", *folders)
    others = _ask_git("ls-files", "--others", "--exclude-standard", "--", *folders)
    if not tracked and not others:
        return None
    digest = hashlib.sha256((tracked or "").encode())
    for name in (others or "").splitlines():
        digest.update(name.encode())
        digest.update((files.ROOT / name).read_bytes())
    return digest.hexdigest()[:12]


@functools.cache
def commit() -> str | None:
    """The commit of the checkout; None where it is no checkout."""
    return _ask_git("rev-parse", "HEAD")


def _ask_git(*words: str) -> str | None:
    """State of the checkout by git; None where there is no git, or no checkout."""
    if shutil.which("git") is None:
        return None
    command = ["git", "-C", str(files.ROOT), "-c", "core.quotePath=false", *words]
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode:
        return None
    return done.stdout.decode(errors="replace").strip()


@functools.cache
def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
