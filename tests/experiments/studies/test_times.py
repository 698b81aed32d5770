"""The grid of times: routes that are right, turns that are turns, ratios with their intervals."""

import itertools
import types
from typing import ClassVar

import numpy as np
import pytest
import torch

from baselines.cnn import CNN
from baselines.softmax import SoftmaxRegression
from experiments.protocol import machine
from experiments.protocol.experiment import Run
from experiments.protocol.settings import named
from experiments.protocol.stop import StopRule
from experiments.records import configs
from experiments.records.results import Results
from experiments.reporting.table import records
from experiments.studies.table1.times import grid, libraries, measure
from experiments.studies.table1.times.libraries import MAJORITIES, MEDIANS, LibraryHDC
from experiments.studies.table1.times.measure import Samples, Training, in_turns
from experiments.studies.table1.view import STUDY
from hdc import HDCClassifier, bits

MODELS = ("hdc", "softmax", "softmax_dual", "ridge", "cnn1", "cnn3")


@pytest.fixture
def samples(frames_and_labels):
    frames, labels = frames_and_labels(60, 3, 12)
    return Samples(torch.from_numpy(frames), labels)


# Models by standard libraries ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("median", "majority"), list(itertools.product(MEDIANS, MAJORITIES))
)
def test_hdc_by_libraries_has_the_prototypes_of_ours_but_for_ties(
    median, majority, samples
):
    pytest.importorskip("torchhd" if majority.startswith("torchhd") else "numpy")
    ours = HDCClassifier().fit(samples.frames, samples.labels)
    theirs = LibraryHDC(median, majority)
    assert list(theirs.train(samples.frames, samples.labels)) == [{"samples_seen": 60}]
    expected = bits.unpack(ours.prototypes_, 144).numpy()
    assert (
        theirs.prototypes_ != expected
    ).mean() < 0.1  # 20 frames per class tie at times
    assert (theirs.predict(samples.frames) == samples.labels).all()


