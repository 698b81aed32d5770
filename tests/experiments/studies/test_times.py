"""The grid of times: routes that are right, turns that are turns, ratios with their intervals."""

import itertools
import types
from typing import ClassVar

import numpy as np
import pytest
import torch
from matplotlib import pyplot as plt

from baselines.cnn import CNN
from baselines.softmax import SoftmaxRegression
from experiments.protocol import machine
from experiments.protocol.experiment import Run
from experiments.protocol.settings import named
from experiments.protocol.stop import StopRule
from experiments.records import configs
from experiments.records.results import Results
from experiments.reporting.measured import ENDS
from experiments.reporting.table import records
from experiments.studies.claims import times
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import rules
from experiments.studies.table1.times import grid, libraries, measure
from experiments.studies.table1.times.libraries import MEDIANS, LibraryHDC
from experiments.studies.table1.times.measure import Samples, Training, one_turn
from experiments.studies.table1.view import STUDY
from hdc import HDCClassifier, bits


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
    ways = configs.task("times_grid")["ways"]
    assert [way for way in grid.WAYS if way != grid.DEFAULT] == list(ways)
    for models in ways.values():
        assert set(models) == set(grid.MODELS)
        for config in models.values():
            measure.instantiate(config["model"], "model")


def test_the_grid_of_a_small_scene(small_scene, one_thread, results, monkeypatch):
    monkeypatch.setattr(machine, "keeps_memory", lambda: False)
    kept = []
    monkeypatch.setattr(machine, "keep_memory", lambda: kept.append(True))
    task = configs.task("times_grid")
    del task["_target_"]
    for models in task["ways"].values():
        del models["cnn3"]
        models["cnn1"]["model"] |= {"filters": [2], "lr": 1e-2}
    task |= {"scene": small_scene, "seeds": [0, 3], "fewer": {"cnn1": 1}}
    rows = list(measure.times_grid.rows(Run(), **task))
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


def row(way, model, seed, seconds, hdc_seconds=2.0):
    return {
        "way": way, "model": model, "turn": seed, "seconds": seconds,
        "trained_s": seconds or 60.0, "hdc_seconds": hdc_seconds, "train_accuracy": 0.95,
        "test_accuracy": 0.9, "status": "ok" if seconds else "not reached",
        "origin": "simulated", "seed": seed,
    }  # fmt: skip


def test_a_ratio_is_the_median_over_seeds_between_order_statistics(
    tmp_path, write_measurement, write_run, drawn
):
    rows = [row("tuned", "cnn1", t, 10.0 + 2 * t) for t in range(7)]
    rows += [row("tuned", "hdc", t, 2.0) for t in range(7)]
    rows += [row("tuned", "cnn3", 0, 40.0), row("libraries", "cnn3", 0, None)]
    rows += [row("default", "cnn1", 0, 7.0)]  # of a time before the runs had it
    write_measurement("times_grid", rows, scene="touch")
    # The mean of before and after, not the run of HDC by itself.
    write_run("hdc", curve=[{"training_s": 4.0}], beside_s={"hdc": 4.0})
    for seed, seconds in enumerate((90.0, 30.0, 60.0)):
        curve = [
            {
                "training_s": seconds,
                "loss": 1.0,
                "train_accuracy": 0.95,
                "test_accuracy": 0.8,
            }
        ]
        write_run("cnn1", seed=seed, curve=curve, beside_s={"hdc": 3.0})
    (table,) = (t for t in STUDY.tables_of(Results(tmp_path)) if t.name == "times_grid")
    found = {(line["way"], line["model"]): line for line in records(table.data)}
    assert list(found) == [
        ("libraries", "cnn3"), ("default", "hdc"), ("default", "cnn1"),
        ("tuned", "hdc"), ("tuned", "cnn1"), ("tuned", "cnn3"),
    ]  # fmt: skip
    line = found["tuned", "cnn1"]
    assert (line["seconds"], line["ratio"], line["runs"]) == (16, 8, 7)
    assert (line["ratio_low"], line["ratio_high"]) == (5, 11)
    assert line["coverage"] == pytest.approx(1 - 2 / 2**7)
    once = found["tuned", "cnn3"]
    assert (once["ratio"], once["ratio_low"], once["runs"]) == (20, None, 1)
    ours = found["default", "cnn1"]
    assert (ours["ratio"], ours["ratio_low"], ours["ratio_high"]) == (20, 10, 30)
    assert [ours["train_accuracy"], ours["test_accuracy"]] == pytest.approx([0.95, 0.8])
    never = found["libraries", "cnn3"]
    assert (never["seconds"], never["at_least"]) == (np.inf, 30)
    cells = {tuple(cells[:2]): cells[2:] for cells in table.cells()}
    assert cells["tuned", "CNN, 1 layer"][:3] == ["16.0", "8.0 [5.0, 11]", "7"]
    assert cells["standard libraries", "CNN, 3 layers"][:2] == ["not reached", "> 30"]
    assert "training time relative to HDC" in drawn(STUDY)["times_grid"]


