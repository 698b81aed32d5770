"""Tables and figures of every study for one set of results, each made when it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from experiments.records.record import Record
from experiments.records.results import RUNS, Results
from experiments.reporting import comparison
from experiments.reporting.columns import Column
from experiments.reporting.study import Figure, Quantity, Study
from experiments.reporting.table import Table, frame, text_for
from experiments.reporting.text import number
from hdc.io import write_atomically

MINE = "mine"
COMPARISON = comparison.NAME
_SHOWN_OF_RUNS = (
    *("id", "scene", "model", "overrides", "seed", "status"),
    *("test_accuracy_final", "training_s"),
)


@dataclass(frozen=True)
class Failure:
    """A table, figure or number of a study that could not be made, and why."""

    study: str
    called: str
    error: Exception

    def __str__(self) -> str:
        """One line."""
        text = " ".join(str(self.error).split())
        kind = type(self.error).__name__
        return f"study {self.study} failed at {self.called}: {kind}: {text}"


@dataclass
class Answers:
    """Answers of some studies from one set of results, ``reference`` or ``mine``.

    What fails is kept in ``failures``; everything else is made.
    """

    name: str
    results: Results
    studies: Sequence[Study]
    failures: list[Failure] = field(default_factory=list)
    _made: dict[str, Table | None] = field(default_factory=dict)

    def table(self, name: str) -> Table | None:
        """The table of that name, if it has rows."""
        if name == COMPARISON:
            return self.comparison()
        for study in self.studies:
            for table in study.tables:
                if table.name == name:
                    return self._of(study, table)
        return None

    def tables(self, study: Study) -> Iterator[Table]:
        """The tables of a study that have rows."""
        for table in study.tables:
            made = self._of(study, table)
            if made is not None:
                yield made

    def figures(self, study: Study) -> Iterator[tuple[Figure, Table]]:
        """The figures of a study that have something to draw, with their tables."""
        for figure in study.figures:
            made = self._of(study, figure.table)
            if made is not None:
                caption = text_for(figure.caption, made.data)
                commands = tuple(figure.commands) or made.commands
                yield replace(figure, caption=caption, commands=commands), made

    def every_table(self) -> Iterator[Table]:
        """The tables of all studies, and the published numbers beside ours."""
        for study in self.studies:
            yield from self.tables(study)
        beside = self.comparison()
        if beside is not None:
            yield beside

    def comparison(self) -> Table | None:
        """Every published number beside ours. Among one's own stands nothing that was not
        measured."""
        if COMPARISON not in self._made:
            quantities: list[Quantity] = []
            experiments: list[str] = []
            for study in self.studies:
                for numbers in study.numbers:
                    experiments += numbers.of
                    try:
                        quantities += numbers.made(self.results.frame(*numbers.of))
                    except Exception as error:
                        self.failures.append(Failure(study.name, "its numbers", error))
            with_missing = self.name != MINE
            table = comparison.compare(quantities, experiments, with_missing)
            self._made[COMPARISON] = table if len(table.data) else None
        return self._made[COMPARISON]

    def older_tables(self) -> list[str]:
        """Names of the tables that take an experiment with records of older code."""
        older = {one.experiment for one in self.results.measurements if one.outdated}
        if any(run.outdated for run in self.results.runs):
            older.add(RUNS)
        found = self.every_table()
        return sorted(t.name for t in found if not older.isdisjoint(t.experiments))

    def write(self, folder: Path, tex: bool = False) -> list[Path]:
        """Write tables and figures as files, and remove those of an earlier report; the files."""
        written = [
            _written(folder / "tables" / name, text)
            for table in self.every_table()
            for name, text in _texts_of(table, tex).items()
        ]
        if self.name == MINE:  # records.jsonl has the runs of the reference
            runs = runs_table(self.results)
            written.append(_written(folder / "tables" / "runs.csv", runs.csv()))
        written += self._draw(folder / "figures")
        for path in (*folder.glob("tables/*"), *folder.glob("figures/*")):
            if path.is_file() and path not in written:
                path.unlink()
        return written

    def _of(self, study: Study, table: Table) -> Table | None:
        """A table, made once; None where it has no rows, or fails."""
        if table.name not in self._made:
            self._made[table.name] = None
            try:
                lines = self.results.frame(*table.experiments)
                self._made[table.name] = table.made(lines)
            except Exception as error:
                self.failures.append(Failure(study.name, f"table {table.name}", error))
        return self._made[table.name]

    def _draw(self, folder: Path) -> Iterator[Path]:
        """Draw every figure; the files, with the CSV of what no table of the study shows."""
        from experiments.reporting.plot import (
            save,  # --help does not wait for matplotlib
        )

        for study in self.studies:
            shown = {table.name for table in study.tables}
            for figure, table in self.figures(study):
                try:
                    drawn = save(figure.draw(table.data), figure.kind)
                except Exception as error:
                    failure = Failure(study.name, f"figure {figure.name}", error)
                    self.failures.append(failure)
                    continue
                yield _written(folder / f"{figure.name}.{figure.kind}", drawn)
                if table.name not in shown and figure.kind != "webp":
                    yield _written(folder / f"{figure.name}.csv", table.csv())


def _written(path: Path, content: str | bytes) -> Path:
    write_atomically(path, content)
    return path


def _texts_of(table: Table, tex: bool) -> dict[str, str]:
    """The files of a table by name, with what they contain."""
    texts = {f"{table.name}.csv": table.csv(), f"{table.name}.md": table.markdown()}
    return texts | ({f"{table.name}.tex": table.tex()} if tex else {})


def runs_table(results: Results) -> Table:
    """One row per run, finished or not; each key that was changed of the configs has a column."""
    rows = sorted(
        map(_row_of_run, [*results.runs, *results.unfinished]),
        key=lambda row: (row["scene"], row["model"], row["id"]),
    )
    data = frame(rows)
    four = {
        name: Column(name.replace("_", " "), partial(number, digits=4))
        for name in _SHOWN_OF_RUNS
    }
    note = "tables/runs.csv has a column for every key that was changed, processor and command."
    return Table(
        "runs",
        lambda _: data,
        of=RUNS,
        title="Every run",
        note=note,
        columns=four,
        shown=_SHOWN_OF_RUNS,
        data=data,
    )


def _row_of_run(run: Record) -> Mapping[str, Any]:
    environment, config, results = run.environment, run.config, run.results
    changed = run.changed.items()
    last = run.curve[-1]["training_s"] if run.curve else None
    return {
        "id": run.id,
        "scene": run.scene.name if run.scene else "",
        "model": run.model.name if run.model else "",
        "overrides": " ".join(f"{key}={value}" for key, value in changed),
        "stop_rule": run.stop,
        "n_train": results.get("n_train", config["split"]["n_train"]),
        "pixels": config["data"]["pixels"],
        "seed": config["seed"]["run"],
        "status": ": ".join(filter(None, [run.status, run.error])),
        "test_accuracy_final": results.get("test_accuracy_final"),
        "training_s": results.get("total_time_s", last),
        "origin": results.get("origin"),
        "cpu": environment.cpu,
        "threads": environment.threads,
        "exclusive": environment.exclusive,
        "code": ", ".join(run.outdated if run.is_finished else ()) or "current",
        "command": run.command,
        **run.changed,
    }