def test_the_median_of_a_histogram_is_that_of_numpy():
    for size in (7, 8, 1001, 4096):
        frame = np.random.default_rng(size).integers(0, 256, size, dtype=np.uint8)
        lower = np.sort(frame)[(size - 1) // 2]
        for median in MEDIANS.values():
            assert median(frame) == lower


@pytest.mark.parametrize("filters", [[], [4], [2, 3]])
def test_a_plain_network_takes_the_same_steps_as_ours(filters, samples):
    """Only then a difference of times is one of how it is computed."""
    plain = libraries.PlainNetwork(filters, reports_per_epoch=3, lr=1e-3, seed=4)
    shared = {"lr": 1e-3, "seed": 4, "reports_per_epoch": 3}
    ours = CNN(filters=filters, **shared) if filters else SoftmaxRegression(**shared)
    pairs = zip(
        plain.train(samples.frames, samples.labels),
        ours.train(samples.frames, samples.labels),
        strict=False,
    )
    for one, other in itertools.islice(pairs, 6):
        for key in ("samples_seen", "epoch", "steps", "batch_accuracy"):
            assert one[key] == other[key], key
    mine = dict(plain.network_.named_parameters())
    theirs = [p.detach() for p in ours.network_.parameters()]
    for parameter, other in zip(mine.values(), theirs, strict=True):
        torch.testing.assert_close(parameter.detach(), other, rtol=1e-3, atol=1e-5)
    assert (plain.predict(samples.frames) == ours.predict(samples.frames)).mean() > 0.9


# Turns --------------------------------------------------------------------------------------------


class Timed:
    """A model that takes so long a report, and is right from one of its reports on."""

    clock = types.SimpleNamespace(t=0.0)
    calls: ClassVar[list[str]] = []

    def __init__(self, name, seconds, right_from=1, steps=True):
        self.name, self.seconds = name, seconds
        self.right_from, self.steps, self.report = right_from, steps, 0

    def train(self, frames, labels):
        Timed.calls.append(self.name)
        self.labels = labels
        for self.report in range(1, 6):
            Timed.clock.t += self.seconds
            row = {"samples_seen": 60 * self.report, "loss": 1.0, "batch_accuracy": 0.8}
            yield {**row, "steps": self.report} if self.steps else {"samples_seen": 60}
            if not self.steps:
                return

    def predict(self, frames):
        Timed.clock.t += 1000  # which counts for nothing
        right = self.report >= self.right_from
        return self.labels if right else (self.labels + 1) % 3


def timed(name, seconds, **more):
    target = f"{Timed.__module__}.Timed"
    return {"_target_": target, "name": name, "seconds": seconds, **more}


@pytest.fixture
def training(samples, monkeypatch):
    monkeypatch.setattr(
        "experiments.protocol.clock.time.perf_counter", lambda: Timed.clock.t
    )

    def built(node, _):
        return Timed(**{key: node[key] for key in node if key != "_target_"})

    monkeypatch.setattr(measure, "instantiate", built)
    Timed.calls.clear()
    return Training(None, samples, samples, StopRule(), to_end=("end",))


def test_hdc_is_timed_before_and_after_each_model_of_each_turn(training):
    models = {
        "hdc": timed("hdc", 2.0, steps=False),
        "a": timed("a", 3.0),
        "b": timed("b", 5.0),
    }
    rows = list(in_turns(training, models, 2, 70))
    assert Timed.calls == ["hdc", "a", "hdc", "b", "hdc", "hdc"] * 2
    assert [(r["turn"], r["model"], r["seconds"], r["hdc_seconds"]) for r in rows] == [
        (0, "a", 3, 2), (0, "b", 5, 2), (0, "hdc", 2, 2),
        (1, "a", 3, 2), (1, "b", 5, 2), (1, "hdc", 2, 2),
    ]  # fmt: skip


def test_a_long_model_takes_part_in_as_many_turns_as_fit_and_in_one_at_least(training):
    models = {
        "hdc": timed("hdc", 0.1, steps=False),
        "short": timed("short", 10.0),
        "long": timed("long", 30.0),
        "very": timed("very", 200.0),
    }
    rows = list(in_turns(training, models, 9, 70))
    counts = {name: sum(r["model"] == name for r in rows) for name in models}
    assert counts == {"hdc": 9, "short": 7, "long": 2, "very": 1}


def test_time_ends_at_the_report_that_exceeds_the_target_or_with_the_model(training):
    iterative = training.carry_out("a", timed("a", 3.0, right_from=4))
    assert (iterative.seconds, iterative.steps) == (12, 4)
    assert (iterative.train_accuracy, iterative.test_accuracy) == (1, 1)
    # Known from before: it is not looked at earlier, and is found at the same report.
    assert training.carry_out("a", timed("a", 3.0, right_from=4), skip=4).seconds == 12
    assert training.carry_out("end", timed("end", 3.0, right_from=1)).seconds == 15
    one_pass = training.carry_out("c", timed("c", 3.0, steps=False, right_from=9))
    assert (one_pass.seconds, one_pass.train_accuracy) == (3, 0)
    never = training.carry_out("a", timed("a", 3.0, right_from=9))
    assert np.isinf(never.seconds)


def test_the_fastest_route_takes_part(training, monkeypatch):
    monkeypatch.setattr(Training, "warm_up", lambda *_: None)
    routes = {"slow": {"model": timed("a", 3.0)}, "fast": {"model": timed("a", 1.0)}}
    assert measure.fastest(training, "a", routes) == "fast"


def test_every_model_has_a_route_by_every_way_and_each_can_be_built():
    task = configs.task("times_grid")
    assert list(task["ways"]) == list(grid.WAYS)
    for models in task["ways"].values():
        assert set(models) == set(MODELS)
        for routes in models.values():
            for route in routes.values():
                measure.instantiate(route["model"], "model")


def test_the_grid_of_a_small_scene(small_scene, one_thread, results, monkeypatch):
    monkeypatch.setattr(machine, "_kept", False)
    kept = []
    monkeypatch.setattr(machine, "keep_memory", lambda: kept.append(True))
    task = configs.task("times_grid")
    del task["_target_"]
    for models in task["ways"].values():
        del models["cnn3"]
        models["cnn1"] = {
            name: {"model": {**route["model"], "filters": [2], "lr": 1e-2}}
            for name, route in models["cnn1"].items()
        }
    task |= {"scene": small_scene, "turns": 2}
    rows = list(measure.times_grid.rows(Run(), **task))
    assert len(kept) == 2  # by two of three ways, and not before the first
    assert len(rows) == 3 * 5 * 2
    assert {row["status"] for row in rows} == {"ok"}
    for row in rows:
        assert row["seconds"] > 0
        assert row["hdc_seconds"] > 0
        assert row["train_accuracy"] > 0.9 or row["model"] in ("softmax_dual", "ridge")
    monkeypatch.setattr(machine, "_kept", True)
    with pytest.raises(ValueError, match=r"task\.ways\.libraries: expected a process"):
        next(measure.times_grid.rows(Run(), **task))
    del task["ways"]["tuned"]["hdc"]
    with pytest.raises(ValueError, match=r"task\.ways\.tuned: expected hdc"):
        next(measure.times_grid.rows(Run(), **task))


def test_the_runner_leaves_memory_to_the_grid_alone():
    """PyTorch at its defaults gives freed memory back."""

    assert named({"_target_": f"{measure.__name__}.times_grid"}).own_memory
    other = "experiments.studies.benchmark.measure.benchmark"
    assert not named({"_target_": other}).own_memory
    assert named(None) is None


# The table ----------------------------------------------------------------------------------------


def row(way, model, turn, seconds, hdc_seconds=2.0):
    return {
        "way": way, "route": "r", "model": model, "turn": turn, "seconds": seconds,
        "hdc_seconds": hdc_seconds, "train_accuracy": 0.95, "test_accuracy": 0.9,
        "status": "ok" if seconds else "not reached", "origin": "simulated", "seed": 0,
    }  # fmt: skip


def test_a_ratio_is_the_median_over_turns_between_order_statistics(
    tmp_path, write_measurement, drawn
):
    rows = [row("default", "cnn1", t, 10.0 + 2 * t) for t in range(7)]
    rows += [row("default", "hdc", t, 2.0) for t in range(7)]
    rows += [row("tuned", "cnn3", 0, 40.0), row("tuned", "ridge", 0, None)]
    write_measurement("times_grid", rows)
    (table,) = STUDY.tables_of(Results(tmp_path))
    found = {(line["way"], line["model"]): line for line in records(table.data)}
    assert list(found)[:2] == [("default", "hdc"), ("default", "cnn1")]
    line = found["default", "cnn1"]
    assert (line["seconds"], line["ratio"], line["turns"]) == (16, 8, 7)
    assert (line["ratio_low"], line["ratio_high"]) == (5, 11)
    assert line["coverage"] == pytest.approx(1 - 2 / 2**7)
    once = found["tuned", "cnn3"]
    assert (once["ratio"], once["ratio_low"], once["turns"]) == (20, None, 1)
    assert np.isinf(found["tuned", "ridge"]["seconds"])
    cells = {tuple(cells[:2]): cells[2:] for cells in table.cells()}
    assert cells["by default", "CNN, 1 layer"][:3] == [
        "16.0",
        "8.00 [5.00, 11.0]",
        "7",
    ]
    assert cells["tuned", "Ridge"][0] == "not reached"
    assert "training time, × HDC" in drawn(STUDY)["times_grid"]
