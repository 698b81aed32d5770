"""A config in typed parts: resolved once, at the door; a wrong value is named by its key."""

from __future__ import annotations

import inspect
import math
import pkgutil
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, TypeVar

import msgspec
import torch
from msgspec import Meta
from omegaconf import DictConfig, OmegaConf

from experiments.protocol.stop import StopRule

_T = TypeVar("_T")
_WORDS = {
    "int": "an integer",
    "float": "a number",
    "bool": "true or false",
    "str": "a text",
    "array": "a list",
    "object": "a mapping",
}

Seed = Annotated[
    int,
    Meta(
        ge=0,
        le=2**53,
        description="an integer from 0 to 2^53",
    ),
]


class Seeds(msgspec.Struct, frozen=True):
    """``seed``: one for each thing that is drawn."""

    run: Seed
    sensor: Seed
    samples: Seed
    split: Seed
    pixels: Seed
    init: Seed


class Split(msgspec.Struct, frozen=True):
    """``split``: which samples train and which test; the scene's labels limit the numbers."""

    kind: str
    test_fraction: float
    group: str | None = None
    n_train: int | None = None


class Data(msgspec.Struct, frozen=True):
    """``data``: how many pixels are seen."""

    pixels: int | None = None


class Settings(msgspec.Struct, frozen=True):
    """A config: what is the same for every scene and model is typed, the others are plain."""

    seed: Seeds
    split: Split
    data: Data
    stop: StopRule
    exclusive: bool
    cache: bool
    force: bool
    scene: dict[str, Any]
    model: dict[str, Any]
    device: Any = "cpu"
    threads: Any = None
    task: dict[str, Any] | None = None
    beside: dict[str, dict[str, Any]] = {}


def resolved(cfg: DictConfig) -> dict[str, Any]:
    """A composed config as plain values.

    Raises:
        ValueError: naming the keys that have no value.
    """
    missing = ", ".join(sorted(OmegaConf.missing_keys(cfg)))
    if missing:
        raise ValueError(f"{missing}: expected a value, found none")
    values: Any = OmegaConf.to_container(cfg, resolve=True)
    return values


def settings_of(config: Mapping[str, Any]) -> Settings:
    """A resolved config in typed parts, refused where it can be known to be wrong before anything
    is built.

    Raises:
        ValueError: naming the key, what was expected and what was found.
    """
    settings = checked(config, Settings)
    for group in ("scene", "model"):
        _check_arguments(config[group], group)
    _check_device("device", settings.device)
    _check_device("model.device", settings.model.get("device", "cpu"))
    return settings


def named(task: Mapping[str, Any] | None) -> Callable[..., object] | None:
    """The experiment that ``task`` of a config names; None for a plain run.

    Raises:
        ValueError: if there is none of this name, or what has it is no experiment.
    """
    if task is None:
        return None
    target = str(task.get("_target_"))
    text = f"task._target_: expected the dotted name of an experiment, found {target}"
    try:
        found: Callable[..., object] = pkgutil.resolve_name(target)
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"{text} ({error})") from error
    if not hasattr(found, "rows"):
        raise ValueError(f"{text}; @experiment makes one of a generator of rows")
    return found


def checked(
    values: Any,
    kind: type[_T],
    key: str = "",
) -> _T:
    """Plain values as a typed object.

    Args:
        values: mapping of a resolved config.
        kind: a struct; what a ``Meta`` of a field describes is what the message expects.
        key: where in the config they stand.

    Raises:
        ValueError: naming the key that is wrong, what was expected and what was found.
    """
    for name, value in _leaves(values, key):
        if isinstance(value, float) and math.isnan(value):
            raise ValueError(f"{name}: expected a number, found nan")
    try:
        return msgspec.convert(values, kind)
    except msgspec.ValidationError as error:
        raise ValueError(_message(str(error), values, kind, key)) from error


def _message(
    text: str,
    values: Any,
    kind: Any,
    key: str,
) -> str:
    """An error of msgspec, ``Expected `int` >= 0 - at `$.run```, in our words."""
    problem, _, path = text.partition(" - at `$")
    path, is_inside, _ = path.partition("[")  # of a mapping or a list
    for name in path.strip(".`").split("."):
        if not name:
            continue
        key = f"{key}.{name}".lstrip(".")
        values = values[name]
        kind = typing.get_type_hints(kind, include_extras=True)[name]
    quoted = problem.split("`")
    if problem.startswith("Object missing"):
        return f"{key}.{quoted[1]}: expected a value, found none".lstrip(".")
    if problem.startswith("Object contains unknown"):
        names = ", ".join(typing.get_type_hints(kind))
        return f"{key}.{quoted[1]}: expected one of {names}".lstrip(".")
    if not problem.startswith("Expected"):
        return text  # of a struct itself
    expected = _described(kind, quoted[1])
    if is_inside:
        expected = f"each value to be {expected}"
    return f"{key}: expected {expected}, found {_said(values)}"


def _described(kind: Any, names: str) -> str:
    for choice in (kind, *typing.get_args(kind)):  # itself, or one of a union
        for each in getattr(choice, "__metadata__", ()):
            if isinstance(each, Meta) and each.description:
                return each.description
    return " or ".join(_WORDS.get(name, name) for name in names.split(" | "))


def _said(value: Any) -> str:
    return "null" if value is None else repr(value)


def _check_device(key: str, name: Any) -> None:
    try:
        torch.empty(0, device=torch.device(name)).cpu()
    # Torch raises each of these: of no name, an unknown device, one that is lacking, "meta".
    except (RuntimeError, AssertionError, NotImplementedError, TypeError) as error:
        gpus = [f"cuda:{k}" for k in range(torch.cuda.device_count())]
        there = ", ".join(["cpu", *gpus])
        raise ValueError(f"{key}: expected one of {there}, found {name!r}") from error


def _check_arguments(config: Any, key: str) -> None:
    """Refuse a text where what a ``_target_`` names takes a number: models fail of it late, or not.

    Raises:
        ValueError: naming the key.
    """
    if isinstance(config, Mapping):
        kinds = _argument_types(str(config.get("_target_", "")))
        for name, value in config.items():
            if isinstance(value, str) and name in kinds:
                _check_text(value, kinds[name], f"{key}.{name}")
            _check_arguments(value, f"{key}.{name}")


def _argument_types(target: str) -> dict[str, Any]:
    """Annotations of the arguments of a class or function; of one that cannot be had, none."""
    try:
        part = pkgutil.resolve_name(target)
        call = part.__init__ if inspect.isclass(part) else part
        return typing.get_type_hints(call)
    except (ImportError, AttributeError, ValueError, NameError, TypeError):
        return {}


def _check_text(
    value: str,
    kind: Any,
    key: str,
) -> None:
    try:
        msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        expected = _described(kind, str(error).split("`")[1])
        raise ValueError(f"{key}: expected {expected}, found {value!r}") from error
    except TypeError:  # a type that texts are not compared with
        return


def _leaves(
    node: Any,
    key: str = "",
) -> Iterator[tuple[str, Any]]:
    """(dotted key, value) of everything in a resolved config that is no mapping."""
    if not isinstance(node, Mapping):
        yield key, node
        return
    for name, value in node.items():
        yield from _leaves(value, f"{key}.{name}".lstrip("."))
