"""An experiment is a task: a struct whose fields are its config, and whose rows are its record."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import msgspec
from rich.console import Console

from experiments.protocol import data
from experiments.protocol.model import instantiate
from experiments.records import store
from experiments.records.console import say
from experiments.records.files import results_dir
from experiments.records.record import Record, name_of
from experiments.records.rows import Row, Rows
from scenes.frames import Scene

_DRAWN = "scenes.sensor."  # scenes that their config determines: no file is read

__all__ = ["Context", "Row", "Task", "named"]


@dataclass(frozen=True, eq=False)
class Context:
    """Console, cache and name for a task; no row depends on them.

    Attributes:
        name: of the experiment, or of the model that is trained.
        cache: keep frames on disk.
        force: make everything again.
        console: shows progress.
        about: the record as it is begun; without it no part is kept.
    """

    name: str = "experiment"
    cache: bool = False
    force: bool = False
    console: Console = field(default_factory=lambda: Console(highlight=False))
    about: Record | None = None

    def note(self, text: str) -> None:
        """Show a line of progress."""
        say(self.console, f"{self.name}: {text}", "dim")

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
        about = self.about
        if self.force or about is None:
            yield from compute()
            return
        folder = results_dir() / "cache" / "parts"
        config = {**about.config, "part": dict(key)}
        name = name_of(self.name, config, about.data)
        made = store.made_before(folder, name, about.revisions)
        if made is None:
            made = msgspec.structs.replace(
                about,
                id=name,
                config=config,
                status="finished",
                rows=Rows.of(compute()),
            )
            store.append(folder, made)
        yield from made.rows.dicts()


class Task(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base class of tasks. ``task._target_`` of a config names one; the other keys are its fields.

    A field that is a scene is built to know its frames; typed parts of a config are in
    :mod:`experiments.protocol.settings`.

    Attributes:
        revision: raised when its rows change.
        uses: dotted names of code that its rows depend on and its config does not name.
        timed: whether its rows have times: such a one runs alone on its cores.
    """

    revision: ClassVar[int] = 1
    uses: ClassVar[tuple[str, ...]] = ()
    timed: ClassVar[bool] = False

    @classmethod
    def components(cls, **_: Any) -> Sequence[str]:
        """Names of the code that its revision depends on (:mod:`experiments.records.revision`)."""
        return cls.uses

    def fingerprint(self) -> str:
        """Digest of the frames of every scene among its fields, a user's own class too."""
        digests = []
        for key in self.__struct_fields__:
            part = getattr(self, key)
            target = str(part.get("_target_", "")) if isinstance(part, Mapping) else ""
            is_scene = target.startswith("scenes.") or (key == "scene" and target)
            if is_scene and not target.startswith(_DRAWN):
                scene = instantiate(part, key)
                if hasattr(scene, "fingerprint"):
                    digests.append(scene.fingerprint())
        return " ".join(digests)

    def rows(self, context: Context) -> Iterator[Row]:
        """Measure, and yield a row at a time."""
        raise NotImplementedError


def named(config: Mapping[str, Any]) -> type[Task]:
    """The task that a part of a config names.

    Raises:
        ValueError: if there is none of this name.
    """
    target = str(config.get("_target_"))
    text = f"task._target_: expected the dotted name of a Task, found {target}"
    try:
        found = pkgutil.resolve_name(target)
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"{text} ({error})") from error
    if not (isinstance(found, type) and issubclass(found, Task)):
        raise ValueError(f"{text}, which is none")
    return found
