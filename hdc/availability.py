"""Methods of a model that depend on its parts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class UnavailableError(AttributeError, ValueError):
    """A method that a model with these parameters does not have."""


class needs:
    """Decorator of a method that exists only if a part of the model has a method `name`.

    Otherwise ``hasattr`` is False, as scikit-learn expects of a method that would always raise, and
    accessing the method raises :class:`UnavailableError` with the reason in one line.

    Args:
        part: ``"encoder"`` or ``"readout"``.
        name: method of the part.
        expected: the expected part in words.
    """

    def __init__(self, part: str, name: str, expected: str):
        self._needed = part, name, expected

    def __call__(self, method: Callable[..., Any]) -> Any:
        self._method = method
        self.__doc__ = method.__doc__
        return self

    def __get__(self, owner: Any, kind: type | None = None) -> Any:
        if owner is None:
            return self._method
        part, name, expected = self._needed
        found = owner.parts[part](getattr(owner, part))
        if getattr(found, name, None) is None:
            raise UnavailableError(
                f"{self._method.__name__}: expected {expected}, found {found!r}"
            )
        return self._method.__get__(owner, kind)
