"""Class and parameters of an encoder or a read-out as JSON, to save and to compare them."""

from __future__ import annotations

import numbers
from collections.abc import Collection, Mapping
from typing import Any

from hdc.parameters import Family, Parametrised, shown


def describe(part: Parametrised, known: Family) -> dict[str, Any]:
    """Class and parameters of a part, including its own parts, as JSON.

    A parameter that JSON cannot hold, such as an array, is replaced by the value in `stand_ins`.

    Raises:
        ValueError: for such a parameter without a value in `stand_ins`.
    """
    parameters = part.get_params(deep=False)
    for name, value in parameters.items():
        if name in part.parts:
            parameters[name] = describe(part.parts[name](value), known)
            continue
        stored = _as_json(value)
        if stored is None and value is not None:
            if name not in part.stand_ins:
                raise ValueError(
                    f"{type(part).__name__}.{name}: expected numbers, text or a list of them, "
                    f"which a file keeps, found {shown(value)}"
                )
            stored = part.stand_ins[name]
        parameters[name] = stored
    return {"class": known.name_of(part), "parameters": parameters}


def _as_json(value: Any) -> Any:
    """A value for JSON: numbers of numpy become Python's, fractions text, other objects None."""
    if isinstance(value, str | int | float | bool | None):
        return value
    if isinstance(value, list | tuple):
        items = [_as_json(item) for item in value]
        return None if None in items else items
    if getattr(value, "shape", None) == ():  # a number of numpy or torch
        return value.item()
    return str(value) if isinstance(value, numbers.Rational) else None


def rebuild(
    description: Mapping[str, Any],
    what: str,
    known: Family,
    trusted: Collection[str] | None = None,
) -> Any:
    """The part of a description by :func:`describe`.

    Args:
        description: from a file, so that it may be anything.
        what: the parameter, for errors.
        known: our own classes by name.
        trusted: dotted names of other classes whose modules may be imported; None allows any that
            another process could import.

    Raises:
        ValueError, TypeError: as a call of :class:`hdc.parameters.Family`.
    """
    name = description["class"]
    if trusted is None and name.startswith("__main__."):
        raise ValueError(
            f"{what}: expected a class in a module to import, found {name!r} of a script"
        )
    if name not in known and trusted is not None and name not in trusted:
        raise ValueError(
            f"{what}: expected one of {', '.join(known)}, or a class that is trusted, found "
            f"{name!r}; to import it: load(path, trusted=[{name!r}]), or --trusted {name}"
        )
    kind = known.find(name, what)
    if not issubclass(kind, Parametrised):
        raise ValueError(f"{what}: expected a part of a model, found {name!r}")
    parameters = kind.of_today(description["parameters"])
    for key in kind.parts:
        inner = parameters[key]
        # A name would be imported, trusted or not.
        if not isinstance(inner, Mapping):
            raise ValueError(f"{key}: expected a part of a model, found {inner!r}")
        parameters[key] = rebuild(inner, key, known, trusted)
    return kind(**parameters)
