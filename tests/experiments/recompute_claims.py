"""Every number of claims.csv once more, from the records, by code that shares nothing with it, and
the verdicts of contest.csv.

    python -m tests.experiments.recompute_claims results/reference

Reads ``records.jsonl``, the frozen rules and the two tables with json, csv, YAML and numpy.
It follows docs/claims.md, not the code that made the tables.
Exits 1 and names each cell on which the two disagree.
"""

from __future__ import annotations

import csv
import hashlib
import math
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml

from tests.experiments.recompute_arithmetic import (
    above,
    by_laboratory,
    contrast,
    of_mean,
    spread,
    word_of,
)
from tests.experiments.recompute_records import (
    ROOT,
    Folder,
    labels,
    shares,
    shown,
)

RULES = ROOT / "experiments" / "studies" / "claims" / "rules.yaml"
RULES_3 = RULES.with_name("rules_3.yaml")
PUBLISHED = ROOT / "results" / "published.csv"
FROZEN = RULES.with_name("frozen.yaml")
UNITS = {"much_slower": "×", "sharper": "1", "restored": "%"}  # of others: points
TOLERANCE = 2e-5  # the table has six digits
CHECKED = (
    *("mean", "mean_low", "mean_high", "predicted_low", "predicted_high"),
    *("equal", "equal_low", "equal_high"),
)


def of_recordings(folder: Folder, rules: dict, name: str, rival: str) -> dict | None:
    """Accuracy with many or with few frames, objects."""
    claim = rules["claims"][name]
    form = rules["forms"][claim.get("form", "published")]
    evidence, kinds, statuses = [], [], set()
    for record, rows in folder.measured("recordings"):
        scene = record["scene"]
        listed = rules["recordings"].get(scene)
        allowed = claim.get("recordings") or rules["recordings"]
        if listed is None or scene not in allowed:
            continue
        split = (record["config"].get("splits") or {}).get("counts")
        if split and any(split.get(k) != v for k, v in listed["split"].items()):
            continue
        number = difference(rows, form, rival, claim["sizes"], rules)
        if number is not None:
            evidence.append((listed["laboratory"], *number))
            kinds.append(listed["frames"])
            statuses.add(listed["status"])
    if not evidence:
        return None
    unseen = statuses == {"confirmatory"}
    status = "confirmatory" if unseen else "exploratory"
    return {**by_laboratory(evidence), "kinds": kinds, "status": status}


def difference(
    rows: list[dict], form: str, rival: str, size: str, rules: dict
) -> tuple[float, float] | None:
    """HDC less its rival on one recording, and the variance of it."""
    every = shares(rows)
    models = [form] if rival == "published" else [form, rival]
    seeds = len({row["seed"] for row in rows}) > 1
    unit = 0 if seeds else 1  # seed, or draw
    units = sorted({place[2:][unit] for place in every if place[0] in models})

    def accuracies(model: str, n: int) -> np.ndarray:
        per_unit = []
        for one in units:
            of_unit = [
                share
                for place, share in every.items()
                if place[:2] == (model, n) and place[2:][unit] == one
            ]
            per_unit.append(np.mean(of_unit) if of_unit else math.nan)
        return np.array(per_unit)

    table = {
        n: [accuracies(model, n) for model in models] for n in rules["sizes"][size]
    }
    full = {n: t for n, t in table.items() if not np.isnan(t).any() and len(units)}
    if size == "few":
        chosen = list(full) if len(full) == len(table) else []
    else:
        below = [
            n
            for n, of_models in full.items()
            if min(a.mean() for a in of_models) < rules["saturated"]
        ]
        chosen = [max(below)] if below else []
    if not chosen:
        return None
    less = np.mean([full[n][0] - theirs(full[n]) for n in chosen], axis=0)
    tested = [
        row["n_test"]
        for row in rows
        if row["model"] == form and row["split"] == "counts"
    ]
    variance = spread(less, float(np.mean(tested)), seeds)
    return None if math.isnan(variance) else (float(less.mean()), variance)


