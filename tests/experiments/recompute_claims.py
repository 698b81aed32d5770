"""Every number of verdicts.csv once more, from the records, by code that shares nothing with that
which judged.

    python -m tests.experiments.recompute_claims results/reference

Reads ``records.jsonl``, ``rules_4.yaml`` and the table with json, YAML, csv and numpy. The
posterior is integrated over the numbers of the sources themselves, by a fine sum, where the harness
writes Student's t as a mixture of normals. Exits 1 and names each cell on which the two disagree.
"""

from __future__ import annotations

import base64
import csv
import json
import math
import sys
import zlib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from statistics import NormalDist

import numpy as np
import yaml

from tests.experiments.recompute_table1 import STUDENT, main

ROOT = Path(__file__).parents[2]
RULES = yaml.safe_load(
    (ROOT / "experiments/studies/claims/rules_4.yaml").read_text("utf-8")
)
# In points, or as a probability: the harness's nodes for t and for τ are few.
TOLERANCES = {"mean": 0.1, "mean_low": 0.5, "mean_high": 0.5, "probability": 0.005}
EXACT = 1e-4  # of columns that are sums alone
KINDS = {"u1": "u1", "u2": "<u2", "i4": "<i4"}


def labels(text: str) -> np.ndarray:
    kind, _, packed = text.partition(":")
    data = zlib.decompress(base64.b64decode(packed))
    return np.frombuffer(data, KINDS[kind]).astype(int)


def rows_of(record: dict) -> Iterator[dict]:
    """The rows of a record; one that asked for several sizes is a row for each."""
    columns = record["rows"]["columns"]
    for values in record["rows"]["values"]:
        row = dict(zip(columns, values))  # noqa: B905  (trimmed)
        if isinstance(row.get("n"), list):
            for n, predicted in zip(row["n"], row["predicted"], strict=True):
                yield row | {"n": n, "predicted": predicted}
        else:
            yield row


def lines_of(record: dict) -> list[dict]:
    """Rows with their right answers: all, or in the second and the first session of a drift."""
    truth: dict[tuple, np.ndarray] = {}
    found = []
    for row in rows_of(record):
        draw = tuple(row.get(key) for key in ("seed", "split", "draw"))
        if row.get("labels"):
            truth[draw] = labels(row["labels"])
        if row.get("predicted"):
            right = labels(row["predicted"]) == truth[draw]
            n_new = row.get("n_test_new", len(right))
            row = row | {"right": int(right.sum()) if "n_test" in row else None}
            row |= {
                "right_new": int(right[:n_new].sum()),
                "right_old": int(right[n_new:].sum()),
            }
        found.append(row)
    return found


def lines(records: list[dict], claim: dict, name: str) -> list[dict]:
    """The rows on one recording, by the kind of its split that the rules state."""
    found = []
    for record in records:
        if record["experiment"] != claim["experiment"]:
            continue
        if record["scene"]["label"] != name:
            continue
        config = record["config"]
        for key in claim["split"].split("."):
            config = config[key]
        if config == RULES["recordings"][name]["split"]:
            found += [r for r in lines_of(record) if r.get("split") in (None, "counts")]
    return found


