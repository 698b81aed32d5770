"""Parameters by name, nested as in scikit-learn, for estimators and their parts.

The parameters of a class are the arguments of ``__init__``, which only assigns them. A parameter
such as ``encoder`` that is a part with its own parameters may be an object or the name of a class;
its parameters are ``encoder__ties`` and so on.
"""

from __future__ import annotations

import copy
import importlib
import inspect
import math
import numbers
import pkgutil
from collections import UserDict
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, ClassVar, Self


class Parametrised:
    """Base class of objects with parameters; `parts` names those that have parameters, too."""

    parts: ClassVar[Mapping[str, Callable[[Any], Any]]] = {}
    """Parameter → function that makes the part from a name or an object."""
    stand_ins: ClassVar[Mapping[str, str]] = {}
    """Parameter → what a file holds instead of a value that is no JSON, such as an array."""
    renamed: ClassVar[Mapping[str, str]] = {}
    """Name of a parameter in files of an earlier version → its current name."""

    @classmethod
    def of_today(cls, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Parameters from a file of this or an earlier version, by their current names."""
        return {
            cls.renamed.get(name, name): value for name, value in parameters.items()
        }

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Parameters by name; if `deep`, also the parameters of parts, as ``part__name``."""
        names = inspect.signature(type(self)).parameters
        found = {name: getattr(self, name) for name in names}
        if deep:
            for name, make in self.parts.items():
                inner = make(found[name]).get_params()
                found |= {f"{name}__{key}": value for key, value in inner.items()}
        return found

    def set_params(self, **params: Any) -> Self:
        """Set parameters by name; ``part__name`` sets a parameter of a part.

        Raises:
            ValueError: for an unknown name.
        """
        for name, value in sorted(params.items(), key=lambda item: "__" in item[0]):
            part, _, inner = name.partition("__")
            known = self.get_params(deep=bool(inner))
            if name not in known:
                raise ValueError(f"set_params: {not_among(name, known)}")
            if inner:
                chosen = copy.copy(self.parts[part](getattr(self, part)))
                setattr(self, part, chosen.set_params(**{inner: value}))
            else:
                setattr(self, part, value)
        return self

    def unlearned(self) -> Self:
        """An untrained copy with the same parameters, whose parts are copies, too."""
        parameters = self.get_params(deep=False)
        for name in self.parts:
            if isinstance(parameters[name], Parametrised):
                parameters[name] = parameters[name].unlearned()
        return type(self)(**parameters)

    def fresh(self, name: str) -> Any:
        """A new untrained part from a parameter, checked."""
        given = getattr(self, name)
        part = self.parts[name](given)
        if part is given:
            part = part.unlearned()
        part.check()
        return part

    def __repr__(self) -> str:
        parameters = self.get_params(deep=False).items()
        listed = ", ".join(f"{name}={shown(value)}" for name, value in parameters)
        return f"{type(self).__name__}({listed})"


class Part(Parametrised):
    """Base class of encoders and read-outs, the parts of a model."""

    revision: ClassVar[int] = 1
    """Incremented by hand in a commit that changes the result for some frame or query."""

    def check(self) -> None:
        """Raise ValueError for a parameter that is not allowed."""


class Family(UserDict[str, Any]):
    """Our own classes of one kind of part by name, each imported when it is used; makes parts.

    Args:
        what: the parameter, for errors.
        base: required base class.
        classes: name → dotted name.
    """

    def __init__(self, what: str, base: type, classes: Mapping[str, str]):
        super().__init__(classes)
        self.what = what
        self.base = base

    def __getitem__(self, name: str) -> Any:
        return pkgutil.resolve_name(self.data[name])

    def __call__(self, part: Any, what: str = "") -> Any:
        """A part of a model from a name or an object.

        Args:
            part: an object; one of our names; or the dotted name of a class, ``"module.Class"``.
            what: the parameter, for errors, if it is another one.

        Raises:
            ValueError: for a name that is not known, or a module that cannot be imported.
            TypeError: for a class in place of an object, or an object of another kind.
        """
        what = what or self.what
        kind = self.find(part, what) if isinstance(part, str) else type(part)
        if not issubclass(kind, self.base):
            base = f"{self.base.__module__}.{self.base.__name__}"
            expected = f"one of {', '.join(self)}, or an object of {base}"
            raise TypeError(f"{what}: expected {expected}, found {part!r}")
        return kind() if isinstance(part, str) else part

    def find(self, name: str, what: str) -> type:
        """The class by one of our names or a dotted name; raises as a call."""
        if name in self:
            ours: type = self[name]
            return ours
        module, _, attribute = name.rpartition(".")
        if not module:
            dotted = "or a dotted name such as 'module.Class'"
            raise ValueError(f"{what}: {not_among(name, self, dotted)}")
        try:
            found = getattr(importlib.import_module(module), attribute)
        except (ImportError, AttributeError) as error:
            raise ValueError(
                f"{what}: expected a class {name!r}, found: {error}"
            ) from error
        if not isinstance(found, type):
            raise ValueError(f"{what}: expected a class, found {name!r}, which is none")
        return found

    def name_of(self, part: object) -> str:
        """Name by which :meth:`find` finds an object's class; dotted unless it is ours."""
        kind = type(part)
        path = f"{kind.__module__}.{kind.__qualname__}"
        return next((name for name, ours in self.data.items() if ours == path), path)

    def attribute(self, module: str, wanted: str) -> Any:
        """The class with this name, for the ``__getattr__`` of a module."""
        for name, path in self.data.items():
            if path.endswith(f".{wanted}"):
                return self[name]
        raise AttributeError(f"module {module!r} has no attribute {wanted!r}")


def check_choice(name: str, value: Any, choices: Collection[Any]) -> None:
    """Raise ValueError, listing the choices, for another value."""
    if value not in list(choices):  # values may not be hashable
        raise ValueError(f"{name}: {not_among(value, choices)}")


def not_among(value: Any, choices: Iterable[Any], others: str = "") -> str:
    """Text of an error: the expected and the found value.

    Args:
        value: found value.
        choices: expected values.
        others: other possibilities, in words.
    """
    expected = f"expected one of {', '.join(map(str, choices))}"
    if others:
        expected += f", {others}"
    return f"{expected}, found {value!r}"


def check_integer(
    name: str, value: Any, least: float = -math.inf, most: float = math.inf
) -> None:
    """Raise ValueError unless a parameter is an integer in a range."""
    whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
    if whole and least <= value <= most:
        return
    expected = "an integer"
    if most < math.inf:
        expected += f" from {least} to {most}"
    elif least > -math.inf:
        expected += f" ≥ {least}"
    raise ValueError(f"{name}: expected {expected}, found {value!r}")


def is_number(value: Any) -> bool:
    """Whether a value is a real, finite number, and not a bool."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return False
    return math.isfinite(value)


def check_share(name: str, value: Any, interval: str) -> float:
    """A parameter as a float; ValueError if it is not in an interval.

    Args:
        name: name of the parameter.
        value: its value.
        interval: ``"[0, 1]"``, ``"[0, 1)"`` or ``"(0, 1)"``.
    """
    inside = is_number(value) and 0 <= value <= 1
    outside = {"[0, 1]": (), "[0, 1)": (1,), "(0, 1)": (0, 1)}[interval]
    if not inside or value in outside:
        raise ValueError(f"{name}: expected a share in {interval}, found {value!r}")
    return float(value)


def shown(value: Any) -> str:
    """Text of a parameter in one line, of an array its shape."""
    shape = getattr(value, "shape", ())
    if shape == ():
        return repr(value)
    return f"<{type(value).__name__} of shape {tuple(shape)}>"
