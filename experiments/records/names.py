"""Names of parameters that changed after version 3.0: the ids of records are made of the old ones,
so that records that were made since then keep theirs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_READOUTS = "hdc.readouts."
"""Start of the targets whose parameters changed."""
_OLD = {
    "n_neighbors": "n_neighbours",
    "random_state": "seed",
    "class_weight": "balance",
}


def of_version_3_0(node: Any) -> Any:
    """A config with the names of 3.0, and ``balance`` as the truth value that it was."""
    if isinstance(node, list | tuple):
        return [of_version_3_0(value) for value in node]
    if not isinstance(node, Mapping):
        return node
    if not str(node.get("_target_")).startswith(_READOUTS):
        return {key: of_version_3_0(value) for key, value in node.items()}
    found = {_OLD.get(key, key): value for key, value in node.items()}
    if "balance" in found:
        found["balance"] = found["balance"] == "balanced"
    return found
