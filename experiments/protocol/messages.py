"""A user's error in one line: the key, what was expected and what was found."""

from __future__ import annotations

import difflib
import shlex
import traceback
from collections.abc import Sequence

from hydra.errors import (
    HydraException,
    InstantiationException,
    MissingConfigException,
    OverrideParseException,
)
from omegaconf.errors import OmegaConfBaseException

_USER_ERRORS = (ValueError, OSError, HydraException, OmegaConfBaseException)
_LAUNCHERS = ("hydra_plugins", "joblib", "submitit")
# Lines of Hydra's that name nothing of the user's.
_SKIPPED = ("See https:", "object_type=")


def is_users(error: BaseException) -> bool:
    """Whether an error is the user's to mend, or of a launcher: no Slurm, a worker that was ended.
    All others are ours, and have a traceback."""
    if isinstance(error, _USER_ERRORS):
        return True
    raised_in = ""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        raised_in = str(frame.f_globals.get("__name__"))
    return raised_in.partition(".")[0] in _LAUNCHERS


def message(error: BaseException, words: Sequence[str] = ()) -> str:
    """The message of an error, in one line where it is Hydra's.

    Args:
        error: any.
        words: of the command line.
    """
    if isinstance(error, MissingConfigException) and error.options:
        group, _, name = str(error.missing_cfg_file).rpartition("/")
        text = f"{group}: expected one of {', '.join(error.options)}, found {name}"
        meant = difflib.get_close_matches(name, error.options, 1)
        return f"{text}; did you mean {meant[0]}?" if meant else text
    if isinstance(error, InstantiationException):
        return _of_target(error)
    if isinstance(error, OverrideParseException) and "=" in error.override:
        return _of_value(error.override)
    if not isinstance(error, HydraException | OmegaConfBaseException):
        return str(error).strip()
    lines = (line.strip() for line in str(error).splitlines())
    shown = [line for line in lines if line and not line.startswith(_SKIPPED)]
    _, _, lacking = shown[0].partition("Could not override '")
    return _of_key(lacking.partition("'")[0], words) if lacking else ", ".join(shown)


def _of_target(error: InstantiationException) -> str:
    """The key that Hydra could not build, and why."""
    _, _, key = str(error).partition("full_key: ")
    what = key.strip() or "config"
    _, _, target = str(error).partition("locating target '")
    if target:
        found = target.partition("'")[0]
        expected = "the dotted name of a class or a function"
        return f"{what}._target_: expected {expected}, found {found}"
    reason = error.__cause__ or str(error).splitlines()[0]
    return f"{what}: {reason}"


def _of_value(override: str) -> str:
    """How to write a value with characters that Hydra's grammar gives a meaning."""
    key, _, value = override.partition("=")
    inner = value.strip("'\"")
    quoted = shlex.quote(f'{key}="{inner}"')
    return f"{key}: expected a value, in quotes of its own where it has = , ( or spaces: {quoted}"


def _of_key(key: str, words: Sequence[str]) -> str:
    """How to set a key that a config, or one of those in a sweep, does not have."""
    keys = "--cfg job prints its keys"
    given = [word for word in words if word.startswith(f"{key}=")]
    if not given or not {"-m", "--multirun"} & set(words):
        return f"{key}: expected a key of this config; {keys}, +{key}=… adds a new one"
    group, value = key.partition(".")[0], given[-1].partition("=")[2]
    if value.startswith("choice("):
        return f"{key}: expected a {group} that has it; leave the others to a call of their own"
    every = f"for a sweep whose every {group} has it"
    return f"{key}: expected '{key}=choice({value})', {every}; found {value}"