def difference(
    found: list[dict], claim: dict, name: str, size: int | str
) -> tuple[float, float] | None:
    """Mean over draws of the form's accuracy minus its rival's, and the variance of this mean."""

    def of(model: str, having: dict) -> list[dict]:
        keys = {"model": model, **having}
        return [row for row in found if all(row.get(k) == v for k, v in keys.items())]

    form = of(claim["form"], claim.get("of_form", {}))
    rival = of(claim["rival"], claim.get("of_rival", {}))
    if size != "as trained":
        largest = max((row["n"] for row in form + rival), default=0)
        n = largest if size == "largest" else size
        form, rival = ([r for r in of_one if r["n"] == n] for of_one in (form, rival))
    right, asked = claim.get("right", "right"), claim.get("asked", "n_test")
    rival_right = claim.get("rival_right", right)
    rival_asked = claim.get("rival_asked", asked)

    def shares(rows: list[dict], right: str, asked: str) -> dict[tuple, float]:
        drawn = {(r.get("seed") or 0, r.get("draw") or 0): r for r in rows}
        assert len(drawn) == len(rows)
        return {draw: row[right] / row[asked] for draw, row in drawn.items()}

    ours, theirs = shares(form, right, asked), shares(rival, rival_right, rival_asked)
    both = sorted(ours.keys() & theirs.keys())
    k = RULES["recordings"][name].get("groups") or claim.get("draws") or RULES["draws"]
    if len(both) < k:
        return None
    less = np.array([ours[draw] - theirs[draw] for draw in both[:k]])
    n = float(np.mean([row[asked] for row in form + rival]))
    least = (n * abs(less.mean()) + 1) / (n + 2) / n
    variance = max(less.var(ddof=1) if k > 1 else 0.0, least)
    return float(less.mean()), float(variance * (1 / k + RULES["shared"]))


def sources(
    records: list[dict], claim: dict, size: int | str, names: list[str]
) -> list[tuple[float, float]] | None:
    """The number of each source and its variance; None if a recording was not measured."""
    by_source: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for name in names:
        one = difference(lines(records, claim, name), claim, name, size)
        if one is None:
            return None
        by_source[RULES["recordings"][name]["source"]].append(one)
    found = []
    for of_one in by_source.values():
        means, within = np.array(of_one).T
        between = means.var(ddof=1) if len(means) > 1 else 0.0
        found.append((means.mean(), max(within.mean(), between) / len(means)))
    return found


STEP = 0.0005
THETA = np.arange(-1, 1 + STEP, STEP)  # numbers that a source may have
MU = 0.001 * (np.arange(-600, 600) + 0.5)
N_TAU = 48


def posteriors(every: list[list[tuple[float, float]]]) -> list[np.ndarray]:
    """The posterior of μ on its grid for several sets of sources."""
    prior, freedom = RULES["prior"], RULES["prior"]["freedom"]
    values = np.array([value for each in every for value, _ in each])
    scales = np.sqrt([variance for each in every for _, variance in each])
    t = (1 + ((values - THETA[:, None]) / scales) ** 2 / freedom) ** (
        -(freedom + 1) / 2
    )
    apart = MU[:, None] - THETA
    total = [np.zeros(len(MU)) for _ in every]
    for place in range(N_TAU):  # quantiles of the half-normal, each as likely
        tau = prior["between"] * NormalDist().inv_cdf(0.5 + (place + 0.5) / N_TAU / 2)
        normal = np.exp(-((apart / tau) ** 2) / 2)
        normal /= np.maximum(normal.sum(1, keepdims=True), 1e-300)
        likely = np.log(normal @ t / scales)
        start = 0
        for number, each in enumerate(every):
            log = likely[:, start : start + len(each)].sum(1)
            total[number] += np.exp(log - (MU / prior["mean"]) ** 2 / 2)
            start += len(each)
    return [each / each.sum() for each in total]


def names_of(claim: dict, size: int | str, status: str) -> list[str]:
    named = claim.get("recordings") or list(RULES["recordings"])
    known = RULES["recordings"]
    every = [n for n in named if size in known[n].get("sizes", [size])]
    if status == "all":
        return every
    return [name for name in every if known[name]["status"] == status]


def equal(found: list[tuple[float, float]]) -> dict[str, float]:
    """The mean over sources of equal weight, and Student's interval, in points."""
    values = np.array([100 * value for value, _ in found])
    cells = {"equal": values.mean(), "sources": len(values)}
    if len(values) > 1:
        half = STUDENT[len(values) - 2] * values.std(ddof=1) / math.sqrt(len(values))
        cells |= {"equal_low": values.mean() - half, "equal_high": values.mean() + half}
    return cells


