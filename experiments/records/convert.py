"""Records of schema 5 in that of schema 6, once: ``python experiments/records/convert.py FILE``."""

import json
import math
import shlex
import sys
from pathlib import Path

import numpy as np
from omegaconf import OmegaConf

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from experiments.records import configs
from experiments.records.record import Record, labelled
from experiments.records.rows import unpack_labels
from experiments.records.store import _DECODER, to_line

FIRST = {"scene": 0, "split": 1, "model": 2, "stop": 3}
OF_FRAMES = ("scene", "split", "old_split")
CLASSES = {
    "recordings": "Recordings",
    "recording_costs": "RecordingCosts",
    "drift": "Drift",
    "robustness": "Robustness",
    "correlation": "Correlation",
    "footprint": "Footprint",
    "stability": "Stability",
    "numerics": "Numerics",
    "stiffness": "Stiffness",
    "values": "Values",
    "coverage": "Coverage",
    "times_grid": "TimesGrid",
}


def of_today(name):
    """The dotted name of an experiment, which is a class now."""
    module, _, last = name.rpartition(".")
    is_task = name.startswith("experiments.studies.") and last in CLASSES
    return f"{module}.{CLASSES[last]}" if is_task else name


def number(value):
    return None if isinstance(value, str) and not math.isfinite(float(value)) else value


def at(config, key):
    for part in key.split("."):
        if isinstance(config, list):
            config = dict(zip(map(str, range(len(config))), config, strict=True))
        config = config.get(part) if isinstance(config, dict) else None
    return config


def common(old):
    revisions = {of_today(name): value for name, value in old["revisions"].items()}
    return {
        "schema": 6,
        **{
            k: old[k]
            for k in ("id", "config", "data", "command", "environment")
            if k in old
        },
        "revisions": dict(sorted(revisions.items())),
    }


def of_run(old):
    curve = [
        dict(zip(old["rows"]["columns"], row, strict=True))
        for row in old["rows"]["values"]
    ]
    curve = [{k: number(v) for k, v in row.items()} for row in curve]
    iterative = any(row.get("loss") is not None or "loss" in row for row in curve)
    changed = {
        key: old["changed"][key]
        for key in sorted(
            old.get("changed", {}), key=lambda k: FIRST.get(k.split(".")[0], 4)
        )
        if key not in configs.COORDINATES
        and not (key.startswith("stop.") and not iterative)
    }
    of_model = {k: v for k, v in changed.items() if k.startswith(("model.", "stop."))}
    of_scene = {k: v for k, v in changed.items() if k not in of_model}
    scene, model = old["choices"]["scene"], old["choices"]["model"]
    seconds = old["training_s"]
    if iterative:
        once = len(curve) == 1 and "steps" not in curve[0]
        solved = seconds if once and old["stop"] == "finished" else None
        reached = old.get("time_to_target_train_s")
        seconds = reached if reached is not None else solved
    of = old["scene"]
    truth, answer = (unpack_labels(old[k]) for k in ("test_labels", "predicted"))
    results = {
        "origin": of["origin"],
        "saturated": of.get("saturated", ""),
        "classes": json.dumps(of["classes"]),
        "n_classes": len(of["classes"]),
        "n_samples": of["n"],
        "height": of["shape"][0],
        "width": of["shape"][1],
        "n_pixels": int(np.prod(of["shape"])),
        "stop": old["stop"],
        "iterative": iterative,
        "training_time_s": seconds,
        "total_time_s": old["training_s"],
        **{f"beside.{name}_s": s for name, s in old.get("beside_s", {}).items()},
        **{
            k: old.get(k)
            for k in (
                "time_to_target_train_s",
                "time_to_target_test_s",
                "train_accuracy_at_target",
                "test_accuracy_at_target",
                "train_accuracy_max",
                "train_accuracy_final",
                "test_accuracy_max",
                "test_accuracy_final",
                "predict_single_s",
                "predict_batch_s_per_frame",
                "n_train",
                "n_test",
            )
        },
        "right": int((truth == answer).sum()),
        "train_set": old["data_sha256"]["train"],
        "test_set": old["data_sha256"]["test"],
        "test_indices": old.get("test_indices"),
        "labels": old["test_labels"],
        "predicted": old["predicted"],
        "model_bytes": old.get("model_bytes"),
    }
    rows = [*curve, results]
    columns = list(dict.fromkeys(key for row in rows for key in row))
    values = [[row.get(c) for c in columns] for row in rows]
    return common(old) | {
        "experiment": old.get("experiment") or "",
        "scene": {
            "name": scene,
            "label": labelled(scene, of_scene),
            "display": old.get("scene_display", {}),
        },
        "model": {
            "name": model,
            "label": labelled(model, of_model),
            "display": old.get("display", {}),
        },
        "stop": old["choices"].get("stop") or "",
        "changed": changed,
        "timed": True,
        "rows": {"columns": columns, "values": values},
    }


def of_measurement(old):
    changed = {}
    words = shlex.split(old["command"])
    for word in words:
        key = word.partition("=")[0].lstrip("+~")
        if key.startswith("scene.") and key.rpartition(".")[2] not in configs.SEEDS:
            changed[key] = json.dumps(at(old["config"], key))
    name = old.get("scene", "")
    shown = OmegaConf.to_container(OmegaConf.create(configs.scene_display(name)))
    columns = old["rows"]["columns"]
    timed = any(c.endswith("_s") or c == "seconds" for c in columns)
    environment = dict(old["environment"])
    if "exclusive=false" in words:
        environment["exclusive"] = False
    scene = {"name": name, "label": labelled(name, changed), "display": shown}
    return common(old) | {
        "experiment": old["name"],
        "task": of_today(old["task"]),
        "scene": scene if name else None,
        "changed": old.get("changed", {}),
        "elsewhere": any(
            k.partition(".")[0] in OF_FRAMES for k in old.get("changed", {})
        ),
        "timed": timed,
        "environment": environment,
        "seconds": old["seconds"],
        "rows": old["rows"],
    }


def trimmed(rows):
    for row in rows["values"]:
        while row and row[-1] is None:
            row.pop()


if __name__ == "__main__":
    path = Path(sys.argv[1])
    lines = []
    for line in path.read_text().splitlines():
        old = json.loads(line)
        new = of_run(old) if old["type"] == "run" else of_measurement(old)
        trimmed(new["rows"])
        made: Record = _DECODER.decode(json.dumps(new))
        lines.append(to_line(made))
    path.write_text("".join(f"{line}\n" for line in lines))
