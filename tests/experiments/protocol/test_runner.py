"""One config, one record: named after what determines it, not repeated, kept when it breaks off."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import msgspec
import numpy as np
import pytest
import torch

import experiments
import hdc
from experiments.protocol import runner
from experiments.protocol.task import Task
from experiments.records import store
from experiments.records.environment import environment
from experiments.records.results import Results
from experiments.records.rows import unpack_labels
from tests.experiments.composed import composed
from tests.experiments.made_up import carried_out

SENSOR = {"_target_": "scenes.sensor.scene.SpeckleScene", "seed": 1, "display": "x"}
CALLS = []


class Counting(Task, frozen=True):
    """Numbers up to one."""

    revision: ClassVar = 3
    uses: ClassVar = ("hdc.bits",)
    timed: ClassVar = True

    scene: Mapping[str, Any] | None = None
    most: int = 2
    sizes: Sequence[float | int] = (1,)

    def rows(self, context):
        CALLS.append((context, self))
        for k in range(self.most):
            yield {"k": np.int64(k), "call": len(CALLS), "nothing": np.nan}


@pytest.fixture(autouse=True)
def nothing_called():
    CALLS.clear()


@pytest.fixture
def count(results, one_thread):
    """count(*words, **task) → the record of Counting, whether it was there, what was printed."""

    def call(*words, **task):
        cfg = composed("threads=1", "exclusive=false", *words)
        cfg["task"] = {"_target_": f"{__name__}.Counting", **task}
        choices = {"scene": "touch", "experiment": "numbers"}
        return carried_out(cfg, runner.Asked(choices))

    return call


def the_record(results):
    (entry,) = store.read(results)
    return entry


# What a record says -------------------------------------------------------------------------------


def test_a_training_says_what_it_was_and_what_came_out(
    carry_out, results, frames_and_labels
):
    entry = carry_out("seed.run=2", "exclusive=false")
    assert the_record(results) == entry
    found = entry.results
    assert entry.status == found["stop"] == "finished"
    assert found["origin"] == "recorded"
    assert (found["n_train"], found["n_test"]) == (40, 10)
    here = msgspec.structs.replace(environment("cpu", 1), exclusive=False)
    assert (entry.environment, entry.timed) == (here, True)
    assert not set(runner.NOT_IDENTITY) & set(entry.config)
    label = f"recorded frames.npz ({entry.data[:6]})"
    assert (entry.scene.name, entry.scene.label) == ("recorded", label)
    assert (entry.model.name, entry.stop) == ("hdc", "paper")
    shown = entry.model.display["name"], entry.scene.display["name"]
    assert shown == ("HDC as published", "Own recording")
    # Every figure again, from the frames and the predictions in the record.
    frames, labels = frames_and_labels()
    tested, truth, answer = (
        unpack_labels(found[key]) for key in ("test_indices", "labels", "predicted")
    )
    assert found["test_accuracy_final"] == (truth == answer).mean()
    assert found["train_accuracy_final"] > 0.5
    np.testing.assert_array_equal(truth, labels[tested])
    train = np.setdiff1d(np.arange(50), tested)
    model = hdc.HDCClassifier().fit(frames[train], labels[train])
    np.testing.assert_array_equal(answer, model.predict(frames[tested]))
    assert 0 < found["predict_single_s"] < 1
    assert 0 < found["training_time_s"] == found["total_time_s"] < 10


def test_an_experiment_says_what_was_measured_how_and_on_what(count, results):
    words = ("force=true", "cache=false")
    made, repeated, _ = count(*words, scene=SENSOR, sizes=[1, 2])
    # Displays are for tables: no row depends on them.
    scene = {key: SENSOR[key] for key in ("_target_", "seed")}
    config = {"scene": scene, "most": 2, "sizes": [1, 2]}
    ((context, task),) = CALLS
    assert (context.name, context.cache, context.force) == ("numbers", False, True)
    assert task.scene == scene
    assert made.revisions[f"{__name__}.Counting"] == 3
    line = json.loads((results / store.FILE).read_text())
    about = {
        "schema": 6,
        "experiment": "numbers",
        "task": f"{__name__}.Counting",
        "config": config,
        "timed": True,
        # JSON has no NaN, and what is missing at the end of a row is left out.
        "rows": {"columns": ["k", "call", "nothing"], "values": [[0, 1], [1, 1]]},
    }
    assert line.items() >= about.items()
    assert (made.data, repeated, made.scene.label) == ("", False, "touch")
    assert made.rows.dicts()[0] == {"k": 0, "call": 1, "nothing": None}


CHANGES = [
    # Which run of a config it is, and how it is carried out, is no change of it.
    ("scene stop seed.run split.n_train data.pixels scene.path scene.seed", {}),
    ("device threads exclusive hydra/launcher model.sampling_seed nothing.of.it", {}),
    ("model.momentum model.layers.1.n", {"model.momentum": "null", "model.layers.1.n": "3"}),
    (
        "stop.budget_s task.p split.kind scene.sensor.noise",
        {"scene.sensor.noise": "0.2", "split.kind": '"ordered"', "stop.budget_s": "60", "p": "0.5"},
    ),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "expected"), CHANGES, ids=lambda x: str(x)[:30])
def test_what_was_set_is_in_the_record_frames_first(keys, expected):
    config = {
        "scene": {"seed": 3, "sensor": {"noise": 0.2}, "path": "x"},
        "split": {"kind": "ordered", "n_train": 5},
        "model": {"sampling_seed": 3, "layers": [{}, {"n": 3}]},
        "stop": {"budget_s": 60},
        "data": {"pixels": 100},
        "seed": {"run": 3},
        "device": "cpu",
        "threads": 1,
        "p": 0.5,
    }
    found = runner._changed(config, keys.split())
    assert list(found.items()) == list(expected.items())


# What names it ------------------------------------------------------------------------------------

IDENTITY = ["seed.run=1", "seed.pixels=7", "split.kind=ordered", "split.n_train=20",
            "data.pixels=100", "model.readout.ties=one", "scene.subsample=2"]  # fmt: skip


def test_the_id_is_a_function_of_config_and_data(carry_out, recording):
    path = recording()
    first = carry_out(scene=path).id
    ids = [carry_out(override, scene=path).id for override in IDENTITY]
    assert len({first, *ids}) == len(IDENTITY) + 1
    for override in ("force=true", "cache=false", "exclusive=false"):
        assert carry_out(override, scene=path).id == first
    torch.set_num_threads(2)
    assert carry_out(scene=path).id not in {first, *ids}
    torch.set_num_threads(1)
    with np.load(path) as held:
        frames, labels = held["frames"], held["labels"]
    frames[3, 0, 0] ^= 1
    np.savez(path, frames=frames, labels=labels)
    assert carry_out(scene=path).id not in {first, *ids}


def test_committed_records_are_found_under_their_names(committed_results):
    """Under another name, everything would be measured again."""
    for record in committed_results.measurements:
        kind = runner.named({"_target_": record.task})
        if record.revisions[record.task] != kind.revision:
            continue  # it is measured again in any case
        task = runner.checked(record.config, kind, "task")
        fields = msgspec.structs.fields(kind)
        own = {f.name: record.config.get(f.name, f.default) for f in fields}
        assert runner.name_of(record.experiment, own, record.data) == record.id
        assert task.timed <= record.timed


# Found finished, or made again --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("group", "key", "value", "why"),
    [
        ("revisions", f"{__name__}.Counting", 0, "Counting (changed)"),
        ("revisions", "experiments", 0, f"(revision 0, now {experiments.REVISION})"),
        ("environment", "threads", 2, "2 threads, now 1"),
        ("environment", "changes", "x", "changes of a checkout that are in no commit"),
    ],
    ids=str,
)
def test_what_was_finished_by_other_code_or_threads_is_made_again_and_why_is_said(
    count, results, group, key, value, why
):
    first, *_ = count()
    assert count()[1:] == (True, "")
    path = results / store.FILE
    entry = json.loads(path.read_text())
    entry[group][key] = value
    path.write_text(json.dumps(entry))
    made, repeated, said = count()
    assert (made.id, repeated) == (first.id, False)
    assert said.startswith(f"{first.id}: made again, finished otherwise: ")
    assert why in said
    assert count()[1]
    assert len(store.find(results, first.id).rows.values) == len(CALLS) == 2
    assert count("force=true")[1] is False


def test_a_run_with_limits_of_the_load_says_what_it_was_and_is_the_same_run(carry_out):
    strict = carry_out("+disturbed.others=-1", "+disturbed.yardstick=0")
    assert strict.results["load.disturbed"]
    assert strict.results["load.yardstick_1"] >= 1
    assert strict.id == carry_out("force=true").id


def test_a_run_without_the_models_beside_it_that_are_asked_for_is_made_again(
    carry_out, results
):
    """Their times do not determine its id."""
    beside = "+beside.same.model._target_=hdc.HDCClassifier"
    alone = carry_out()
    both = carry_out(beside)
    assert both.id == alone.id
    assert both.results["beside.same_s"] > 0
    assert not carry_out.repeated
    assert "no beside.same_s" in carry_out.said
    for overrides in ([beside], []):
        assert carry_out(*overrides) == both
        assert carry_out.repeated


# Broken off ---------------------------------------------------------------------------------------


def test_a_training_that_breaks_off_leaves_its_curve(carry_out, results, fake):
    calls = []

    def predict(self, frames):
        calls.append(len(frames))
        if len(calls) > 5:  # one in the warm-up, two a report
            raise RuntimeError("not that way" + 20_000 * "!")
        return np.zeros(len(frames), np.int64)

    reports = [{"samples_seen": k, "loss": 2.0} for k in (1, 2)]
    fake(*reports, predict=predict)
    with pytest.raises(RuntimeError, match="not that way"):
        carry_out()
    entry = the_record(results)
    assert entry.status == "failed"
    assert entry.error.startswith("RuntimeError: not that way!")
    assert len(entry.error) <= 2000
    assert [row["training_s"] > 0 for row in entry.curve] == [True, True]
    assert Results(results).unfinished == [entry]
    # Predictions that are no classes are a failure that can be read, too.
    fake({"samples_seen": 1}, predict=lambda self, frames: np.full(len(frames), 99))
    with pytest.raises(ValueError, match="predicted: expected 10 labels from 0 to 4"):
        carry_out()
    assert len(the_record(results).curve) == 1
    assert Results(results).problems == []


def test_a_full_disk_leaves_the_records_that_there_were(count, results, full_disk):
    first, *_ = count()
    count("force=true")  # composes
    for k in range(100):
        failed = full_disk(k, lambda: count("force=true"))
        assert store.find(results, first.id).id == first.id
        if failed is None:
            break
        assert "No space left" in str(failed)
    assert 0 < k < 100
