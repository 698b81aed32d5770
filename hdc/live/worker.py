"""The thread that takes frames and predicts, and the jobs of the pages between two frames."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from hdc.live.session import Answer, Session

FASTEST = 20.0
"""Frames a second that are taken and shown, of a recording too."""
WATCHED = 2.0
"""Seconds for which frames are taken after a page asked for one."""


@dataclass(frozen=True)
class View:
    """The latest frame and what the model says of it."""

    picture: bytes = b""  # JPEG of the frame and, on its right, its hypervector
    answer: Answer | None = None  # None where the model cannot predict yet
    label: str | None = None  # class of the frame, if the source knows it
    seconds: float = 0.0  # from the frame to the answer
    error: str = ""  # why there is no newer frame


class Worker:
    """Runs a session in one thread until :meth:`stop`; its `view` is replaced for each frame."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.view = View()
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._asked = -WATCHED
        self._thread = threading.Thread(target=self._run, daemon=True, name="sensor")

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join(10)

    def do(self, job: Callable[[Session], Any]) -> Any:
        """Do a job between two frames."""
        with self._lock:
            return job(self.session)

    def picture(self) -> bytes:
        """The latest picture; frames are taken as long as pages ask for it."""
        self._asked = time.monotonic()
        return self.view.picture

    def _run(self) -> None:
        while not self._stopped.is_set():
            begin = time.monotonic()
            if begin - self._asked < WATCHED:
                try:
                    with self._lock:
                        self._look()
                except Exception as error:  # no frame may end the page for everybody
                    self.view = replace(self.view, error=str(error) or repr(error))
            left = 1 / FASTEST - (time.monotonic() - begin)
            self._stopped.wait(max(0.002, left))  # a moment in which a job may begin

    def _look(self) -> None:
        frame, shares, answer, seconds = self.session.look()
        grey = frame if frame.dtype == np.uint8 else (frame >> 8).astype(np.uint8)
        drawn = np.hstack([grey, (255 * shares).astype(np.uint8)])
        _, picture = cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, 70])
        label = self.session.source.label
        self.view = View(picture.tobytes(), answer, label, seconds=seconds)
