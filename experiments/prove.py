"""Show that changed code computes the same as the code that made the committed records.

For each row of runs, and each measurement with seeds, the cheapest seed is computed again. Where
every integer, text and digest agrees, the digest of today's code is adopted for all records of the
row, and their field ``proven`` says by which run. Times are adopted only where the model and the
protocol, the code that the clock measures, compute the same; otherwise ``times_by`` keeps the
digest of the code that was timed. ``python -m experiments.reference --prove`` runs it.
"""

from __future__ import annotations

import datetime
import importlib
from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec
from omegaconf import OmegaConf
from rich.console import Console

from experiments.protocol.experiment import Run as Runner
from experiments.protocol.model import instantiate
from experiments.protocol.trial import train_and_test
from experiments.records import measurement, sources
from experiments.records import record as records
from experiments.records.configs import task
from experiments.records.environment import cpu_model
from experiments.records.measurement import Measured
from experiments.records.results import Results, Run

_TIMED = tuple(f"experiments.protocol.{name}" for name in ("trial", "clock", "stop"))


def prove(folder: Path, console: Console, chosen: Callable[[str], bool] = lambda _: True) -> int:
    """Adopt today's code for the records of a results folder that it computes again.

    `chosen` is asked for the name of each row of runs (``scene-model``) and of each measurement.
    Returns how many could not be proven.
    """
    results, failed = Results(folder), 0
    adopted: dict[str, str] = {}
    rows = defaultdict[tuple[Any, ...], list[Run]](list)  # whatever their seeds, N and D
    for run in results.runs:
        rows[run.scene, run.model, run.record.choices.stop, run.record.environment.code].append(run)
    for runs in rows.values():
        cheapest = min(runs, key=lambda run: run.record.training_s)
        name = f"{cheapest.record.choices.scene}-{cheapest.record.choices.model}"
        if not chosen(name) or not any(run.outdated for run in runs):
            continue
        difference = _run_differs(cheapest)
        console.print(f"{name}: {difference or 'computes the same'}", soft_wrap=True)
        failed += bool(difference)
        if not difference:
            adopted |= {run.record.id: cheapest.record.id for run in runs}
    if adopted:
        _rewrite(folder, adopted)
    for measured in results.measurements:
        if chosen(measured.record.name) and measured.outdated:
            difference = _measurement_differs(measured, console)
            console.print(f"{measured.folder.name}: {difference or 'computes the same'}")
            failed += bool(difference)
            if not difference:
                _adopt_measurement(measured)
    return failed


def _run_differs(run: Run) -> str:
    """How a run differs when it is computed again; nothing where it does not."""
    record, again = run.record, dict[str, Any]()
    cfg = OmegaConf.create({**record.config, "cache": False})
    scene = instantiate(cfg.scene, "scene")
    names = msgspec.to_builtins(record.choices)
    train_and_test(cfg, scene, names, [], again, None, Console(quiet=True))
    plain = msgspec.json.decode(records.to_line({**again, "environment": {}}, []))
    keys = ["n_train", "n_test", "test_labels", "predicted", "model_bytes"]
    if record.environment.cpu == cpu_model():  # frames differ in last bits between processors
        keys.append("data_sha256")
    known = msgspec.to_builtins(record)
    differing = [key for key in keys if plain[key] != known[key]]
    return f"differs in {', '.join(differing)}" if differing else ""


def _proof(by: str, code: str) -> dict[str, str]:
    return {"by": by, "made_by_code": code, "on": datetime.date.today().isoformat()}


def _rewrite(folder: Path, adopted: Mapping[str, str]) -> None:
    """Adopt today's code for runs; `adopted`: id of a run → id of the run that proves it."""
    code, lines = records.read_code(folder), []
    for line in (folder / records.RUNS).read_bytes().splitlines():
        entry = msgspec.json.decode(line)
        if proof := adopted.get(entry["id"]):
            before, files = entry["environment"]["code"], sources.sources(entry["config"])
            timed = sources.closure(*_TIMED, *sources.targets(entry["config"]["model"]))
            if not timed.items() <= code[before].items():
                entry["times_by"] = entry.get("times_by") or before
            entry["proven"] = _proof(proof, before)
            entry["environment"]["code"] = sources.code_hash(files)
            code[entry["environment"]["code"]] = files
        lines.append(entry)
    records.write_all(folder, lines, code)


def _measurement_differs(measured: Measured, console: Console) -> str:
    config = measured.record.config
    target = task(measured.record.name).get("_target_", "")
    module, _, name = target.rpartition(".")
    seeds = config.get("seeds")
    if not module or not seeds:
        return "not proven: an experiment without seeds is measured again"
    rows = getattr(importlib.import_module(module), name).rows
    again = list(
        rows(Runner(name, {**config, "_target_": target}), **config | {"seeds": seeds[:1]})
    )
    known = [row for row in measured.rows if row.get("seed") == seeds[0]]
    if len(again) != len(known):
        return f"differs in the number of rows: {len(known)}, now {len(again)}"
    again = measurement.from_lines(measurement.to_lines(again))
    differing = {
        key
        for old, new in zip(known, again, strict=True)
        for key in {**old, **new}  # numbers with a point may differ in digits
        if not isinstance(old.get(key), float) and old.get(key) != new.get(key)
    }
    return f"differs in {', '.join(sorted(differing))}" if differing else ""


def _adopt_measurement(measured: Measured) -> None:
    entry = msgspec.json.decode((measured.folder / "record.json").read_bytes())
    environment, config = entry["environment"], entry["config"]
    files = sources.sources({**config, "_target_": task(entry["name"])["_target_"]})
    entry["proven"] = _proof(f"seed {config['seeds'][0]}", environment["code"])
    environment |= {"code": sources.code_hash(files), "sources": files}
    measurement.write(measured.folder, entry, measured.rows)
