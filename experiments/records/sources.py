"""Digests of the code that made a record: of the files that a configuration's run is computed by.

They are found by following imports from the ``_target_`` of the configuration and from the trial
itself, so that a change in one model leaves the records of the others as they are. Comments,
docstrings and layout do not count: they change no result.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.records.files import ROOT

PACKAGES = ("hdc", "baselines", "scenes", "experiments")
_INSTALLED = ("stdlib", "purelib", "platlib")
_TRIAL = "experiments.protocol.trial"
_RECORDS = ROOT / "experiments" / "records"  # stores results and computes none


def sources(config: Mapping[str, Any]) -> dict[str, str]:
    """Path in the checkout → digest of every file of the project that takes part in a run of this
    resolved configuration."""
    return closure(_TRIAL, *targets(config))


def closure(*names: str) -> dict[str, str]:
    """As :func:`sources`, of every file that importing these dotted names loads."""
    return {_address(path): digest(path) for path in sorted(_closure(tuple(sorted(set(names)))))}


def code_hash(files: Mapping[str, str]) -> str:
    """One digest for all of :func:`sources`, wherever the files lie."""
    return hashlib.sha256(repr(sorted(set(files.values()))).encode()).hexdigest()


def outdated(files: Mapping[str, str]) -> list[str]:
    """The files of a record whose code this checkout does not have, at that or another address."""
    return list(_outdated(tuple(sorted(files.items()))))


@functools.cache
def _outdated(files: tuple[tuple[str, str], ...]) -> tuple[str, ...]:
    gone = ((ROOT / name, known) for name, known in files if known not in _all_now())
    return tuple(_address(p) for p, known in gone if not p.is_file() or digest(p) != known)


class _Computing(ast.NodeTransformer):
    """Drops docstrings, and the module that a name of this project is imported from: that module
    has a digest of its own, wherever it lies."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        text = isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        return None if text else node

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.AST:
        if (node.module or "").partition(".")[0] in PACKAGES:
            node.module = "project"
        return node


@functools.cache
def digest(path: Path) -> str:
    """Digest of what a Python file computes, wherever it lies."""
    tree = _Computing().visit(ast.parse(path.read_bytes()))
    lines = ast.unparse(tree).splitlines()
    imported = sorted(line for line in lines if line.startswith("from project import"))
    rest = [line for line in lines if not line.startswith("from project import")]
    return hashlib.sha256("\n".join([*imported, *rest]).encode()).hexdigest()[:12]


@functools.cache
def _all_now() -> frozenset[str]:
    """Digests of all code of this checkout."""
    return frozenset(digest(path) for name in PACKAGES for path in (ROOT / name).rglob("*.py"))


def targets(node: Any) -> set[str]:
    """Every ``_target_`` below a part of a configuration."""
    if isinstance(node, Mapping):
        own = {str(node["_target_"])} if "_target_" in node else set()
        return own.union(*map(targets, node.values()))
    return set().union(*map(targets, node)) if isinstance(node, list | tuple) else set()


@functools.cache
def _closure(names: tuple[str, ...]) -> frozenset[Path]:
    """The project's files that importing these dotted names loads, sooner or later."""
    loaded: set[Path] = set()
    waiting = {path for name in names for path in _files(name)}
    while waiting:
        path = waiting.pop()
        if path.parent != _RECORDS:
            loaded.add(path)
            waiting |= _imports(path) - loaded
    return frozenset(loaded)


@functools.cache
def _imports(path: Path) -> frozenset[Path]:
    """The project's files that a file imports, at its top or within a function."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(path for name in names for path in _files(name))


def _files(name: str) -> set[Path]:
    """The files behind a dotted name: its packages and the module it lies in."""
    if name.partition(".")[0] not in PACKAGES:
        return _of_user(name)
    words = name.split(".")
    places = [ROOT.joinpath(*words[: k + 1]) for k in range(len(words))]
    files = (path for p in places for path in (p / "__init__.py", p.with_suffix(".py")))
    return {path for path in files if path.is_file()}


def _of_user(name: str) -> set[Path]:
    """The file of a user's own module, if it is no installed one."""
    module = sys.modules.get(name.rpartition(".")[0])
    file = Path(getattr(module, "__file__", None) or "").resolve()
    installed = (Path(sysconfig.get_path(place)).resolve() for place in _INSTALLED)
    own = file.suffix == ".py" and not any(map(file.is_relative_to, installed))
    return {file} if own else set()


def _address(path: Path) -> str:
    return path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else str(path)