def theirs(of_models: list[np.ndarray]) -> np.ndarray | float:
    """The rival's accuracies, or the paper's on objects."""
    return of_models[1] if len(of_models) > 1 else of_the_paper()


def of_the_paper() -> float:
    """The paper's accuracy on objects."""
    with PUBLISHED.open(encoding="utf-8") as file:
        for line in csv.DictReader(file):
            if (line["experiment"], line["quantity"]) == ("tactile", "test_accuracy"):
                return float(line["value"]) / 100
    raise LookupError("published.csv: no tactile/test_accuracy")


def of_drift(folder: Folder, rules: dict, name: str) -> dict | None:
    """The share of the loss that came back."""
    claim = rules["claims"][name]
    update, evidence, kinds = claim["update"], [], []
    for record, rows in folder.measured("drift"):
        of_scene = shown(record["scene"])
        lab, kind = of_scene["family"], of_scene["kind"]
        truths = {
            row["seed"]: labels(row["labels"]) for row in rows if row.get("labels")
        }
        by_seed: dict[int, dict[str, list[float]]] = {}
        for row in rows:
            if row["model"] != "hdc":
                continue
            new, old = of_sessions(row, truths)
            place = by_seed.setdefault(row["seed"], {"old": [], "new": [], "after": []})
            if row["method"] == "stored":
                place["new"].append(new)
                place["old"].append(old)
            elif (row["method"], row["p"], row["n_new"]) == (
                update["method"],
                update["p"],
                update["n_new"],
            ):
                place["after"].append(new)
        means = [
            {key: float(np.mean(values)) for key, values in place.items()}
            for place in by_seed.values()
            if all(place.values())
        ]
        lost = np.array([m["old"] - m["new"] for m in means])
        if not len(lost) or lost.mean() < claim["lost"] or (lost <= 0).any():
            continue
        share = np.array([m["after"] - m["new"] for m in means]) / lost
        if kind in claim["decide"] and len(share) > 1:
            seeds = 1 if kind == "captured" else len(share)  # else they share frames
            evidence.append((lab, float(share.mean()), share.var(ddof=1) / seeds))
            kinds.append(kind)
    if not evidence:
        return None
    return {**by_laboratory(evidence), "kinds": kinds}


def of_sessions(row: dict, truths: dict) -> tuple[float, float]:
    """Share of right answers in the new and in the old session."""
    n_new, n_old = row["n_test_new"], row["n_test_old"]
    right = labels(row["predicted"]) == truths[row["seed"]]
    return right[:n_new].sum() / n_new, right[n_new:].sum() / n_old


def of_flips(folder: Folder, rules: dict, name: str, level: float) -> dict | None:
    """What flipped bits cost HDC."""
    claim, evidence, kinds = rules["claims"][name], [], []
    for record, rows in folder.measured("robustness"):
        of_scene = shown(record["scene"])
        lab, kind = of_scene["family"], of_scene["kind"]
        clean: dict[int, list[float]] = {}
        flipped: dict[int, list[float]] = {}
        for row in rows:
            if row["model"] != "hdc":
                continue
            share = row["right"] / row["n_test"]
            if row["disturbance"] == "none":
                clean.setdefault(row["seed"], []).append(share)
            elif (row["disturbance"], row["level"]) == ("bit_flips", level):
                flipped.setdefault(row["seed"], []).append(share)
        both = sorted(clean.keys() & flipped.keys())
        less = np.array([np.mean(flipped[s]) - np.mean(clean[s]) for s in both])
        variance = spread(less, rows[0]["n_test"], seeds=kind != "captured")
        if kind in claim["decide"] and not math.isnan(variance):
            evidence.append((lab, float(less.mean()), variance))
            kinds.append(kind)
    if not evidence:
        return None
    return {**by_laboratory(evidence), "kinds": kinds}


