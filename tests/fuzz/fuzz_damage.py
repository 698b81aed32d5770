"""Ways in which a file comes to be damaged, or is made to look like one that it is not."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from typing import Any

from hypothesis import strategies as st

_LARGE = (2**16 - 1, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1, 60_000, 10**9, 2**24)
_NUMBERS = st.builds(
    lambda value, width, order: (value % 256**width).to_bytes(width, order),
    st.sampled_from(_LARGE),
    st.sampled_from([1, 2, 4, 8]),
    st.sampled_from(["little", "big"]),
)
_DIGITS = st.sampled_from(_LARGE).map(lambda value: str(value).encode())
_LOST = st.integers(1, 64).map(bytes)  # as on a disk that lost a block
_PLACES = st.floats(0, 1) | st.floats(0, 1).map(lambda x: x**4)  # near the start stand the sizes
_EDITS = st.lists(
    st.tuples(
        st.sampled_from(["put", "insert", "cut", "end"]),
        _PLACES,
        st.binary(min_size=1, max_size=64) | _NUMBERS | _DIGITS | _LOST,
    ),
    min_size=1,
    max_size=6,
)


@st.composite
def edited(draw: Callable[..., Any], data: bytes) -> bytes:
    """The bytes of a file with some put over others, put between, cut out, or without its end."""
    for what, where, some in draw(_EDITS):
        at = int(where * len(data))
        new = some if what in ("put", "insert") else b""
        rest = {"insert": data[at:], "end": b""}.get(what, data[at + len(some) :])
        data = data[:at] + new + rest
    return data


_DEEP: Any = 1
for _ in range(500):
    _DEEP = [_DEEP]

VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text())
    | st.sampled_from(["${seed.run}", "${oc.env:HOME}", "../../etc/passwd", "a,b", "x" * 100_000])
    | st.sampled_from(["<script>|[b]\\\x1b[31m\n", "\ud800", 2**70, 10**400, 1e308, _DEEP])
    | st.just({"_target_": "os.system"}),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=6,
)


def _keys(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if path:
        yield path
    if isinstance(tree, dict | list):
        for key in tree if isinstance(tree, dict) else range(len(tree)):
            yield from _keys(tree[key], (*path, key))


@st.composite
def field_changed(draw: Callable[..., Any], tree: Any) -> Any:
    """A JSON value in which one value, at any depth, is another or is gone."""
    tree = copy.deepcopy(tree)
    *before, last = draw(st.sampled_from(list(_keys(tree))))
    node = tree
    for key in before:
        node = node[key]
    if draw(st.booleans()):
        node[last] = draw(VALUES)
    else:
        del node[last]
    return tree
