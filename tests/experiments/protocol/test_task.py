"""A task is a struct of checked fields; what it computes with gives it scenes and keeps parts."""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
import torch

from experiments.protocol import data
from experiments.protocol.task import Context, Task, named
from experiments.records import store
from experiments.records.environment import Environment
from experiments.records.record import Record
from scenes.frames import Frames

SENSOR = {"_target_": "scenes.sensor.scene.SpeckleScene", "seed": 1}


class Counting(Task, frozen=True):
    """Of no rows."""

    scene: Mapping[str, Any] | None = None
    most: int = 2
    models: Mapping[str, Any] | None = None


def test_frames_that_no_config_determines_are_known_by_their_content(recording):
    """Of every scene among the fields, a user's own class too."""

    scene_of = "scenes.recorded.open_recording"

    def digest(path):
        scene = {"_target_": scene_of, "path": str(path)}
        both = Counting(scene=scene, models=scene).fingerprint()
        one = Counting(scene=scene, models={"_target_": "hdc.HDCClassifier"})
        assert both == f"{one.fingerprint()} {one.fingerprint()}"
        return one.fingerprint()

    first = digest(recording())
    assert first
    assert digest(recording(30, 3)) not in (first, "")
    # A computed scene is determined by its config, and so is what is no scene.
    for scene in (SENSOR, {"path": "x"}, None):
        assert Counting(scene=scene).fingerprint() == ""
    with pytest.raises(ValueError, match=r"^scene: .*'path'"):
        Counting(scene={"_target_": scene_of}).fingerprint()
    own = Counting(scene={"_target_": f"{__name__}.Own"})
    for Own.content in ("first", "second"):
        assert own.fingerprint() == Own.content


class Own:
    content = "first"

    def fingerprint(self):
        return self.content


def test_what_is_no_task_is_named():
    assert named({"_target_": f"{__name__}.Counting"}) is Counting
    for target in ("hdc.HDCClassifier", "math.pi"):
        expected = rf"^task\._target_: .* a Task, found {target}, which is none$"
        with pytest.raises(ValueError, match=expected):
            named({"_target_": target})


def test_a_part_is_kept_under_name_config_key_and_data_unless_forced(results):
    machine, calls = Environment(cpu="A", threads=1), itertools.count()

    def part(key, name="numbers", force=False, **about):
        about = {"config": {}, "data": "", "revisions": {"experiments": 1}} | about
        record = Record(schema=6, id="", environment=machine, **about)
        context = Context(name, force=force, about=record)
        (row,) = context.part(key, lambda: [{"call": next(calls)}])
        return row["call"]

    key = {"seed": 1, "kind": "a"}
    assert part(key) == part(key) == 0
    assert part({"seed": 2, "kind": "a"}) == 1
    others = ({"name": "x"}, {"data": "f"}, {"config": {"most": 1}}, {"force": True})
    assert [part(key, **other) for other in others] == [2, 3, 4, 5]
    assert part(key) == 0
    path = results / "cache" / "parts" / store.FILE
    path.write_bytes(path.read_bytes().splitlines(keepends=True)[0][:-20])
    assert part(key) == part(key) == 6  # what was damaged is made again
    assert part(key, revisions={"experiments": 2}) == 7


def test_scenes_come_at_their_seeds_and_are_kept_on_disk_where_asked_for(
    results, monkeypatch
):
    def made(config, what):
        seeds = [config["seed"], config["sensor"]["sampling_seed"], config["n"]]
        images = torch.tensor(seeds, dtype=torch.uint8).reshape(3, 1, 1)
        return Frames(images, np.arange(3), tuple("abc"), {}, origin="simulated")

    monkeypatch.setattr(data, "instantiate", made)
    config = {"seed": 0, "sensor": {"sampling_seed": 0}, "n": 7}
    for cache in (False, True):
        found = dict(Context(cache=cache).scenes(config, [4, 2]))
        for seed in (4, 2):
            frames = found[seed].frames(np.arange(3))
            assert frames.flatten().tolist() == [seed, seed, 7]
        assert len(list(results.glob("cache/*.npy"))) == 2 * cache
        assert isinstance(found[4], data.DerivedScene) == cache
