"""Tables of the measurements stiffness, softmax_methods and footprint: CSV, and Markdown to read.

Each table says what was measured and how; a measurement that is not there has no table. The
numbers in the text are those of the rows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from experiments import measurement, table_text
from experiments.measurement import Measured
from experiments.record import write_atomically

Row = dict[str, Any]
GROUP = ("model", "pixels", "method", "start")  # of the rows of one sweep
PAPER_RATE = 1e-4  # Sec. III.A
GAPS = (1e-1, 1e-3, 1e-5)  # of F − F*, to which the time is told
_PIXELS = {"raw": "0…255", "unit": "0…1", "standard": "standardised",
           "unit_centred": "0…1, centred", "centred": "0…1, each centred"}  # fmt: skip
_METHODS = {"GD": "gradient descent", "SGD": "SGD, batches of 20", "Adam": "Adam, batches of 20"}


def write(results: Path) -> list[Path]:
    """Write the tables of the measurements that a results folder has; what was written."""
    written: list[Path] = []
    for name, rows, text in (
        ("stiffness", limits, _limits_text),
        ("softmax_methods", methods, _methods_text),
        ("footprint", footprint, _footprint_text),
    ):
        measured = measurement.read(results, name)
        if measured is None or not measured.rows:
            continue
        made = rows(measured)
        for kind, content in (
            ("csv", measurement.to_csv(made)),
            ("md", text(measured, made)),
        ):
            path = results / "tables" / f"{name}.{kind}"
            write_atomically(path, content)
            written.append(path)
    return written


# Stability limits ---------------------------------------------------------------------------------


def limits(measured: Measured) -> list[Row]:
    """One row a sweep: the predicted largest stable rate and those observed.

    An observed limit is the geometric mean of the lowest rate at which something happened and the
    next lower one; ``> rate`` and ``< rate`` if it never or always happened.
    """
    return [_limit(lines) for lines in sweeps(measured).values()]


def sweeps(measured: Measured) -> dict[tuple[str, ...], list[dict[str, str]]]:
    """The rows of each sweep by model, pixels, method and start, in the order of their rates."""
    found: dict[tuple[str, ...], list[dict[str, str]]] = {}
    for row in measured.rows:
        if row["kind"] == "sweep":
            found.setdefault(tuple(row[key] for key in GROUP), []).append(row)
    return {key: sorted(lines, key=lambda r: float(r["rate"])) for key, lines in found.items()}


def _limit(lines: Sequence[dict[str, str]]) -> Row:
    first = lines[0]
    predicted = float(first["predicted"])
    row: Row = {key: first[key] for key in GROUP}
    row |= {
        "n": int(first["n"]),
        "d": int(first["d"]),
        "lambda_max": float(first["lambda_max"]) if "lambda_max" in first else None,
        "predicted": predicted,
    }
    for key in ("rises", "exceeds", "ends_above"):
        row[key], ratio = _crossing(lines, key, predicted)
        row[f"{key}_over_predicted"] = ratio
    seen = row["exceeds_over_predicted"]
    row["within_factor_2"] = "yes" if seen and 0.5 <= seen <= 2 else "no"
    row["why_not"] = "" if row["within_factor_2"] == "yes" else _why_not(row, lines)
    return row


def _crossing(
    lines: Sequence[dict[str, str]], key: str, predicted: float
) -> tuple[float | str, float | None]:
    """The observed limit, and its ratio to the predicted one where there is a number."""
    rates = [float(line["rate"]) for line in lines]
    at = next((k for k, line in enumerate(lines) if line[key] == "yes"), None)
    if at is None:
        return f"> {table_text.number(rates[-1])}", None
    if at == 0:
        return f"< {table_text.number(rates[0])}", None
    limit = math.sqrt(rates[at - 1] * rates[at])
    return limit, limit / predicted


def _why_not(row: Row, lines: Sequence[dict[str, str]]) -> str:
    """What the rows themselves say of a limit that was not found where it was predicted."""
    left = [(float(x["rate"]), float(x["lambda_end"])) for x in lines if "lambda_end" in x]
    if isinstance(row["exceeds"], str) and row["exceeds"].startswith(">"):
        text = "the loss falls at every rate: "
        above = next((x for x in left if x[0] > row["predicted"]), None)
        if above is None:
            return text + "the frames are separated before the swings grow"
        return (
            text + "the frames are separated before the swings grow, and the curvature goes with "
            f"the loss (λ_max at the end {table_text.number(above[1])}, at the start "
            f"{table_text.number(row['lambda_max'])})"
        )
    if row["method"] == "Adam":
        return (
            "the prediction takes the mean square of the slopes as settled; the first steps are "
            "made without, all of the same size. The loss is above the start in the first epochs"
            + _and_ends(row)
        )
    grown = max((value for _, value in left), default=0.0)
    if grown > 1.5 * row["lambda_max"]:
        return (
            "the network sharpens as it learns: λ_max at the end of a stable run is "
            f"{table_text.number(grown)}, at the start {table_text.number(row['lambda_max'])}; "
            f"the limit has come down to {table_text.number(2 / grown)}"
        )
    return "λ_max at the start is no bound along the way"


def _and_ends(row: Row) -> str:
    ends = row["ends_above"]
    rates = ends if isinstance(ends, str) else f"above {table_text.number(ends)}"
    return f", and at the end for rates {rates}"


def _limits_text(measured: Measured, rows: Sequence[Row]) -> str:
    def seen(key: str) -> Callable[[Row], str]:
        return lambda r: table_text.number(r[key])

    table = _markdown(rows, (
        ("Model", lambda r: table_text.display_name(r["model"])),
        ("Pixels", lambda r: _PIXELS[r["pixels"]]),
        ("Method", lambda r: _METHODS[r["method"]]),
        ("Start", lambda r: r["start"]),
        ("N × D", lambda r: f"{r['n']} × {r['d']:,}"),
        ("λ_max", seen("lambda_max")),
        ("Predicted limit", seen("predicted")),
        ("Loss rises above", seen("rises")),
        ("Loss exceeds the start above", seen("exceeds")),
        ("Loss ends above the start above", seen("ends_above")),
        ("Observed / predicted", seen("exceeds_over_predicted")),
        ("Within a factor 2", lambda r: r["within_factor_2"]),
        ("Why not", lambda r: r["why_not"]),
    ))  # fmt: skip
    return (
        f"**Largest stable learning rates, {_where(measured)}**\n\n{table}\n\n"
        "Predicted: 2/λ_max of the Hessian at the start; for SGD of the mean over minibatches; "
        "for Adam 38/λ_max of the Hessian preconditioned by the slopes of an epoch. Observed: "
        "geometric mean of the two swept rates between which the loss begins to exceed the start. "
        "Start `optimum`: of the penalised loss, slightly perturbed; the other softmax rows begin "
        "at zero weights and have no penalty. The convolutional networks see fewer frames and only "
        f"the middle of each.\n\n{why_1e_4(rows)}\n"
    )


def why_1e_4(rows: Sequence[Row]) -> str:
    """A paragraph on the published learning rate, its numbers from the rows of :func:`limits`."""
    found = {
        (r["pixels"], r["method"]): r["predicted"]
        for r in rows
        if (r["model"], r["start"]) == ("softmax", "zero")
    }
    known = [(m, found["unit", m]) for m in _METHODS if ("unit", m) in found]
    if not known:
        return ""
    tens = {10.0 ** math.floor(math.log10(limit)) for _, limit in known}
    text = "**Why 1e-4?** On pixels in 0…1 the predicted limits for softmax regression are "
    text += ", ".join(f"{_rate(limit)} ({_METHODS[m]})" for m, limit in known)
    text += (
        f": the largest power of ten below {'each' if len(known) > 1 else 'it'} is "
        + " or ".join(_rate(ten) for ten in sorted(tens))
        + (", the published rate" if tens == {PAPER_RATE} else f" (published: {_rate(PAPER_RATE)})")
        + ". "
    )
    if ("raw", "GD") in found:
        times = PAPER_RATE / found["raw", "GD"]
        text += (
            f"On pixels in 0…255 the limit of gradient descent is {_rate(found['raw', 'GD'])}, and "
            f"{_rate(PAPER_RATE)} is {table_text.number(times)} times that. "
        )
    if ("standard", "GD") in found:
        text += f"On standardised pixels it is {_rate(found['standard', 'GD'])}. "
    return text + (
        "The paper names neither the optimiser nor the scaling; the rate is the one that trying "
        "powers of ten on pixels in 0…1 would find, which is no proof that it was found so. The "
        "limits fall as 1/D and as one over the square of the mean brightness, which all frames "
        "share and which here is that of a simulated sensor. Above them the loss swings at first "
        "and comes down later: the gradients are bounded, and the frames separable."
    )


# Methods ------------------------------------------------------------------------------------------


def methods(measured: Measured) -> list[Row]:
    """One row a method: the time to each of :data:`GAPS`, and where it ended."""
    found: dict[tuple[str, str, str], list[dict[str, str]]] = {}
    for line in measured.rows:
        # The dual methods choose their rate themselves: all their rows are one curve.
        rate = "" if "steps" in line else line.get("rate", "")
        found.setdefault((line["method"], line["pixels"], rate), []).append(line)
    rows = []
    for (method, pixels, _), lines in found.items():
        lines.sort(key=work)
        last = lines[-1]
        row: Row = {"method": method, "pixels": pixels,
                    "rate": float(last["rate"]) if "rate" in last else None}  # fmt: skip
        for gap in GAPS:
            times = [float(x["seconds"]) for x in lines if float(x["loss_gap"]) <= gap]
            row[f"seconds_to_{gap:g}"] = times[0] if times else None
        row |= {key: float(last[key]) for key in ("seconds", "loss_gap", "test_error")}
        rows.append(row)
    return rows


def work(row: dict[str, str]) -> float:
    """Steps of a method that is run anew for each number of them, else seconds: orders a curve."""
    return float(row.get("steps", row["seconds"]))


def _methods_text(measured: Measured, rows: Sequence[Row]) -> str:
    def to(gap: float) -> tuple[str, Callable[[Row], str]]:
        return f"s to F − F* ≤ {gap:g}", lambda r: table_text.number(r[f"seconds_to_{gap:g}"])

    table = _markdown(rows, (
        ("Method", lambda r: r["method"]),
        ("Pixels", lambda r: _PIXELS[r["pixels"]]),
        ("Rate", lambda r: table_text.number(r["rate"])),
        *(to(gap) for gap in GAPS),
        ("s in all", lambda r: table_text.number(r["seconds"])),
        ("F − F* at the end", lambda r: table_text.number(r["loss_gap"])),
        ("Test error, %, at the end", lambda r: table_text.percent(r["test_error"])),
    ))  # fmt: skip
    return (
        f"**Softmax regression by explicit, adaptive and second-order methods, "
        f"{_where(measured)}**\n\n{table}\n\n"
        "F: mean cross-entropy + ‖W‖²/(2CN), pixels in 0…1; F*: the dual Newton method at its "
        "tightest. Gradient descent at 0.9 of its stability limit. – : not reached in the time "
        "given.\n"
    )


# Footprint ----------------------------------------------------------------------------------------


def footprint(measured: Measured) -> list[Row]:
    """The rows as they are, numbers as numbers."""
    numbers = ("n", "modules", "peak_bytes", "torch_bytes", "above_torch_bytes")
    return [
        {k: int(v) if k in numbers else float(v) if k.endswith("_s") else v for k, v in row.items()}
        for row in measured.rows
    ]


def _footprint_text(measured: Measured, rows: Sequence[Row]) -> str:
    def scaled(key: str, factor: float) -> Callable[[Row], str]:
        return lambda r: table_text.number(r[key] * factor) if key in r else "–"

    def name(r: Row) -> str:
        return " ".join(filter(None, (r.get("scene"), r.get("model")))) or "–"

    table = _markdown(rows, (
        ("Scene and model", name),
        ("What", lambda r: r["what"] + (f", N = {r['n']}" if "n" in r else "")),
        ("First prediction, s", scaled("first_prediction_s", 1)),
        ("of it importing torch, s", scaled("torch_s", 1)),
        ("A frame, ms", scaled("frame_s", 1e3)),
        ("Peak, MB", scaled("peak_bytes", 1e-6)),
        ("above torch's, MB", scaled("above_torch_bytes", 1e-6)),
        ("Modules", lambda r: str(r.get("modules", "–"))),
        ("Loaded of those watched", lambda r: r.get("loaded", "–")),
        ("Parts built", lambda r: r.get("parts", "–")),
        ("Status", lambda r: r["status"]),
    ))  # fmt: skip
    return (
        f"**What each scene and model load, build and hold. {_machine(measured)}**\n\n{table}\n\n"
        "Every row is a process of its own. First prediction: from the start of the process, scene "
        "and model built, frames made and learnt. Watched: cv2, sklearn, pandas, matplotlib, "
        "scipy, scipy.stats, baselines.cnn and the parts of other scenes. `stream`: frames made, "
        "predicted and learnt as they come; `run`: the whole command line, which holds the frames "
        "of a run in memory. `everything`: texture, two sessions, drift and creep. The sensor is "
        "simulated, the transmission matrices of the fibre are measured.\n"
    )


# Parts --------------------------------------------------------------------------------------------


def _markdown(rows: Sequence[Row], columns: table_text.Columns) -> str:
    def lines() -> Iterator[list[str]]:
        yield [name for name, _ in columns]
        yield ["---"] * len(columns)
        for row in rows:
            yield [cell(row).replace("|", "\\|") for _, cell in columns]

    return "\n".join("| " + " | ".join(line) + " |" for line in lines())


def _where(measured: Measured) -> str:
    scene = measured.record["config"]["scene"]["_target_"]
    kind = "simulated" if scene.startswith("scenes.sensor.") else scene
    return f"on {kind} frames. {_machine(measured)}"


def _machine(measured: Measured) -> str:
    environment = measured.record["environment"]
    threads = environment["threads"]
    text = f"{environment['cpu']}, {threads} thread{'s' * (threads != 1)}."
    if changed := measured.outdated:
        text += f" Made by other code than this ({', '.join(changed)} changed since)."
    return text


def _rate(value: float) -> str:
    return f"{value:.1e}".replace(".0e", "e").replace("e-0", "e-")
