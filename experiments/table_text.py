"""Tables as text: what the cells of a row look like, and a table as CSV, Markdown and LaTeX."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from experiments.tables import Row

NAMES = {
    "hdc": "HDC",
    "hdc_compiled": "HDC, compiled",
    "hdc_random_ties": "HDC, random ties",
    "hdc_integer": "HDC, integer prototypes",
    "hdc_online": "HDC, online",
    "record_hdc": "HDC, record-based",
    "softmax": "Softmax",
    "softmax_dual": "Softmax, dual Newton",
    "softmax_lbfgs": "Softmax, L-BFGS",
    "softmax_raw": "Softmax, raw pixels",
    "softmax_sgd": "Softmax, SGD",
    "cnn1": "CNN, 1 layer",
    "cnn3": "CNN, 3 layers",
    "cnn1_fast": "CNN, 1 layer, bfloat16",
    "cnn3_fast": "CNN, 3 layers, bfloat16",
    "ridge": "Ridge read-out",
    "correlation": "Image correlation",
    "nearest_neighbour": "Nearest neighbour, bits",
    "sklearn_centroid": "scikit-learn centroid",
    "sklearn_ridge": "scikit-learn ridge",
    "sklearn_logistic": "scikit-learn logistic",
    "sklearn_svc": "scikit-learn linear SVC",
}


def to_csv(rows: Sequence[Row], columns: Sequence[str]) -> str:
    """Comma-separated values; what is unknown is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_cell(line.get(column)) for column in columns] for line in rows)
    return text.getvalue()


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


Columns = Sequence[tuple[str, Callable[[Row], str]]]


def number(value: Any, digits: int = 3) -> str:
    """A number to three significant digits, a text as it is, nothing as a dash."""
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    if value and not 1e-3 <= abs(value) < 1e5:
        return f"{value:.1e}"
    decimals = max(0, digits - 1 - int(np.floor(np.log10(abs(value))))) if value else 0
    return f"{value:.{decimals}f}"


def percent(value: float | None) -> str:
    """A fraction in percent, one decimal where it is not whole."""
    return "–" if value is None else f"{100 * value:.1f}".removesuffix(".0")


def time_cell(line: Row) -> str:
    """Median training time with quartiles where there are several seeds."""
    if not line["seeds"]:
        return str(line["status"])
    text = number(line["training_time_s"])
    low, high = (
        number(line[f"training_time_q{q}_s"]).replace("not reached in ", "> ").removesuffix(" s")
        for q in (25, 75)
    )
    return text if low == high else f"{text} ({low}…{high})"


def interval_cell(line: Row, value: str = "test_accuracy_final", bounds: str = "test_ci") -> str:
    """An accuracy with its interval."""
    if line.get(value) is None:
        return "–"
    low, high = percent(line[f"{bounds}_low"]), percent(line[f"{bounds}_high"])
    return f"{percent(line[value])} [{low}, {high}]"


def published_cell(line: Row) -> str:
    """The published test accuracy with the interval of 100 samples."""
    return interval_cell(line, "published_test_accuracy", "published_test_ci")


def bytes_cell(value: Any) -> str:
    """Bytes in kB or MB."""
    if not isinstance(value, int):
        return number(value)
    return f"{number(value / 1e3)} kB" if value < 1e6 else f"{number(value / 1e6)} MB"


def predict_cell(line: Row) -> str:
    """Milliseconds to predict a single frame."""
    return number(line["predict_single_s"] * 1e3) if line["seeds"] else "–"


def display_name(model: str) -> str:
    """What a model is called in tables and figures; its config's name if nothing is set."""
    return NAMES.get(model, model)


def _name(line: Row) -> str:
    return display_name(line["model"])


TABLE1_COLUMNS: Columns = (
    ("Model", _name),
    ("Seeds", lambda r: str(r["seeds"])),
    ("Training time, s, paper", lambda r: number(r["published_training_time_s"])),
    ("Training time, s, here", time_cell),
    ("× HDC, paper", lambda r: number(r["published_training_time_over_hdc"])),
    ("× HDC, here", lambda r: number(r.get("training_time_over_hdc"))),
    ("Training accuracy, %, paper", lambda r: percent(r["published_train_accuracy"])),
    ("Training accuracy, %, here", lambda r: percent(r.get("train_accuracy_max"))),
    ("Test accuracy, %, paper [95 %]", published_cell),
    ("Test accuracy, %, here, maximum", lambda r: percent(r.get("test_accuracy_max"))),
    ("Test accuracy, %, here, final [95 %]", interval_cell),
    ("McNemar p", lambda r: number(r.get("mcnemar_p"), 2)),
    ("Size", lambda r: bytes_cell(r.get("model_bytes"))),
    ("Status", lambda r: r["status"] if not r.get("stop") else f"{r['status']}, {r['stop']}"),
)
EXTENDED_COLUMNS: Columns = (
    *TABLE1_COLUMNS[:2],
    ("Training time, s", time_cell),
    ("Until it stopped, s", lambda r: number(r.get("total_time_s"))),
    ("× HDC", TABLE1_COLUMNS[5][1]),
    ("Training accuracy, %", TABLE1_COLUMNS[7][1]),
    ("Test accuracy, %, maximum", TABLE1_COLUMNS[9][1]),
    ("Test accuracy, %, final [95 %]", interval_cell),
    ("McNemar p", TABLE1_COLUMNS[11][1]),
    ("Prediction, ms a frame", predict_cell),
    *TABLE1_COLUMNS[12:],
)  # fmt: skip
CURVE_COLUMNS: Columns = (
    ("Model", _name),
    ("N", lambda r: str(r["n_train"] or "all")),
    ("D", lambda r: str(r["pixels"] or "all")),
    ("Seeds", lambda r: str(r["seeds"])),
    ("Test accuracy, %, final [95 %]", interval_cell),
    ("Training time, s", time_cell),
    ("Prediction, ms a frame", EXTENDED_COLUMNS[9][1]),
    ("Size", TABLE1_COLUMNS[12][1]),
    ("Status", TABLE1_COLUMNS[13][1]),
)


