"""What was fitted, and what the sensor then predicts: ``python -m scenes.sensor.calibrate``.

Writes ``results/calibration.csv``: the paper's value, ours over fresh sensor seeds, and in every
row whether the quantity was fitted or is predicted. Seeds 100 and above are for fitting, the seeds
reported are others. ``--fit`` shows the fit: every fitted parameter beside its neighbours, on the
fitting seeds, in ``results/sensor_fit.csv``.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenes.sensor import statistics as st
from scenes.sensor.configured import scene

RESULTS = Path(__file__).parents[2] / "results"
FITTING, REPORTED = (100, 101, 102), (0, 1, 2, 3, 4)
SMALL = (5, 10, 15, 20, 25, 30, 40, 50, 80)
Numbers = dict[str, float]


@dataclass(frozen=True)
class Row:
    """One line of the table: what is measured, the paper's value, accepted range, status."""

    key: str
    what: str
    paper: str
    low: float
    high: float
    status: str
    note: str = ""


ROWS = (
    Row("max_cs", "max C^s_ll", "0.178", 0.158, 0.198, "fitted"),
    Row("dcs", "ΔC^s", "0.055", 0.040, 0.070, "fitted"),
    Row("dcb", "ΔC^b", "0.036", 0.026, 0.046, "predicted"),
    Row("dcb_over_dcs", "ΔC^b / ΔC^s", "0.65", 0.55, 0.75, "predicted",
        "0.64 for Gaussian intensities (arcsine law), 0.55 to first order for two polarisations"),
    Row("dcp_held_out", "ΔC^p, samples not in the prototypes", "0.1", 0.07, 0.13, "predicted"),
    Row("dcp_training", "ΔC^p, samples in the prototypes", "0.1", 0.07, 0.13, "predicted"),
    Row("touch", "touch, N = 400, %", "100", 99, 100, "predicted", "watched in the fit"),
    Row("crossing", "touch, N at which 90 % is crossed", "20", 15, 40, "fitted"),
    *(Row(f"touch_{n}", f"touch, N = {n}, %", "> 90 only for N > 20", 0, 100, "fitted" if n == 20
          else "predicted") for n in SMALL),
    Row("finger", "finger, %", "87.9", 84, 92, "fitted", "five folds of 20 test samples a label"),
    Row("finger_r", "finger, labels R1 R2 R3, %", "weakest", 0, 100, "predicted"),
    Row("finger_l", "finger, labels L1 L2 L3, %", "", 0, 100, "predicted"),
    Row("finger_none", "finger, label None, %", "taken for R2, R3", 0, 100, "predicted"),
    Row("spatial", "51 positions, %", "93", 91, 96, "fitted"),
    Row("drift_stored", "drift, stored prototypes, %", "32", 25, 40, "fitted", "by T0"),
    Row("drift_0.5", "drift, N_new = 50, p = 0.5, %", "95", 93, 100, "predicted"),
    Row("drift_0.75", "drift, N_new = 50, p = 0.75, %", "95", 93, 100, "predicted"),
    Row("drift_1", "drift, N_new = 50, p = 1, %", "", 0, 100, "predicted"),
    Row("tactile", "tactile, %", "100", 98, 100, "fitted", "rests on the assumed depth offsets"),
    Row("tactile_texture", "tactile, control: texture only, a new patch every touch, %", "", 0, 100,
        "predicted", "chance is 33.3 %"),
    Row("tactile_same", "tactile, control: texture only, always the same patch, %", "", 0, 100,
        "predicted", "chance is 33.3 %"),
    Row("tactile_finer", "tactile, control: same patch, depth ± 0.1 %, place ± 10 µm, %", "", 0,
        100, "predicted", "the assumption that would make texture alone visible"),
    Row("tactile_depth", "tactile, control: depth only, %", "", 0, 100, "predicted"),
)  # fmt: skip


def encode(made: Any, which: np.ndarray | None = None) -> st.Bits:
    """Hypervectors of a scene's samples."""
    chosen = np.arange(len(made)) if which is None else which
    return np.concatenate([st.hypervectors(f) for f in st.batches(made, chosen)])


def crossed(bits: st.Bits, labels: np.ndarray, train: int, seed: int) -> np.ndarray:
    """Confusion matrix summed over folds with ``train`` training samples a class."""
    classes = int(labels.max()) + 1
    parts = [
        st.accuracy(bits[a], labels[a], bits[b], labels[b], classes)
        for a, b in st.folds(labels, train, seed)
    ]
    return sum(parts[1:], start=parts[0])


