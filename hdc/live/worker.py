"""The thread that takes frames and predicts, and the jobs of the pages between two frames."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2

from hdc.live.session import Session, View

FASTEST = 20.0
"""Frames a second that are taken and shown, of a recording too."""
WATCHED = 2.0
"""Seconds for which frames are taken after a page asked for one."""


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
        """JPEG of the latest view; frames are taken as long as pages ask for it."""
        self._asked = time.monotonic()
        drawn = self.view.drawn
        if drawn is None:
            return b""
        _, picture = cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, 70])
        return picture.tobytes()

    def _run(self) -> None:
        while not self._stopped.is_set():
            begin = time.monotonic()
            if begin - self._asked < WATCHED:
                try:
                    with self._lock:
                        self.view = self.session.look()
                except Exception as error:  # no frame may end the page for everybody
                    self.view = replace(self.view, error=str(error) or repr(error))
            left = 1 / FASTEST - (time.monotonic() - begin)
            self._stopped.wait(max(0.002, left))  # a moment in which a job may begin
