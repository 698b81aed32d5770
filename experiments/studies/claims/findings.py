"""Findings in a few sentences, for README and for the page of results: findings.yaml and
answers.yaml, filled from tables.

A field of a sentence is ``{row.column:format}``, where ``row`` is a row that the finding names, and
``format`` is one of :data:`FORMATS`, with `` interval`` after it if the bounds are to follow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import pandas as pd
from omegaconf import OmegaConf

from experiments.reporting.answers import Answers
from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.table import ENDS
from experiments.reporting.text import interval, number, percent, size, two_digits

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _power(value: float) -> str:
    """Two digits times a power of ten: 1.7 × 10⁻¹⁵."""
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits} × 10{str(int(exponent)).translate(_SUPERSCRIPTS)}"


def _on_each(numbers: str) -> str:
    """``A: x; B: y`` as “x on A and y on B”."""
    parts = (part.partition(": ") for part in numbers.split("; "))
    return " and ".join(f"{number} on {scene}" for scene, _, number in parts)


PATH = Path(__file__).with_name("findings.yaml")
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
    "power": _power,
    "count": "{:.0f}".format,
    "scenes": _on_each,
    "model": display_name,
    "scene": scene_name,
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


@dataclass(frozen=True)
class Cell:
    """A number or a text with its bounds, as a field of a sentence."""

    value: Any
    bounds: tuple[Any, Any]

    def __format__(self, text: str) -> str:
        name, _, with_bounds = text.partition(" ")
        if name not in FORMATS or with_bounds not in ("", "interval"):
            known = ", ".join(filter(None, FORMATS))
            raise ValueError(f"format: expected one of {known}, found {text}")
        if self.value is None or pd.isna(self.value):
            raise NotMeasured
        show = FORMATS[name]
        unit = UNITS.get(name, "") if with_bounds else ""
        if not with_bounds or any(map(pd.isna, self.bounds)):
            return show(self.value) + unit
        return interval(show(self.value) + unit, *map(show, self.bounds))


class Line:
    """A row whose columns are attributes, as fields of a sentence have them: ``{row.name}``, or
    ``{row[name]}`` where a name has a dot."""

    def __init__(self, where: str, values: Mapping[str, Any]) -> None:
        self._where, self._values = where, values

    def __getattr__(self, name: str) -> Cell:
        if name not in self._values:
            known = ", ".join(self._values)
            raise ValueError(f"{self._where} has no column {name}; it has {known}")
        low, high = (self._values.get(f"{name}{end}") for end in ENDS[1:])
        return Cell(self._values.get(name), (low, high))

    __getitem__ = __getattr__


def findings(answers: Answers) -> list[str]:
    """Sentences of README in Markdown, in their order; none of what was not measured.

    Raises:
        ValueError: naming the finding and what of it the tables do not have.
    """
    numbered = enumerate(_read(PATH, list[Finding]), 1)
    named = ((f"finding {place}", finding) for place, finding in numbered)
    return list(_sentences(PATH, named, answers).values())


def answers_of_studies(answers: Answers) -> dict[str, str]:
    """A sentence in Markdown for each study that was measured: what it found.

    Raises:
        ValueError: naming the study and what of its sentence the tables do not have.
    """
    by_study = _read(ANSWERS, dict[str, Finding])
    return _sentences(ANSWERS, by_study.items(), answers)


def _sentences(
    path: Path, found: Iterable[tuple[str, Finding]], answers: Answers
) -> dict[str, str]:
    sentences = {}
    for name, finding in found:
        try:
            sentences[name] = _sentence(finding, answers)
        except NotMeasured:
            continue
        except ValueError as error:
            raise ValueError(f"{path.name}, {name}: {error}") from None
    return sentences


def _read(path: Path, kind: Any) -> Any:
    """The findings of a file.

    Raises:
        ValueError: naming the file and the key that is wrong.
    """
    try:
        return msgspec.convert(OmegaConf.to_container(OmegaConf.load(path)), kind)
    except msgspec.ValidationError as error:
        raise ValueError(f"{path}: {error}") from None


def _sentence(finding: Finding, answers: Answers) -> str:
    lines = {name: _line(wanted, answers) for name, wanted in finding.rows.items()}
    lines |= {name: _spread(each, answers) for name, each in finding.spreads.items()}
    if not finding.texts:
        return _filled(finding.text, lines)
    word = _filled(finding.word, lines)
    if word not in finding.texts:
        raise ValueError(
            f"texts: expected one for {word}, found {', '.join(finding.texts)}"
        )
    return _filled(finding.texts[word], lines)


def _filled(text: str, lines: Mapping[str, Line]) -> str:
    try:
        return text.format(**lines)
    except KeyError as error:
        known = ", ".join(lines)
        raise ValueError(f"rows: expected {error}, found {known}") from None


def _values(name: str, answers: Answers) -> pd.DataFrame:
    """The values of a table of some study."""
    known = [table.name for study in answers.studies for table in study.tables]
    if name not in known:
        raise ValueError(f"table: expected one of {', '.join(known)}, found {name}")
    table = answers.table(name)
    if table is None:
        raise NotMeasured
    return table.data


def _line(wanted: Mapping[str, Any], answers: Answers) -> Line:
    """The only row of a table that has these values; an empty one stands for none."""
    where, data = _rows(wanted, answers)
    if len(data) != 1:
        values = {key: wanted[key] for key in wanted if key != "table"}
        raise ValueError(f"{where}: expected one row with {values}, found {len(data)}")
    return Line(where, data.iloc[0].to_dict())


def _rows(wanted: Mapping[str, Any], answers: Answers) -> tuple[str, pd.DataFrame]:
    """The rows of a table that have these values, and what the table is called."""
    values = {**wanted}
    name = values.pop("table")
    data = _values(name, answers)
    where = f"table {name}"
    for column, value in values.items():
        if column not in data:
            raise ValueError(
                f"{where} has no column {column}; it has {', '.join(data)}"
            )
        data = data[data[column].fillna("").astype(str) == str(value)]
    return where, data


def _spread(wanted: Spread, answers: Answers) -> Line:
    """The least, the median and the most over recordings."""
    numbers = _by_recording(wanted, wanted.of, answers)
    if wanted.over:
        numbers = numbers / _by_recording(wanted, wanted.over, answers)
    found = {"least": numbers.min(), "median": numbers.median(), "most": numbers.max()}
    return Line(f"spread of {wanted.column}", found)


def _by_recording(
    wanted: Spread, values: Mapping[str, Any], answers: Answers
) -> pd.Series:
    """A column of the rows with these values, a number per recording, at its largest n."""
    where, data = _rows({"table": wanted.table, **values}, answers)
    data = data[data.n == data.groupby("recording").n.transform("max")]
    if not len(data) or data.recording.duplicated().any():
        raise ValueError(
            f"{where}: expected one row per recording with {values}, found {len(data)}"
        )
    return data.set_index("recording")[wanted.column]
