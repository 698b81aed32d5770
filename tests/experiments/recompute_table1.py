"""Every measured number of table1.csv once more, from the records, by code that shares nothing with
that which made it.

    python -m tests.experiments.recompute_table1 results/reference

Reads ``records.jsonl``, ``published.csv``, the two configs of Table I and the table with json, csv,
YAML and numpy. Exits 1 and names each cell on which the two disagree, each row that the table
lacks, and a file that is not there.
"""

from __future__ import annotations

import csv
import json
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import yaml

ROOT = Path(__file__).parents[2]
SCENE, EXPERIMENTS = "touch", ("table1", "table1_descent")
RECIPES = {"softmax_descent": "softmax"}  # whose row of the paper a model repeats
PUBLISHED = ROOT / "results" / "published.csv"
TOLERANCE = 2e-5  # the table has six digits
# The 97.5 % quantiles of Student's t, from one degree of freedom on, as tables print them.
STUDENT = (12.7062047, 4.3026527, 3.1824463, 2.7764451, 2.5705818, 2.4469119, 2.3646243,
           2.3060041, 2.2621572)  # fmt: skip
STOPS = ("paper", "long", "end", "quick", "reached")


def runs_of(folder: Path) -> list[dict]:
    """Every training that finished, in the order in which they ended; its last row are its
    ``results``."""
    lines = (folder / "records.jsonl").read_text("utf-8").splitlines()
    runs = []
    for record in map(json.loads, lines):
        if "model" in record and record.get("status", "finished") == "finished":
            columns, values = record["rows"]["columns"], record["rows"]["values"]
            rows = [dict(zip(columns, row)) for row in values]  # noqa: B905  (trimmed)
            runs.append(record | {"results": rows.pop(), "curve": rows})
    return runs


def models() -> list[str]:
    """The models that the configs of Table I name."""
    names: list[str] = []
    for name in EXPERIMENTS:
        path = ROOT / "configs" / "experiment" / f"{name}.yaml"
        tree = yaml.safe_load(path.read_text("utf-8"))
        names += tree["hydra"]["sweeper"]["params"]["model"].split(",")
    return names


def counting(runs: list[dict], model: str) -> list[dict]:
    """The runs of a row, the last of each seed: those alone on the machine, by the first rule to
    stop of which there are some."""
    own = []
    for run in runs:
        config = run["config"]
        whole = config["split"]["n_train"] is config["data"]["pixels"] is None
        named = (run["scene"]["name"], run["model"]["name"]) == (SCENE, model)
        if named and whole and not run.get("changed"):
            own.append(run)

    def place(run: dict) -> tuple[bool, int]:
        alone = run["environment"].get("exclusive", True)
        return not alone, STOPS.index(run["stop"])

    first = min(map(place, own), default=None)
    by_seed = {run["config"]["seed"]["run"]: run for run in own if place(run) == first}
    return [by_seed[seed] for seed in sorted(by_seed)]


def is_iterative(run: dict) -> bool:
    return any("loss" in row for row in run["curve"])


def seconds(run: dict) -> float:
    """Training time: of an iterative model that until training accuracy passes 90 %."""
    if not is_iterative(run):
        return run["results"]["total_time_s"]
    reached = (row for row in run["curve"] if (row.get("train_accuracy") or 0) > 0.9)
    return next((row["training_s"] for row in reached), math.inf)


def at_papers(run: dict, level: float | None) -> float | None:
    """Test accuracy at the first report with the paper's training accuracy, or after one pass."""
    if not is_iterative(run):
        return run["results"]["test_accuracy_final"]
    for report in run["curve"]:
        if level is not None and (report.get("train_accuracy") or 0) >= level:
            return report.get("test_accuracy")
    return None


def papers_level(model: str) -> float | None:
    """Training accuracy of the paper, a fraction."""
    wanted = f"{RECIPES.get(model, model)}_training_accuracy"
    with PUBLISHED.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if (row["experiment"], row["quantity"]) == ("table1", wanted):
                return float(row["value"]) / 100
    return None


