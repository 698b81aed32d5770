"""Tables from records: the numbers of a row, and a table as CSV, Markdown and LaTeX.

What a row says, for the records of all its seeds:

- Times are medians with quartiles. The training time of a model that learns step by step is the
  paper's: until its training accuracy exceeded 90 %. A seed that never did counts as infinitely
  long, so a median or quartile may be "not reached in T s". A model that learns in one pass has the
  time until it is done (for HDC: until the prototypes are made).
- Accuracies are means over the seeds. ``test_accuracy_final`` is that of the last model; its
  interval is Wilson's for the counts of all seeds together, as if they were independent samples.
- ``mcnemar_p`` is the exact McNemar test against ``hdc`` on the same test samples, seeds together.
"""

from __future__ import annotations

import csv
import functools
import io
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from experiments import evaluate, sources
from experiments.record import ROOT
from experiments.selection import Group, Records, Run, numbers, sweep

Row = dict[str, Any]

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
PUBLISHED_TEST_SAMPLES = 100  # Fig. 5(a) of the paper

# Columns of table1.csv and table1_extended.csv.
# fmt: off
TABLE1 = (
    "model", "n_train",
    "training_time_s", "training_time_q25_s", "training_time_q75_s",
    "time_to_90_train_s", "time_to_90_test_s", "total_time_s",
    "train_accuracy_max", "train_accuracy_final", "test_accuracy_max", "test_accuracy_final",
    "test_ci_low", "test_ci_high", "mcnemar_p", "model_bytes", "predict_single_s",
    "training_time_over_hdc",
    "published_training_time_s", "published_training_time_over_hdc", "published_train_accuracy",
    "published_test_accuracy", "published_test_ci_low", "published_test_ci_high",
    "seeds", "stop", "status", "scene", "origin", "cpu", "threads", "code",
)
# Columns of accuracy_vs_n.csv, accuracy_vs_d.csv and work_precision.csv.
CURVE = (
    "model", "n_train", "pixels", "test_accuracy_final", "test_ci_low", "test_ci_high",
    "test_accuracy_max", "training_time_s", "training_time_q25_s", "training_time_q75_s",
    "predict_single_s", "predict_batch_s_per_frame", "model_bytes",
    "seeds", "stop", "status", "scene", "origin", "code",
)
# fmt: on


# Rows ---------------------------------------------------------------------------------------------


def table1(records: Records, experiment: str = "table1") -> list[Row]:
    """One row for each model of the experiment, in its order."""
    params = sweep(experiment)
    scene = params["scene"][0]
    hdc = records.group(scene, "hdc")
    return [row(records.group(scene, model), hdc) for model in params["model"]]


def curve(records: Records, experiments: Sequence[str]) -> list[Row]:
    """One row for each model, number of training samples and of pixels of the experiments."""
    rows = []
    for experiment in experiments:
        params = sweep(experiment)
        scene = params["scene"][0]
        for model in params["model"]:
            for n in numbers(params.get("split.n_train", ["null"])):
                for pixels in numbers(params.get("data.pixels", ["null"])):
                    hdc = records.group(scene, "hdc", n, pixels)
                    rows.append(row(records.group(scene, model, n, pixels), hdc))
    return rows


def row(group: Group, hdc: Group) -> Row:
    """What the runs of a group say, with the published numbers; None where there is nothing."""
    result: Row = {
        "model": group.model,
        "n_train": group.n_train,
        "pixels": group.pixels,
        "seeds": len(group.runs),
        "status": group.status,
        "scene": group.scene,
        **_published(group),
    }
    if not group.runs:
        return result
    runs, records = group.runs, [run.record for run in group.runs]
    longest = max(record["training_s"] for record in records)
    q25, median, q75 = _quartiles([training_time(run) for run in runs])
    right = sum(int(_right(record).sum()) for record in records)
    n_test = sum(record["n_test"] for record in records)
    low, high = evaluate.wilson(right, n_test)

    def mean(key: str) -> float | None:
        values = [record[key] for record in records if record[key] is not None]
        return float(np.mean(values)) if values else None

    def to_target(key: str) -> float | str:
        return _reached(_quartiles([_or_never(record[key]) for record in records])[1], longest)

    reference = _quartiles([training_time(run) for run in hdc.runs])[1] if hdc.runs else None
    result |= {
        "n_train": records[0]["n_train"],
        "pixels": group.pixels or int(np.prod(records[0]["scene"]["shape"])),
        "training_time_s": _reached(median, longest),
        "training_time_q25_s": _reached(q25, longest),
        "training_time_q75_s": _reached(q75, longest),
        "time_to_90_train_s": to_target("time_to_target_train_s"),
        "time_to_90_test_s": to_target("time_to_target_test_s"),
        "total_time_s": float(np.median([record["training_s"] for record in records])),
        "train_accuracy_max": mean("train_accuracy_max"),
        "train_accuracy_final": mean("train_accuracy_final"),
        "test_accuracy_max": mean("test_accuracy_max"),
        "test_accuracy_final": right / n_test,
        "test_ci_low": low,
        "test_ci_high": high,
        "n_test": n_test,
        "mcnemar_p": None if group.model == "hdc" else mcnemar(runs, hdc.runs),
        "model_bytes": _same(record["model_bytes"] for record in records),
        "predict_single_s": float(np.median([r["predict_single_s"] for r in records])),
        "predict_batch_s_per_frame": float(
            np.median([r["predict_batch_s_per_frame"] for r in records])
        ),
        "training_time_over_hdc": (
            median / reference if reference and np.isfinite(median) else None
        ),
        "stop": "; ".join(sorted({record["stop"] for record in records})),
        "origin": _same(record["scene"]["origin"] for record in records),
        "cpu": _same(record["environment"]["cpu"] for record in records),
        "threads": _same(record["environment"]["threads"] for record in records),
        "code": ", ".join(sources.outdated(_files(records))) or "current",
    }
    return result