def test_a_row_of_table_1_has_the_ratio_of_its_claim(tmp_path, write_run):
    write_run("hdc", curve=[{"training_s": 0.5}])
    for seed in range(5):
        curve = [
            {
                "training_s": 4.0 + seed,
                "loss": 1.0,
                "train_accuracy": 0.95,
                "test_accuracy": 0.8,
            }
        ]
        beside = {"hdc": 0.5, "hdc_numpy": 2.0}
        write_run("softmax", seed=seed, curve=curve, beside_s=beside)
    tables = {t.name: records(t.data) for t in STUDY.tables_of(Results(tmp_path))}
    (shown,) = (r for r in tables["table1"] if r["model"] == "softmax")
    (grid_row,) = (r for r in tables["times_grid"] if r["model"] == "softmax")
    pair = [
        (shown[f"training_time_over_hdc{end}"], grid_row[f"ratio{end}"]) for end in ENDS
    ]
    assert pair == [(12, 12), (8, 8), (16, 16)]
    (claimed,) = times.pieces(
        "softmax",
        rules().claims["softmax"],
        rules(),
        Evidence(Results(tmp_path).frame(*grid.OF)),
    )
    assert tuple(claimed.estimate) == (12, 8, 16)
    assert shown["training_time_over_numpy_hdc"] == 3


def reached_after(seconds):
    """The curve of a training that reaches 90 % at its only checkpoint."""
    accuracies = {"train_accuracy": 0.95, "test_accuracy": 0.8}
    return [{"training_s": seconds, "loss": 1.0, **accuracies}]


def test_a_run_without_hdc_beside_it_counts_for_no_ratio(tmp_path, write_run):
    """Seven runs make an interval of order statistics; the one ratio of them makes none."""
    write_run("hdc", curve=[{"training_s": 0.5}])
    for seed in range(7):
        write_run("softmax", seed=seed, curve=reached_after(4.0))
    lines = grid.every_line(Results(tmp_path).frame(*grid.OF))
    found = {line["model"]: (line["ratio"], line["runs"]) for line in lines}
    assert found == {"hdc": (1, 1), "softmax": (8, 1)}


def test_a_grid_of_other_frames_does_not_displace_that_of_table_1(
    tmp_path, write_measurement
):
    write_measurement("times_grid", [row("tuned", "cnn1", 0, 10.0)], scene="touch")
    rows = [row("tuned", "cnn1", 0, 99.0)]
    other = {"scene": "diffuser", "changed": {"scene.template": '"x"'}}
    write_measurement("times_grid", rows, config={"scene": {}}, **other)
    (line,) = grid.every_line(Results(tmp_path).frame(*grid.OF))
    assert line["seconds"] == 10


def test_the_grid_names_its_own_frames_and_no_others(tmp_path, write_run):
    write_run("hdc", curve=[{"training_s": 0.5}], beside_s={"hdc": 0.5})
    write_run("softmax", curve=reached_after(4.0), beside_s={"hdc": 0.5})
    write_run("hdc", scene="fibre_grouped", origin="computed", classes="abcde")
    results = Results(tmp_path)
    (table,) = (t for t in STUDY.tables_of(results) if t.name == "times_grid")
    (plot,) = (p for p in STUDY.plots_of(results) if p.name == "times_grid")
    for text in (table.title, plot.caption):
        assert "simulated frames" in text
        assert "computed" not in text
    assert plot.commands == table.commands != ()
    assert all("fibre" not in command for command in plot.commands)
    head = plot.draw()._suptitle.get_text().replace("\n", " ")
    plt.close("all")
    assert "Touch, simulated frames, random split, 20 % test" in head


def test_a_training_that_never_got_there_is_drawn_at_its_bound(
    tmp_path, write_measurement
):
    rows = [row("tuned", "hdc", 0, 2.0), row("tuned", "cnn3", 0, None)]
    write_measurement("times_grid", rows, scene="touch")
    (plot,) = (p for p in STUDY.plots_of(Results(tmp_path)) if p.name == "times_grid")
    (axes,) = plot.draw().axes
    plt.close("all")
    heights = [line.get_ydata()[0] for line in axes.lines if line.get_marker() == "v"]
    assert heights == [30]