def touch(seed: int, overrides: Sequence[str] = ()) -> Numbers:
    """Figs. 4 and 5: correlations, and accuracy against the number of training samples."""
    made = scene("touch", seed, seed, overrides)
    labels, classes = made.labels, len(made.classes)
    size, parts = made.shape[0] * made.shape[1], []
    speckle = np.zeros((classes, size))
    hyper = np.zeros((classes, size))
    for start, frames in zip(
        range(0, len(made), 50), st.batches(made, np.arange(len(made))), strict=True
    ):
        mine = labels[start : start + 50]
        parts.append(st.hypervectors(frames))
        ones = np.unpackbits(parts[-1], axis=1)[:, :size]
        speckle += st.standardised_sum(frames, mine, classes)
        hyper += st.standardised_sum(ones, mine, classes)
    bits, counts = np.concatenate(parts), np.bincount(labels)
    cs, cb = st.mean_correlation(speckle, counts), st.mean_correlation(hyper, counts)
    train, test = next(st.folds(labels, 80, seed))
    stored = st.prototypes(bits[train], labels[train], classes)
    found = {
        "max_cs": float(np.diag(cs).max()),
        "dcs": st.contrast(cs),
        "dcb": st.contrast(cb),
        "dcb_over_dcs": st.contrast(cb) / st.contrast(cs),
        "dcp_held_out": st.contrast(
            st.prototype_correlation(stored, bits[test], labels[test], size)
        ),
        "dcp_training": st.contrast(
            st.prototype_correlation(stored, bits[train], labels[train], size)
        ),
        "touch": 100 * st.share_right(crossed(bits, labels, 80, seed)),
    }
    rng = np.random.default_rng(seed)
    curve = []
    for n in SMALL:
        right = []
        for _ in range(12):
            few = [
                rng.permutation(train[labels[train] == c])[: n // classes] for c in range(classes)
            ]
            part = np.concatenate(few)
            confusion = st.accuracy(bits[part], labels[part], bits[test], labels[test], classes)
            right.append(st.share_right(confusion))
        curve.append(100 * float(np.mean(right)))
        found[f"touch_{n}"] = curve[-1]
    above = next((i for i, value in enumerate(curve) if value > 90), None)
    if above is None or above == 0:
        found["crossing"] = float("inf") if above is None else SMALL[0]
    else:
        pair, values = SMALL[above - 1 : above + 1], curve[above - 1 : above + 1]
        found["crossing"] = float(np.interp(90, values, pair))
    return found


def finger(seed: int, overrides: Sequence[str] = ()) -> Numbers:
    """Fig. 6(b)."""
    made = scene("finger", seed, seed, overrides)
    confusion = crossed(encode(made), made.labels, 80, seed)
    right = 100 * np.diag(confusion) / confusion.sum(1)
    return {
        "finger": 100 * st.share_right(confusion),
        "finger_l": float(right[:3].mean()),
        "finger_r": float(right[3:6].mean()),
        "finger_none": float(right[6]),
    }


def spatial(seed: int, overrides: Sequence[str] = ()) -> Numbers:
    """Fig. 7: 80 samples a position for the prototypes, 20 for testing."""
    made = scene("spatial", seed, seed, overrides)
    bits = encode(made)
    train, test = next(st.folds(made.labels, 80, seed))
    confusion = st.accuracy(bits[train], made.labels[train], bits[test], made.labels[test], 51)
    return {"spatial": 100 * st.share_right(confusion)}


def drift(seed: int, overrides: Sequence[str] = ()) -> Numbers:
    """Fig. 8(b): N_old = 400, N_new = 50, tested on the other 450 samples of the second session."""
    made = scene("drift", seed, seed, overrides)
    bits, labels = encode(made), made.labels
    old = np.flatnonzero(made.samples["session"] == 0)
    new = np.flatnonzero(made.samples["session"] == 1)
    train = old[next(st.folds(labels[old], 80, seed))[0]]
    again, rest = (new[part] for part in next(st.folds(labels[new], 10, seed)))
    stored = st.prototypes(bits[train], labels[train], 5)
    fresh = st.prototypes(bits[again], labels[again], 5)
    rng = np.random.default_rng(seed)
    found = {}
    for p in (0.0, 0.5, 0.75, 1.0):
        taken = np.packbits(rng.random((5, stored.shape[1] * 8)) < p, axis=1)
        predicted = st.distances(bits[rest], (stored & ~taken) | (fresh & taken)).argmin(1)
        name = f"drift_{p:g}" if p else "drift_stored"
        found[name] = 100 * float((predicted == labels[rest]).mean())
    return found


def tactile(seed: int, overrides: Sequence[str] = ()) -> Numbers:
    """Fig. 9(d) and its controls."""
    level = ("classes.P40.offset=0.0", "classes.P120.offset=0.0")
    finer = ("contact.depth_spread=0.001", "contact.position_spread=1e-5")
    smooth = tuple(f"classes.{name}.spacing=null" for name in ("paper", "P40", "P120"))
    found = {}
    for name, changed in (
        ("tactile", ()),
        ("tactile_texture", level),
        ("tactile_same", (*level, "contact.fresh=false")),
        ("tactile_finer", (*level, "contact.fresh=false", *finer)),
        ("tactile_depth", smooth),
    ):
        made = scene("tactile", seed, seed, (*overrides, *changed))
        found[name] = 100 * st.share_right(crossed(encode(made), made.labels, 80, seed))
    return found


EXPERIMENTS: tuple[Callable[..., Numbers], ...] = (touch, finger, drift, tactile, spatial)

# Fitted parameter, its neighbours, and the experiment and numbers it was fitted to.
NEIGHBOURS: tuple[tuple[str, tuple[float, ...], Callable[..., Numbers], tuple[str, ...]], ...] = (
    ("sensor.thermal.scale", (62.0, 124.0, 248.0), touch, ("max_cs", "dcs", "crossing", "touch")),
    ("sensor.thermal.spread", (2.0, 2.8, 3.6), touch, ("max_cs", "dcs", "crossing", "touch")),
    ("sensor.paths.forward", (0.1, 0.25, 0.5), touch, ("max_cs", "dcs", "crossing", "touch")),
    ("sensor.camera.pupil", (140, 200, 280), touch, ("max_cs", "dcs", "crossing", "touch")),
    (
        "sensor.camera.unevenness",
        (0.22, 0.275, 0.33),
        touch,
        ("max_cs", "dcs", "crossing", "touch"),
    ),
    ("sensor.paths.reach", (15e-3, 22e-3, 30e-3), spatial, ("spatial",)),
    ("contact.position_spread", (0.3e-3, 0.4e-3, 0.55e-3), finger, ("finger", "finger_r")),
    ("contact.depth_spread", (0.08, 0.12, 0.16), finger, ("finger", "finger_r")),
    ("sessions.1.offset", (0.35, 0.55, 0.8), drift, ("drift_stored", "drift_0.5", "drift_0.75")),
)


def report(seeds: Sequence[int], path: Path) -> list[dict[str, Any]]:
    """Measure every experiment on every seed; write the table after each seed."""
    measured: dict[str, list[float]] = {}
    lines: list[dict[str, Any]] = []
    command = "python -m scenes.sensor.calibrate --seeds " + " ".join(map(str, seeds))
    for seed in seeds:
        for experiment in EXPERIMENTS:
            start = time.perf_counter()
            for key, value in experiment(seed).items():
                measured.setdefault(key, []).append(value)
            spent = time.perf_counter() - start
            print(f"seed {seed}: {experiment.__name__} {spent:.0f} s", file=sys.stderr, flush=True)
        lines = [line(row, measured[row.key], command) for row in ROWS]
        write(path, lines)
    return lines


def line(row: Row, values: Sequence[float], command: str) -> dict[str, Any]:
    """One line of calibration.csv."""
    mean = float(np.mean(values))
    ranged = row.low > 0 or row.high < 100
    return {
        "quantity": row.what,
        "paper": row.paper,
        "ours": f"{mean:.4g}",
        "sd": f"{np.std(values, ddof=1) if len(values) > 1 else 0:.2g}",
        "seeds": len(values),
        "status": row.status,
        "expected": f"{row.low:g} to {row.high:g}" if ranged else "",
        "met": ("yes" if row.low <= mean <= row.high else "no") if ranged else "",
        "note": row.note,
        "values": " ".join(f"{v:.4g}" for v in values),
        "command": command,
    }


def fit(seeds: Sequence[int], path: Path) -> list[dict[str, Any]]:
    """Each fitted parameter beside two neighbours, the others at their calibrated values."""
    lines = []
    for name, values, experiment, keys in NEIGHBOURS:
        for value in values:
            chosen = seeds[:1] if experiment is spatial else seeds
            found = [experiment(seed, [f"{name}={value}"]) for seed in chosen]
            means = {key: f"{np.mean([f[key] for f in found]):.4g}" for key in keys}
            lines.append({"parameter": name, "value": value, "seeds": " ".join(map(str, chosen))})
            lines[-1]["found"] = "; ".join(f"{key} {mean}" for key, mean in means.items())
            lines[-1]["command"] = "python -m scenes.sensor.calibrate --fit"
            print(name, value, lines[-1]["found"], file=sys.stderr, flush=True)
            write(path, lines)
    return lines


def write(path: Path, lines: Sequence[dict[str, Any]]) -> None:
    """CSV with the keys of the first line as its header."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(lines[0]))
        writer.writeheader()
        writer.writerows(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=list(REPORTED))
    parser.add_argument("--fit", action="store_true", help="show the fit instead, on its own seeds")
    parser.add_argument("--out", type=Path, help="where the table goes")
    chosen = parser.parse_args(arguments)
    if chosen.fit:
        fit(FITTING, chosen.out or RESULTS / "sensor_fit.csv")
        return
    both = sorted(set(chosen.seeds) & set(FITTING))
    if both:
        parser.error(f"--seeds: found {both}, which the parameters were fitted on")
    for found in report(chosen.seeds, chosen.out or RESULTS / "calibration.csv"):
        print(f"{found['quantity']:62} {found['paper']:>22} {found['ours']:>8} ± {found['sd']:6} "
              f"{found['status']:9} {found['met']}")  # fmt: skip


if __name__ == "__main__":
    main()
