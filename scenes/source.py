"""Public repositories of recordings.

The environment variable ``MEASURED_DATA`` names a folder of checkouts, one sub-folder a repository,
called like the last part of its name or ``owner+name``.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

DATA = "MEASURED_DATA"


@dataclass(frozen=True)
class Source:
    """A public repository on GitHub at one commit.

    Args:
        repository: ``owner/name``.
        commit: the commit whose files were looked at.
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
        root, (owner, name) = os.environ.get(DATA), self.repository.split("/")
        places = (
            [Path(root).expanduser() / n for n in (name, f"{owner}+{name}")]
            if root
            else []
        )
        return next((place for place in places if place.is_dir()), None)

    def folder(self) -> Path:
        """The checkout.

        Raises:
            FileNotFoundError: it is not there; the message has the command that gets it.
        """
        if place := self.find():
            return place
        raise FileNotFoundError(
            f"scene.source: expected a checkout of github.com/{self.repository}, found none in "
            f"{DATA}={os.environ.get(DATA, '')}; get it by: {self.command()}"
        )

    def command(self) -> str:
        """The git commands that make the checkout."""
        place = f"{os.environ.get(DATA) or f'${DATA}'}/{self.repository.split('/')[1]}"
        clone = f"git clone https://github.com/{self.repository} {place}"
        return f"{clone} && git -C {place} checkout {self.commit}"

    def check(self, root: Path, files: Iterable[str]) -> str:
        """Digest of these files, given relative to the checkout.

        Raises:
            ValueError: their content is not that of ``sha256``.
        """
        names = tuple(sorted(files))
        found = _digest(
            root, names, tuple((root / n).stat().st_mtime_ns for n in names)
        )
        if self.sha256 not in (None, found):
            raise ValueError(
                f"{root}: expected the {len(names)} files of {self.repository} at {self.commit} "
                f"with scene.source.sha256={self.sha256}, found {found}"
            )
        return found


@lru_cache(maxsize=16)
def _digest(root: Path, names: tuple[str, ...], changed: tuple[int, ...]) -> str:
    """SHA-256 over the lines that ``sha256sum`` prints; ``changed`` (ns) dates what is kept."""
    contents = (
        hashlib.sha256((root / name).read_bytes()).hexdigest() for name in names
    )
    lines = (
        f"{content}  {name}\n" for content, name in zip(contents, names, strict=True)
    )
    return hashlib.sha256("".join(lines).encode()).hexdigest()