def ratio(records: list[dict], times: dict) -> dict[str, float] | None:
    """The ratio of training times, and its range over medians and minima of the measurements."""
    medians, every = [], []
    for record in records:
        if record["experiment"] != times["experiment"]:
            continue
        seconds: dict[str, list[float]] = defaultdict(list)
        for row in rows_of(record):
            counts = row["threads"] == times["threads"] and not row["disturbed"]
            if counts and row.get("fit_s") is not None:
                seconds[row["model"]].append(row["fit_s"])
        ours, theirs = seconds[times["over"]], seconds[times["model"]]
        if min(len(ours), len(theirs)) < times["fits"]:
            return None
        medians.append(float(np.median(theirs) / np.median(ours)))
        every += [medians[-1], min(theirs) / min(ours)]
    if len(medians) < times["measurements"]:
        return None
    mean = math.exp(np.mean(np.log(medians)))
    return {"mean": mean, "mean_low": min(every), "mean_high": max(every)}


def differing(where: str, row: dict, cells: dict, tolerances: dict) -> Iterator[str]:
    for column, value in cells.items():
        stated = float(row[column]) if row[column] else math.nan
        allowed = tolerances.get(column, EXACT * max(1, abs(value)))
        if not abs(stated - value) <= allowed:
            yield f"{where}, {column}: {stated}, recomputed {value}"


def disagreements(folder: Path) -> Iterator[str]:
    """Cells that the records do not give again."""
    text = (folder / "records.jsonl").read_text("utf-8").splitlines()
    records = [json.loads(line) for line in text]
    with (folder / "tables" / "verdicts.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    judged = []
    for row in table:
        where = f"{row['claim']}, {row['size']}, {row['status']}"
        size = int(row["size"]) if row["size"].isdigit() else row["size"]
        if row["claim"] in RULES["claims"]:
            claim = RULES["claims"][row["claim"]]
            found = sources(records, claim, size, names_of(claim, size, row["status"]))
            if found is None:
                if row["word"] != "open":
                    yield f"{where}: {row['word']}, recomputed open"
                continue
            judged.append((where, row, found))
        elif row["claim"] in RULES["times"]:
            times = RULES["times"][row["claim"]]
            found = ratio(records, times)
            word = "open"
            if found is not None:
                yield from differing(where, row, found, {})
                if found["mean_low"] >= times["at_least"]:
                    word = "yes"
                elif found["mean_high"] < times["at_least"]:
                    word = "no"
            if row["word"] != word:
                yield f"{where}: {row['word']}, recomputed {word}"
        else:
            yield from choice(records, where, row)
    of_all = posteriors([found for _, _, found in judged])
    for (where, row, found), shares in zip(judged, of_all, strict=True):
        ends = np.interp((0.025, 0.975), shares.cumsum() - shares / 2, MU)
        likely = float(shares[-RULES["margin"] < MU].sum())
        cells = {"mean": 100 * float(shares @ MU), "probability": likely}
        cells |= {"mean_low": 100 * ends[0], "mean_high": 100 * ends[1]}
        yield from differing(where, row, cells | equal(found), TOLERANCES)
        sure = RULES["sure"]
        word = "yes" if likely >= sure else "no" if likely <= 1 - sure else "open"
        if word != row["word"]:
            yield f"{where}: {row['word']}, recomputed {word}"


def choice(records: list[dict], where: str, row: dict) -> Iterator[str]:
    """The first form at most the margin below the best, by sources of equal weight."""
    asked = RULES["choices"][row["claim"]]
    first, *others = asked["among"]
    gains = {first: 0.0}
    for form in others:
        claim = {**asked, "form": form, "rival": first}
        found = sources(records, claim, asked["size"], asked["recordings"])
        if found is None:
            return
        gains[form] = equal(found)["equal"]
    least = max(gains.values()) - 100 * RULES["margin"]
    word = next(form for form, gain in gains.items() if gain >= least)
    if word != row["word"]:
        yield f"{where}: {row['word']}, recomputed {word}"
    yield from differing(where, row, {"equal": gains[word]}, {})


if __name__ == "__main__":
    sys.exit(main(disagreements, "verdicts.csv"))
