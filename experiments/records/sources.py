"""Which code made a record: digests of the files that a configuration's run is computed by.

Found by following imports from the ``_target_`` of the configuration and from the trial itself, so
that a change in one model leaves the records of the others as they are. Comments, docstrings and
layout do not count: they change no result.
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
_RECORDS = ROOT / "experiments" / "records"  # writes down what came of a run, and computes none


def sources(config: Mapping[str, Any], *modules: str) -> dict[str, str]:
    """Digest by path of every file of the project that takes part in a run of this configuration.

    Args:
        config: resolved; the parts of it that carry a ``_target_`` count.
        modules: dotted names of modules that take part, too.

    Returns:
        dict: path in the checkout → the first 12 hexadecimal digits of a SHA-256.
    """
    return closure(_TRIAL, *modules, *targets(config))


def closure(*names: str) -> dict[str, str]:
    """As :func:`sources`, of every file that importing these dotted names loads."""
    return {_address(path): digest(path) for path in sorted(_closure(tuple(sorted(set(names)))))}


def code_hash(files: Mapping[str, str]) -> str:
    """One digest for all of :func:`sources`, wherever the files lie."""
    return hashlib.sha256(repr(sorted(set(files.values()))).encode()).hexdigest()


def outdated(files: Mapping[str, str]) -> list[str]:
    """The files of a record whose code this checkout does not have, at that or another address."""
    moved = (name for name, known in sorted(files.items()) if _now(name) != known)
    return [name for name in moved if files[name] not in _all_now()]


@functools.cache
def digest(path: Path) -> str:
    """Digest of what a Python file computes, the same on every Python and wherever it lies.

    Comments, docstrings and layout do not count, nor from which module of this project a name is
    imported: the module it comes from has a digest of its own.
    """
    text = _text(ast.parse(path.read_bytes()))
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _text(node: Any) -> str:
    """A syntax tree as text: :func:`ast.dump` without what differs between versions of Python."""
    if isinstance(node, list):
        own = {name for item in node for name in _own_names(item)}
        rest = (_text(item) for item in node if not (_is_docstring(item) or _own_names(item)))
        return f"[{', '.join([*sorted(own), *rest])}]"
    if not isinstance(node, ast.AST):
        return repr(node)
    if isinstance(node, ast.JoinedStr):  # Python 3.12.0 and .1 end some in an empty text
        node = ast.JoinedStr([part for part in node.values if _constant(part) != ""])
    fields = (
        (name, value)
        for name, value in ast.iter_fields(node)
        # Python 3.12 added type parameters; the context of a name follows from its place.
        if value not in (None, []) and name not in ("ctx", "kind", "type_ignores", "type_comment")
    )
    return f"{type(node).__name__}({', '.join(f'{name}={_text(v)}' for name, v in fields)})"


def _own_names(statement: Any) -> list[str]:
    """What a statement imports from this project: their order is the formatter's."""
    if not isinstance(statement, ast.ImportFrom) or not statement.module:
        return []
    if statement.module.partition(".")[0] not in PACKAGES:
        return []
    return [f"own {alias.name} as {alias.asname}" for alias in statement.names]


def _is_docstring(statement: Any) -> bool:
    """Whether a statement is a text that stands alone: a docstring, or as good as a comment."""
    return isinstance(statement, ast.Expr) and isinstance(_constant(statement.value), str)


def _constant(node: Any) -> Any:
    return node.value if isinstance(node, ast.Constant) else None


@functools.cache
def _all_now() -> frozenset[str]:
    """Digests of all code of this checkout."""
    return frozenset(digest(path) for name in PACKAGES for path in (ROOT / name).rglob("*.py"))


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
    waiting = {path for name in names for path in _files(name)}
    while waiting:
        path = waiting.pop()
        if path.parent != _RECORDS:
            found.add(path)
            waiting |= _imports(path) - found
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
    """The files behind a dotted name: its packages and, last, the module it lies in.

    Of a class outside this project it is the file of its module, unless a library has it.
    """
    if name.partition(".")[0] not in PACKAGES:
        return _of_ones_own(name)
    found, place = set(), ROOT
    for word in name.split("."):
        place = place / word
        for path in (place / "__init__.py", place.with_suffix(".py")):
            if path.is_file():
                found.add(path)
    return found


def _of_ones_own(name: str) -> set[Path]:
    module = sys.modules.get(name.rpartition(".")[0])
    file = Path(getattr(module, "__file__", None) or "").resolve()
    installed = (Path(sysconfig.get_path(place)).resolve() for place in _INSTALLED)
    own = file.suffix == ".py" and not any(map(file.is_relative_to, installed))
    return {file} if own else set()


def _address(path: Path) -> str:
    return path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else str(path)
