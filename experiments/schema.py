"""What a run's record must hold before a table or a figure is made of it.

A record is a file, and files are edited, cut and merged by hand; one that is wrong somewhere is
named with the key that is wrong, and never a row of a table or a traceback.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

_NAME = re.compile(r"(?!.*\.\.)[\w./-]+")  # of a file of configs/, which is looked for
_LARGEST = 2**53  # of a number that every reader of JSON sees alike


def _number(value: Any) -> bool:
    # Compared, not converted: an integer can be too large for a float. NaN is below nothing.
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def _integer(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= _LARGEST


def _text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= 10_000


def _list_of(valid: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, list) and all(map(valid, value))


def _mapping_of(valid: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, dict) and all(map(valid, value.values()))


_KINDS: dict[str, Callable[[Any], bool]] = {
    "a text": _text,
    "a name": lambda v: _text(v) and _NAME.fullmatch(v) is not None,
    "an integer": _integer,
    "an integer ≥ 1": lambda v: _integer(v) and v >= 1,
    "seconds": lambda v: _number(v) and v >= 0,
    "a fraction": lambda v: _number(v) and 0 <= v <= 1,
    "a mapping": lambda v: isinstance(v, dict),
    "a mapping to integers": _mapping_of(_integer),
    "a mapping to texts": _mapping_of(_text),
    "a list of texts": _list_of(_text),
    "a list of integers": _list_of(_integer),
    "a list of lists of integers": _list_of(_list_of(_integer)),
    "two integers ≥ 1": lambda v: _list_of(lambda n: _integer(n) and n >= 1)(v) and len(v) == 2,
}

# Key → kind; a ? after the kind: null will do; before the key: it need not be there; a * before the
# key: only a summary needs it.
_ALWAYS = {
    "id": "a text",
    "?error": "a text",
    "choices.scene": "a name",
    "choices.model": "a name",
    "config.device": "a text",
    "config.threads": "an integer ≥ 1",
    "config.seed": "a mapping to integers",
    "config.seed.run": "an integer",
    "config.split.n_train": "an integer ≥ 1?",
    "config.data.pixels": "an integer ≥ 1?",
    "config.stop": "a mapping",
    "environment.cpu": "a text",
    "environment.threads": "an integer ≥ 1",
    "environment.code": "a text",
    "environment.sources": "a mapping to texts",
    "scene.name": "a name",
    "scene.origin": "a text",
    "scene.shape": "two integers ≥ 1",
    "scene.classes": "a list of texts",
    "?scene.skipped": "a list of texts",
}
_FINISHED = {
    "stop": "a text",
    "training_s": "seconds",
    "time_to_target_train_s": "seconds?",
    "time_to_target_test_s": "seconds?",
    "train_accuracy_max": "a fraction?",
    "train_accuracy_final": "a fraction",
    "test_accuracy_max": "a fraction?",
    "test_accuracy_final": "a fraction",
    "*test_ci_low": "a fraction",
    "*test_ci_high": "a fraction",
    "model_bytes": "an integer",
    "n_train": "an integer ≥ 1",
    "n_test": "an integer ≥ 1",
    "test_labels": "a list of integers",
    "predicted": "a list of integers",
    "confusion": "a list of lists of integers",
    "predict_single_s": "seconds",
    "predict_batch_s_per_frame": "seconds",
    "data_sha256": "a mapping to texts",
    "data_sha256.test": "a text",
}


def check_run(record: Mapping[str, Any], summary: bool = False) -> None:
    """Check the fields that readers use; others may be there and hold anything.

    Args:
        record: of a run, as :func:`experiments.record.read_record` returns it.
        summary: whether what only :func:`experiments.summary.summarise` uses has to be there too.

    Raises:
        ValueError: naming the key, what it holds and what was expected.
    """
    _check(record, _ALWAYS, summary)
    if record["status"] != "finished":
        return
    _check(record, _FINISHED, summary)
    n = record["n_test"]
    for key in ("test_labels", "predicted"):
        if len(record[key]) != n:
            raise ValueError(f"{key}: expected n_test = {n} integers, found {len(record[key])}")
    classes, confusion = record["scene"].get("classes"), record.get("confusion")
    if (
        classes is not None
        and confusion is not None
        and not (
            len(confusion) == len(classes) and all(len(row) == len(classes) for row in confusion)
        )
    ):
        raise ValueError(f"confusion: expected {len(classes)} rows and columns, found others")


def _check(record: Mapping[str, Any], fields: Mapping[str, str], summary: bool) -> None:
    for key, kind in fields.items():
        path = key.lstrip("?*")
        value: Any = record
        for word in path.split("."):
            if not isinstance(value, Mapping) or word not in value:
                if key == path or (summary and key[0] == "*"):
                    raise ValueError(f"{path}: expected {kind.removesuffix('?')}, found none")
                break
            value = value[word]
        else:
            null = kind.endswith("?") and value is None
            if not null and not _KINDS[kind.removesuffix("?")](value):
                raise ValueError(
                    f"{path}: expected {kind.removesuffix('?')}, found {_short(value)}"
                )


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except (RecursionError, ValueError):  # nested deeply, an integer of thousands of digits
        text = type(value).__name__
    return text if len(text) <= 80 else f"{text[:77]}…"
