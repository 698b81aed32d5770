"""Methods of a model that depend on its parts, and refusal of arguments by an old name."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar

Method = TypeVar("Method", bound=Callable[..., Any])

_WITH = {
    "add": (
        "readout",
        "a read-out that learns batch by batch",
        ", which needs all frames at once; fit anew",
    ),
    "adapt": ("readout", "a read-out that adapts", "; fit anew"),
    "held_out": ("readout", "a read-out with a method held_out", ""),
    "distances": ("readout", "a read-out that counts, such as 'majority'", ""),
    "zero": ("encoder", "an encoder with a reference, such as 'reference'", ""),
}
"""Method of a part → the part, the expected part in words, and advice for the error."""


class UnavailableError(AttributeError, ValueError):
    """A method that a model with these parameters does not have."""


def needs(name: str) -> Callable[[Method], Method]:
    """Decorate a method that exists only if a part of the model has a method `name`.

    Otherwise ``hasattr`` is False, as scikit-learn expects of a method that would always raise, and
    accessing the method raises :class:`UnavailableError` with the reason in one line.
    """

    def decorate(method: Method) -> Method:
        return _Available(method, name)  # type: ignore[return-value]

    return decorate


def renamed(old: str, new: str) -> Callable[[Method], Method]:
    """Decorate a method so that the old name of an argument raises an error with the new one.

    Args:
        old: keyword that is no longer accepted.
        new: what to write instead, in words.
    """

    def decorate(method: Method) -> Method:
        @functools.wraps(method)
        def refusing(*arguments: Any, **named: Any) -> Any:
            if old in named:
                raise TypeError(
                    f"{method.__name__}: expected {new}, found {old!r}, which has left"
                )
            return method(*arguments, **named)

        return refusing  # type: ignore[return-value]

    return decorate


class _Available:
    """The descriptor of :func:`needs`."""

    def __init__(self, method: Callable[..., Any], name: str):
        self.__doc__ = method.__doc__
        self._method = method
        self._name = name

    def __get__(self, owner: Any, kind: type | None = None) -> Any:
        if owner is None:
            return self._method
        part, expected, advice = _WITH[self._name]
        try:
            found = owner._part(part)
        except (TypeError, ValueError) as error:
            raise UnavailableError(f"{self._method.__name__}: {error}") from error
        if getattr(found, self._name, None) is None:
            raise UnavailableError(
                f"{self._method.__name__}: expected {expected}, found {found!r}{advice}"
            )
        return self._method.__get__(owner, kind)
