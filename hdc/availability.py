"""Methods that a model has or lacks by its encoder and its read-out, and old names of arguments."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar

from hdc.encoders import Encoder, RelativeEncoder, make_encoder
from hdc.estimator import Estimator
from hdc.readouts import Counting, Readout, Updatable, make_readout

Method = TypeVar("Method", bound=Callable[..., Any])


class UnavailableError(AttributeError, ValueError):
    """A method that an object of these parameters does not have."""


def available_unless(reason: Callable[[Any], str | None]) -> Callable[[Method], Method]:
    """A decorator: the method is there only where `reason` of the object is None.

    Elsewhere ``hasattr`` is False, as scikit-learn expects of a method that always raises, and
    asking for the method raises :class:`UnavailableError` with the reason, one line.
    """

    def decorate(method: Method) -> Method:
        return _Available(method, reason)  # type: ignore[return-value]

    return decorate


def renamed(old: str, new: str) -> Callable[[Method], Method]:
    """A decorator: an argument that had another name up to version 2.0 is refused by its new one.

    Args:
        old: keyword that is no longer taken.
        new: what stands for it, in words.
    """

    def decorate(method: Method) -> Method:
        @functools.wraps(method)
        def refusing(*arguments: Any, **named: Any) -> Any:
            if old in named:
                raise TypeError(
                    f"{method.__name__}: expected {new}, found {old!r}, which was of version 2.0"
                )
            return method(*arguments, **named)

        return refusing  # type: ignore[return-value]

    return decorate


class _Available:
    """The descriptor of :func:`available_unless`."""

    def __init__(self, method: Callable[..., Any], reason: Callable[[Any], str | None]):
        self.__doc__ = method.__doc__
        self._method = method
        self._reason = reason

    def __get__(self, owner: Any, kind: type | None = None) -> Any:
        if owner is None:
            return self._method
        reason = self._reason(owner)
        if reason is not None:
            raise UnavailableError(f"{self._method.__name__}: {reason}")
        return self._method.__get__(owner, kind)


# Why a classifier lacks a method; None where it has it -------------------------------------------


def whole_only(model: Estimator) -> str | None:
    """Why a model does not learn batch by batch."""
    readout, wrong = _readout_of(model)
    if isinstance(readout, Updatable):
        return None
    return wrong or (
        f"expected a read-out that learns batch by batch, found {readout!r}, which needs all "
        "frames at once; fit anew"
    )


def without_held_out(model: Estimator) -> str | None:
    """Why a model has no probabilities."""
    readout, wrong = _readout_of(model)
    if readout is None:
        return wrong
    own = type(readout).held_out is not Readout.held_out
    if own or not isinstance(readout, Updatable):
        return None
    return f"expected a read-out with a method held_out, found {readout!r}"


def not_compared(model: Estimator) -> str | None:
    """Why a model has no frames to compare new ones with."""
    readout, _ = _readout_of(model)
    return None if isinstance(readout, Counting) else without_held_out(model)


def fixed(model: Estimator) -> str | None:
    """Why a model does not adapt to labelled frames."""
    readout, wrong = _readout_of(model)
    if hasattr(readout, "adapt"):
        return None
    return wrong or f"expected a read-out that adapts, found {readout!r}; fit anew"


def without_reference(model: Estimator) -> str | None:
    """Why a model has no reference to move."""
    try:
        encoder: Encoder = make_encoder(model.encoder)
    except (TypeError, ValueError) as error:
        return str(error)
    if isinstance(encoder, RelativeEncoder):
        return None
    return (
        f"expected an encoder with a reference, such as 'reference', found {encoder!r}"
    )


def _readout_of(model: Estimator) -> tuple[Readout | None, str | None]:
    """The read-out of a model, or what is wrong with it."""
    try:
        return make_readout(model.readout), None
    except (TypeError, ValueError) as error:
        return None, str(error)
