"""Films of single touches as a scene: a few frames of each film in which the sensor is pressed.

A data set is a YAML file, such as configs/scene/wedge.yaml. It needs no labelled times: a film
begins untouched, so the sensor is pressed in the frames that differ most from the first one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from hdc import readers
from hdc.parameters import check_integer
from hdc.readers.film import stream_video
from hdc.readers.template import Template
from scenes.frames import Indices, row_numbers
from scenes.source import PublicScene, Source
from scenes.validate import require


class _Film(NamedTuple):
    file: str
    label: str
    group: int
    session: int


class FilmScene(PublicScene):
    """Frames of the films of a public repository.

    The frame that differs most from the first frame of a film is pressed, and so are the frames
    around it whose mean absolute difference from the first frame is at least half as large.

    Args:
        source: the repository, arguments of :class:`scenes.source.Source`.
        sessions: a mapping for each session with its ``folder`` and a ``template`` of file names
            with ``{label}`` and ``{group}``, as :func:`hdc.readers.open_recording` has them.
        labels: the labels that are kept; null: all.
        frames_per_film: frames of a film, evenly spaced over the time in which it is pressed.
        subsample: every n-th pixel on both axes.

    Attributes:
        samples: ``order``, ``group`` (the number of a film among the films of its label and
            session) and ``session``.
        others: see :class:`scenes.source.PublicScene`.

    Raises:
        FileNotFoundError: the repository is not there; the message says how to get it.
        ValueError: its files do not have the digest ``source.sha256``, or a setting does not fit.
    """

    def __init__(
        self,
        source: Mapping[str, Any],
        sessions: Sequence[Mapping[str, str]],
        labels: Sequence[str] | None = None,
        frames_per_film: int = 20,
        subsample: int = 1,
    ) -> None:
        check_integer("scene.frames_per_film", frames_per_film, 1)
        check_integer("scene.subsample", subsample, 1)
        self.source = Source(**source)
        root = self.source.folder()
        films = _films(root, sessions, labels)
        self.sha256 = self.source.check(root, [film.file for film in films])
        self.classes = tuple(sorted({film.label for film in films}))
        self._settings = (self.sha256, frames_per_film, subsample)
        files = tuple(str(root / film.file) for film in films)
        self._images = _pressed(files, frames_per_film, subsample)
        self.shape = (self._images.shape[1], self._images.shape[2])
        film_of = np.repeat(np.arange(len(films)), frames_per_film)
        numbers = np.array([self.classes.index(film.label) for film in films])
        self.labels = numbers[film_of]
        self.samples: Mapping[str, np.ndarray] = {
            "order": np.arange(len(film_of)),
            "group": np.array([film.group for film in films])[film_of],
            "session": np.array([film.session for film in films])[film_of],
        }

    def frames(self, indices: Indices) -> Tensor:
        """Frames uint8 [len(indices), H, W]."""
        return torch.from_numpy(self._images[row_numbers(indices, len(self))])

    def fingerprint(self) -> str:
        """SHA-256 over the files, the settings, classes and labels."""
        digest = hashlib.sha256(repr((self._settings, self.classes)).encode())
        for array in (self.labels, self.samples["group"], self.samples["session"]):
            digest.update(np.ascontiguousarray(array, dtype="<i8").data)
        return digest.hexdigest()


def _films(
    root: Path, sessions: Sequence[Mapping[str, str]], labels: Sequence[str] | None
) -> list[_Film]:
    """The films of each session, in order of their names."""
    found: list[_Film] = []
    for number, session in enumerate(sessions):
        template, before = Template(session["template"]), len(found)
        for path in sorted((root / session["folder"]).iterdir()):
            fields = template.read(path.name)
            if fields and (labels is None or fields["label"] in labels):
                file, label = path.relative_to(root).as_posix(), fields["label"]
                of_label = [film.label == label for film in found[before:]]
                found.append(_Film(file, label, sum(of_label), number))
        expected = f"files like {session['template']} in {root / session['folder']}"
        require(len(found) > before, "scene.sessions", "none", expected)
    return found


@lru_cache(maxsize=2)
def _pressed(files: tuple[str, ...], count: int, subsample: int) -> np.ndarray:
    """Frames of pressed films uint8 [films · count, H, W], kept in this process."""
    window = readers.Window(None, subsample)
    frames = []
    for file in files:
        every = np.stack([frame for _, frame in stream_video(Path(file), window)])
        frames.append(every[pressed(every, count)])
    return np.concatenate(frames)


def pressed(film: np.ndarray, count: int) -> np.ndarray:
    """Numbers [count] of frames of a film [T, H, W] in which the sensor is pressed, in order."""
    changed = np.abs(film.astype(np.float32) - film[0]).mean(axis=(1, 2))
    most = int(changed.argmax())
    too_little = np.flatnonzero(changed < changed[most] / 2)
    first = too_little[too_little < most].max(initial=-1) + 1
    last = too_little[too_little > most].min(initial=len(film)) - 1
    return np.linspace(first, last, count).round().astype(np.int64)
