"""The thread that takes frames and teaches, and what it shows of them."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from hdc.live.session import Answer, Session

FASTEST = 30.0
"""Frames a second that are worth showing."""
TEST_EVERY = 0.25
"""Seconds between fresh touches while nothing is taught."""
MOST_JOBS = 64

Job = Callable[[Session], Iterator[None] | None]
"""What is to be done with the session; a generator goes on a step a frame."""


@dataclass(frozen=True)
class View:
    """What was last seen.

    Attributes:
        number: of the frame, counted from 1.
        picture: JPEG of the frame and, on its right, its hypervector.
        answer: what the model says, if there is one.
        rate: frames a second.
        busy: something is being taught.
        version: of the prototypes.
        prototypes: JPEG of each class's.
        message: the latest sentence to tell, and its number.
    """

    number: int = 0
    picture: bytes = b""
    answer: Answer | None = None
    rate: float = 0.0
    busy: bool = False
    version: int = -1
    prototypes: dict[str, bytes] = field(default_factory=dict)
    message: tuple[int, str] = (0, "")


class Worker:
    """Runs a session in one thread, which nothing but :meth:`stop` ends.

    Attributes:
        view: replaced, never changed.
    """

    def __init__(self, session: Session) -> None:
        self.session, self.view = session, View()
        self._jobs: queue.Queue[Job] = queue.Queue(MOST_JOBS)
        self._watchers, self._lock = 0, threading.Lock()
        self._wanted, self._stopped = threading.Event(), threading.Event()
        self._doing: Iterator[None] | None = None
        self._times: deque[float] = deque(maxlen=30)
        self._tested = 0.0
        self._thread = threading.Thread(target=self._run, daemon=True, name="sensor")

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopped.set()
        self._wanted.set()
        self._thread.join(10)

    def do(self, job: Job) -> None:
        """Have something done before one of the next frames."""
        try:
            self._jobs.put_nowait(job)
        except queue.Full:
            self.say("Too much at once: wait a moment.")
        self._wanted.set()

    @property
    def waiting(self) -> bool:
        """Whether something was asked for that is not done."""
        return self._doing is not None or not self._jobs.empty()

    def say(self, text: str) -> None:
        """Show a sentence to everybody."""
        with self._lock:
            self.view = replace(self.view, message=(self.view.message[0] + 1, text))

    def watch(self, more: int) -> None:
        """Count those who look: frames are made while there are some."""
        with self._lock:
            self._watchers += more
        self._wanted.set()

    # In the thread -------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._stopped.is_set():
            try:
                self._work()
                if self._watchers:
                    self._look()
                elif self._doing is None and self._jobs.empty():
                    self._wanted.wait()
                    self._wanted.clear()
                    self._times.clear()
            except (ValueError, OSError) as error:
                self._doing = None
                self.say(str(error))
                self._stopped.wait(0.2)  # a camera that is gone stays gone
            except Exception as error:  # nobody's mistake may end the page for the others
                self._doing = None
                logging.getLogger(__name__).exception("the page goes on")
                self.say(f"This went wrong: {type(error).__name__}: {error}")
                self._stopped.wait(0.2)

    def _work(self) -> None:
        """One step of what is being done; else of what waits; else a test now and then."""
        if self._doing is None:
            try:
                while self._doing is None:
                    self._doing = self._jobs.get_nowait()(self.session)
            except queue.Empty:
                pass
        now = time.monotonic()
        if self._doing is not None:
            try:
                next(self._doing)
                self.session.test()
            except StopIteration:
                self._doing = None
        elif self._watchers and now - self._tested > TEST_EVERY:
            self._tested = now
            self.session.test()

    def _look(self) -> None:
        begin = time.perf_counter()
        frame, bits, answer = self.session.look()
        drawn = time.perf_counter()
        picture = jpeg(np.hstack([grey(frame), enlarged(small(bits), frame.shape)]))
        end = self.session.took("picture", drawn)
        version, prototypes = self.session.version, self.view.prototypes
        if version != self.view.version:
            prototypes = {n: jpeg(small(p)) for n, p in self.session.prototypes().items()}
        if self._doing is None:
            time.sleep(max(0.0, 1 / FASTEST - (end - begin)))
        self._times.append(time.perf_counter())
        passed = self._times[-1] - self._times[0]
        with self._lock:
            self.view = View(
                self.view.number + 1,
                picture,
                answer,
                (len(self._times) - 1) / passed if passed else 0.0,
                self._doing is not None,
                version,
                prototypes,
                self.view.message,
            )


def grey(frame: np.ndarray) -> np.ndarray:
    """A frame as uint8."""
    return frame if frame.dtype == np.uint8 else (frame >> 8).astype(np.uint8)


def small(bits: np.ndarray) -> np.ndarray:
    """Bits [H, W] as a grey picture uint8 of half the size: means over 2 × 2 of them."""
    import cv2

    height, width = bits.shape
    size = max(1, width // 2), max(1, height // 2)
    return cv2.resize(bits.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA)


def enlarged(picture: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """A picture in the size (H, W) of another."""
    import cv2

    return cv2.resize(picture, shape[::-1], interpolation=cv2.INTER_NEAREST)


def jpeg(picture: np.ndarray) -> bytes:
    """A grey picture uint8 [H, W] as JPEG."""
    import cv2

    done, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 70])
    assert done
    return encoded.tobytes()
