"""The grid of times: routes that are right, turns that are turns, ratios with their intervals."""

import itertools
import types
from typing import ClassVar

import numpy as np
import pytest
import torch
from matplotlib.lines import CARETUPBASE

from baselines.cnn import CNN
from baselines.softmax import SoftmaxRegression
from experiments.protocol import machine
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context, named
from experiments.reporting.table import ENDS, records
from experiments.studies.table1.times import grid, libraries, measure
from experiments.studies.table1.times.libraries import MEDIANS, LibraryHDC
from experiments.studies.table1.times.measure import Samples, Training, one_turn
from experiments.studies.table1.view import STUDY
from hdc import HDCClassifier, bits
from tests.experiments import composed


@pytest.fixture
def samples(frames_and_labels):
    frames, labels = frames_and_labels(60, 3, 12)
    return Samples(torch.from_numpy(frames), labels)


# Models by standard libraries ---------------------------------------------------------------------


@pytest.mark.parametrize("median", MEDIANS)
def test_hdc_by_libraries_has_the_prototypes_of_ours_but_for_ties(median, samples):
    ours = HDCClassifier().fit(samples.frames, samples.labels)
    theirs = LibraryHDC(median)
    assert list(theirs.train(samples.frames, samples.labels)) == [{"samples_seen": 60}]
    expected = bits.unpack(ours.prototypes_, 144).numpy()
    assert (
        theirs.prototypes_ != expected
    ).mean() < 0.1  # 20 frames per class tie at times
    assert (theirs.predict(samples.frames) == samples.labels).all()


