"""Ways in which a file comes to be damaged, or is made to look like one that it is not."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np

Rng = np.random.Generator

_HEADER = 512  # bytes at the start of a file, where most sizes stand
_LARGE = (2**16 - 1, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1, 60_000, 10**9, 2**24)


def flip(data: bytes, rng: Rng) -> bytes:
    """One to eight bytes become others."""
    damaged = bytearray(data)
    for at in rng.integers(0, len(data), rng.integers(1, 9)):
        damaged[at] ^= int(rng.integers(1, 256))
    return bytes(damaged)


def truncate(data: bytes, rng: Rng) -> bytes:
    """The file ends early."""
    return data[: rng.integers(0, len(data))]


def zero(data: bytes, rng: Rng) -> bytes:
    """Up to 64 bytes in a row become zero, as on a disk that lost a block."""
    start, stop = _run(data, rng)
    return data[:start] + bytes(stop - start) + data[stop:]


def splice(data: bytes, rng: Rng) -> bytes:
    """Up to 64 bytes in a row are put over others, put between others, or left out."""
    start, stop = _run(data, rng)
    at = int(rng.integers(0, len(data)))
    match rng.integers(3):
        case 0:
            return data[:at] + data[start:stop] + data[at + stop - start :]
        case 1:
            return data[:at] + data[start:stop] + data[at:]
        case _:
            return data[:start] + data[stop:]


def large(data: bytes, rng: Rng) -> bytes:
    """A number near the start becomes a large one: up to 8 bytes in either order, or digits."""
    at = int(rng.integers(0, min(len(data), _HEADER)))
    value = _LARGE[rng.integers(len(_LARGE))]
    if data[at : at + 1].isdigit():
        digits = len(data[at : at + 20]) - len(data[at : at + 20].lstrip(b"0123456789"))
        return data[:at] + str(value).encode() + data[at + digits :]
    width = int(rng.choice([1, 2, 4, 8]))
    order = "little" if rng.integers(2) else "big"
    number = (value % 256**width).to_bytes(width, order)  # type: ignore[arg-type]
    return data[:at] + number + data[at + width :]


def _run(data: bytes, rng: Rng) -> tuple[int, int]:
    start = int(rng.integers(0, len(data)))
    return start, min(len(data), start + int(rng.integers(1, 65)))


DAMAGES: dict[str, Callable[[bytes, Rng], bytes]] = {
    f.__name__: f for f in (flip, truncate, zero, splice, large)
}

_HOSTILE: tuple[Callable[[], Any], ...] = (
    lambda: None, lambda: True, lambda: -1, lambda: 0, lambda: 2**70, lambda: 10**400,
    lambda: 1e308, lambda: -0.5, lambda: "", lambda: "x" * 100_000, lambda: "${oc.env:HOME}",
    lambda: "../../etc/passwd", lambda: "<script>|[b]\\\x1b[31m\n", lambda: "\ud800",
    lambda: [], lambda: [[]], lambda: {}, lambda: {"a": {"_target_": "os.system"}},
    lambda: list(range(1000)), lambda: _nested(500),
)  # fmt: skip


def _nested(depth: int) -> Any:
    value: Any = 1
    for _ in range(depth):
        value = [value]
    return value


def field_of(tree: Any, rng: Rng) -> Any:
    """A copy of a JSON value in which one value, at any depth, is another or is gone."""
    tree = copy.deepcopy(tree)
    places: list[tuple[Any, Any]] = []
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        keys = list(node) if isinstance(node, dict) else range(len(node))
        places += [(node, key) for key in keys]
        waiting += [node[key] for key in keys if isinstance(node[key], dict | list)]
    node, key = places[rng.integers(len(places))]
    choice = int(rng.integers(len(_HOSTILE) + 1))
    if choice < len(_HOSTILE):
        node[key] = _HOSTILE[choice]()
    else:
        del node[key]
    return tree
