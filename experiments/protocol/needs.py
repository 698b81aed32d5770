"""Packages and data that a config needs and other configs do not, and which are missing."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Mapping
from typing import Any

from experiments.records import configs, revision, sources
from scenes.source import DATA, Source


def needs(config: Any) -> str:
    """One line: ``needs scipy, data of owner/name; lacks cv2``. Empty where nothing is needed.

    Args:
        config: resolved. Nothing of it is imported or built.
    """
    names = [name for name, _ in revision.targets(config)]
    here: dict[str, bool] = {}
    for package in sorted(sources.packages_of(names)):
        if package not in sys.modules:
            here[package] = importlib.util.find_spec(package) is not None
    for source in sources_of(config):
        here[f"data of {source.repository} ({DATA})"] = source.find() is not None
    parts = []
    for word, is_here in (("needs", True), ("lacks", False)):
        found = [name for name, known in here.items() if known == is_here]
        parts += [f"{word} {', '.join(found)}"] if found else []
    return "; ".join(parts)


def sources_of(config: Any) -> list[Source]:
    """The public recordings that a config reads."""
    given = (part.get("source") for part in configs.mappings(config))
    return [Source(**each) for each in given if isinstance(each, Mapping)]
