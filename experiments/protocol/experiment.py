"""Experiments that are more than a run: a generator of typed rows, and everything around it."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.protocol import data
from experiments.records import measurement
from experiments.records.configs import without_display
from experiments.records.measurement import Row, measure
from scenes.frames import Scene

__all__ = ["Row", "Run", "experiment"]


class Run:
    """One call of an experiment: how its rows are made; no row depends on it.

    Args:
        name: name of the measurement.
        config: bound arguments of the experiment, with its ``_target_``.
        device: as torch names it.
        cache: keep frames on disk.
        force: make kept parts again.
        console: shows progress.
    """

    def __init__(
        self,
        name: str = "experiment",
        config: Mapping[str, Any] | None = None,
        device: str = "cpu",
        cache: bool = False,
        force: bool = False,
        console: Console | None = None,
    ):
        self.name, self.config = name, dict(config or {})
        self.device, self.cache, self.force = device, cache, force
        self.console = console or Console(highlight=False)

    def note(self, text: str) -> None:
        """Show a line of progress."""
        self.console.print(
            f"{self.name}: {text}", style="dim", markup=False, soft_wrap=True
        )

    def scene(self, config: Mapping[str, Any], seed: int) -> Scene:
        """The scene of a resolved config at a seed."""
        return data.scene_at(config, seed, self.cache, self.console)

    def scenes(
        self, config: Mapping[str, Any], seeds: Sequence[int]
    ) -> Iterator[tuple[int, Scene]]:
        """(seed, scene) for each seed; frames of a scene are forgotten before the next."""
        for seed in seeds:
            yield seed, self.scene(config, seed)

    def part(
        self, key: Mapping[str, Any], compute: Callable[[], Iterable[Row]]
    ) -> Iterator[Row]:
        """Rows of one part of a long experiment, kept once complete: an interrupted one resumes.

        Args:
            key: tells the part from others of the same experiment and config.
            compute: makes its rows.
        """
        if self.force:
            yield from compute()
        else:
            yield from measurement.part(
                self.name, {**self.config, "part": dict(key)}, compute
            )
        self.note(", ".join(f"{name} {value}" for name, value in key.items()))


def experiment(rows: Callable[..., Iterator[Row]]) -> Callable[..., Path]:
    """Make a Hydra task of a generator of rows; its arguments, defaults included, are its identity.

    The task takes ``name``, ``scene_name``, ``device``, ``cache`` and ``force`` from the runner,
    binds the other arguments to those of the generator, and writes the rows (:func:`measure`). The
    generator itself is its attribute ``rows``.

    Raises:
        ValueError: from the task, for an argument that the generator does not have or lacks.
    """
    signature = inspect.signature(rows)

    @functools.wraps(rows)
    def task(
        *,
        name: str | None = None,
        scene_name: str = "",
        device: str = "cpu",
        cache: bool = True,
        force: bool = False,
        **given: Any,
    ) -> Path:
        try:
            bound = signature.bind(None, **given)
        except TypeError as error:
            known = ", ".join(list(signature.parameters)[1:])
            raise ValueError(
                f"task: expected the keys {known}, found {error}"
            ) from None
        bound.apply_defaults()
        arguments = without_display(dict(list(bound.arguments.items())[1:]))
        config = {"_target_": f"{rows.__module__}.{rows.__name__}", **arguments}
        run = Run(name or rows.__name__, config, device, cache, force)
        compute = functools.partial(rows, run, **arguments)
        return measure(
            run.name,
            config,
            compute,
            scene=scene_name if "scene" in arguments else "",
            device=device,
            force=force,
            console=run.console,
        )

    task.rows = rows  # type: ignore[attr-defined]
    return task
