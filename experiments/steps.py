"""What the reproduction consists of, how much of a step is finished and how long the rest takes.

A sweep is finished run by run, a measurement when its record is, and any other step when the same
code has made its file before. An estimate adds up the training times in the records of a sweep and
what comes on top of them; runs without a record share the default of their step.
"""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from experiments import sources
from experiments.record import ROOT, read_record, results_dir
from experiments.selection import CONFIGS

# Of a run, on top of its training time: reading frames and warming up, and testing after each
# report, which for a convolutional network takes two fifths as long as the training.
_START_S = 2.0
_TESTING = 0.4

# What a sweep that does not name these has for them.
_DEFAULTS = {"split.kind": "random", "split.n_train": "null", "data.pixels": "null"}

Record = Mapping[str, Any]


@dataclass(frozen=True)
class Step:
    """One command, as words after ``python -m``.

    Attributes:
        name: unique.
        stage: steps of one stage are followed by the report.
        full, quick: the commands; an empty one is left out.
        minutes: about how long each takes from nothing on 2 cores (full, quick).
        makes: the file below results/ that a step without records makes.
    """

    name: str
    stage: str
    full: str
    quick: str
    minutes: tuple[float, float]
    makes: str = ""

    def command(self, quick: bool) -> list[str]:
        """Words after ``python -m``; none if the step is left out."""
        return shlex.split(self.quick if quick else self.full)


@dataclass(frozen=True)
class Progress:
    """How many runs a step has, how many are finished, seconds of all and of those left."""

    runs: int
    finished: int
    total_s: float
    left_s: float


def progress(
    step: Step, quick: bool, records: Sequence[Record], before: Mapping[str, str] | None = None
) -> Progress:
    """How much of a step is finished.

    Args:
        step: full or quick.
        records: of the results folder.
        before: what tables/reproduce.csv has of the step.
    """
    default = 60 * step.minutes[quick]
    if step.makes or not step.full.startswith("experiments.run"):
        seconds = float(before["seconds"]) if before else default
        done = bool(step.makes and before) and _is_made(step, quick, before or {})
        return Progress(1, int(done), seconds, 0 if done else seconds)
    settings = dict(w.split("=", 1) for w in step.command(quick)[1:] if "=" in w)
    name = settings.pop("experiment")
    tree: Any = OmegaConf.to_container(OmegaConf.load(CONFIGS / "experiment" / f"{name}.yaml"))
    if "task" in tree:
        return _of_measurement(name, records, default, None if quick else step.full)
    return _of_sweep({**_DEFAULTS, **tree["hydra"]["sweeper"]["params"], **settings},
                     records, default)  # fmt: skip


def code(step: Step) -> str:
    """Digest of the code that a step without records runs; empty for any other."""
    if not step.makes:
        return ""
    target = step.full.split()[0]
    if target == "experiments.run":
        target = f"experiments.{step.name}"
    return sources.code_hash(sources.sources({"_target_": target}))[:12]


def read_records(results: Path) -> list[Record]:
    """Every record of runs and measurements; files that are none are left out."""
    found = []
    for path in sorted(results.glob("*/*/record.json")):
        try:
            found.append(read_record(path.parent))
        except ValueError:
            continue
    return [record for record in found if record]


def _is_made(step: Step, quick: bool, before: Mapping[str, str]) -> bool:
    same = (before["status"], before["command"], before["code"]) == (
        "finished", shlex.join(step.command(quick)), code(step),
    )  # fmt: skip
    folders = (results_dir(), ROOT / "results")  # the sensor's scripts know the second only
    return same and any((folder / step.makes).exists() for folder in folders)


def _of_measurement(
    name: str, records: Sequence[Record], default: float, command: str | None
) -> Progress:
    """A full one is finished if this command made it, a quick one whatever the command was."""
    known = next((r for r in records if r.get("name") == name and r["status"] == "finished"), None)
    if known is None:
        return Progress(1, 0, default, default)
    seconds = float(known["seconds"])
    current = not sources.outdated(known["environment"]["sources"])
    # The number of threads changes no row.
    made = [word for word in shlex.split(known["command"]) if not word.startswith("threads=")]
    current &= command is None or made == ["python", "-m", *shlex.split(command)]
    return Progress(1, int(current), seconds, 0 if current else seconds)


def _of_sweep(params: Mapping[str, Any], records: Sequence[Record], default: float) -> Progress:
    values = {key: [v.strip() for v in str(text).split(",")] for key, text in params.items()}
    known = {
        tuple(_value(record, key) for key in values): record["training_s"]
        for record in records
        if record["status"] == "finished" and "choices" in record
    }
    taken = [known.get(job) for job in itertools.product(*values.values())]
    done = [_START_S + (1 + _TESTING) * s for s in taken if s is not None]
    left = (len(taken) - len(done)) * default / len(taken)
    return Progress(len(taken), len(done), sum(done) + left, left)


def _value(record: Record, key: str) -> str:
    """What a record has for a key of a sweep, as it is written there."""
    group, _, name = key.partition(".")
    value = record["config"][group].get(name) if name else record["choices"].get(group)
    return "null" if value is None else str(value)