def test_a_pixel_is_above_the_lower_median_by_every_library():
    for size in (7, 8, 1001, 4096):
        frame = np.random.default_rng(size).integers(0, 256, size, dtype=np.uint8)
        lower = np.sort(frame)[(size - 1) // 2]
        for median in MEDIANS.values():
            assert ((frame > median(frame)) == (frame > lower)).all()


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


def test_hdc_is_timed_before_and_after_each_model(training):
    models = {
        "hdc": timed("hdc", 2.0, steps=False),
        "a": timed("a", 3.0),
        "b": timed("b", 5.0),
    }
    rows = list(one_turn(training, models))
    assert Timed.calls == ["hdc", "a", "hdc", "b", "hdc", "hdc"]
    assert [(r["model"], r["seconds"], r["hdc_seconds"]) for r in rows] == [
        ("a", 3, 2), ("b", 5, 2), ("hdc", 2, 2),
    ]  # fmt: skip


def test_time_ends_at_the_report_that_exceeds_the_target_or_with_the_model(training):
    iterative = training.carry_out("a", timed("a", 3.0, right_from=4))
    assert iterative.seconds == iterative.trained_s == 12
    assert (iterative.train_accuracy, iterative.test_accuracy) == (1, 1)
    assert training.carry_out("end", timed("end", 3.0, right_from=1)).seconds == 15
    one_pass = training.carry_out("c", timed("c", 3.0, steps=False, right_from=9))
    assert (one_pass.seconds, one_pass.train_accuracy) == (3, 0)
    never = training.carry_out("a", timed("a", 3.0, right_from=9))
    assert (never.seconds, never.trained_s) == (np.inf, 15)


def test_every_model_is_computed_by_every_way_and_each_can_be_built():
    ways = composed.task("times_grid")["ways"]
    assert [way for way in grid.WAYS if way != grid.DEFAULT] == list(ways)
    for models in ways.values():
        assert set(models) == set(grid.MODELS)
        for config in models.values():
            measure.instantiate(config["model"], "model")


def test_the_grid_of_a_small_scene(small_scene, one_thread, results, monkeypatch):
    monkeypatch.setattr(machine, "keeps_memory", lambda: False)
    kept = []
    monkeypatch.setattr(machine, "keep_memory", lambda: kept.append(True))
    task = composed.task("times_grid")
    del task["_target_"]
    for models in task["ways"].values():
        del models["cnn3"]
        models["cnn1"]["model"] |= {"filters": [2], "lr": 1e-2}
    task |= {"scene": small_scene, "seeds": [0, 3], "fewer": {"cnn1": 1}}
    rows = list(composed.made(measure.TimesGrid, **task).rows(Context()))
    assert len(kept) == 1  # by the second of two ways, and not before the first
    assert len(rows) == 2 * (2 * 4 + 1)
    assert {(row["turn"], row["seed"]) for row in rows} == {(0, 0), (1, 3)}
    assert {row["status"] for row in rows} == {"ok"}
    for row in rows:
        assert row["seconds"] == row["trained_s"] > 0 or row["model"] == "hdc"
        assert row["hdc_seconds"] > 0
        assert row["train_accuracy"] > 0.9 or row["model"] in ("softmax_dual", "ridge")
    monkeypatch.setattr(machine, "keeps_memory", lambda: True)
    with pytest.raises(ValueError, match=r"task\.ways\.libraries: expected a process"):
        next(composed.made(measure.TimesGrid, **task).rows(Context()))
    del task["ways"]["tuned"]["hdc"]
    with pytest.raises(ValueError, match=r"task\.ways\.tuned: expected hdc"):
        next(composed.made(measure.TimesGrid, **task).rows(Context()))


def test_the_runner_leaves_memory_to_the_grid_alone():
    """PyTorch at its defaults gives freed memory back."""

    assert named({"_target_": f"{measure.__name__}.TimesGrid"}).own_memory
    other = "experiments.studies.footprint.measure.Footprint"
    assert not named({"_target_": other}).own_memory


# The table ----------------------------------------------------------------------------------------


def row(way, model, seed, seconds):
    return {
        "way": way, "model": model, "turn": seed, "seconds": seconds,
        "trained_s": seconds or 60.0, "hdc_seconds": 2.0, "train_accuracy": 0.95,
        "test_accuracy": 0.9, "status": "ok" if seconds else "not reached",
        "origin": "simulated", "seed": seed,
    }  # fmt: skip


def reached_after(seconds):
    """The curve of a training that reaches 90 % at its only checkpoint."""
    accuracies = {"train_accuracy": 0.95, "test_accuracy": 0.8}
    return [{"training_s": seconds, "loss": 1.0, **accuracies}]


@pytest.fixture
def table(answers):
    """table(name) → that table, of the records in tmp_path."""
    return lambda name="times_grid": answers(STUDY).table(name)


def test_a_ratio_is_the_median_over_seeds_between_order_statistics(
    table, write_measurement, write_run
):
    rows = [row("tuned", "cnn1", t, 10.0 + 2 * t) for t in range(7)]
    rows += [row("tuned", "hdc", t, 2.0) for t in range(7)]
    rows += [row("libraries", "cnn3", 0, None)]
    rows += [row("default", "cnn1", 0, 7.0)]  # of a time before the runs had it
    write_measurement("times_grid", rows, scene="touch")
    other = {"scene": "diffuser", "changed": {"scene.template": '"x"'}}  # frames
    rows = [row("tuned", "cnn1", 0, 99.0)]
    write_measurement("times_grid", rows, config={"scene": {}}, **other)
    write_run("hdc", curve=[{"training_s": 4.0}])
    for seed, seconds in enumerate((90.0, 30.0, 60.0)):
        beside = {"hdc": 3.0}  # the mean of before and after, not a run of HDC
        write_run("cnn1", seed=seed, curve=reached_after(seconds), beside_s=beside)
    write_run("ridge", curve=[{"training_s": 4.0}])  # none beside it: no ratio
    made = table()
    found = {(line["way"], line["model"]): line for line in records(made.data)}
    assert list(found) == [
        ("libraries", "cnn3"), ("default", "hdc"), ("default", "cnn1"),
        ("tuned", "hdc"), ("tuned", "cnn1"),
    ]  # fmt: skip
    for place, expected in (
        (("tuned", "cnn1"), (16, 8, 5, 11, 7)),
        (("default", "cnn1"), (60, 20, 10, 30, 3)),
        (("libraries", "cnn3"), (np.inf, np.inf, None, None, 1)),
    ):
        names = ("seconds", "ratio", "ratio_low", "ratio_high", "runs")
        assert tuple(found[place][name] for name in names) == expected, place
    assert found["tuned", "cnn1"]["coverage"] == pytest.approx(1 - 2 / 2**7)
    assert found["default", "cnn1"]["test_accuracy"] == pytest.approx(0.8)
    assert found["libraries", "cnn3"]["at_least"] == 30
    cells = {tuple(cells[:2]): cells[2:] for cells in made.cells()}
    assert cells["tuned", "CNN, 1 layer"][:3] == ["16.0", "8.0 [5.0, 11]", "7"]
    assert cells["standard libraries", "CNN, 3 layers"][:2] == ["not reached", "> 30"]
    # The row of Table I has the same ratio.
    line = next(r for r in records(table("table1").data) if r["model"] == "cnn1")
    assert [line[f"training_time_over_hdc{end}"] for end in ENDS] == [20, 10, 30]


def test_a_training_that_never_got_there_is_drawn_at_its_bound(
    write_measurement, figures
):
    rows = [row("tuned", "hdc", 0, 2.0), row("tuned", "cnn3", 0, None)]
    write_measurement("times_grid", rows, scene="touch")
    (axes,) = figures(STUDY)["times_grid"].axes
    arrows = [line for line in axes.lines if line.get_marker() == CARETUPBASE]
    assert [float(line.get_ydata()[0]) for line in arrows] == [48]  # from 30 upwards
