"""The steps of ``configs/reproduce.yaml``: the command of each, its cost, the claims it serves."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable
from dataclasses import dataclass

from experiments.records import configs

LANES = 2  # steps that run at a time where nothing is timed
_RUN = "experiments.run"
_SHARING = ("threads=1", "exclusive=false")  # how a step shares the machine


@dataclass(frozen=True)
class Step:
    """One command.

    Attributes:
        words: what stands after ``python -m``.
        minutes: about how long it takes from nothing on 2 cores.
        needs: an environment variable that names data of others, without which it is skipped.
        timed: whether it measures times: it has the machine alone. Others run two at a time, with
            one thread each.
        claims: of the paper, to whose evidence its numbers belong.
    """

    name: str
    words: tuple[str, ...]
    minutes: float
    needs: str | None = None
    timed: bool = True
    claims: tuple[str, ...] = ()

    @property
    def all_words(self) -> tuple[str, ...]:
        """Its words, and those that make it share the machine."""
        if self.timed or self.words[0] != _RUN:
            return self.words
        own = (word for word in self.words if word not in _SHARING)
        return (*own, *_SHARING)

    @property
    def command(self) -> str:
        return shlex.join(["python", "-m", *self.all_words])

    @property
    def skipped(self) -> str:
        """Why it cannot run here, in a sentence; empty if it can."""
        if self.needs is None or os.environ.get(self.needs):
            return ""
        return f"skipped: the environment variable {self.needs} names no copy of public data"


def steps(mode: str = "full", claim: str | None = None) -> list[Step]:
    """The steps of ``full`` or ``quick``; of a claim, those that it needs."""
    found = []
    for step in configs.reproduction():
        left_out = step.get("not_quick", ()) if mode == "quick" else ()
        claims = tuple(name for name in step.get("claims", ()) if name not in left_out)
        if mode not in step or (claim is not None and claim not in claims):
            continue
        found.append(
            Step(
                name=step["name"],
                words=tuple(shlex.split(step[mode])),
                minutes=step["minutes"][mode],
                needs=step.get("needs"),
                timed=step.get("timed", True),
                claims=claims,
            )
        )
    return found


def able(found: Iterable[Step]) -> list[Step]:
    """The steps that can run here."""
    return [step for step in found if not step.skipped]


def claims() -> list[str]:
    """The claims that a step serves, in the order of the steps."""
    every = (claim for step in steps() for claim in step.claims)
    return list(dict.fromkeys(every))


def cost_text(found: Iterable[Step]) -> str:
    """The time that steps take together: untimed ones run side by side."""
    minutes = sum(s.minutes if s.timed else s.minutes / LANES for s in found)
    return f"{minutes:.0f} min" if minutes < 90 else f"{minutes / 60:.1f} h"
