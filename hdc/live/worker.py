"""The thread that takes frames and predicts, and the jobs of the pages between two frames."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeVar

import cv2
import numpy as np

from hdc.live.session import Answer, Session

FASTEST = 30.0
"""Frames a second that are worth showing."""
TEST_EVERY = 0.25
"""Seconds between two fresh touches that test the model."""

T = TypeVar("T")


@dataclass(frozen=True)
class View:
    """The latest frame and what the model says of it."""

    number: int = 0  # of frames so far
    picture: bytes = b""  # JPEG of the frame and, on its right, its hypervector
    answer: Answer | None = None  # None where the model cannot predict yet
    label: str | None = None  # class of the frame, if the source knows it
    error: str = ""  # why there is no newer frame
    version: int = -1  # of the prototypes
    prototypes: dict[str, bytes] = field(default_factory=dict)  # JPEG of each class's


class Worker:
    """Runs a session in one thread until :meth:`stop`.

    Attributes:
        view: replaced for each frame.
        busy: a job is being done.
    """

    def __init__(self, session: Session) -> None:
        self.session, self.view, self.busy = session, View(), False
        self.watchers = 0  # open pages: frames are taken while there are some
        self._lock, self._stopped, self._tested = threading.Lock(), threading.Event(), 0.0
        self._thread = threading.Thread(target=self._run, daemon=True, name="sensor")

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join(10)

    def do(self, job: Callable[[Session], T]) -> T:
        """Do a job between two frames."""
        with self._lock:
            self.busy = True
            try:
                return job(self.session)
            finally:
                self.busy = False

    def _run(self) -> None:
        while not self._stopped.is_set():
            begin = time.monotonic()
            if self.watchers:
                try:
                    with self._lock:
                        self._look()
                except Exception as error:  # no frame may end the page for everybody
                    if not isinstance(error, ValueError | OSError):
                        logging.getLogger(__name__).exception("frame")
                    self.view = replace(self.view, error=str(error) or repr(error))
            # At least a moment in which a job may begin.
            self._stopped.wait(max(0.002, 1 / FASTEST - (time.monotonic() - begin)))

    def _look(self) -> None:
        before, session = self.view, self.session
        if time.monotonic() - self._tested > TEST_EVERY:
            self._tested = time.monotonic()
            session.test()
        frame, hypervector, answer = session.look()
        prototypes = before.prototypes
        if session.version != before.version:
            prototypes = {name: _jpeg(_half(p)) for name, p in session.prototypes().items()}
        grey = frame if frame.dtype == np.uint8 else (frame >> 8).astype(np.uint8)
        drawn = cv2.resize(_half(hypervector), grey.shape[::-1], interpolation=cv2.INTER_NEAREST)
        picture, label = _jpeg(np.hstack([grey, drawn])), session.source.label
        number = before.number + 1
        self.view = View(number, picture, answer, label, "", session.version, prototypes)


def _half(bits: np.ndarray) -> np.ndarray:
    """Bits [H, W] as a grey picture uint8 of half the size: means over 2 × 2 of them."""
    height, width = bits.shape
    size = max(1, width // 2), max(1, height // 2)
    return cv2.resize(bits.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA)


def _jpeg(picture: np.ndarray) -> bytes:
    """A grey picture uint8 [H, W] as JPEG."""
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 70])[1].tobytes()
