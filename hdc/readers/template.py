"""Templates: the path of an image in a folder with fields for what it says of the image."""

from __future__ import annotations

import re
import unicodedata

from hdc.readers.files import SettingError, wrong

FIELDS = {
    "label": "text",
    "session": "text",
    "group": "text",
    "order": "number",
    "value": "signed",
}
"""Fields of a template, and what each stands for."""
_LONGEST = {
    "text": r"[^/]+",
    "anything": r"[^/]*",
    "word": r"[^\W\d_]+",
    "whole": r"\d+",
    "number": r"\d+(?:\.\d+)?",
    "signed": r"[-+]?\d+(?:\.\d+)?",
}
_SHORTEST = {
    "text": r"[^/]+?",
    "anything": r"[^/]*?",
    "word": r"[^\W\d_]+?",
    "whole": r"\d+?",
    "number": r"\d+?(?:\.\d+?)??",
    "signed": r"[-+]??\d+?(?:\.\d+?)??",
}
_FORMS = {"d": "whole", "w": "word"}
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
        self._longest = re.compile(self._pattern(_LONGEST))
        self._shortest = re.compile(self._pattern(_SHORTEST))

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

    def _pattern(self, forms: dict[str, str]) -> str:
        parts = self._parts()
        pattern = ""
        for number, (kind, text) in enumerate(parts):
            if kind == "literal":
                pattern += re.escape(text)
                continue
            form = forms[kind]
            if number > 0 and parts[number - 1][0] in _FREE:
                form = _BEFORE.get(kind, "") + form
            if number + 1 < len(parts) and parts[number + 1][0] in _FREE:
                form += _AFTER.get(kind, "")
            pattern += f"(?P<{text}>{form})" if text else form
        return pattern

    def _parts(self) -> list[tuple[str, str]]:
        """Kind and text of each part: what is literal, or a field's name (none of a ``*``)."""
        parts: list[tuple[str, str]] = []
        seen = []
        for part in re.split(r"(\{[^{}]*\}|\*)", self._template):
            if part == "*":
                parts.append(("anything", ""))
            elif part.startswith("{") and part.endswith("}"):
                kind, name = self._field(part[1:-1])
                self._require(name not in seen)
                seen.append(name)
                parts.append((kind, name))
            elif part:
                parts.append(("literal", part))
        return parts

    def _field(self, text: str) -> tuple[str, str]:
        name, colon, form = text.partition(":")
        self._require(name in FIELDS)
        if not colon:
            return FIELDS[name], name
        self._require(form in _FORMS and FIELDS[name] == "text")
        return _FORMS[form], name

    def _require(self, condition: bool) -> None:
        if not condition:
            known = ", ".join(f"{{{name}}}" for name in FIELDS)
            raise wrong("template", self._template, f"fields among {known}, each once")


def _shown(fields: dict[str, str]) -> str:
    return ", ".join(f"{name} {text!r}" for name, text in fields.items())
