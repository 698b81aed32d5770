"""Records made up for tests: configurations as composed, results chosen."""

from __future__ import annotations

import copy
import io
import json

import msgspec
import numpy as np
from omegaconf import OmegaConf
from rich.console import Console

from experiments.protocol import runner
from experiments.protocol.measure_run import _of_trial
from experiments.protocol.trial import Trial
from experiments.records import record, store
from experiments.records.environment import Environment
from experiments.records.revision import revisions
from experiments.records.rows import Rows, pack_labels
from tests.experiments.composed import tree

FINGERPRINT = "f" * 64
MADE_ON = {"cpu": "A CPU", "threads": 2, "commit": "c" * 40}


def run(
    folder,
    model,
    *,
    scene="touch",
    classes=("L1", "L2", "R1", "R2", "None"),
    origin="simulated",
    seed=0,
    stop="paper",
    wrong=(),
    truth=None,
    curve=None,
    status="finished",
    change=None,
    environment=None,
    made_by=None,
    choices=None,
    display=None,
    scene_display=None,
    stopped=None,
    **results,
):
    cfg = copy.deepcopy(tree(f"scene={scene}", f"model={model}", f"stop={stop}"))
    for key, value in {"seed.run": seed, **(change or {})}.items():
        OmegaConf.update(cfg, key, value)
    whole = OmegaConf.to_container(cfg, resolve=True)
    config = {k: v for k, v in whole.items() if k not in runner.NOT_IDENTITY}
    config["threads"] = 2
    names = {"scene": scene, "model": model, **(choices or {})}
    changed = runner._changed(config, list(change or {}))
    name = f"{names['scene']}-{names['model']}"
    curve = curve or [{"training_s": 0.5, "samples_seen": 400}]
    truth = np.arange(100) % len(classes) if truth is None else np.asarray(truth)
    is_wrong = np.isin(np.arange(len(truth)), list(wrong))
    predicted = np.where(is_wrong, (truth + 1) % len(classes), truth)
    right = ~is_wrong
    begun = record.Record(
        schema=record.SCHEMA,
        id=record.name_of(name, config, FINGERPRINT),
        scene=record.Named(names["scene"], names["scene"], scene_display or {}),
        model=record.Named(names["model"], names["model"], display or {}),
        stop=stop,
        config=config,
        changed=changed,
        timed=True,
        data=FINGERPRINT,
        revisions=revisions(config) if made_by is None else made_by,
        environment=msgspec.convert(MADE_ON | (environment or {}), Environment),
        status="interrupted",
    )
    if status != "finished":
        failed = runner._ended(begun, [], status=status, error="ValueError: it broke")
        store.append(folder, failed)
        return begun.id
    final = float(right.mean())
    rows = [{"train_accuracy": 1.0, "test_accuracy": final, **row} for row in curve]
    reason = stopped or ("trained" if "loss" in rows[0] else "finished")
    trial = Trial(tuple(rows), reason, rows[-1]["training_s"])
    last = {
        "origin": origin,
        "classes": json.dumps(list(classes)),
        "n_classes": len(classes),
        "n_pixels": 250_000,
        "n_train": cfg.split.n_train or 400,
        "n_test": len(truth),
        "labels": pack_labels(truth),
        **_of_trial(trial, 0.9),
        "train_accuracy_final": rows[-1]["train_accuracy"],
        "test_accuracy_final": final,
        "right": int(right.sum()),
        "predicted": pack_labels(predicted),
        "predict_single_s": 1e-3,
        "predict_batch_s_per_frame": 1e-4,
        "test_set": f"test of seed {seed}",
        "model_bytes": 1000,
        **results,
    }
    store.append(
        folder,
        runner._ended(begun, [*rows, last], status="finished", seconds=1.0),
    )
    return begun.id


def measurement(folder, name, rows, config=None, scene="", label="", **about):
    config = config or {}
    if "revisions" not in about:  # which imports what the config names
        about["revisions"] = revisions(config)
    made = record.Record(
        schema=record.SCHEMA,
        id=record.name_of(name, config, ""),
        experiment=name,
        scene=record.Named(scene, label or scene) if scene else None,
        config=config,
        environment=msgspec.convert(MADE_ON, Environment),
        rows=Rows.of(rows),
        **{"timed": any(key.endswith("_s") for row in rows for key in row), **about},
    )
    store.append(folder, made)


def carried_out(config, asked):
    """The record of a config, whether it was there already, and what was printed."""
    console = Console(record=True, width=300, file=io.StringIO())
    made, repeated = runner.carry_out(config, asked, console)
    return made, repeated, console.export_text()
