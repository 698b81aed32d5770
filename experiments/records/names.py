"""Names of parameters that changed after version 3.0: older records have them, and ids of records
are made of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_READOUTS = "hdc.readouts."
"""Start of the targets whose parameters changed."""
_NEW = {
    "n_neighbours": "n_neighbors",
    "seed": "random_state",
    "balance": "class_weight",
}
_OLD = {new: old for old, new in _NEW.items()}


def of_today(config: Any) -> Any:
    """The config of a record with the names of now."""
    return _renamed(config, _NEW)


def of_version_3_0(config: Any) -> Any:
    """A config with the names of 3.0, of which the names of records are made."""
    return _renamed(config, _OLD)


def _renamed(node: Any, names: Mapping[str, str]) -> Any:
    if isinstance(node, list | tuple):
        return [_renamed(value, names) for value in node]
    if not isinstance(node, Mapping):
        return node
    if not str(node.get("_target_")).startswith(_READOUTS):
        return {key: _renamed(value, names) for key, value in node.items()}
    found = {names.get(key, key): value for key, value in node.items()}
    if found.get("balance", False) in (None, "balanced"):
        found["balance"] = found["balance"] == "balanced"
    if isinstance(found.get("class_weight"), bool):
        found["class_weight"] = "balanced" if found["class_weight"] else None
    return found
