"""Training times: HDC beside each model, enough fits in groups, what is disturbed.

The table is that of the committed records, byte by byte (test_report.py).
"""

import types
from contextlib import contextmanager
from typing import ClassVar

import pytest
import torch

from experiments.protocol.load import Load
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context
from experiments.studies.table1 import measure
from experiments.studies.table1.measure import NOT_REACHED, Samples, Times, fit
from tests.experiments import composed
from tests.experiments.golden_items import SMALL_SENSOR

QUIET, BUSY = Load(0.0, {1: 1.0}), Load(0.5, {1: 1.0})
OTHERS = "others took 50% of the processor time"


@pytest.fixture
def samples(frames_and_labels):
    frames, labels = frames_and_labels(60, 3, 12)
    return Samples(torch.from_numpy(frames), labels)


# Fits and groups, by made-up clocks ---------------------------------------------------------------


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
        right = self.report >= self.right_from
        return self.labels if right else (self.labels + 1) % 3


class Loads:
    """A watch that finds one load after the other, quiet at the end."""

    def __init__(self, loads):
        self.loads = iter(loads)

    @contextmanager
    def watching(self):
        yield
        self.load = next(self.loads, QUIET)


@pytest.fixture
def timing(samples, monkeypatch):
    """timing(loads, models, **fields) → rows of one thread, by a clock that models move."""
    clock = types.SimpleNamespace(
        perf_counter=lambda: Timed.clock.t, process_time=lambda: 2 * Timed.clock.t
    )
    for place in ("protocol.clock", "protocol.load", "studies.table1.measure"):
        monkeypatch.setattr(f"experiments.{place}.time", clock)

    monkeypatch.setattr(measure, "instantiate", lambda config, _: Timed(**config))
    monkeypatch.setattr(measure, "warm_up", lambda *_: None)

    def rows(loads, models, **fields):
        Timed.calls.clear()
        config = composed.task("times") | {"cold": [], "only": {}, "fewer": {}}
        parts = {name: {"model": {"name": name, **of}} for name, of in models.items()}
        task = composed.made(Times, **{**config, "models": parts, **fields})
        watch = Loads(loads)
        return list(measure._Timing(task, samples, watch).rows(1))

    return rows


HDC = {"seconds": 0.5, "steps": False}  # it learns in one pass


def test_hdc_is_timed_before_and_after_each_model_in_groups_of_two_seconds(timing):
    """Five fits at least, of a model that is named as slow fewer."""
    models = {"hdc": HDC, "a": {"seconds": 3.0}, "b": {"seconds": 0.75}}
    rows = timing([], models, fewer={"a": 2})
    hdc, a = ["hdc"] * 8, ["a"] * 2  # two groups of four fits, two of one
    assert Timed.calls == [*hdc, *a, *hdc, *["b"] * 6, *hdc]
    groups = dict.fromkeys((r["model"], r["group"]) for r in rows)
    expected = [*["hdc"] * 2, *a, *["hdc"] * 2, *["b"] * 2, *["hdc"] * 2]
    assert [model for model, _ in groups] == expected
    assert {(r["model"], r["fit_s"], r["cpu_s"]) for r in rows} == {
        ("hdc", 0.5, 1.0), ("a", 3.0, 6.0), ("b", 0.75, 1.5),
    }  # fmt: skip
    assert {r["disturbed"] for r in rows} == {""}


def test_a_disturbed_group_is_measured_again_and_every_line_of_it_stands(timing):
    again = {"most": 2, "budget_s": 4.5}
    rows = timing([BUSY, QUIET, BUSY, BUSY, BUSY], {"hdc": HDC}, fits=8, retries=again)
    groups = {r["group"]: (r["attempt"], r["others"], r["disturbed"]) for r in rows}
    # The second group has one attempt more, and none is left in the budget of 4.5 s then.
    assert list(groups.values()) == [
        (0, 0.5, OTHERS), (1, 0.0, ""), (0, 0.5, OTHERS), (1, 0.5, OTHERS)
    ]  # fmt: skip
    assert len(rows) == 4 * 4


def test_a_fit_ends_at_the_report_that_exceeds_the_target_or_with_the_model(
    timing, samples
):
    def one(**more):
        return fit({"name": "a", "seconds": 3.0, **more}, samples, StopRule())

    assert one(right_from=4) == {"fit_s": 12, "cpu_s": 24, "train_accuracy": 1}
    one_pass = {"fit_s": 3, "cpu_s": 6, "train_accuracy": 0}
    assert one(steps=False, right_from=9) == one_pass
    never = {"fit_s": 15, "cpu_s": 30, "train_accuracy": 0, "disturbed": NOT_REACHED}
    assert one(right_from=9) == never


def test_the_times_of_a_small_scene(one_thread, results):
    scene = composed.composed("scene=touch", *SMALL_SENSOR)["scene"]
    task = composed.task("times")
    for name in ("softmax", "cnn1", "cnn3"):
        del task["models"][name]
    task |= {"scene": scene, "threads": [1], "group_s": 0, "cold": ["hdc"]}
    task |= {"busy": [0.5], "retries": {"most": 0, "budget_s": 0}}
    *fits, cold = composed.made(Times, **task).rows(Context())
    order = ("hdc", "hdc_compiled", "hdc", "softmax_dual", "hdc")
    assert [row["model"] for row in fits] == [m for m in order for _ in range(5)]
    assert all(row["train_accuracy"] > 0.9 for row in fits)
    assert (cold["model"], cold["cold"]) == ("hdc", True)
    assert cold["fit_s"] > 50 * fits[0]["fit_s"]  # which imports torch
    assert cold["disturbed"]
    found = {(row["busy"], row["origin"]) for row in (*fits, cold)}
    assert found == {(0.5, "simulated")}
