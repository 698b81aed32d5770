"""Which code made a record: digests of the files that a configuration's run is computed by.

Found by following imports from the ``_target_`` of the configuration and from the trial itself, so
that a change in one model leaves the records of the others as they are. Comments, docstrings and
layout do not count: they change no result.
"""

from __future__ import annotations

import ast
import functools
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("hdc", "baselines", "scenes", "experiments")
_TRIAL = "experiments.trial"
# What carries a run out, or writes down what came of it, and computes none of it.
_CARRIERS = tuple(
    f"experiments/{name}.py" for name in ("locks", "measurement", "record", "sources")
)


def sources(config: Mapping[str, Any]) -> dict[str, str]:
    """Digest by path of every file of the project that takes part in a run of this configuration.

    Args:
        config: resolved; the parts of it that carry a ``_target_`` count.

    Returns:
        dict: path in the checkout → the first 12 hexadecimal digits of a SHA-256.
    """
    return {
        path.relative_to(ROOT).as_posix(): digest(path)
        for path in sorted(_closure(tuple(sorted({_TRIAL, *targets(config)}))))
    }


def code_hash(files: Mapping[str, str]) -> str:
    """One digest for all of :func:`sources`."""
    return hashlib.sha256(repr(sorted(files.items())).encode()).hexdigest()


def outdated(files: Mapping[str, str]) -> list[str]:
    """The files of a record that are not those of this checkout, or no longer there."""
    return [
        name
        for name, known in sorted(files.items())
        if name not in _CARRIERS and _now(name) != known
    ]


@functools.cache
def digest(path: Path) -> str:
    """Digest of a Python file's code, comments, docstrings and layout aside."""
    tree = ast.parse(path.read_bytes())
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and _is_docstring(body[:1]):
            del body[0]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()[:12]


def _is_docstring(statements: Sequence[ast.AST]) -> bool:
    return any(
        isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant) and type(s.value.value) is str
        for s in statements
    )


@functools.cache
def _now(name: str) -> str | None:
    path = ROOT / name
    return digest(path) if path.is_file() else None


def targets(node: Any) -> set[str]:
    """Every ``_target_`` below a part of a configuration."""
    if isinstance(node, Mapping):
        own = {str(node["_target_"])} if "_target_" in node else set()
        return own.union(*map(targets, node.values()))
    return set().union(*map(targets, node)) if isinstance(node, list | tuple) else set()


@functools.cache
def _closure(names: tuple[str, ...]) -> frozenset[Path]:
    """The project's files that importing these dotted names loads, sooner or later."""
    found: set[Path] = set()
    carriers = {ROOT / name for name in _CARRIERS}
    waiting = {path for name in names for path in _files(name)} - carriers
    while waiting:
        path = waiting.pop()
        found.add(path)
        waiting |= _imports(path) - found - carriers
    return frozenset(found)


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
    """The files behind a dotted name: its packages and, last, the module it lies in."""
    if name.partition(".")[0] not in PACKAGES:
        return set()
    found, place = set(), ROOT
    for word in name.split("."):
        place = place / word
        for path in (place / "__init__.py", place.with_suffix(".py")):
            if path.is_file():
                found.add(path)
    return found
