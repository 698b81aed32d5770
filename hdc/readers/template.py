"""Templates: the path of an image, a file or an array, with fields for what it says."""

from __future__ import annotations

import os
import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Sequence

from hdc.readers.files import SettingError, wrong

_NUMBERED = re.compile(r"(.*?)((?:[\W_]+[A-Za-z]*=?)?)(\d+)")
"""A name such as ball__t=0 or ball_run2: the thing, the text between, and a number."""
_END = re.compile(r"(\.[^./]+|/[^./]+)?$")
"""The suffix of a file, or the last part of the name of an array."""
_FIELDS = {
    "*": ("", "anything"),
    "{order}": ("order", "number"),
    "{value}": ("value", "signed"),
}
for _name in ("label", "session", "group"):
    for _form, _kind in (("", "text"), (":d", "whole"), (":w", "word")):
        _FIELDS[f"{{{_name}{_form}}}"] = (_name, _kind)
"""Name of each field of a template, and what it stands for."""
_FORMS = {
    "text": r"[^/]+~",
    "anything": r"[^/]*~",
    "word": r"[^\W\d_]+~",
    "whole": r"(?<!\d)\d+(?!\d)",
    "number": r"(?<!\d)\d+~(?:\.\d+~)?~(?!\d)",
    "signed": r"[-+]?~(?<!\d)\d+~(?:\.\d+~)?~(?!\d)",
}
"""Regular expressions; ``~`` is nothing in the longest reading, and ``?`` in the shortest. A number
has all digits that stand together: wood12 is wood and 12, not wood1 and 2."""


class Template:
    """A template such as ``{session}/{label}/*_{order}.png``.

    Fields are ``label``, ``session`` and ``group`` (any text within a name, a whole number as
    ``{session:d}``, or letters alone as ``{label:w}``), ``order`` and ``value`` (numbers); ``*`` is
    any text within a name.

    Raises:
        SettingError: a field is unknown or there twice.
    """

    def __init__(self, template: str) -> None:
        self._template = unicodedata.normalize("NFC", template.removeprefix("./"))
        # The first fields of a name are longest in one reading and shortest in the other:
        # where these two agree there is no third.
        pattern = self._pattern()
        self._longest = re.compile(pattern.replace("~", ""))
        self._shortest = re.compile(pattern.replace("~", "?"))

    def read(self, file: str) -> dict[str, str] | None:
        """Texts of a file's path, by field; None where the path does not fit the template.

        Raises:
            SettingError: it has two readings; both are named.
        """
        name = unicodedata.normalize("NFC", file)
        longest = self._longest.fullmatch(name)
        shortest = self._shortest.fullmatch(name)
        if longest is None or shortest is None:
            return None
        fields = shortest.groupdict()
        if any(longest.span(field) != shortest.span(field) for field in fields):
            raise SettingError(
                f"template: expected one reading of each path, found two of {file}: "
                f"{_shown(fields)}; or {_shown(longest.groupdict())} (a field that is a whole "
                "number is written {session:d}, one of letters alone {label:w}; a manifest.csv "
                "says it file by file)"
            )
        return fields

    def _pattern(self) -> str:
        parts = [part for part in re.split(r"(\{[^{}]*\}|\*)", self._template) if part]
        fields = [_FIELDS.get(part, ("", "")) for part in parts]
        names = [name for name, _ in fields if name]
        unknown = [p for p in parts if p not in _FIELDS and f"{p[0]}{p[-1]}" == "{}"]
        if unknown or len({*names}) < len(names):
            expected = f"fields among {', '.join(_FIELDS)}, each once"
            raise wrong("template", self._template, expected)
        pairs = zip(parts, fields, strict=True)
        return "".join(_expression(part, *field) for part, field in pairs)


def _expression(part: str, name: str, kind: str) -> str:
    """The regular expression of a part of a template, which is of this kind."""
    form = _FORMS.get(kind) or re.escape(part).replace(r"\~", r"\x7e")
    return f"(?P<{name}>{form})" if name else form


def _shown(fields: dict[str, str]) -> str:
    return ", ".join(f"{name} {text!r}" for name, text in fields.items())


# Names that suggest a template -----------------------------------------------------------------


def suggested(names: Sequence[str], usual: Sequence[str]) -> list[str]:
    """Templates that the names of files, or of arrays in one file, suggest.

    Names are alike that have as many parts and the same end: the suffix of a file, or the last part
    of arrays such as trial_1/frames and trial_2/frames. A folder that all of them are in stays.

    Args:
        names: of the files or arrays.
        usual: fields that a name in that folder can be.
    """
    alike: dict[tuple[str, int], list[str]] = defaultdict(list)
    for name in names:
        stem = _END.sub("", name)
        alike[name.removeprefix(stem), stem.count("/")].append(stem)
    return [
        template + end
        for (end, _), stems in alike.items()
        for template in _suggested_by(stems, usual)
        if end.startswith(".") or len(stems) > 1
    ]


def numbered(names: Sequence[str]) -> str:
    """The template of names that differ in a number at their end, such as ball__t=0 and ball__t=1;
    empty where they are not such: two things are there, and one of them twice."""
    read = [found.groups() for name in names if (found := _NUMBERED.fullmatch(name))]
    things = Counter(thing + between for thing, between, _ in set(read))
    if len(things) < 2 or max(things.values()) < 2:
        return ""
    between, *others = {part for _, part, _ in read}
    if others or not between:
        return "{label}{group:d}"
    form = ":d" if any(between in thing for thing, _, _ in read) else ""
    return f"{{label}}{between}{{group{form}}}"


def _suggested_by(stems: Sequence[str], usual: Sequence[str]) -> list[str]:
    """Templates of names without their ends, which are alike."""
    folder = os.path.commonpath([*map(os.path.dirname, stems)])
    parts = os.path.relpath(stems[0], folder or None).split("/")
    twins = numbered([os.path.basename(stem) for stem in stems])
    readings = [twins, *usual]
    if len(parts) > 1:
        # A number that begins anew in each session is no group: a file is one.
        of_day = twins and f"{{session}}/{twins.replace('{group}', '*')}"
        readings = [of_day, "{label}/{group}", "{session}/{label}"]
        readings = [
            reading.replace("/", "/*" * (len(parts) - 2) + "/") for reading in readings
        ]
    return [os.path.join(folder, reading) for reading in readings if reading]
