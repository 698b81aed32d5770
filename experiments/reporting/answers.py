"""Tables and figures of every study for one set of results, each made when it is asked for."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple, TypeVar

from experiments.records.results import RUNS, Results
from experiments.reporting import comparison
from experiments.reporting.study import Figure, Study
from experiments.reporting.table import Table, text_for
from hdc.io import write_atomically

MINE, RUNS_TABLE = "mine", "runs"
OF_NO_STUDY = (comparison.NAME, RUNS_TABLE)
Made = TypeVar("Made")


class Failure(NamedTuple):
    """A table or figure of a study that could not be made, and why, in one line."""

    study: str
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass
class Answers:
    """Answers of some studies from one set of results, ``reference`` or ``mine``.

    Tables keep the rows whose columns have one of the values that ``only`` names, or begin with the
    name. Errors are kept in ``failures``; everything else is made.
    """

    name: str
    results: Results
    studies: Sequence[Study]
    only: Mapping[str, Sequence[str]] = field(default_factory=dict)
    failures: list[Failure] = field(default_factory=list)
    _made: dict[str, Table | None] = field(default_factory=dict)

    def table(self, name: str) -> Table | None:
        """The table of that name, if it has rows."""
        for study in self.studies:
            for table in study.tables:
                if table.name == name:
                    return self._of(study, table)
        return next((table for table in self.of_no_study if table.name == name), None)

    def tables(self, study: Study) -> list[Table]:
        """The tables of a study that have rows."""
        made = (self._of(study, table) for table in study.tables)
        return [table for table in made if table is not None]

    def figures(self, study: Study) -> list[Figure]:
        """The figures of a study that have something to draw, each with the table that is made."""
        found = [(figure, self._of(study, figure.table)) for figure in study.figures]
        return [
            replace(figure, table=made, title=text_for(figure.title, made.data))
            for figure, made in found
            if made
        ]

    def every_table(self) -> Iterator[Table]:
        """The tables of all studies, and of none."""
        for study in self.studies:
            yield from self.tables(study)
        yield from self.of_no_study

    @functools.cached_property
    def of_no_study(self) -> list[Table]:
        """The published numbers and ours, and every run of one's own, if they have rows."""
        found = [self._comparison(), *([self._runs()] if self.name == MINE else [])]
        return [table for table in found if len(table.data)]

    def _comparison(self) -> Table:
        """Every published number that was measured, and ours."""
        every = [
            (study, numbers) for study in self.studies for numbers in study.numbers
        ]
        quantities = []
        for study, numbers in every:
            make = functools.partial(numbers.made, self.results.frame(*numbers.of))
            quantities += self._tried(study, "its numbers", make) or []
        experiments = [name for _, numbers in every for name in numbers.of]
        return comparison.compare(quantities, experiments)

    def _runs(self) -> Table:
        """A row per training, finished or not, with a column per setting."""
        rows = self.results.trainings(finished=False)
        unread = ["labels", "predicted", "test_indices"]
        return Table(
            RUNS_TABLE,
            lambda _: None,
            of=RUNS,
            title="Every run",
            note="tables/runs.csv has a column for every setting, processor and command.",
            shown=(
                *("record", "scene", "model", "seed", "status"),
                *("test_accuracy_final", "total_time_s"),
            ),
            data=rows.drop(columns=unread, errors="ignore"),
        )

    @functools.cached_property
    def left_out(self) -> list[str]:
        """Records that no table shows, and why, a line each."""
        lines = [*self.results.problems, *self.results.left_out()]
        tables = (table for study in self.studies for table in study.tables)
        known = {name for table in tables for name in table.experiments}
        for measured in self.results.measurements:
            module = measured.task.rpartition(".")[0]
            if measured.experiment not in known and not module.startswith(
                "experiments."
            ):
                text = f"no table shows it; if {module} has a STUDY: --study {module}"
                lines.append(f"{measured.id}: {text}")
        return lines

    def older_tables(self) -> list[str]:
        """Names of the tables that take an experiment with records of older code."""
        older = {one.experiment for one in self.results.measurements if one.outdated}
        if any(run.outdated for run in self.results.runs):
            older.add(RUNS)
        found = self.every_table()
        return sorted(t.name for t in found if not older.isdisjoint(t.experiments))

    def write(self, folder: Path, tex: bool = False) -> list[Path]:
        """Write tables and figures as files, and remove files of an earlier report; the files."""
        contents: dict[Path, str | bytes] = {}
        for table in self.every_table():
            path = folder / "tables" / table.name
            contents[path.with_suffix(".csv")] = table.csv()
            contents[path.with_suffix(".md")] = table.markdown()
            if tex:
                contents[path.with_suffix(".tex")] = table.tex()
        for name, drawn in self._drawn():
            contents[folder / "figures" / name] = drawn
        for path, content in contents.items():
            write_atomically(path, content)
        for path in (*folder.glob("tables/*"), *folder.glob("figures/*")):
            if path.is_file() and path not in contents:
                path.unlink()
        return list(contents)

    def _drawn(self) -> Iterator[tuple[str, str | bytes]]:
        """Names and contents of the files of figures, with the CSV of what no table shows."""
        for study in self.studies:
            shown = {table.name for table in study.tables}
            for figure in self.figures(study):
                made = self._tried(study, f"figure {figure.name}", figure.file)
                if made is None:
                    continue
                yield f"{figure.name}.svg", made
                if figure.table.name not in shown:
                    yield f"{figure.name}.csv", figure.table.csv()

    def _of(self, study: Study, table: Table) -> Table | None:
        """A table, made once; None where it has no rows, or fails."""
        if table.name not in self._made:
            make = functools.partial(table.made, self.results.frame(*table.experiments))
            made = self._tried(study, f"table {table.name}", make)
            self._made[table.name] = made and self._kept(made)
        return self._made[table.name]

    def _kept(self, table: Table) -> Table | None:
        data = table.data
        for column, names in self.only.items():
            if names and column in data:
                values = data[column].astype(str)
                begin = values.str.extract(r"([\w.-]*)", expand=False)
                data = data[values.isin(names) | begin.isin(names)]
        kept = data.reset_index(drop=True)
        return replace(table, data=kept) if len(kept) else None

    def _tried(self, study: Study, what: str, make: Callable[[], Made]) -> Made | None:
        """The result of a call; None, and one more failure, where it raises."""
        try:
            return make()
        except Exception as error:
            why = f"{type(error).__name__}: {' '.join(str(error).split())}"
            text = f"study {study.name} failed at {what}: {why}"
            self.failures.append(Failure(study.name, text))
            return None
