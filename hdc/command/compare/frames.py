"""Frames in memory, and which of them are learnt, chosen by and tested on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch

from hdc.bank import Bank
from hdc.command.holdout import hold_out, labels_or_zeros, split, split_groups
from hdc.readers import Recording
from hdc.readers.recording import with_progress
from hdc.selection import Frames

PIXELS = ("raw", "standardised")
"""Input of the baselines: grey values, raw or standardised per frame."""
_COLUMNS = 2**13  # pixels that are made floats at a time


class FrameBank(Bank):
    """A bank of frames of any real type, with products of their greys in floating point.

    Args:
        frames: [N, H, W] or [N, D].
        labels: class indices int64 [N].
        n_classes: L.
    """

    def __init__(self, frames: np.ndarray, labels: np.ndarray, n_classes: int) -> None:
        super().__init__(torch.from_numpy(frames), labels, n_classes)
        self.coordinates: dict[str, tuple[bytes, tuple[np.ndarray, np.ndarray]]] = {}

    def products(self, pixels: str) -> np.ndarray:
        """Inner products float64 [N, N] of frames less the mean of all, by one of PIXELS."""
        return self._raw if pixels == "raw" else self._standardised_products

    @cached_property
    def _raw(self) -> np.ndarray:
        n = len(self)
        return self._sum(np.zeros((n, 1)), np.ones((n, 1)))

    @cached_property
    def _standardised_products(self) -> np.ndarray:
        flat = self.frames.flatten(1).numpy()
        means = np.empty((len(flat), 1))
        deviations = np.empty((len(flat), 1))
        for i, frame in enumerate(flat):
            means[i] = frame.mean(dtype=np.float64)
            deviations[i] = frame.std(dtype=np.float64)
        deviations[deviations == 0] = 1
        return self._sum(means, deviations)

    def _sum(self, offsets: np.ndarray, scales: np.ndarray) -> np.ndarray:
        flat = self.frames.flatten(1).numpy()
        total = np.zeros((len(flat), len(flat)))
        for start in range(0, self.dimension, _COLUMNS):
            block = (flat[:, start : start + _COLUMNS] - offsets) / scales
            block = block - block.mean(axis=0)
            total += block @ block.T
        return total


@dataclass(frozen=True)
class Parts:
    """Indices of frames, each increasing.

    Attributes:
        chosen_on: what models are chosen by; learnt for the test at random, too.
        random: held out of the earlier frames at random.
        earlier: all that may be learnt for the test on later frames.
        later: frames of later sessions, of another recording, or the last of each class.
        later_name: which of these.
    """

    chosen_on: np.ndarray
    random: np.ndarray
    earlier: np.ndarray
    later: np.ndarray
    later_name: str

    def tests(self) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """Name, training frames and test frames; the last is the test that counts."""
        yield "at random", self.chosen_on, self.random
        yield self.later_name, self.earlier, self.later


def read_frames(
    recording: Recording,
    other: Recording | None = None,
    rows: np.ndarray | None = None,
) -> Frames:
    """Decode a recording, and another after it, into memory.

    Args:
        recording: of classes or of values.
        other: of the same classes or values.
        rows: indices of the frames of `recording` that are wanted; by default all.

    Raises:
        ValueError: the other has classes, values or frames that the first has not.
    """
    if rows is None:
        rows = np.arange(len(recording))
    parts = [(recording, rows)]
    session = None if recording.session is None else recording.session[rows]
    group = _groups(recording, rows)
    if other is not None:
        _check_alike(recording, other)
        parts.append((other, np.arange(len(other))))
        session, group = (_followed(own, len(other)) for own in (session, group))
    total = sum(len(index) for _, index in parts)
    stream = (frame for source, index in parts for frame in source.stream(index))
    images = np.stack(list(with_progress(stream, total, "Reading")))
    if recording.values is not None:
        bank = FrameBank(images, np.zeros(total, np.int64), 1)
        names, units = recording.value_names, recording.value_units
        return Frames(bank, names, units, session, _values(parts), group=group)
    known, labels = _classes(recording, parts)
    bank = FrameBank(images, labels, len(known))
    return Frames(bank, known, (), session, None, group=group)


def _followed(numbers: np.ndarray | None, n: int) -> np.ndarray | None:
    """Sessions or groups of the first recording, and −1 for n frames of another, which has its
    own."""
    return None if numbers is None else np.concatenate([numbers, np.full(n, -1)])


def _groups(recording: Recording, rows: np.ndarray) -> np.ndarray | None:
    """Numbers of the groups of some frames, int64 [N]; None where none are known."""
    if recording.group is None:
        return None
    _, numbers = np.unique(recording.group[rows], return_inverse=True)
    return numbers


Part = tuple[Recording, np.ndarray]
"""A recording, and the indices of those of its frames that are read."""


def _values(parts: Sequence[Part]) -> np.ndarray:
    """Values float64 [N, T] of the frames of some recordings."""
    found = []
    for source, index in parts:
        assert source.values is not None
        found.append(source.values[index])
    return np.concatenate(found)


def _classes(
    recording: Recording, parts: Sequence[Part]
) -> tuple[tuple[str, ...], np.ndarray]:
    """The classes that occur, in the order of the recording, and which each frame is of [N]."""
    texts: list[str] = []
    for source, index in parts:
        texts += np.array(source.names)[index].tolist()
    here = set(texts)
    known = tuple(name for name in recording.classes if name in here)
    row = {name: number for number, name in enumerate(known)}
    return known, np.array([row[text] for text in texts])


def _check_alike(recording: Recording, other: Recording) -> None:
    first = (recording.frame_shape, recording.dtype)
    second = (other.frame_shape, other.dtype)
    if first != second:
        raise ValueError(
            f"--test: expected frames {recording.frame_shape} {recording.dtype} as in the first "
            f"recording, found {other.frame_shape} {other.dtype}"
        )
    if recording.values is not None:
        if other.values is None or other.value_names != recording.value_names:
            expected = ", ".join(recording.value_names)
            found = ", ".join(other.value_names) or "none"
            raise ValueError(f"--test: expected values {expected}, found {found}")
        return
    known = set(recording.names)
    if unknown := sorted(set(other.names) - known):
        listed = ", ".join(name for name in recording.classes if name in known)
        raise ValueError(f"--test: expected classes among {listed}, found {unknown[0]}")


def part(recording: Recording, other: Recording | None, fraction: float) -> Parts:
    """Which frames are learnt and which are tested.

    Of one recording the last sessions are later, else whole groups where they are known, else the
    last frames of each class (of all, where values are learnt) in the order of recording. A
    `fraction` of the earlier ones is held out at random, by whole groups where they are known.

    Raises:
        ValueError: a class has too few frames.
    """
    labels = labels_or_zeros(recording)
    if other is not None:
        n = len(recording)
        earlier, later = np.arange(n), np.arange(n, n + len(other))
        name = "the other recording"
    else:
        earlier, later, how = hold_out(recording, fraction, by_order=True)
        name = how.removeprefix("in ")
    if recording.group is not None:
        group = recording.group[earlier]
        inner, held_out = split_groups(labels[earlier], group, fraction, 1)
    else:
        inner, held_out = split(labels[earlier], fraction, 0)
    return Parts(earlier[inner], earlier[held_out], earlier, later, name)
