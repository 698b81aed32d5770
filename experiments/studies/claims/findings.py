"""Findings in a few sentences, for the first screen of README: findings.yaml, filled from tables.

A field of a sentence is ``{row.column:format}``, where ``row`` is a row that the finding names, and
``format`` is one of :data:`FORMATS`, with `` interval`` after it if the bounds are to follow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import pandas as pd
from omegaconf import OmegaConf

from experiments.reporting.answers import Answers
from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.table import ENDS
from experiments.reporting.text import interval, percent, two_digits

PATH = Path(__file__).with_name("findings.yaml")
FORMATS: Mapping[str, Callable[[Any], str]] = {
    "": str,
    "points": lambda value: f"{value:+.1f}".replace("-", "−"),
    "percent": percent,
    "two": two_digits,
    "count": "{:.0f}".format,
    "model": display_name,
    "scene": scene_name,
}


class Ratio(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A column of one model relative to that of another, on each recording at its largest n."""

    table: str
    column: str
    model: str
    over: str


class Finding(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A sentence, or one of several.

    Attributes:
        text: the sentence.
        rows: by name, a ``table`` and the values that tell one of its rows.
        ratios: by name; has the columns ``least`` and ``most``.
        texts: a sentence for each ``word`` that these fields give, or for ``yes`` and ``no``:
            whether the inequality ``holds``.
    """

    text: str = ""
    rows: dict[str, dict[str, Any]] = {}
    ratios: dict[str, Ratio] = {}
    word: str = ""
    holds: str = ""
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
        unit = " points" if name == "points" and with_bounds else ""
        if not with_bounds or any(map(pd.isna, self.bounds)):
            return show(self.value) + unit
        return interval(show(self.value) + unit, *map(show, self.bounds))


class Line:
    """A row whose columns are attributes, as fields of a sentence have them."""

    def __init__(self, where: str, values: Mapping[str, Any]) -> None:
        self._where, self._values = where, values

    def __getattr__(self, name: str) -> Cell:
        if name not in self._values:
            known = ", ".join(self._values)
            raise ValueError(f"{self._where} has no column {name}; it has {known}")
        low, high = (self._values.get(f"{name}{end}") for end in ENDS[1:])
        return Cell(self._values[name], (low, high))


def findings(answers: Answers) -> list[str]:
    """Sentences in Markdown, in their order; none of what was not measured.

    Raises:
        ValueError: naming the finding and what of it the tables do not have.
    """
    sentences = []
    for place, finding in enumerate(_read(), 1):
        try:
            sentences.append(_sentence(finding, answers))
        except NotMeasured:
            continue
        except ValueError as error:
            raise ValueError(f"{PATH.name}, finding {place}: {error}") from None
    return sentences


def _read() -> list[Finding]:
    """The findings of the file.

    Raises:
        ValueError: naming the file and the key that is wrong.
    """
    try:
        return msgspec.convert(
            OmegaConf.to_container(OmegaConf.load(PATH)), list[Finding]
        )
    except msgspec.ValidationError as error:
        raise ValueError(f"{PATH}: {error}") from None


def _sentence(finding: Finding, answers: Answers) -> str:
    lines = {name: _line(wanted, answers) for name, wanted in finding.rows.items()}
    lines |= {name: _ratio(wanted, answers) for name, wanted in finding.ratios.items()}
    if not finding.texts:
        return _filled(finding.text, lines)
    word = _filled(finding.word, lines)
    if finding.holds:
        word = "yes" if pd.eval(_filled(finding.holds, lines)) else "no"
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
    if len(data) != 1:
        raise ValueError(f"{where}: expected one row with {values}, found {len(data)}")
    return Line(where, data.iloc[0].to_dict())


def _ratio(wanted: Ratio, answers: Answers) -> Line:
    """The least and the most over recordings of a column of one model relative to another's."""
    data = _values(wanted.table, answers)
    at_most = data[data.n == data.groupby("recording").n.transform("max")]
    by_model = at_most.pivot(index="recording", columns="model", values=wanted.column)
    for model in (wanted.model, wanted.over):
        if model not in by_model:
            known = ", ".join(by_model)
            raise ValueError(
                f"table {wanted.table} has no model {model}; it has {known}"
            )
    ratio = by_model[wanted.model] / by_model[wanted.over]
    return Line(
        f"ratio of {wanted.column}", {"least": ratio.min(), "most": ratio.max()}
    )
