"""Public data that a config needs and other configs do not, and which are missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.records import configs
from scenes.source import DATA, Source


def needs(config: Any) -> str:
    """One line: ``needs data of owner/name``, ``lacks data of owner/name``, or both. Empty where
    nothing is needed.

    Args:
        config: resolved. Nothing of it is imported or built.
    """
    given = (part.get("source") for part in configs.mappings(config))
    sources = [Source(**each) for each in given if isinstance(each, Mapping)]
    here = {source.repository: source.find() is not None for source in sources}
    parts = []
    for word, is_here in (("needs", True), ("lacks", False)):
        names = [name for name, known in here.items() if known == is_here]
        parts += [f"{word} data of {', '.join(names)} ({DATA})"] if names else []
    return "; ".join(parts)
