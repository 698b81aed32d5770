"""Parts of a config, typed: a wrong value is named by its key before anything is built."""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

import msgspec
import torch
from msgspec import Meta
from omegaconf import DictConfig, OmegaConf

_T = TypeVar("_T")

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
    threads: Any


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
        ValueError: naming the key that is wrong and what was expected.
    """
    try:
        return msgspec.convert(values, kind)
    except msgspec.ValidationError as error:
        problem, _, path = str(error).partition(" - at `$")
        wrong = f"{key}{path.rstrip('`')}".lstrip(".")
        raise ValueError(f"{wrong}: {problem}" if wrong else problem) from error


def check_device(key: str, name: Any) -> None:
    """Refuse a device that is not here.

    Raises:
        ValueError: naming the key.
    """
    try:
        torch.empty(0, device=torch.device(name)).cpu()
    # Torch raises each of these: of no name, an unknown device, one that is lacking, "meta".
    except (RuntimeError, AssertionError, NotImplementedError, TypeError) as error:
        raise ValueError(f"{key}={name}: {error}") from error
