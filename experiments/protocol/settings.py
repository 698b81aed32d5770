"""Parts of a config, typed: a wrong value is named by its key before anything is built."""

from __future__ import annotations

import re
from typing import Annotated, Any, TypeVar

import msgspec
import torch
from msgspec import Meta
from omegaconf import DictConfig, OmegaConf

_T = TypeVar("_T")
# How messages call the types of msgspec.
_WORDS = {
    "int": "an integer",
    "float": "a number",
    "bool": "true or false",
    "str": "a text",
    "array": "a list",
    "object": "a mapping",
}

Seed = Annotated[int, Meta(ge=0, le=2**53)]


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


class Carried(msgspec.Struct, frozen=True):
    """How a task is carried out, whatever it is."""

    exclusive: bool
    cache: bool
    force: bool
    device: Any


def resolved(cfg: DictConfig) -> dict[str, Any]:
    """A composed config as plain values.

    Raises:
        MissingMandatoryValue: naming a key that has no value.
    """
    values: Any = OmegaConf.to_container(cfg, resolve=True, throw_on_missing=True)
    return values


def checked(values: Any, kind: type[_T], key: str = "") -> _T:
    """Plain values as a typed object.

    Args:
        values: mapping of a resolved config.
        kind: a struct.
        key: where in the config they stand.

    Raises:
        ValueError: naming the key that is wrong, what was expected and what was found.
    """
    try:
        return msgspec.convert(values, kind)
    except msgspec.ValidationError as error:
        raise ValueError(_message(str(error), values, key)) from error


def _message(text: str, values: Any, key: str) -> str:
    """An error of msgspec, ``Expected `int` >= 0 - at `$.run```, in our words."""
    problem, _, path = text.partition(" - at `$")
    known, some, within = path.strip("`").partition("[...]")
    for name in re.findall(r"\w+", known):
        key = f"{key}.{name}".lstrip(".")
        values = values[int(name) if isinstance(values, list) else name]
    if some:  # value of a mapping: msgspec does not say which
        key += f".*{within}"
    start, _, named = problem.partition(" field ")
    named = f"{key}.{named.strip('`')}".lstrip(".")
    if start == "Object missing required":
        return f"{named}: expected a value, found none"
    if start == "Object contains unknown":
        return f"{named}: expected no such key"
    if not problem.startswith("Expected"):
        return problem  # of a struct itself
    found = "null" if values is None else repr(values)
    return f"{key}: {_expected(problem)}, found {found}"


def _expected(problem: str) -> str:
    """``expected an integer >= 0`` of msgspec's ``Expected `int` >= 0, got `str```."""
    words = problem.partition(", got")[0].replace("`", "").replace("|", "or").split()
    return " ".join(_WORDS.get(word, word) for word in ["expected", *words[1:]])


def check_device(key: str, name: Any) -> None:
    """Refuse a device that is not here.

    Raises:
        ValueError: naming the key.
    """
    try:
        torch.empty(0, device=torch.device(name)).cpu()
    # Torch raises each of these: of no name, an unknown device, one that is lacking, "meta".
    except (RuntimeError, AssertionError, NotImplementedError, TypeError) as error:
        expected = f"cpu, or one of {torch.cuda.device_count()} GPUs such as cuda:0"
        raise ValueError(f"{key}: expected {expected}, found {name!r}") from error
