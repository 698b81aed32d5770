"""Revisions and imports as the source states them: nothing of it is imported."""

from __future__ import annotations

import ast
import functools
import sys
from collections.abc import Iterable, Iterator
from typing import Any

from experiments.records.files import ROOT

PACKAGES = ("hdc", "baselines", "scenes", "experiments")


def revision_of(name: str) -> int | None:
    """``revision`` of a class or function of the project by its dotted name, 1 where neither it nor
    a base of it states one; None where the project has none of this name."""
    found = _stand_in(name)
    return None if found is None else getattr(found, "revision", 1)


def packages_of(names: Iterable[str]) -> set[str]:
    """Packages of others that parts of the project, by their dotted names, import as they are
    imported, and so on with what they import of the project."""
    waiting = [part for name in names for part in (name, name.rpartition(".")[0])]
    seen: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name and name not in seen:
            seen.add(name)
            waiting += _imported(name)
    found = {name.partition(".")[0] for name in seen}
    return found.difference(PACKAGES, sys.stdlib_module_names)


def _imported(module: str) -> Iterator[str]:
    """Names that a module of the project imports at once; of others, none."""
    for line in _tree(module).body:
        if isinstance(line, ast.Import):
            yield from (alias.name for alias in line.names)
        elif isinstance(line, ast.ImportFrom) and line.module:
            yield line.module
            yield from (f"{line.module}.{alias.name}" for alias in line.names)


@functools.cache
def _stand_in(name: str) -> type | None:
    """A class with the bases of the one of this name, and the revision that stands in it; that of
    a function has neither."""
    module, _, last = name.rpartition(".")
    tree = _tree(module)
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and node.name == last:
            names = (ast.unparse(base).partition("[")[0] for base in node.bases)
            bases = map(_stand_in, (f"{module}.{base}" for base in names))
            return type(last, tuple(filter(None, bases)), _stated(node))
        if isinstance(node, ast.FunctionDef) and node.name == last:
            return type(last, (), {})
    imports = (line for line in ast.walk(tree) if isinstance(line, ast.ImportFrom))
    for line in imports:
        if last in (alias.name for alias in line.names):
            return _stand_in(f"{line.module}.{last}")
    return None


def _stated(node: ast.ClassDef) -> dict[str, Any]:
    lines = (line for line in node.body if isinstance(line, ast.AnnAssign))
    for line in lines:
        if line.value is not None and ast.unparse(line.target) == "revision":
            return {"revision": ast.literal_eval(line.value)}
    return {}


@functools.cache
def _tree(module: str) -> ast.Module:
    """The source of a module of the project; an empty one where there is none."""
    path = ROOT.joinpath(*module.split("."))
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if file.is_file():
            return ast.parse(file.read_bytes())
    return ast.Module([], [])
