"""Public repositories of data sets.

Public data are read only from the folder that the environment variable ``MEASURED_DATA`` names. It
has one sub-folder per repository, with the repository's name or ``owner+name``.
"""

from __future__ import annotations

import hashlib
import os
import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

import numpy as np

DATA = "MEASURED_DATA"


@dataclass(frozen=True)
class Source:
    """A public repository on GitHub at one commit.

    Args:
        repository: ``owner/name``.
        commit: the commit whose files were used.
        cite: authors, title and place of what to cite.
        licence: as stated by the repository, or ``"none stated"``: then frames may be used to
            judge a model, and must not be passed on.
        sha256: digest of what ``sha256sum`` prints of the files that a scene reads, in order of
            their names; null: not checked.
    """

    repository: str
    commit: str
    cite: str
    licence: str = "none stated"
    sha256: str | None = None

    def find(self) -> Path | None:
        """The checkout in the folder that ``MEASURED_DATA`` names, if it is there."""
        root = os.environ.get(DATA)
        if not root:
            return None
        owner, name = self.repository.split("/")
        for folder in (name, f"{owner}+{name}"):
            place = Path(root).expanduser() / folder
            if place.is_dir():
                return place
        return None

    def folder(self) -> Path:
        """The checkout.

        Raises:
            FileNotFoundError: it is not there; the message has the command that gets it.
        """
        place = self.find()
        if place is None:
            root = os.environ.get(DATA, "the variable not set")
            raise FileNotFoundError(
                f"{DATA}: expected a folder with a checkout of github.com/{self.repository}, found "
                f"{root}; export {DATA}=FOLDER, then: {self.command()}"
            )
        return place

    def command(self) -> str:
        """The git commands that make the checkout; they fail where ``MEASURED_DATA`` is not set."""
        name = self.repository.split("/")[1]
        root = os.environ.get(DATA)
        # ${X:?} ends the command where X is not set: nothing is cloned into the root folder.
        place = shlex.quote(f"{root}/{name}") if root else f'"${{{DATA}:?}}/{name}"'
        clone = f"git clone https://github.com/{self.repository} {place}"
        return f"{clone} && git -C {place} checkout {self.commit}"

    def check(self, root: Path, files: Iterable[str]) -> str:
        """Digest of these files, given relative to the checkout.

        Raises:
            ValueError: their content is not that of ``sha256``.
        """
        names = tuple(sorted(files))
        changed = tuple((root / name).stat().st_mtime_ns for name in names)
        found = _digest(root, names, changed)
        if self.sha256 not in (None, found):
            raise ValueError(
                f"{root}: expected the {len(names)} files of {self.repository} at {self.commit} "
                f"with scene.source.sha256={self.sha256}, found {found}"
            )
        return found


class PublicScene:
    """A scene of frames that a camera took, read from a public repository.

    Attributes:
        source: the repository.
        sha256: digest of the files that are read.
        others: see :class:`scenes.frames.Scene`.
    """

    origin = "measured"
    revision: ClassVar[int] = 1
    """Raised by hand, in the subclass whose frames a commit changes."""
    cacheable = False
    source: Source
    sha256: str
    labels: np.ndarray

    def __len__(self) -> int:
        return len(self.labels)


@lru_cache(maxsize=16)
def _digest(
    root: Path,
    names: tuple[str, ...],
    changed: tuple[int, ...],
) -> str:
    """SHA-256 over the lines that ``sha256sum`` prints; ``changed`` (ns) dates what is kept."""
    whole = hashlib.sha256()
    for name in names:
        content = hashlib.sha256((root / name).read_bytes()).hexdigest()
        whole.update(f"{content}  {name}\n".encode())
    return whole.hexdigest()
