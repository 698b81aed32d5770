"""An experiment is a task: what its generator gets, what its record holds, what it refuses."""

import io
import itertools
import sys
import types

import numpy as np
import pytest
import torch
from omegaconf import OmegaConf
from rich.console import Console

from experiments.protocol import data
from experiments.protocol.experiment import Run, experiment
from experiments.records import configs, store
from scenes.frames import Frames

SENSOR = {"_target_": "scenes.sensor.scene.SpeckleScene", "seed": 1, "display": "x"}
RUNS = []  # of calls of the generators below


@pytest.fixture(autouse=True)
def no_runs():
    RUNS.clear()


@experiment
def counting(run: Run, scene: dict, most: int = 2, model: dict | None = None):
    """Numbers up to one."""
    RUNS.append((run, scene, most, model))
    for k in range(most):
        yield {"k": k}


@experiment
def alone(run: Run):
    RUNS.append(run)
    yield {"k": 0}


def console():
    """One that keeps what is printed."""
    return Console(record=True, width=300, file=io.StringIO())


def test_what_is_said_of_an_experiment_is_that_of_its_task():
    for task in (counting, alone):
        assert (task.revision, task.timed, task.own_memory) == (1, False, False)
        assert list(task.components()) == []
    assert (counting.__name__, counting.__doc__) == ("counting", "Numbers up to one.")
    assert list(counting.rows(None, {}, most=1)) == [{"k": 0}]

    @experiment(revision=3, uses=("hdc.bank",), timed=True, own_memory=True)
    def other(run):
        yield {"k": 1}

    assert (other.revision, other.timed, other.own_memory) == (3, True, True)
    assert list(other.components(scene={}, any=1)) == ["hdc.bank"]
    assert list(other.rows(None)) == [{"k": 1}]


def test_arguments_and_what_is_computed_on_reach_rows_and_record(results, monkeypatch):
    sensor = {key: SENSOR[key] for key in ("_target_", "seed")}
    file = {"scene": {**sensor, "seed": 0}, "most": 2, "other": 5}
    monkeypatch.setattr(configs, "task", {"numbers": file}.get)
    record = counting(
        name="numbers",
        scene_name="touch",
        device="meta",
        cache=False,
        force=True,
        scene=SENSOR,
        model={"a": [{"display": {"name": "y"}, "b": 1}]},
    )
    # Displays are for tables: no row depends on them.
    arguments = {"scene": sensor, "most": 2, "model": {"a": [{"b": 1}]}}
    ((run, *given),) = RUNS
    assert given == list(arguments.values())
    assert (run.name, run.device, run.cache, run.force) == (
        "numbers",
        "meta",
        False,
        True,
    )
    assert run.config == {"_target_": f"{__name__}.counting", **arguments}
    assert record.rows.dicts() == [{"k": 0}, {"k": 1}]
    assert (record.name, record.scene, record.data) == ("numbers", "touch", "")
    assert record.task == f"{__name__}.counting"
    assert record.config == arguments
    assert record.environment.device == "meta"
    assert record.changed == {
        "scene.seed": "1",
        "model": '{"a": [{"b": 1}]}',
    }


def test_without_a_file_an_experiment_is_named_after_its_rows_and_nothing_changed(
    results,
):
    record = alone(scene_name="touch")
    assert (record.name, record.scene, record.config) == ("alone", "", {})
    assert (record.changed, record.environment.device) == ({}, "cpu")
    alone()
    (run,) = RUNS  # found finished
    assert (run.name, run.device, run.cache, run.force) == ("alone", "cpu", True, False)
    alone(force=True)
    assert len(RUNS) == 2


@pytest.mark.parametrize(
    ("task", "arguments", "message"),
    [
        (counting, {}, "task: expected the keys scene, most, model, found .*'scene'"),
        (counting, {"scene": {}, "mots": 3}, "keys scene, most, model, found .*'mots'"),
        (alone, {"seeds": 3}, "task: expected no keys, found .*'seeds'"),
        (
            counting,
            {"scene": {}, "model": {"_target_": "scenes.recorded.open_recording"}},
            "^model: .*'path'",
        ),
    ],
)
def test_arguments_that_the_rows_do_not_have_or_lack_are_named(
    task, arguments, message
):
    with pytest.raises(ValueError, match=message):
        task(**arguments)
    assert RUNS == []


