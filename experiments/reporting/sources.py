"""What the functions of a study take: all results, or the rows of measurements on one scene."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.text import counted, frames_of

Of = str | Sequence[str] | None


@dataclass(frozen=True)
class Source:
    """Arguments of a registered function, and the suffix of its answer's name."""

    arguments: tuple[Any, ...]
    suffix: str = ""
    commands: tuple[str, ...] = ()
    measured: Measured | None = None

    def fill(self, text: str) -> str:
        """A text with the frames and the machine of the measurement put in."""
        if self.measured is None:
            return text
        env = self.measured.record.environment
        parts = [env.cpu, counted(env.threads, "thread")]
        if env.device not in (None, "cpu"):
            parts.insert(0, env.device)
        text = text.replace("{frames}", frames_of(self.measured.rows))
        return text.replace("{machine}", ", ".join(parts))


def sources(results: Results, of: Of) -> Iterator[Source]:
    """What a function takes that was registered for these measurements, once for each scene."""
    if of is None:
        if results:
            yield Source((results,))
        return
    names = [of] if isinstance(of, str) else list(of)
    for suffix, first in with_places(results, names[0]):
        every = [first]
        for name in names[1:]:
            found = _on_the_same_scene(results, name, first)
            if found is not None:
                every.append(found)
        if len(every) < len(names):
            continue
        commands = dict.fromkeys(one.record.command for one in every)
        frames = [one.frame for one in every]
        arguments = (*frames, first.record.config)
        yield Source(arguments, suffix, tuple(commands), first)


def _on_the_same_scene(results: Results, name: str, other: Measured) -> Measured | None:
    """The first measurement of that name on the frames of another."""
    scene = other.record.config.get("scene")
    for _, measured in with_places(results, name):
        if measured.record.config.get("scene") == scene:
            return measured
    return None


def with_places(results: Results, name: str) -> Iterator[tuple[str, Measured]]:
    """The measurement on the experiment's own frames, then those on others, each with the suffix
    of the names of its tables and figures."""
    suffixes: set[str] = set()
    if (measured := results.measured(name)) is not None:
        yield "", measured
    for measured in results.measurements:
        if measured.record.name != name or not measured.of_other_frames:
            continue
        suffix = f"_{measured.record.scene or measured.folder.name}"
        if suffix in suffixes:  # the same scene with other settings
            suffix = f"_{measured.folder.name}"
        suffixes.add(suffix)
        yield suffix, measured
