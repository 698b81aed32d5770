"""Records made up for tests: configurations as composed, results chosen."""

from __future__ import annotations

import copy
import json

import msgspec
import numpy as np
from omegaconf import OmegaConf

from experiments.protocol import runner
from experiments.protocol.measure_run import _of_trial
from experiments.protocol.trial import Trial
from experiments.records import configs, record, store
from experiments.records.environment import Environment
from experiments.records.revision import revisions
from experiments.records.rows import Rows, pack_labels
from tests.experiments import composed
from tests.experiments.composed import tree

FINGERPRINT = "f" * 64
MADE_ON = {"cpu": "A CPU", "threads": 2, "commit": "c" * 40, "dirty": False}


def run(
    folder,
    model,
    *,
    scene="touch",
    classes=("L1", "L2", "R1", "R2", "None"),
    origin="simulated",
    seed=0,
    n_train=None,
    pixels=None,
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
    experiment="",
    beside_s=None,
    load=None,
    **results,
):
    cfg = copy.deepcopy(tree(f"scene={scene}", f"model={model}", f"stop={stop}"))
    cfg.seed.run, cfg.split.n_train, cfg.data.pixels = seed, n_train, pixels
    for key, value in (change or {}).items():
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
        experiment=experiment,
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
    reason = "trained" if "loss" in rows[0] else "finished"
    trial = Trial(tuple(rows), results.get("stopped", reason), rows[-1]["training_s"])
    last = {
        "origin": origin,
        "saturated": "",
        "classes": json.dumps(list(classes)),
        "n_classes": len(classes),
        "n_samples": 500,
        "height": 500,
        "width": 500,
        "n_pixels": 250_000,
        "n_train": n_train or 400,
        "n_test": len(truth),
        "labels": pack_labels(truth),
        **_of_trial(trial, 0.9),
        **{f"beside.{name}_s": s for name, s in (beside_s or {}).items()},
        **(load or {}),
        "train_accuracy_final": rows[-1]["train_accuracy"],
        "test_accuracy_final": final,
        "right": int(right.sum()),
        "predicted": pack_labels(predicted),
        "predict_single_s": 1e-3,
        "predict_batch_s_per_frame": 1e-4,
        "train_set": "a",
        "test_set": f"test of seed {seed}",
        "model_bytes": 1000,
    }
    last |= {key: value for key, value in results.items() if key in last}
    store.append(
        folder,
        runner._ended(begun, [*rows, last], status="finished", seconds=1.0),
    )
    return begun.id


def measurement(folder, name, rows, config=None, scene="", environment=None, **entry):
    config = config or {}
    of_file = composed.task(name) if configs.is_known("experiment", name) else {}
    of_frames = {"scene", "split", "old_split"} & config.keys()
    entry = {
        "elsewhere": any(config[key] != of_file.get(key) for key in of_frames),
        "timed": any(key.endswith("_s") for row in rows for key in row),
        "seconds": 1.5,
        "command": f"python -m experiments.run experiment={name}",
        "label": scene,
        **entry,
    }
    named = record.Named(scene, entry.pop("label")) if scene else None
    if "revisions" not in entry:  # which imports what the config names
        entry["revisions"] = revisions(config)
    made = record.Record(
        schema=record.SCHEMA,
        id=record.name_of(name, config, ""),
        experiment=name,
        scene=named,
        config=config,
        environment=msgspec.convert(MADE_ON | (environment or {}), Environment),
        rows=Rows.of(rows),
        **{key: value for key, value in entry.items() if key != "label"},
    )
    store.append(folder, made)
    return made
