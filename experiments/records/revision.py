"""Revisions: by which state of the code a record was made, as far as its numbers depend on it.

A part that a config names by ``_target_`` (encoder, read-out, baseline, scene, study) may have
an attribute ``revision``, an integer that is raised by hand in the commit that changes its numbers;
without one it is 1. A part that is made of further ones says so by ``components(**parameters)``,
which returns their classes, or dotted names of them. A package may have one ``REVISION`` more, for
what all of its parts share; that of ``experiments`` is the protocol's. A test of golden numbers
fails when a number moves and no revision does (``tests/experiments/golden_numbers.py``).

A user's own module counts by its file, with the modules beside it that it imports.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib
import importlib.util
import json
import os
import pkgutil
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from experiments.records import configs, sources
from experiments.records.sources import PACKAGES

_INSTALLED = ("stdlib", "purelib", "platlib")
_DIGITS = 12

Revisions = dict[str, int | str]
"""Revision by dotted name; of a user's own modules, the digests of their files."""


def revisions(config: Any) -> Revisions:
    """Revisions of everything that takes part in what a resolved config asks for."""
    found = _of_package("experiments")
    for target, parameters in targets(config):
        found |= _of_target(target, json.dumps(parameters, sort_keys=True, default=str))
    return dict(sorted(found.items()))


def outdated(made_by: Revisions, now: Revisions) -> list[str]:
    """Parts with another revision now than in a record, with both of them.

    A user's module that ``now`` does not have counts as unchanged.
    """
    lines = []
    for name in sorted({*made_by, *now}):
        before, after = made_by.get(name), now.get(name)
        is_own = name.partition(".")[0] not in PACKAGES
        if before == after or (is_own and after is None):
            continue
        if is_own:
            lines.append(f"{name} (changed)")
        else:
            lines.append(f"{name} (revision {_said(before)}, now {_said(after)})")
    return lines


def of_today(made_by: Revisions) -> Revisions:
    """Today's revisions of the parts that a record names, as far as they lie in our packages.

    They are read from the source: whoever reads a record runs no code that the record names.
    """
    found: Revisions = {}
    for name in made_by:
        package = name.partition(".")[0]
        if package in PACKAGES:
            found |= _of_package(package)
            now = None if name in PACKAGES else sources.revision_of(name)
            found |= {} if now is None else {name: now}
    return found


def of_class(kind: type) -> Revisions:
    """Revisions of one class, and of the package that it lies in."""
    return _of_part(f"{kind.__module__}.{kind.__qualname__}", kind)


def of_own(config: Any) -> Revisions:
    """Revisions of those parts of a config that lie in a user's own modules."""
    found: Revisions = {}
    for target, parameters in targets(config):
        if target.partition(".")[0] not in PACKAGES:
            found |= revisions({"_target_": target, **parameters})
    return found


def targets(config: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each ``_target_`` in a part of a config, with the parameters next to it."""
    for node in configs.mappings(config):
        if "_target_" in node:
            parameters = {k: v for k, v in node.items() if not k.startswith("_")}
            yield str(node["_target_"]), parameters


def _said(revision: int | str | None) -> str:
    return "none" if revision is None else str(revision)


@functools.cache
def _of_target(target: str, parameters: str) -> Revisions:
    package = target.partition(".")[0]
    if package not in PACKAGES and is_installed(package):
        return {}  # its version is in the record
    try:
        part = pkgutil.resolve_name(target)
    except (ImportError, AttributeError, ValueError):
        return {}  # whoever builds it says what is wrong
    found = _of_part(target, part)
    from baselines.library import components  # late: records are read without torch

    for each in components(part, **json.loads(parameters)):
        if isinstance(each, str):
            found = found | _of_target(each, "{}")
        else:
            found = found | of_class(each)
    return found


def _of_part(name: str, part: Any) -> Revisions:
    package = name.partition(".")[0]
    own = {name: getattr(part, "revision", 1)}
    if package in PACKAGES:
        return own | _of_package(package)
    return own | _own_files(getattr(part, "__module__", name))


def _of_package(name: str) -> Revisions:
    shared = getattr(importlib.import_module(name), "REVISION", None)
    if shared is None:
        return {}
    return {name: shared}


@functools.cache
def _own_files(name: str) -> Revisions:
    """Digests of a user's module and of those beside it that it imports; of others, none."""
    if is_installed(name.partition(".")[0]):
        return {}
    module = importlib.import_module(name)
    file = Path(getattr(module, "__file__", None) or "").resolve()
    if file.suffix != ".py":
        return {}
    found: Revisions = {}
    waiting = [file]
    while waiting:
        path = waiting.pop()
        relative = Path(os.path.relpath(path, file.parent)).as_posix()
        if relative not in found:
            found[relative] = _digest(path)
            waiting += _imported_beside(path)
    return found


def _imported_beside(path: Path) -> Iterator[Path]:
    """Files of the folder of a file, or below it, that it imports; of its package, also above."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        folder, names = path.parent, []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            folder = path.parents[max(0, node.level - 1)]
            names = [f"{node.module or ''}.{alias.name}" for alias in node.names]
        for name in names:
            yield from _files_of(name.strip("."), folder)


def _files_of(name: str, folder: Path) -> Iterator[Path]:
    """Files behind a dotted name, from the folder, or from the package that it lies in."""
    first, *rest = name.split(".")
    packages = [above for above in (folder, *folder.parents) if above.name == first]
    starts = [(package, rest) for package in packages]
    if folder.name != first:
        starts.append((folder, [first, *rest]))
    for start, words in starts:
        for n in range(1, len(words) + 1):
            module = start.joinpath(*words[:n])
            for path in (module.with_suffix(".py"), module / "__init__.py"):
                if path.is_file():
                    yield path


@functools.cache
def is_installed(package: str) -> bool:
    """Whether a package comes with Python, or was installed: it is looked for, not imported."""
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):  # of a module without one
        return False
    if spec is None:
        return False
    if spec.origin in ("built-in", "frozen"):
        return True
    folders = [Path(sysconfig.get_path(name)).resolve() for name in _INSTALLED]
    file = Path(spec.origin or "").resolve()
    return any(file.is_relative_to(folder) for folder in folders)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:_DIGITS]
