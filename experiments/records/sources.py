"""Imports as the source states them: nothing of it is imported."""

from __future__ import annotations

import ast
import functools
import sys
from collections.abc import Iterable, Iterator

from experiments.records.files import ROOT

PACKAGES = ("hdc", "baselines", "scenes", "experiments")


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
def _tree(module: str) -> ast.Module:
    """The source of a module of the project; an empty one where there is none."""
    path = ROOT.joinpath(*module.split("."))
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if file.is_file():
            return ast.parse(file.read_bytes())
    return ast.Module([], [])