def test_frames_that_no_config_determines_are_known_by_their_content(
    results, recording
):
    """Of every scene among the arguments; another recording at the same place is another one."""

    def digest(path):
        scene = {"_target_": "scenes.recorded.open_recording", "path": str(path)}
        both = counting(scene=scene, model=scene).data
        one = counting(scene=scene, model=SENSOR).data
        assert RUNS[-1][0].data == one  # names of parts depend on it
        other = {"_target_": "hdc.HDCClassifier"}
        assert counting(scene=scene, model=other).data == one
        assert both == f"{one} {one}"
        return one

    first = digest(recording())
    assert first
    assert digest(recording(30, 3)) not in (first, "")
    assert len(list(store.read(results))) == 6
    # A computed scene is determined by its config, and so is what is no scene.
    for scene in (SENSOR, {"path": "x"}, "touch", None):
        assert counting(scene=scene).data == ""


def test_a_scene_of_an_own_class_is_known_by_its_content(results, monkeypatch):
    class Own:
        content = "first"

        def fingerprint(self):
            return self.content

    laboratory = types.ModuleType("laboratory")
    laboratory.Own, Own.__module__ = Own, "laboratory"
    monkeypatch.setitem(sys.modules, "laboratory", laboratory)
    for Own.content in ("first", "second"):
        record = counting(scene={"_target_": "laboratory.Own"})
        assert record.data == Own.content
    assert len(RUNS) == 2


def test_a_part_is_kept_under_name_config_key_and_data_unless_forced(results):
    calls = itertools.count()
    target = {"_target_": f"{__name__}.counting"}

    def part(key, config=target, **keywords):
        run = Run(config=config, console=console(), **keywords)
        rows = list(run.part(key, lambda: [{"call": next(calls)}]))
        return rows[0]["call"], run.console.export_text()

    said = "experiment: seed 1, kind a\n"
    assert part({"seed": 1, "kind": "a"}) == (0, said)
    assert part({"seed": 1, "kind": "a"}) == (0, said)
    assert part({"seed": 2, "kind": "a"})[0] == 1
    assert part({"seed": 1, "kind": "a"}, name="x") == (
        2,
        said.replace("experiment", "x"),
    )
    assert part({"seed": 1, "kind": "a"}, data="f")[0] == 3
    assert part({"seed": 1, "kind": "a"}, config={**target, "most": 1})[0] == 4
    assert part({"seed": 1, "kind": "a"}, force=True) == (5, said)
    assert part({"seed": 1, "kind": "a"}) == (0, said)
    kept = store.read(results / "cache" / "parts")
    assert sorted(one.name for one in kept) == ["experiment"] * 4 + ["x"]


def test_times_of_another_number_of_threads_are_made_again(results, monkeypatch):
    calls = itertools.count()

    @experiment(timed=True)
    def timing(run):
        yield {"call": next(calls)}

    found = []
    for threads in (2, 2, 1, 1, 2):
        monkeypatch.setattr(torch, "get_num_threads", lambda threads=threads: threads)
        found.append(timing().rows.values)
    assert found == [[[0]], [[0]], [[1]], [[1]], [[2]]]


def test_scenes_come_at_their_seeds_and_are_kept_on_disk_where_asked_for(
    results, monkeypatch
):
    def made(config, what):
        assert what == "scene"
        seeds = [config["seed"], config["sensor"]["sampling_seed"], config["n"]]
        images = torch.tensor(seeds, dtype=torch.uint8).reshape(3, 1, 1)
        return Frames(images, np.arange(3), tuple("abc"), {}, origin="simulated")

    monkeypatch.setattr(data, "instantiate", made)
    config = {"seed": 0, "sensor": {"sampling_seed": 0}, "n": 7}
    for cache in (False, True):
        run = Run(cache=cache, console=console())
        found = dict(
            run.scenes(OmegaConf.to_container(OmegaConf.create(config)), [4, 2])
        )
        for seed in (4, 2):
            frames = found[seed].frames(np.arange(3))
            assert frames.flatten().tolist() == [seed, seed, 7]
        assert len(list(results.glob("cache/*.npy"))) == 2 * cache
        assert isinstance(found[4], data.CachedScene) == cache
