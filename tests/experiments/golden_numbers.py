"""Numbers that stay as they are until a revision is raised: what they are, and the file of them.

``python -m tests.experiments.golden_numbers`` writes ``golden/numbers.json`` anew. It refuses where
a number has moved and no revision of what made it has: raise the ``revision`` of what you changed
(:mod:`experiments.records.revision`) in the same commit. Without the file all numbers are new.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from experiments.records.revision import revisions
from tests.experiments.golden_items import Item, items

FILE = Path(__file__).parent / "golden" / "numbers.json"


def moved(before: Any, now: Any, tolerance: float) -> str:
    """Where two values differ, in words; empty where they are the same."""
    old, new = dict(leaves(before)), dict(leaves(now))
    if set(old) != set(new):
        return f"has {sorted(set(new) - set(old))}, had {sorted(set(old) - set(new))}"
    for place, value in old.items():
        if not same(value, new[place], tolerance):
            return f"{place} {new[place]}, was {value}".strip()
    return ""


def leaves(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """(place, value) of everything in nested dictionaries and lists."""
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from leaves(part, f"{place} {key}".strip())
    elif isinstance(value, list):
        for k, part in enumerate(value):
            yield from leaves(part, f"{place}[{k}]")
    else:
        yield place, value


def same(before: Any, now: Any, tolerance: float) -> bool:
    """Whether two values are equal, or say nothing."""
    if before is None or now is None:
        return True
    if isinstance(before, float) or isinstance(now, float):
        return abs(before - now) <= tolerance * max(1.0, abs(before))
    return bool(before == now)


def complaint(name: str, item: Item, known: Mapping[str, Any] | None) -> str:
    """What is wrong with a number, in one line; empty where it is as the file has it."""
    write = "python -m tests.experiments.golden_numbers writes the file anew"
    if known is None:
        return f"{name}: a new number: {write}"
    now = revisions(item.config)
    if now != known["revisions"]:
        return f"{name}: a revision is another: {write}"
    made = json.loads(json.dumps(item.make()))
    change = moved(known["value"], made, item.tolerance)
    if not change:
        return ""
    parts = ", ".join(now)
    return (
        f"{name}: a number moved and no revision did ({change}). Raise the revision of what you "
        f"changed, one of {parts}; then {write}"
    )


def read() -> dict[str, Any]:
    """The file; empty where there is none."""
    known: dict[str, Any] = json.loads(FILE.read_text()) if FILE.is_file() else {}
    return known


def write() -> list[str]:
    """Write the file anew, and nothing where a number moved without a revision: those."""
    known, values, refused = read(), {}, []
    for name, item in items().items():
        problem = complaint(name, item, known.get(name))
        if "no revision did" in problem:
            refused.append(problem)
        made = known[name]["value"] if not problem else item.make()
        values[name] = {"revisions": revisions(item.config), "value": made}
    if not refused:
        lines = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in sorted(values.items())]
        FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    return refused


if __name__ == "__main__":
    problems = write()
    sys.exit("\n".join(problems) if problems else 0)
