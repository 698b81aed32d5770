"""Every published number beside ours: comparison.csv and tables/comparison.md.

One row for each line of published.csv, or several where the paper leaves a condition open. The
verdict, from the first of these that applies:

- ``missing``: nothing was measured.
- ``setting``: the paper's choice and not its result (learning rate, number of labels): the ``same``
  here, or ``another``.
- ``not reached``: the median run never got where the number is taken.
- ``no interval``: measured, but not often enough for an interval. Such a number never matches.
- ``matches``: the published number lies within its interval: zero is in the 95 % interval of the
  difference ours − paper, which the intervals of both make up (Newcombe, Statist. Med. 17, 873
  (1998); Zou and Donner, ibid. 27, 1693 (2008)). A published number without one counts as exact.
- ``differs``: it does not.

Before it stands what the simulated sensor's calibration did with the number: ``fitted`` chose a
parameter, so a fitted number that agrees is called ``fitted`` and never ``matches``; ``predicted``
was compared only.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments import evaluate, table_text, tables
from experiments.record import ROOT, read_record
from experiments.selection import Group, Records, sweep
from experiments.tables import Row

# What reading a measurement raises whose rows were made by other code and lack something.
MISFITS = (KeyError, ValueError, IndexError, TypeError)
TITLE = "Published numbers and ours, with 95 % intervals"
COLUMNS = (
    "experiment", "quantity", "condition", "unit", "published", "published_low", "published_high",
    "measured", "ci_low", "ci_high", "n", "seeds", "verdict", "made_by", "note",
)  # fmt: skip
# Rows of calibration.csv that are about a published number.
_CALIBRATION = {
    "table1/hdc_test_accuracy": "touch, N = 400, %",
    "accuracy_vs_n/n_for_90_percent": "touch, N at which 90 % is crossed",
    "correlation/max_same_class_speckle": "max C^s_ll",
    "correlation/contrast_speckle": "ΔC^s",
    "correlation/contrast_hypervector": "ΔC^b",
    "correlation/contrast_prototype": "ΔC^p, samples in the prototypes",
    "finger/test_accuracy": "finger, %",
    "spatial/test_accuracy": "51 positions, %",
    "drift/stored_accuracy": "drift, stored prototypes, %",
    "drift/recovered_accuracy": "drift, N_new = 50, p = 0.5, %",
    "tactile/test_accuracy": "tactile, %",
}
# Samples behind a published accuracy, where the paper says how many.
_PUBLISHED_SAMPLES = {
    **{f"table1/{model}_test_accuracy": tables.PUBLISHED_TEST_SAMPLES
       for model in ("hdc", "softmax", "cnn1", "cnn3")},
    **{f"table1/{model}_training_accuracy": 400 for model in ("softmax", "cnn1", "cnn3")},
    "finger/test_accuracy": 140,  # 20 samples for each of 7 labels
    "tactile/test_accuracy": 120,
}  # fmt: skip
_SETTINGS = ("table1/learning_rate", "touch/labels")
# What makes an experiment of published.csv where that is not the one of its name.
_MAKES = {"finger": "scenes", "spatial": "scenes", "tactile": "scenes", "touch": "table1"}
_PUBLISHED_COMPUTER = "paper: Apple M1"


def compare(records: Records, results: Path) -> list[Row]:
    """One row for each line of published.csv, in its order; columns as in :data:`COLUMNS`."""
    found = {key: [row] for key, row in _table1(records).items()}
    found["table1/learning_rate"] = [_learning_rate(records)]
    try:
        found |= _others(results, records.device)
    except MISFITS as error:
        records.problems.append(f"numbers beside Table I: {type(error).__name__}: {error}")
    calibration = _calibration(results)
    rows = []
    for line in _read_csv(ROOT / "results" / "published.csv"):
        key = f"{line['experiment']}/{line['quantity']}"
        published = float(line["value"])
        low, high = _published_interval(key, published)
        for ours in found.get(key) or [{}]:
            row: Row = {
                **{name: line[name] for name in ("experiment", "quantity", "unit")},
                "published": published,
                "published_low": low,
                "published_high": high,
                "setting": key in _SETTINGS,
                **ours,
            }
            experiment = _MAKES.get(line["experiment"], line["experiment"])
            row.setdefault("made_by", f"python -m experiments.run experiment={experiment}")
            fit = calibration.get(_CALIBRATION.get(key, ""), {})
            row["verdict"] = verdict(row, fit.get("status"))
            if fit.get("note"):
                notes = [row.get("note"), f"calibration: {fit['note']}"]
                row["note"] = "; ".join(filter(None, notes))
            rows.append(row)
    return rows


def verdict(row: Mapping[str, Any], calibration: str | None = None) -> str:
    """What to think of a number: see the module's docstring.

    Args:
        row: published, measured, and the bounds of both as in :data:`COLUMNS`; ``setting`` if it
            is one.
        calibration: fitted, predicted, or None for a number that no fit has seen.
    """
    measured = row.get("measured")
    if measured is None:
        return "missing"
    if row.get("setting"):
        return f"setting, {'same' if math.isclose(measured, row['published']) else 'another'}"
    if isinstance(measured, str):
        return "not reached"
    if row.get("ci_low") is None or row.get("ci_high") is None:
        agreement = "no interval"
    else:
        agreement = "matches" if _agrees(row) else "differs"
    if calibration == "fitted" and agreement == "matches":
        return "fitted"
    return f"{calibration}, {agreement}" if calibration else agreement


def to_csv(rows: Sequence[Row]) -> str:
    """The rows as comma-separated values."""
    return table_text.to_csv(rows, COLUMNS)


def to_markdown(rows: Sequence[Row]) -> str:
    """The rows as a table, intervals in brackets, numbers to four digits."""
    head = ("Quantity", "Verdict", "Paper", "Here", "Unit", "n", "Seeds", "Note", "Made by")
    body = [
        [_quantity(row), row["verdict"],
         _with_interval(row, "published", "published_low", "published_high"),
         _with_interval(row, "measured", "ci_low", "ci_high"), row["unit"],
         str(row.get("n") or "–"), str(row.get("seeds") or "–"), row.get("note") or "–",
         f"`{row['made_by']}`"]
        for row in rows
    ]  # fmt: skip
    lines = [head, ["---"] * len(head), *body]
    cells = ([cell.replace("|", "\\|") for cell in line] for line in lines)
    text = "\n".join(f"| {' | '.join(line)} |" for line in cells)
    return f"**{TITLE}**\n\n{text}\n"


def interval_of_times(seconds: Sequence[float]) -> tuple[float, float] | tuple[None, None]:
    """95 % interval of the median of times that spread by factors.

    Student's t interval of the mean logarithm, whose exponential is the median of a log-normal
    distribution. None for fewer than three times (the interval of two spans decades), or if one is
    not finite.
    """
    if len(seconds) < 3 or not np.isfinite(seconds).all():
        return None, None
    from scipy import stats

    logs = np.log(seconds)
    half = stats.t.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / math.sqrt(len(logs))
    return float(np.exp(logs.mean() - half)), float(np.exp(logs.mean() + half))


def _table1(records: Records) -> dict[str, Row]:
    """Times, and the maxima of both accuracies, as published; in seconds and percent."""
    params = sweep("table1")
    found: dict[str, Row] = {}
    for line in tables.table1(records):
        model = line["model"]
        group = records.group(params["scene"][0], model)
        if not group.runs:
            continue
        common = {"seeds": line["seeds"], "made_by": _made_by(run.record for run in group.runs)}
        n_test, n_train = line["n_test"], line["n_train"] * line["seeds"]
        low, high = interval_of_times([tables.training_time(run) for run in group.runs])
        found[f"table1/{model}_training_time"] = common | {
            "measured": line["training_time_s"],
            "ci_low": low,
            "ci_high": high,
            "n": line["seeds"],
            "note": f"median; {line['cpu']}, {line['threads']} threads; {_PUBLISHED_COMPUTER}",
        }
        final = f"maximum of the run, as published; {{:.4g}} % at its end ({line['stop']})"
        found[f"table1/{model}_training_accuracy"] = common | _share(
            line["train_accuracy_max"], n_train, final.format(100 * line["train_accuracy_final"])
        )
        found[f"table1/{model}_test_accuracy"] = common | _share(
            line["test_accuracy_max"], n_test, final.format(100 * line["test_accuracy_final"])
        )
    return found


def _share(accuracy: float, n: int, note: str) -> Row:
    low, high = evaluate.wilson(round(accuracy * n), n)
    return {
        "measured": 100 * accuracy,
        "ci_low": 100 * low,
        "ci_high": 100 * high,
        "n": n,
        "note": note,
    }


def _learning_rate(records: Records) -> Row:
    """The published choice, beside that of the records."""
    scene = sweep("table1")["scene"][0]
    runs = [
        run for model in ("softmax", "cnn1", "cnn3") for run in records.group(scene, model).runs
    ]
    rates = {run.record["config"]["model"]["lr"] for run in runs}
    return {"measured": rates.pop(), "note": "softmax and CNNs"} if len(rates) == 1 else {}


def _others(results: Path, device: str) -> dict[str, list[Row]]:
    """Numbers that are not of Table I, by experiment and quantity, one for each condition."""
    from experiments import paper_numbers

    found: dict[str, list[Row]] = {}
    for row in paper_numbers.summary_rows(results, device):
        notes = [row["interval"] and f"interval: {row['interval']}"]
        if row["code"] != "current":
            notes.append(f"changed since: {row['code']}")
        found.setdefault(f"{row['experiment']}/{row['quantity']}", []).append({
            "measured": row["measured"],
            "ci_low": row["low"],
            "ci_high": row["high"],
            "n": row["n"],
            "seeds": row["seeds"],
            "condition": row["condition"],
            "made_by": _made_by([read_record(results / p) for p in row["source"].split()]),
            "note": "; ".join(filter(None, notes)),
        })  # fmt: skip
    return found


def commands(groups: Iterable[Group]) -> list[str]:
    """What makes the runs of these groups again: a command for the models with the same seeds."""
    alike: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for group in groups:
        records = [run.record for run in group.runs]
        seeds = sorted((r["choices"]["stop"], r["config"]["seed"]["run"]) for r in records)
        alike.setdefault(tuple(seeds), []).extend(records)
    return [_made_by(records) for records in alike.values() if records]


def _made_by(made: Iterable[Mapping[str, Any] | None]) -> str:
    """The command that makes these records again."""
    records = [record for record in made if record]
    for record in records:
        if "choices" not in record:  # a measurement: one command, one record
            return str(record["command"])

    def values(key: str) -> list[Any]:
        group, _, name = key.partition(".")
        every = [r["config"][group][name] if name else r["choices"][group] for r in records]
        return sorted(set(every), key=lambda value: (value is None, value))

    words = ["python -m experiments.run -m"]
    for key in ("scene", "model", "stop", "seed.run", "split.n_train", "data.pixels"):
        if (found := values(key)) != [None]:
            texts = ("null" if value is None else str(value) for value in found)
            words.append(f"{key}={','.join(texts)}")
    return " ".join(words)


def _agrees(row: Mapping[str, Any]) -> bool:
    """Whether zero lies in the interval of the difference ours − paper."""
    ours, paper = row["measured"], row["published"]
    paper_low, paper_high = (
        paper if row.get(name) is None else row[name]
        for name in ("published_low", "published_high")
    )
    if ours >= paper:
        return ours - paper <= math.hypot(ours - row["ci_low"], paper_high - paper)
    return paper - ours <= math.hypot(row["ci_high"] - ours, paper - paper_low)


def _published_interval(key: str, value: float) -> tuple[float, float] | tuple[None, None]:
    n = _PUBLISHED_SAMPLES.get(key)
    if n is None:
        return None, None
    low, high = evaluate.wilson(round(value / 100 * n), n)
    return 100 * low, 100 * high


def _quantity(row: Row) -> str:
    name = f"{row['experiment']}: {row['quantity']}".replace("_", " ")
    return ", ".join(filter(None, [name, row.get("condition")]))


def _with_interval(row: Row, value: str, low: str, high: str) -> str:
    bounds = [row.get(low), row.get(high)]
    text = plain(row.get(value))
    return text if None in bounds else f"{text} [{', '.join(map(plain, bounds))}]"


def plain(value: Any) -> str:
    """A number to four significant digits, a text as it is, nothing as a dash."""
    return "–" if value is None else value if isinstance(value, str) else f"{value:.4g}"


def _calibration(results: Path) -> dict[str, dict[str, str]]:
    """Rows of calibration.csv by quantity; nothing where there is none."""
    path = results / "calibration.csv"
    path = path if path.exists() else ROOT / "results" / "calibration.csv"
    return {line["quantity"]: line for line in _read_csv(path)} if path.exists() else {}


def _read_csv(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