def of_contrasts(
    folder: Folder, rules: dict, name: str, rival: str
) -> tuple[list[str], list[tuple[float, float, float]]]:
    """The word of each scene; and what it is of: a mean over seeds with its interval."""
    samples, words, values = rules["claims"][name]["samples"], [], []
    for _, rows in folder.measured("correlation"):
        sums: dict[tuple[str, int], dict[tuple[str, str], float]] = {}
        for row in rows:
            if row.get("samples") == samples:  # rows of pictures have none
                place = sums.setdefault((row["kind"], row["seed"]), {})
                place[row["class_i"], row["class_j"]] = row["value"]
        kinds = {kind for kind, _ in sums}
        if not {"prototype", rival} <= kinds:
            continue
        seeds = sorted({seed for _, seed in sums})
        less = np.array(
            [contrast(sums["prototype", s]) - contrast(sums[rival, s]) for s in seeds]
        )
        low, high = of_mean(less)
        words.append(above(low, high, 0.0))
        values.append((float(less.mean()), low, high))
    return words, values


def ratios_of_runs(runs: list[dict], rival: str) -> list[float]:
    """Training times of Table I relative to HDC: beside it, or of the same seed on one machine."""

    def of_model(model: str, stops: tuple[str, ...]) -> dict[int, dict]:
        found: dict[int, dict] = {}
        for run in runs:
            choices, config = run["choices"], run["config"]
            whole = config["split"]["n_train"] is config["data"]["pixels"] is None
            alone = run["environment"].get("exclusive", True)
            where = choices["scene"], choices["model"], choices["stop"] in stops
            as_given = whole and alone and not run.get("changed")
            if as_given and where == ("touch", model, True):
                found[config["seed"]["run"]] = run
        return found

    def seconds(run: dict) -> float:
        if "loss" not in run["rows"]["columns"]:
            return run["training_s"]
        return run.get("time_to_target_train_s", math.inf)

    hdc = of_model("hdc", ("paper",))
    ratios = []
    for seed, run in of_model(rival, ("paper", "end")).items():
        beside = run.get("beside_s", {}).get("hdc")
        if beside is None and seed in hdc:
            beside = seconds(hdc[seed])
        if beside is not None:
            ratios.append(seconds(run) / beside)
    return ratios


def of_times(folder: Folder, rules: dict, rival: str) -> dict | None:
    """Words of all ways, and the way with the least ratio."""
    found: dict[str, list[float]] = {}
    if ours := ratios_of_runs(folder.runs(), rival):
        found["default"] = ours
    for _, rows in folder.measured("times_grid"):
        for row in rows:
            if row["model"] == rival and row["way"] != "default":
                seconds = math.inf if row["seconds"] is None else row["seconds"]
                found.setdefault(row["way"], []).append(seconds / row["hdc_seconds"])
    if set(found) != set(rules["ways"]):
        return None
    words, least = [], None
    for ratios in found.values():
        ordered = sorted(ratios)
        n, middle = len(ordered), float(np.median(ordered))
        inner = 0
        chance = [math.comb(n, j) / 2**n for j in range(n + 1)]
        while inner < n // 2 and sum(chance[: inner + 1]) <= 0.025:
            inner += 1
        low, high = ordered[max(inner, 1) - 1], ordered[n - max(inner, 1)]
        factor = 1.0 if n >= rules["runs"]["least"] else rules["runs"]["factor"]
        yes, no = low > factor * rules["times"], high < rules["times"] / factor
        words.append("yes" if yes else "no" if no else "undecided")
        if least is None or middle < least["mean"]:
            least = {"mean": middle}
            if n > 1:  # a single run has no range
                least |= {"mean_low": low, "mean_high": high}
    same = len(set(words)) == 1
    word = words[0] if same else "partly" if "yes" in words else "undecided"
    return {**(least or {}), "word": word, "kinds": ["simulated"]}


