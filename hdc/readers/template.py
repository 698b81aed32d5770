"""Templates: the path of an image in a folder with fields for what it says of the image."""

from __future__ import annotations

import re
import unicodedata

from hdc.readers.files import SettingError, wrong

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
    "whole": r"\d+~",
    "number": r"\d+~(?:\.\d+~)?~",
    "signed": r"[-+]?~\d+~(?:\.\d+~)?~",
}
"""Regular expressions; ``~`` is nothing in the longest reading, and ``?`` in the shortest."""
_FREE = ("text", "anything")
# Beside free text a number is as long as it can be: "wood12" is wood and 12, not wood1 and 2.
_BEFORE = {
    "whole": r"(?<!\d)",
    "number": r"(?<!\d)(?<!\d\.)",
    "signed": r"(?<!\d)(?<!\d\.)(?<![-+])",
}
_AFTER = {
    "whole": r"(?!\d)",
    "number": r"(?!\d)(?!\.\d)",
    "signed": r"(?!\d)(?!\.\d)",
}


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
        unknown = [
            p for p in parts if p not in _FIELDS and p[0] == "{" and p[-1] == "}"
        ]
        if unknown or len({*names}) < len(names):
            expected = f"fields among {', '.join(_FIELDS)}, each once"
            raise wrong("template", self._template, expected)
        free = [False, *(kind in _FREE for _, kind in fields), False]
        pattern = ""
        for k, (part, (name, kind)) in enumerate(zip(parts, fields, strict=True)):
            form = _FORMS.get(kind) or re.escape(part).replace(r"\~", r"\x7e")
            if free[k]:
                form = _BEFORE.get(kind, "") + form
            if free[k + 2]:
                form += _AFTER.get(kind, "")
            pattern += f"(?P<{name}>{form})" if name else form
        return pattern


def _shown(fields: dict[str, str]) -> str:
    return ", ".join(f"{name} {text!r}" for name, text in fields.items())
