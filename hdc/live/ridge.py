"""What ridge regression says of the same samples, for comparison: scikit-learn's, if there is one.

It is trained anew on all samples whenever there are others, in a thread of its own that frames do
not wait for; meanwhile the one trained before answers.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

ALPHA = 1.0
"""Strength of the penalty, with pixels from 0 to 1."""


class Ridge:
    """Ridge regression on pixels to the indicator of each class.

    Attributes:
        state: a sentence about it.
        samples: it was trained on.
    """

    def __init__(self) -> None:
        self.state = "not trained yet"
        self.samples = 0
        self._model: Any = None
        self._waiting: tuple[list[np.ndarray], list[str]] | None = None
        self._busy = False
        self._lock = threading.Lock()

    def train(self, frames: Sequence[np.ndarray], labels: Sequence[str]) -> None:
        """Ask for training; the last who asks is served."""
        with self._lock:
            self._waiting = list(frames), list(labels)
            if self._busy:
                return
            self._busy = True
        threading.Thread(target=self._work, daemon=True, name="ridge").start()

    def predict(self, frame: np.ndarray) -> str | None:
        """The label of a frame [H, W]; None: it cannot say."""
        model = self._model
        return None if model is None else str(model.predict(_pixels([frame]))[0])

    def wait(self, seconds: float = 60.0) -> None:
        """Wait until it is trained on all samples that it was given."""
        end = time.monotonic() + seconds
        while self._busy and time.monotonic() < end:
            time.sleep(0.01)

    def _work(self) -> None:
        while True:
            with self._lock:
                if self._waiting is None:
                    self._busy = False
                    return
                (frames, labels), self._waiting = self._waiting, None
            try:
                self._train(frames, labels)
            except Exception:  # the page goes on without it
                logging.getLogger(__name__).exception("ridge")
                self._model, self.state = None, "left out: training failed"

    def _train(self, frames: list[np.ndarray], labels: list[str]) -> None:
        try:
            from sklearn.linear_model import RidgeClassifier
        except ImportError:
            self.state = "left out: scikit-learn is not installed"
            return
        if len(set(labels)) < 2:
            self._model, self.samples, self.state = None, 0, "not trained yet"
            return
        begin = time.perf_counter()
        self._model = RidgeClassifier(alpha=ALPHA).fit(_pixels(frames), labels)
        self.samples = len(labels)
        milliseconds = 1e3 * (time.perf_counter() - begin)
        self.state = f"trained on {len(labels)} samples in {milliseconds:.0f} ms"


def _pixels(frames: Sequence[np.ndarray]) -> np.ndarray:
    stacked = np.stack(frames).reshape(len(frames), -1)
    return stacked.astype(np.float32) / np.float32(np.iinfo(stacked.dtype).max)
