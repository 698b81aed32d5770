"""Tables and figures of every study for one set of results, each made when it is asked for."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import pandas as pd

from experiments.records.results import Results, own_frames
from experiments.reporting import comparison
from experiments.reporting.study import Figure, Quantity, Study
from experiments.reporting.table import Table, text_for
from hdc.io import write_atomically

MINE = "mine"
Made = TypeVar("Made")


@dataclass
class Answers:
    """Answers of some studies from one set of results, ``reference`` or ``mine``.

    Tables keep the rows whose columns have one of the values that ``only`` names, or begin with the
    name. Errors are kept in ``failures``, each with the name of its study, in one line; everything
    else is made.
    """

    name: str
    results: Results
    studies: Sequence[Study]
    only: Mapping[str, Sequence[str]] = field(default_factory=dict)
    failures: list[tuple[str, str]] = field(default_factory=list)
    _made: dict[str, Table | None] = field(default_factory=dict)

    @functools.cached_property
    def every_study(self) -> list[Study]:
        """The studies, and last the published numbers and ours."""
        experiments = [name for study in self.studies for name in study.numbers]
        compared = comparison.table(self._compared, experiments)
        of_all = Study("numbers", "Every number", "", math.inf, tables=[compared])
        return [*self.studies, of_all]

    def table(self, name: str) -> Table | None:
        """The table of that name, if it has rows."""
        for study in self.every_study:
            for table in study.tables:
                if table.name == name:
                    return self._of(study, table)
        return None

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
        """The tables of all studies."""
        for study in self.every_study:
            yield from self.tables(study)

    def _compared(self, _: pd.DataFrame) -> pd.DataFrame:
        """Every published number that was measured, and ours."""
        quantities: list[Quantity] = []
        for study in self.studies:
            make = functools.partial(self._numbers, study)
            quantities += self._tried(study, "its numbers", make) or []
        return comparison.compare(quantities)

    def _numbers(self, study: Study) -> list[Quantity]:
        found: list[Quantity] = []
        for experiment, make in study.numbers.items():
            frame = own_frames(self.results.frame(experiment))
            if len(frame):
                found += make(frame)
        return found

    @property
    def left_out(self) -> list[str]:
        """Records that no table shows, and why, a line each."""
        return [*self.results.problems, *self.results.left_out()]

    def write(self, folder: Path, tex: bool = False) -> list[Path]:
        """Write tables and figures as files, and remove files of an earlier report; the files."""
        contents: dict[Path, str | bytes] = {}
        for table in self.every_table():
            path = folder / "tables" / table.name
            contents[path.with_suffix(".csv")] = table.csv()
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
            self.failures.append((study.name, text))
            return None
