"""The thread that owns the session: it takes frames, predicts, and does the jobs of the pages."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np

from hdc.live.session import Answer, Session

FASTEST = 30.0
"""Frames a second that are worth showing."""
TEST_EVERY = 0.25
"""Seconds between two fresh touches that test the model."""

Job = Callable[[Session], Any]


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
        self._jobs: queue.Queue[tuple[Job, Future[Any]]] = queue.Queue()
        self._watchers, self._stopped, self._tested = 0, False, 0.0
        self._thread = threading.Thread(target=self._run, daemon=True, name="sensor")

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopped = True
        self.do(lambda session: None)  # wakes the thread
        self._thread.join(10)

    def do(self, job: Job) -> Future[Any]:
        """Do a job before the next frame; the future has its result or its error."""
        future: Future[Any] = Future()
        self._jobs.put((job, future))
        return future

    def watch(self, more: int) -> None:
        """Count open pages: frames are taken while there are some."""

        def count(session: Session) -> None:  # wakes the thread, too
            self._watchers += more

        self.do(count)

    def _run(self) -> None:
        while not self._stopped:
            with suppress(queue.Empty):
                self._work(*self._jobs.get(block=not self._watchers))
            if self._watchers:
                try:
                    self._look()
                except Exception as error:  # no frame may end the page for everybody
                    if not isinstance(error, ValueError | OSError):
                        logging.getLogger(__name__).exception("frame")
                    self.view = replace(self.view, error=str(error) or repr(error))
                    time.sleep(0.2)

        while not self._jobs.empty():
            self._jobs.get()[1].cancel()

    def _work(self, job: Job, future: Future[Any]) -> None:
        self.busy = True
        if future.set_running_or_notify_cancel():  # its page may have been closed
            try:
                future.set_result(job(self.session))
            except Exception as error:  # shown on the page that asked
                future.set_exception(error)
        self.busy = not self._jobs.empty()

    def _look(self) -> None:
        begin, before, session = time.monotonic(), self.view, self.session
        if begin - self._tested > TEST_EVERY:
            self._tested = begin
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
        time.sleep(max(0.0, 1 / FASTEST - (time.monotonic() - begin)))


def _half(bits: np.ndarray) -> np.ndarray:
    """Bits [H, W] as a grey picture uint8 of half the size: means over 2 × 2 of them."""
    height, width = bits.shape
    size = max(1, width // 2), max(1, height // 2)
    return cv2.resize(bits.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA)


def _jpeg(picture: np.ndarray) -> bytes:
    """A grey picture uint8 [H, W] as JPEG."""
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 70])[1].tobytes()
