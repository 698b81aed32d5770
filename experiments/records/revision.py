"""Revisions: by which state of the code a record was made, as far as its numbers depend on it.

Whatever a config names by ``_target_`` (an encoder, a read-out, a rival, a scene, a study) may have
an attribute ``revision``, an integer that is raised by hand in the commit that changes its numbers;
without one it is 1. A part that is made of further ones says so by ``components(**parameters)``,
which returns their classes. A package may have one ``REVISION`` more, for what all of its parts
share; that of ``experiments`` is the protocol's. ``tests/experiments/test_golden.py`` fails when a
number moves and no revision does.

A user's own module counts by its file, with the modules beside it that it imports.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import json
import pkgutil
import sysconfig
from collections.abc import Iterator, Mapping
from modulefinder import ModuleFinder
from pathlib import Path
from typing import Any

PACKAGES = ("hdc", "baselines", "scenes", "experiments")
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


def outdated(made_by: Revisions, config: Any) -> list[str]:
    """What has another revision today than in a record of this config, with both of them.

    A user's module that cannot be found from here counts as unchanged.
    """
    now = revisions(config)
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


def of_class(kind: type) -> Revisions:
    """Revisions of one class, and of the package that it lies in."""
    return _of_part(f"{kind.__module__}.{kind.__qualname__}", kind)


def targets(node: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each ``_target_`` below a part of a config, with the parameters beside it."""
    if isinstance(node, Mapping):
        if "_target_" in node:
            parameters = {k: v for k, v in node.items() if not k.startswith("_")}
            yield str(node["_target_"]), parameters
        for value in node.values():
            yield from targets(value)
    elif isinstance(node, list | tuple):
        for value in node:
            yield from targets(value)


def _said(revision: int | str | None) -> str:
    return "none" if revision is None else str(revision)


@functools.cache
def _of_target(target: str, parameters: str) -> Revisions:
    try:
        part = pkgutil.resolve_name(target)
    except (ImportError, AttributeError, ValueError):
        return {}  # whoever builds it says what is wrong
    found = _of_part(target, part)
    components = getattr(part, "components", None)
    if callable(components):
        for each in components(**json.loads(parameters)):
            found = found | of_class(each)
    return found


def _of_part(name: str, part: Any) -> Revisions:
    package = name.partition(".")[0]
    own = {name: getattr(part, "revision", 1)}
    if package in PACKAGES:
        return own | _of_package(package)
    files = _own_files(getattr(part, "__module__", name))
    return own | files if files else {}  # of an installed package, its version counts


def _of_package(name: str) -> Revisions:
    shared = getattr(importlib.import_module(name), "REVISION", None)
    return {} if shared is None else {name: shared}


@functools.cache
def _own_files(name: str) -> Revisions:
    """Digests of a user's module and of those beside it that it imports; of others, none."""
    module = importlib.import_module(name)
    file = Path(getattr(module, "__file__", None) or "").resolve()
    installed = [Path(sysconfig.get_path(place)).resolve() for place in _INSTALLED]
    if file.suffix != ".py" or any(file.is_relative_to(place) for place in installed):
        return {}
    folders = name.count(".") + (file.name == "__init__.py")
    finder = ModuleFinder(path=[str(file.parents[folders])])
    finder.import_hook(name)
    found: Revisions = {name: _digest(file)}
    for beside, each in finder.modules.items():
        path = getattr(each, "__file__", None)
        if path is not None:
            found[beside] = _digest(Path(path))
    return found


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:_DIGITS]