def _sweep(name: str, overrides: str = "", seeds: str = "") -> str:
    words = [f"experiments.run experiment={name}", overrides, seeds and f"seed.run={seeds}"]
    return " ".join(filter(None, words))


_FIVE = "0,1,2,3,4"
_PAPER = "stop=paper model="
_CHEAP = "model=hdc,hdc_integer,softmax_dual,ridge,correlation,nearest_neighbour"
_ONE = "task.seeds=[0]"
# fmt: off
STEPS = (
    Step("hdc", "Table I", _sweep("table1", f"{_PAPER}hdc", _FIVE),
         _sweep("table1", f"{_PAPER}hdc", "0,1"), (0.5, 0.3)),
    Step("softmax", "Table I", _sweep("table1", f"{_PAPER}softmax", _FIVE),
         _sweep("table1", f"{_PAPER}softmax", "0"), (0.8, 0.2)),
    Step("correlation", "the paper's figures", _sweep("correlation"),
         _sweep("correlation", _ONE), (0.4, 0.1)),
    Step("drift", "the paper's figures", _sweep("drift"),
         _sweep("drift", f"{_ONE} task.draws=3"), (1.5, 0.3)),
    Step("scenes", "the paper's figures", _sweep("scenes"), _sweep("scenes", "", "0"), (6, 1.5)),
    Step("spatial_correlation", "the paper's figures", _sweep("spatial_correlation"),
         _sweep("spatial_correlation", _ONE), (1, 0.2)),
    Step("accuracy_vs_n", "curves", _sweep("accuracy_vs_n"),
         _sweep("accuracy_vs_n", _CHEAP, "0"), (7, 1)),
    Step("accuracy_vs_d", "curves", _sweep("accuracy_vs_d"), _sweep("accuracy_vs_d", "", "0"),
         (1.5, 0.3)),
    Step("work_precision", "curves", _sweep("work_precision"),
         _sweep("work_precision", _CHEAP, "0"), (4, 0.2)),
    Step("stability", "limits", _sweep("stability"), _sweep("stability", "task.small=true"),
         (0.5, 0.2)),
    Step("numerics", "limits", _sweep("numerics"), _sweep("numerics"), (0.5, 0.5)),
    Step("robustness", "limits", _sweep("robustness"),
         _sweep("robustness", f"{_ONE} task.draws=1 task.models=[hdc,softmax,softmax_dual,ridge]"),
         (6, 0.4)),
    Step("softmax_methods", "limits", _sweep("softmax_methods"), "", (5, 0)),
    Step("stiffness", "limits", _sweep("stiffness"), "", (2, 0)),
    Step("footprint", "cost", _sweep("footprint"),
         _sweep("footprint", "task.scenes=[touch,tactile] task.models=[hdc] task.stream=[400]"),
         (3, 0.5)),
    Step("distributed", "cost", _sweep("distributed"), "", (0.2, 0)),
    Step("fuzz", "cost", _sweep("fuzz"), "", (1, 0)),
    Step("benchmark", "cost", _sweep("benchmark"), "", (8, 0), "benchmark.csv"),
    Step("sensor_check", "cost", "scenes.sensor.check", "scenes.sensor.check", (1, 1),
         "sensor_check.csv"),
    Step("pictures", "cost", "scenes.sensor.pictures", "scenes.sensor.pictures", (0.2, 0.2),
         "figures/sensor_touch.png"),
    # The networks of its list are runs of accuracy_vs_n_cnn.
    Step("table1_extended", "other models",
         _sweep("table1_extended",
                "model=hdc_compiled,hdc_random_ties,hdc_integer,hdc_online,record_hdc,"
                "softmax_dual,softmax_lbfgs,softmax_raw,softmax_sgd,ridge,correlation,"
                "nearest_neighbour,sklearn_ridge,sklearn_logistic", _FIVE),
         _sweep("table1_extended", "model=hdc_compiled,hdc_random_ties,hdc_integer,softmax_dual,"
                "softmax_lbfgs,ridge,correlation,nearest_neighbour,sklearn_ridge"),
         (3.5, 0.5)),
    Step("accuracy_vs_n_cnn", "other models", _sweep("accuracy_vs_n_cnn"), "", (26, 0)),
    Step("cnn1", "networks", _sweep("table1", f"{_PAPER}cnn1", "0,1,2"),
         _sweep("table1", "stop=quick model=cnn1", "0"), (14, 2.5)),
    Step("cnn3", "networks", _sweep("table1", f"{_PAPER}cnn3", "0,1,2"),
         _sweep("table1", "stop=quick model=cnn3", "0"), (95, 10)),
    Step("calibration", "end", "scenes.sensor.calibrate", "", (10, 0), "calibration.csv"),
    Step("slow_tests", "end", "pytest -m slow", "", (1.5, 0)),
    Step("readme", "last", "experiments.readme", "", (0.1, 0)),
)
# fmt: on
