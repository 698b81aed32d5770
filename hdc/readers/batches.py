"""Frames of a recording for a model that takes them batch by batch."""

from __future__ import annotations

from itertools import islice

import numpy as np

from hdc.readers.recording import Recording, with_progress


class Batches:
    """Frames [N, H, W] of a recording, decoded as a model asks for one batch after the other.

    A batch lies where the one before it lay: fresh memory for each took a quarter of the time.
    They are read once, from the first to the last.
    """

    def __init__(self, recording: Recording, index: np.ndarray) -> None:
        self._frames = with_progress(recording.stream(index), len(index), "Training")
        self.shape = (len(index), *recording.frame_shape)
        self._batch = np.empty(0)
        self._given = 0

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, batch: slice) -> np.ndarray:
        start, stop, step = batch.indices(len(self))
        if (start, step) != (self._given, 1):
            raise ValueError(
                f"batch: expected one from frame {self._given}, each frame once, found {batch}"
            )
        self._given = stop
        for k, frame in enumerate(islice(self._frames, stop - start)):
            if not len(self._batch):
                self._batch = np.empty((stop - start, *frame.shape), frame.dtype)
            self._batch[k] = frame
        return self._batch[: stop - start]