def origin(rows: Sequence[Row]) -> str:
    """Where the frames of a table come from, for its caption: ``simulated``, ``recorded`` …"""
    found = sorted({str(line["origin"]) for line in rows if line.get("origin")})
    return " and ".join(found) or "no"


def caption(rows: Sequence[Row], what: str) -> str:
    """What a table shows, on which frames, on which machine."""
    scene = " and ".join(sorted({line["scene"] for line in rows}))
    machine = "; ".join(sorted({
        f"{line['cpu']}, {line['threads']} threads" for line in rows if line.get("cpu")
    }))  # fmt: skip
    text = f"{what}, on {origin(rows)} frames of the scene “{scene}”."
    return f"{text} Measured on {machine}." if machine else text


def notes(rows: Sequence[Row]) -> str:
    """How to read a table's numbers."""
    text = (
        "Training time: of a model that learns step by step, until its training accuracy exceeded "
        "90 %; of any other, until it is done (HDC: until the prototypes are made). Times are "
        "medians (quartiles) and accuracies means over the seeds; maxima are over a run, the final "
        "accuracy is the last model's. Intervals: Wilson, 95 %, for the test samples of all seeds "
        "together (paper: 100 samples). McNemar p: exact, against HDC on the same test samples."
    )
    if old := [line for line in rows if line.get("code", "current") != "current"]:
        files = sorted({name for line in old for name in line["code"].split(", ")})
        text += (
            f" Made by other code than this ({', '.join(files)} changed since): "
            f"{', '.join(dict.fromkeys(display_name(line['model']) for line in old))}."
        )
    if any("reached" in (line.get("stop") or "").split("; ") for line in rows):
        text += " Runs marked reached were stopped at 90 %: later accuracies may be higher."
    return text


def to_markdown(rows: Sequence[Row], columns: Columns, title: str) -> str:
    """A Markdown table with its caption above and its notes below."""
    lines = [[name for name, _ in columns], ["---"] * len(columns)]
    lines += [[_markdown(cell(line)) for _, cell in columns] for line in rows]
    table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    return f"**{_markdown(caption(rows, title))}**\n\n{table}\n\n{_markdown(notes(rows))}\n"


def _markdown(text: str) -> str:
    """Text as it is: what a record quotes makes no line, cell, tag, code or link of its own."""
    text = re.sub(r"([\\`*|]|(?<=\])[(\[:])", r"\\\1", " ".join(text.split()))
    return text.replace("&", "&amp;").replace("<", "&lt;")


def to_latex(rows: Sequence[Row], columns: Columns, title: str, label: str) -> str:
    """A LaTeX table (needs the package booktabs) with its caption above and its notes below."""
    align = "l" + "r" * (len(columns) - 2) + "l"
    # A header is broken where it has commas.
    heads = [_tex(name).replace(", ", r" \\ ") for name, _ in columns]
    head = " & ".join(rf"\shortstack{{{name}}}" for name in heads)
    body = [" & ".join(_tex(cell(line)) for _, cell in columns) + r" \\" for line in rows]
    return "\n".join([
        "% needs \\usepackage{booktabs}",
        r"\begin{table*}",
        r"\centering",
        r"\scriptsize",
        rf"\caption{{{_tex(caption(rows, title))}}}",
        rf"\label{{tab:{label}}}",
        rf"\begin{{tabular}}{{{align}}}",
        r"\toprule",
        head + r" \\",
        r"\midrule",
        *body,
        r"\bottomrule",
        r"\end{tabular}",
        "",
        rf"\medskip\raggedright {_tex(notes(rows))}",
        r"\end{table*}",
        "",
    ])  # fmt: skip


_TEX = {
    **{letter: f"\\{letter}" for letter in "&%$#_{}"},
    **{letter: f"${letter}$" for letter in "<>|"},
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "×": r"$\times$", "–": "--", "…": "--", "“": "``", "”": "''",
}  # fmt: skip


def _tex(text: str) -> str:
    # TeX stops at control characters.
    plain = "".join(letter for letter in " ".join(text.split()) if letter.isprintable())
    return "".join(_TEX.get(letter, letter) for letter in plain)