def training_time(run: Run) -> float:
    """Seconds in the paper's sense (see above); infinite if 90 % were not reached."""
    if run.iterative:
        return _or_never(run.record["time_to_target_train_s"])
    return float(run.record["training_s"])


def mcnemar(runs: Sequence[Run], reference: Sequence[Run]) -> float | None:
    """Exact McNemar test on the test samples of all seeds that both have; None without any."""
    theirs = {run.seeds: run.record for run in reference}
    pairs = [
        (_right(run.record), _right(theirs[run.seeds]))
        for run in runs
        if run.seeds in theirs
        and run.record["data_sha256"]["test"] == theirs[run.seeds]["data_sha256"]["test"]
    ]
    if not pairs:
        return None
    a, b = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return evaluate.mcnemar(a, b)


@functools.cache
def published() -> dict[str, float]:
    """Numbers of the paper by experiment and quantity; fractions where it has percent.

    Raises:
        ValueError: naming the file, if it is not a table of them.
    """
    path = ROOT / "results" / "published.csv"
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return {
                f"{line['experiment']}/{line['quantity']}": float(line["value"])
                / (100 if line["unit"] == "%" else 1)
                for line in csv.DictReader(file, strict=True)
                if line["value"]
            }
    except (KeyError, ValueError, csv.Error) as error:
        raise ValueError(
            f"{path}: expected experiment, quantity, value and unit in each row, found: {error!r}"
        ) from error


def published_row(model: str) -> Row:
    """The published line of Table I for a model, as far as there is one."""
    known = published()
    time = known.get(f"table1/{model}_training_time")
    accuracy = known.get(f"table1/{model}_test_accuracy")
    low, high = (None, None) if accuracy is None else wilson_of_published(accuracy)
    return {
        "published_training_time_s": time,
        "published_training_time_over_hdc": time and time / known["table1/hdc_training_time"],
        "published_train_accuracy": known.get(f"table1/{model}_training_accuracy"),
        "published_test_accuracy": accuracy,
        "published_test_ci_low": low,
        "published_test_ci_high": high,
    }


def wilson_of_published(accuracy: float) -> tuple[float, float]:
    """95 % interval of a published test accuracy, which is of 100 samples."""
    return evaluate.wilson(round(accuracy * PUBLISHED_TEST_SAMPLES), PUBLISHED_TEST_SAMPLES)


def _published(group: Group) -> Row:
    # The paper's table is about its touch experiment with all samples and all pixels.
    fits = group.scene == "touch" and group.n_train is None and group.pixels is None
    return published_row(group.model if fits else "")


def _right(record: Mapping[str, Any]) -> np.ndarray:
    return np.equal(record["predicted"], record["test_labels"])


def _or_never(seconds: float | None) -> float:
    return np.inf if seconds is None else float(seconds)


def _quartiles(times: Sequence[float]) -> list[float]:
    """Quartiles; one between a number and infinity is infinite."""
    ordered = np.sort(times)
    result = []
    for q in (0.25, 0.5, 0.75):
        place = q * (len(ordered) - 1)
        below, above = ordered[int(np.floor(place))], ordered[int(np.ceil(place))]
        never = np.isinf(above)
        result.append(np.inf if never else float(below + (place % 1) * (above - below)))
    return result


def _reached(seconds: float, longest: float) -> float | str:
    return seconds if np.isfinite(seconds) else f"not reached in {longest:.3g} s"


def _files(records: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """The code of a row's records, which agree (:class:`selection.Records` sees to it)."""
    return {k: v for record in records for k, v in record["environment"]["sources"].items()}


def _same(values: Any) -> Any:
    distinct = set(values)
    return distinct.pop() if len(distinct) == 1 else "mixed"


# Text ---------------------------------------------------------------------------------------------


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
