"""Revisions: by which state of the code a record was made, as far as its numbers depend on it.

A part that a config names by ``_target_`` (encoder, read-out, baseline, scene, study) may have
an attribute ``revision``, an integer that is raised by hand in the commit that changes its numbers;
without one it is 1. A part that is made of further ones says so by ``components(**parameters)``,
which returns their classes, or dotted names of them. A package may have one ``REVISION`` more, for
what all of its parts share; that of ``experiments`` is the protocol's. A test of golden numbers
fails when a number moves and no revision does (``tests/experiments/golden_numbers.py``).

A user's own module counts by its file; where it imports others, a ``revision`` says that they
changed.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import json
import pkgutil
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from experiments.records import configs
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
    """Today's revisions of the parts that a record names, as far as they lie in our packages: of
    others that a record names, none is imported."""
    found: Revisions = {}
    for name in made_by:
        if name.partition(".")[0] in PACKAGES:
            try:
                found |= _of_part(name, pkgutil.resolve_name(name))
            except (ImportError, AttributeError):  # it left
                continue
    return found


def of_class(kind: type) -> Revisions:
    """Revisions of one class, and of the package that it lies in."""
    return _of_part(f"{kind.__module__}.{kind.__qualname__}", kind)


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
    found: Revisions = {name: getattr(part, "revision", 1)}
    if package in PACKAGES:
        return found | _of_package(package)
    module = sys.modules.get(getattr(part, "__module__", ""))
    file = Path(getattr(module, "__file__", None) or "")
    if file.suffix == ".py" and not is_installed(package):
        found[file.name] = hashlib.sha256(file.read_bytes()).hexdigest()[:_DIGITS]
    return found


def _of_package(name: str) -> Revisions:
    shared = getattr(importlib.import_module(name), "REVISION", None)
    if shared is None:
        return {}
    return {name: shared}


@functools.cache
def is_installed(package: str) -> bool:
    """Whether a package comes with Python, or was installed: it is looked for, not imported."""
    try:
        spec = importlib.util.find_spec(package)
    except ValueError:  # it is what runs
        return False
    if spec is None or spec.origin in ("built-in", "frozen"):
        return spec is not None
    folders = [Path(sysconfig.get_path(name)).resolve() for name in _INSTALLED]
    file = Path(spec.origin or "").resolve()
    return any(file.is_relative_to(folder) for folder in folders)
