"""Errors of files and settings that people give; each names the file or the setting."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

LIBRARIES = {
    "cv2": "readers",
    "tifffile": "readers",
    "imagecodecs": "files",
    "av": "files",
    "h5py": "files",
    "scipy": "files",
}
"""Packages that read files, and the extra of this distribution that brings each."""
SHOWN = 12
"""Choices or names that a message lists."""


class BadFrame(ValueError):
    """A frame that cannot be used, and why."""


class SettingError(ValueError):
    """A setting out of range, as ``name: expected …, found …``."""


class Ambiguous(ValueError):
    """Something that has several readings.

    Attributes:
        where: what has them.
        choices: the words of the command line that take each of them.
    """

    def __init__(self, where: object, choices: Sequence[str]) -> None:
        self.where, self.choices = where, tuple(choices)
        shown = "; or ".join(self.choices[:SHOWN])
        rest = len(self.choices) - SHOWN
        more = f"; or {rest} more" if rest > 0 else ""
        super().__init__(f"{where}: expected one of {shown}{more}")


def wrong(setting: str, found: object, expected: str) -> SettingError:
    """The error of a setting."""
    return SettingError(f"{setting}: expected {expected}, found {found!r}")


def missing(error: ModuleNotFoundError) -> ModuleNotFoundError:
    """The error of a package that is not installed, with the extra that brings it."""
    package = (error.name or "").partition(".")[0]
    if package not in LIBRARIES:
        return error
    install = f"pip install 'speckle-hdc[{LIBRARIES[package]}]'"
    text = f"expected the package {package}, found none; {install}"
    return ModuleNotFoundError(text, name=package)


def check_file(path: Path) -> None:
    """Raise a :class:`BadFrame` unless there is a regular file."""
    if not path.is_file():
        raise BadFrame(f"{path}: expected a readable file, found none")


def file_digest(path: Path) -> str:
    """SHA-256 of a file, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
