"""Findings in a few sentences, for README and for the page of results: findings.yaml and
answers.yaml, filled from tables.

A field of a sentence is ``{row.column:format}``, where ``row`` is a row that the finding names, and
``format`` is one of :data:`FORMATS`, with `` interval`` after it if the bounds are to follow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import pandas as pd
import yaml

from experiments.reporting.answers import Answers
from experiments.reporting.table import ENDS
from experiments.reporting.text import interval, number, percent, size, two_digits
from experiments.studies.limits.stiffness.view import power

FINDINGS = Path(__file__).with_name("findings.yaml")
ANSWERS = Path(__file__).with_name("answers.yaml")
FORMATS: Mapping[str, Callable[[Any], str]] = {
    "": str,
    "points": lambda value: f"{value:+.1f}".replace("-", "−"),
    "percentage": lambda value: f"{value:+.1f}".replace("-", "−"),
    "loss": lambda value: f"{-100 * value:.1f}".replace("-", "−"),
    "percent": percent,
    "number": number,
    "size": size,
    "two": two_digits,
    "power": power,
    "count": "{:.0f}".format,
    "processor": lambda name: name.partition(" (")[0],  # without its marks
}
# Units that stand between a number and its bounds.
UNITS = {"points": " points", "percentage": " percentage points"}


class Spread(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A column over recordings, each at its largest n: ``least``, ``median`` and ``most``.

    Attributes:
        table, column: whose numbers.
        of: values of other columns that tell the rows, one on each recording.
        over: the same of the rows by which those are divided; empty: they are not.
    """

    table: str
    column: str
    of: dict[str, Any]
    over: dict[str, Any] = {}


class Finding(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A sentence, or one of several.

    Attributes:
        text: the sentence.
        rows: by name, a ``table`` and the values that tell one of its rows.
        spreads: by name.
        texts: a sentence for each ``word`` that these fields give.
    """

    text: str = ""
    rows: dict[str, dict[str, Any]] = {}
    spreads: dict[str, Spread] = {}
    word: str = ""
    texts: dict[str, str] = {}


class NotMeasured(Exception):
    """A table or a number is not there yet."""


class Cell(NamedTuple):
    """A number or a text with its bounds, as a field of a sentence."""

    value: Any
    low: Any
    high: Any

    def __format__(self, text: str) -> str:
        name, _, with_bounds = text.partition(" ")
        if pd.isna(self.value):
            raise NotMeasured
        show = FORMATS[name]
        if not with_bounds:
            return show(self.value)
        shown = show(self.value) + UNITS.get(name, "")
        if pd.isna(self.low) or pd.isna(self.high):
            return shown
        return interval(shown, show(self.low), show(self.high))


class Line:
    """A row whose columns are attributes, as fields of a sentence have them: ``{row.name}``, or
    ``{row[name]}`` where a name has a dot."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = values

    def __getattr__(self, name: str) -> Cell:
        bounds = (self._values.get(f"{name}{end}") for end in ENDS[1:])
        return Cell(self._values[name], *bounds)

    __getitem__ = __getattr__


def sentences(path: Path, answers: Answers) -> dict[str, str]:
    """The sentences of a file in Markdown, by their names; none of what was not measured.

    Raises:
        ValueError: naming the file, the sentence and what of it the tables do not have.
    """
    written = yaml.safe_load(path.read_text("utf-8"))
    found = {}
    for name, finding in msgspec.convert(written, dict[str, Finding]).items():
        try:
            found[name] = _sentence(finding, answers)
        except NotMeasured:
            continue
        except (KeyError, ValueError) as error:
            raise ValueError(f"{path.name}, {name}: {error}") from error
    return found


def _sentence(finding: Finding, answers: Answers) -> str:
    lines = {name: _line(wanted, answers) for name, wanted in finding.rows.items()}
    lines |= {name: _spread(each, answers) for name, each in finding.spreads.items()}
    text = finding.text
    if finding.texts:
        text = finding.texts[finding.word.format(**lines)]
    return text.format(**lines)


def _rows(wanted: Mapping[str, Any], answers: Answers) -> pd.DataFrame:
    """The rows of a table that have these values; an empty one stands for none."""
    name = wanted["table"]
    known = {table.name for study in answers.studies for table in study.tables}
    if name not in known:
        raise ValueError(f"table: expected that of a study, found {name}")
    table = answers.table(name)
    if table is None:
        raise NotMeasured
    data = table.data
    for column in wanted.keys() - {"table"}:
        data = data[data[column].fillna("").astype(str) == str(wanted[column])]
    return data


def _line(wanted: Mapping[str, Any], answers: Answers) -> Line:
    """The only row of a table that has these values."""
    data = _rows(wanted, answers)
    if len(data) != 1:
        raise ValueError(f"expected one row with {wanted}, found {len(data)}")
    return Line(data.iloc[0].to_dict())


def _spread(wanted: Spread, answers: Answers) -> Line:
    """The least, the median and the most over recordings."""
    numbers = _by_recording(wanted, wanted.of, answers)
    if wanted.over:
        numbers = numbers / _by_recording(wanted, wanted.over, answers)
    return Line(
        {"least": numbers.min(), "median": numbers.median(), "most": numbers.max()}
    )


def _by_recording(
    wanted: Spread, values: Mapping[str, Any], answers: Answers
) -> pd.Series:
    """A column of the rows with these values, a number per recording, at its largest n."""
    data = _rows({"table": wanted.table, **values}, answers)
    data = data[data.n == data.groupby("recording").n.transform("max")]
    if not data.recording.is_unique:
        raise ValueError(f"expected one row per recording with {values}")
    return data.set_index("recording")[wanted.column]
