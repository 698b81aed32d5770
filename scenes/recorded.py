"""Recorded frames of the user as a scene; :mod:`hdc.readers` describes the formats."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from hdc import readers
from scenes.frames import Indices


class RecordedScene:
    """A :class:`scenes.frames.Scene` of a recording."""

    origin = "recorded"
    revision: ClassVar[int] = 1
    """Raised by hand in the commit that changes the frames it reads."""

    def __init__(self, recording: readers.Recording) -> None:
        if recording.labels is None:
            raise readers.SettingError(
                "path: expected a recording with labels, found values only"
            )
        if len(recording.frame_shape) != 2 or recording.dtype not in (
            np.uint8,
            np.uint16,
        ):
            found = f"{recording.dtype} {recording.frame_shape}"
            raise readers.SettingError(
                f"path: expected images uint8 or uint16 [H, W], found {found}"
            )
        self.recording = recording
        self.classes = recording.classes
        self.labels = recording.labels
        self.shape = recording.frame_shape
        self.samples = recording.samples
        self.values = recording.values

    def __len__(self) -> int:
        return len(self.recording)

    def frames(self, indices: Indices) -> Tensor:
        """Frames uint8 or uint16 [len(indices), H, W]; raises as the recording does."""
        return torch.from_numpy(self.recording.frames(np.asarray(indices)))

    def fingerprint(self) -> str:
        """Digest of the recorded bytes, the pixels kept of them, labels, classes and order."""
        return self.recording.fingerprint()


def open_recording(path: str | Path, **settings: Any) -> RecordedScene:
    """The scene of a recording, opened with the settings of :func:`hdc.readers.open_recording`.

    Raises:
        ValueError: as there; a setting is named as in the configuration, ``scene.crop``.
    """
    try:
        return RecordedScene(readers.open_recording(path, **settings))
    except readers.SettingError as error:
        raise ValueError(f"scene.{error}") from error
    except readers.Ambiguous as error:
        choices = [_as_override(choice) for choice in error.choices]
        raise readers.Ambiguous(error.where, choices) from error


def _as_override(choice: str) -> str:
    """Words of the command ``hdc``, an option or a path, as they are typed for this scene."""
    option, _, value = choice.partition(" ")
    if not option.startswith("--"):
        return f"scene.path={choice}"
    key = option.removeprefix("--").replace("-", "_")
    return f'"+scene.{key}={f"[{value}]" if key == "axes" else value}"'