def recompute(folder: Folder, row: dict, rules: dict) -> dict | None:
    """The cells of a row, by its claim and rival; None where it cannot be computed."""
    name, rival = row["claim"], row["rival"]
    claim = rules["claims"][name]
    rule = claim["rule"]
    if rule == "much_slower":
        return of_times(folder, rules, rival)
    if rule == "sharper":
        words, values = of_contrasts(folder, rules, name, rival)
        if not words:
            return None
        word = words[0] if len(set(words)) == 1 else "partly"
        return {"word": word, "by_scene": values}
    if claim["experiment"] == "recordings":
        found = of_recordings(folder, rules, name, rival)
    elif claim["experiment"] == "drift":
        found = of_drift(folder, rules, name)
    else:
        level = float(rival.rpartition(" at ")[2].removesuffix(" %")) / 100
        found = of_flips(folder, rules, name, level)
    if found is None:
        return None
    found["word"] = word_of(rule, found, rules, claim)
    is_points = row["unit"] == "points"
    # No accuracy is below 0 or above 1, and the paper's is known.
    low, high = -1.0, 1.0
    if rival == "published":
        low, high = 0 - of_the_paper(), 1 - of_the_paper()
    for key in CHECKED:
        bounded = np.clip(found[key], low, high) if is_points else found[key]
        found[key] = 100 * float(bounded)
    return found


