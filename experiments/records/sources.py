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
_STUDIES = "experiments/studies/"
_STORING = {
    ROOT / "experiments" / "records",
    ROOT / "hdc" / "io.py",
}  # compute no result


def sources(config: Mapping[str, Any]) -> dict[str, str]:
    """Path in the checkout → digest of every file of the project that takes part in a run of this
    resolved configuration."""
    return closure(_TRIAL, *targets(config))


def closure(*names: str) -> dict[str, str]:
    """As :func:`sources`, of every file that importing these dotted names loads."""
    return {
        _address(path): digest(path)
        for path in sorted(_closure(tuple(sorted(set(names)))))
    }


def code_hash(files: Mapping[str, str]) -> str:
    """One digest for all of :func:`sources`, wherever the files lie."""
    return hashlib.sha256(repr(sorted(set(files.values()))).encode()).hexdigest()


def outdated(files: Mapping[str, str], config: Mapping[str, Any]) -> list[str]:
    """The files that would make this record today and whose code did not, wherever it lay; and of
    those that made it, the ones that are gone, and a user's own that have changed."""
    studies = {
        name[:-3].replace("/", ".") for name in files if name.startswith(_STUDIES)
    }
    return list(
        _outdated(tuple(sorted(files.items())), frozenset(targets(config) | studies))
    )


@functools.cache
def _outdated(
    files: tuple[tuple[str, str], ...], names: frozenset[str]
) -> tuple[str, ...]:
    made_by = {known for _, known in files}
    new = [name for name, now in closure(_TRIAL, *names).items() if now not in made_by]
    gone = [
        n for n, known in files if not (ROOT / n).is_file() and known not in _all_now()
    ]
    own = (
        (Path(n), known)
        for n, known in files
        if Path(n).is_absolute() and Path(n).is_file()
    )
    return (*new, *gone, *(str(path) for path, known in own if digest(path) != known))


class _Computing(ast.NodeTransformer):
    """Drops docstrings, and the module that a name of this project is imported from: that module
    has a digest of its own, wherever it lies."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        text = isinstance(node.value, ast.Constant) and isinstance(
            node.value.value, str
        )
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
    return frozenset(
        digest(path) for name in PACKAGES for path in (ROOT / name).rglob("*.py")
    )


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
        if _STORING.isdisjoint((path, path.parent)):
            loaded.add(path)
            waiting |= _imports(path) - loaded
    return frozenset(loaded)


@functools.cache
def _imports(path: Path) -> frozenset[Path]:
    """The project's files that a file imports, at its top or within a function.

    A package loads what it offers when that is asked for: see :func:`_files`.
    """
    waiting: list[ast.AST] = [ast.parse(path.read_bytes())]
    names: set[str] = set()
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif not (
            isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        ):
            waiting += ast.iter_child_nodes(node)
    return frozenset(path for name in names for path in _files(name))


def _files(name: str) -> set[Path]:
    """The files behind a dotted name: its packages and the module it lies in."""
    if name.partition(".")[0] not in PACKAGES:
        return _of_user(name)
    words = name.split(".")
    places = [ROOT.joinpath(*words[: k + 1]) for k in range(len(words))]
    files = (path for p in places for path in (p / "__init__.py", p.with_suffix(".py")))
    found = {path for path in files if path.is_file()}
    package = ROOT.joinpath(*words[:-1]) / "__init__.py"
    if package in found and places[-1].with_suffix(".py") not in found:
        for node in ast.walk(ast.parse(package.read_bytes())):
            if isinstance(node, ast.ImportFrom) and words[-1] in {
                a.name for a in node.names
            }:
                found |= _files(f"{node.module}")
    return found


def _of_user(name: str) -> set[Path]:
    """The file of a user's own module, if it is no installed one."""
    module = sys.modules.get(name.rpartition(".")[0])
    file = Path(getattr(module, "__file__", None) or "").resolve()
    installed = (Path(sysconfig.get_path(place)).resolve() for place in _INSTALLED)
    own = file.suffix == ".py" and not any(map(file.is_relative_to, installed))
    return {file} if own else set()


def _address(path: Path) -> str:
    return path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else str(path)
