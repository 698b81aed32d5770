"""Calls that may crash, hang or fill the memory, made where that is counted and harms nobody.

A function is called on one argument after another in a child process with a limit on its memory;
when the child dies or says nothing for too long, another goes on with the next argument.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from experiments.measurement import peak_bytes

# Address space is not memory: a thread reserves some 70 MB that it never touches. The limit on it
# only keeps one that is running away from taking the machine with it.
_ADDRESS_SPACE = 8
_START_S = 120


@dataclass(frozen=True)
class Outcome:
    """What became of one call.

    Attributes:
        kind: ``"value"``, ``"error"``, ``"crash"`` or ``"hang"``.
        value: what the function returned, where it did.
        error: name of the exception's type, or how the child ended.
        message: of the exception.
        seconds: that the call took.
        peak_bytes: the most memory the child had held by its end; 0 where it did not live to say.
    """

    kind: str
    value: Any = None
    error: str = ""
    message: str = ""
    seconds: float = 0.0
    peak_bytes: int = 0


def outcomes(
    function: Callable[[Any], Any],
    arguments: Sequence[Any],
    limit_s: float,
    limit_bytes: float,
    preload: Sequence[str] = (),
) -> Iterator[Outcome]:
    """The outcome of each call, in the order of the arguments.

    Args:
        function: of a module, so that the child can find it.
        arguments: each for one call; they and the values travel between processes.
        limit_s: after which a call counts as hanging and is ended.
        limit_bytes: of memory that a call should stay below; it is ended, with a MemoryError or a
            crash, at a multiple of it.
        preload: modules that children find imported.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(preload))
    done = 0
    while done < len(arguments):
        ours, theirs = context.Pipe(duplex=False)
        child = context.Process(
            target=_work, args=(theirs, function, arguments[done:], limit_bytes), daemon=True
        )
        child.start()
        theirs.close()
        try:
            _wait_for(ours)
            while done < len(arguments):
                start = time.perf_counter()
                if not ours.poll(limit_s):
                    yield Outcome("hang", error=f"nothing in {limit_s:g} s", seconds=limit_s)
                    done += 1
                    break
                try:
                    outcome = ours.recv()
                except EOFError:
                    child.join()
                    yield Outcome("crash", error=_end(child.exitcode), seconds=_since(start))
                    done += 1
                    break
                yield outcome
                done += 1
        finally:
            child.kill()
            child.join()
            ours.close()


def _wait_for(pipe: Connection) -> None:
    """Until the child has imported what it needs."""
    try:
        if pipe.poll(_START_S):
            pipe.recv()
            return
    except EOFError:
        pass
    raise RuntimeError(f"expected a child process to start within {_START_S} s, found none")


def _work(
    pipe: Connection, function: Callable[[Any], Any], arguments: Sequence[Any], limit_bytes: float
) -> None:
    most = int(_ADDRESS_SPACE * limit_bytes)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    pipe.send(None)
    # Decoders complain there in thousands of lines; how a call ended is in its outcome.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    for argument in arguments:
        start = time.perf_counter()
        try:
            outcome = Outcome("value", value=function(argument))
        except BaseException as error:  # an extension's panic is no Exception
            outcome = Outcome("error", error=type(error).__name__, message=str(error))
        pipe.send(
            Outcome(
                outcome.kind, outcome.value, outcome.error, outcome.message,
                _since(start), peak_bytes(),
            )
        )  # fmt: skip


def _since(start: float) -> float:
    return time.perf_counter() - start


def _end(code: int | None) -> str:
    return signal.Signals(-code).name if code is not None and code < 0 else f"exit {code}"