def disagreements(path: Path) -> list[str]:
    """Cells of the table of a folder of results that the records do not give again, and rows that
    it lacks."""
    rules, folder = yaml.safe_load(RULES.read_text("utf-8")), Folder(path)
    with (path / "tables" / "claims.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    wrong = []
    for row in rows:
        folder.named = row["record"]
        found = recompute(folder, row, rules)
        where = f"{row['claim']} against {row['rival']}"
        wrong += [f"{where}, {text}" for text in _different(row, found, rules)]
    has = {(row["claim"], row["rival"]) for row in rows}
    for name, claim in rules["claims"].items():
        for rival in rivals_of(claim, rules):
            row = {"claim": name, "rival": rival, "unit": "", "record": ""}
            if (name, rival) not in has and recompute(folder, row, rules):
                wrong.append(f"{name} against {rival}: missing")
    return wrong


def rivals_of(claim: dict, rules: dict) -> list[str]:
    """Rivals that have a word; of flips at each of their shares."""
    rivals = claim.get("rivals") or rules["rivals"]
    if claim["experiment"] == "drift":
        return ["its own loss"]
    levels = claim.get("levels")
    if not levels:
        return rivals
    return [f"{rival} at {100 * level:g} %" for rival in rivals for level in levels]


def _different(row: dict, found: dict | None, rules: dict) -> Iterator[str]:
    """Cells of a row that are not what was recomputed."""
    if found is None:
        yield "the records give no number"
        return
    again = {
        "word": found["word"],
        "laboratories": str(found.get("units", "")),
        "status": found.get("status", "exploratory"),
        **of_the_rules(row["claim"], rules),
    }
    for key, value in again.items():
        if row[key] != value:
            yield f"{key}: {row[key]}, recomputed {value}"
    for key in CHECKED:
        stated = float(row[key]) if row[key] else math.nan
        value = found.get(key, math.nan)
        nothing = math.isnan(stated) and math.isnan(value)
        close = math.isclose(stated, value, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
        if not nothing and not close:
            yield f"{key}: {stated}, recomputed {value}"
    stated_by_scene = sorted(of_scenes(row.get("by_scene") or ""))
    by_scene = sorted(
        tuple(float(f"{value:.2g}") for value in values)
        for values in found.get("by_scene", [])
    )
    if stated_by_scene != by_scene:
        yield f"by_scene: {stated_by_scene}, recomputed {by_scene}"
    kinds = set(found.get("kinds", []))
    if kinds and set(row["frames"].split(", ")) != kinds:
        yield f"frames: {row['frames']}, recomputed {', '.join(sorted(kinds))}"


def contest_disagreements(path: Path) -> list[str]:
    """Cells of the verdicts of rules 3 that the records do not give again."""
    rules = yaml.safe_load(RULES_3.read_text("utf-8"))
    file = path / "tables" / "contest.csv"
    if not file.exists():
        return []
    evidence = bits_minus_greys(Folder(path), rules)
    wrong = []
    for row in csv.DictReader(file.read_text("utf-8").splitlines()):
        what = row["what"]
        if row["model"] != "bits" or not row.get("word") or what.endswith("objects"):
            continue  # no verdict, or an interval by random resamples
        left_out = what.removeprefix("without ")
        found = by_laboratory([one for one in evidence if one[0] != left_out])
        for stated, again in (("equal", "equal"), ("random", "mean")):
            for end in ("", "_low", "_high"):
                cell, value = float(row[stated + end]), found[again + end]
                if not math.isclose(cell, value, rel_tol=TOLERANCE, abs_tol=TOLERANCE):
                    wrong.append(f"{what}, {stated}{end}: {cell}, recomputed {value}")
        word = contest_word(found, rules)
        if row["word"] != word:
            wrong.append(f"{what}, word: {row['word']}, recomputed {word}")
    return wrong


def bits_minus_greys(folder: Folder, rules: dict) -> list[tuple[str, float, float]]:
    """Laboratory, difference and variance of each recording of rules 3."""
    evidence = []
    for record, rows in folder.measured(rules["experiment"]):
        listed = rules["recordings"].get(record["scene"])
        split = record["config"]["splits"]["counts"]
        if listed and all(split.get(k) == v for k, v in listed["split"].items()):
            number = difference(rows, rules["bits"], rules["greys"], "full", rules)
            if number is not None:
                evidence.append((listed["laboratory"], *number))
    return evidence


def contest_word(found: dict, rules: dict) -> str:
    """The verdict by both intervals."""
    if found["units"] < rules["least_units"]:
        return "undecided"
    lows = found["equal_low"], found["mean_low"]
    highs = found["equal_high"], found["mean_high"]
    if min(lows) > -rules["margin"]:
        return "yes"
    return "no" if max(highs) < -rules["margin"] else "undecided"


def of_the_rules(name: str, rules: dict) -> dict[str, str]:
    """The cells of a claim that follow from the files of the rules alone."""
    claim = rules["claims"][name]
    digest = hashlib.sha256(RULES.read_bytes()).hexdigest()[:12]
    frozen = yaml.safe_load(FROZEN.read_text("utf-8"))
    return {
        "says": claim.get("paper") or claim["ours"],
        "by": "the paper" if claim.get("paper") else "this repository",
        "unit": UNITS.get(claim["rule"], "points"),
        "command": f"python -m experiments.reproduce --full --claim {name}",
        "rules": str(rules["version"]),
        "frozen": frozen["commit"][:12] if frozen["digest"] == digest else "",
        "digest": digest,
    }


def of_scenes(text: str) -> Iterator[tuple[float, ...]]:
    """The numbers of each scene in a text like ``name: 0.2 [0.1, 0.3]; name: ...``."""
    for part in filter(None, text.split("; ")):
        numbers = part.rpartition(": ")[2].replace("−", "-")
        found = re.findall(r"-?[\d.]+(?:e[-+]?\d+)?", numbers)
        yield tuple(float(each) for each in found)


def main() -> int:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "results" / "reference")
    wrong = disagreements(folder) + contest_disagreements(folder)
    for line in wrong:
        print(line)
    if not wrong:
        table = folder / "tables" / "claims.csv"
        print(
            f"{table}: every cell recomputed but `record`; so are the verdicts of contest.csv"
        )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