def mean_share(name: str, shares: list[float], n: float) -> dict[str, float]:
    """Mean of shares of n samples, one per seed, with Student's interval; two right and two wrong
    more make their least variance. Of one seed Wilson's interval."""
    if not shares:
        return {name: math.nan}
    mean, seeds = float(np.mean(shares)), len(shares)
    if seeds == 1:
        z = 1.959963984540054
        centre = (mean + z**2 / (2 * n)) / (1 + z**2 / n)
        half = (
            z * math.sqrt(mean * (1 - mean) / n + (z / (2 * n)) ** 2) / (1 + z**2 / n)
        )
        low, high = centre - half, centre + half
    else:
        p = (sum(shares) * n + 2) / (seeds * n + 4)
        variance = max(float(np.var(shares, ddof=1)), p * (1 - p) / n)
        half = STUDENT[seeds - 2] * math.sqrt(variance / seeds)
        low, high = mean - half, mean + half
    return {name: mean, f"{name}_low": max(0.0, low), f"{name}_high": min(1.0, high)}


def median_range(name: str, values: list[float]) -> dict[str, float]:
    """Median with its order-statistic interval of 95 %; of too few values least and most."""
    ordered, n = sorted(values), len(values)
    found = {name: float(np.median(ordered))}
    if n == 1:
        return found
    chance = [math.comb(n, j) / 2**n for j in range(n + 1)]
    inner = 0
    while inner < n // 2 and sum(chance[: inner + 1]) <= 0.025:
        inner += 1
    inner = max(inner, 1)
    return found | {
        f"{name}_low": ordered[inner - 1],
        f"{name}_high": ordered[n - inner],
    }


def recompute(runs: list[dict], model: str) -> dict[str, float]:
    """The measured cells of a row by column; nan where there is no number."""
    own = [run["results"] for run in counting(runs, model)]
    n = float(np.mean([run["n_test"] for run in own]))
    finals = [run["test_accuracy_final"] for run in own]
    early = [run.get("test_accuracy_at_target") for run in own]
    found = {"seeds": len(own), "n_test": sum(run["n_test"] for run in own)}
    found |= mean_share("test_accuracy_final", finals, n)
    found["test_accuracy_at_target"] = _mean(early)
    found["train_accuracy_final"] = _mean([run["train_accuracy_final"] for run in own])
    times = [seconds(run) for run in counting(runs, model)]
    if math.inf not in times:
        found["training_time_s"] = float(np.median(times))
    found["total_time_s"] = float(np.median([run["total_time_s"] for run in own]))
    beside = [run.get("beside.hdc_s") for run in own]
    if model != "hdc" and None not in beside and math.inf not in times:
        ratios = [time / of for time, of in zip(times, beside, strict=True)]
        found |= median_range("training_time_over_hdc", ratios)
    level = papers_level(model)
    shares = (at_papers(run, level) for run in counting(runs, model))
    known = [share for share in shares if share is not None]
    return found | mean_share("test_accuracy_at_papers", known, n)


def _mean(values: list[float | None]) -> float:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else math.nan


def disagreements(path: Path) -> Iterator[str]:
    """Cells that the records do not give again, rows that are missing, files that are missing."""
    files = path / "records.jsonl", path / "tables" / "table1.csv"
    missing = [file for file in files if not file.is_file()]
    yield from (f"{file}: missing" for file in missing)
    if missing:
        return
    runs = runs_of(path)
    with files[1].open(encoding="utf-8") as file:
        rows = {row["model"]: row for row in csv.DictReader(file)}
    for model in models():
        if not counting(runs, model):
            continue
        if model not in rows:
            yield f"{model}: missing"
            continue
        for column, value in recompute(runs, model).items():
            stated = float(rows[model][column]) if rows[model][column] else math.nan
            nothing = math.isnan(stated) and math.isnan(value)
            close = math.isclose(stated, value, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
            if not nothing and not close:
                yield f"{model}, {column}: {stated}, recomputed {value}"


def main(find: Callable[[Path], Iterator[str]], table: str) -> int:
    """Print where a table of the results of the command line disagrees with its records."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "results" / "reference")
    wrong = list(find(folder))
    print("\n".join(wrong) or f"{folder / 'tables' / table}: every number recomputed")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(disagreements, "table1.csv"))
