"""The scenes as a user composes them, and the promise that a sample is always the same."""

import numpy as np
import pytest
import torch

from scenes.composed import scene_of
from scenes.frames import Scene

TINY = ("sensor.camera.grid=64", "sensor.camera.crop=60", "sensor.camera.pupil=24")
ALL = ("touch", "finger", "spatial", "drift", "tactile")


def scene(name, sensor, samples, overrides=()):
    changed = (f"++scene.{override}" for override in overrides)
    return scene_of(
        [f"scene={name}", f"seed.sensor={sensor}", f"seed.samples={samples}", *changed]
    )


def tiny(name, *overrides, sensor=3, samples=5):
    return scene(name, sensor, samples, (*TINY, *overrides))


@pytest.mark.parametrize("name", ALL)
def test_scene_is_a_scene(name):
    made = tiny(name)
    assert isinstance(made, Scene)
    assert made.origin == "simulated"
    assert len(made) == len(made.labels)
    per_session = made.labels[made.samples["session"] == 0]
    assert len(set(np.bincount(per_session))) == 1
    assert all(len(values) == len(made) for values in made.samples.values())
    frames = made.frames([0, 1])
    assert frames.dtype == torch.uint8
    assert tuple(frames.shape) == (2, *made.shape)
    assert 35 < frames.double().mean() < 65


@pytest.mark.parametrize("name", ALL)
def test_a_sample_is_the_same_however_it_is_asked_for(name):
    indices = [4, 0, 17, 3, 9, 4]
    whole = tiny(name).frames(indices)
    assert (whole[0] == whole[5]).all()
    again = tiny(name)
    for at, index in reversed(list(enumerate(indices))):
        assert (again.frames([index])[0] == whole[at]).all()
    with pytest.raises(IndexError, match=rf"expected values in \[0, {len(again)}\)"):
        again.frames([len(again)])


def test_full_size_frames_do_not_depend_on_threads_or_batch():
    before = torch.get_num_threads()
    try:
        for name in ("touch", "tactile"):
            torch.set_num_threads(1)
            made = scene(name, 1, 1)
            one = made.frames([0, 1])
            assert tuple(one.shape) == (2, 500, 500)
            torch.set_num_threads(2)
            assert (made.frames([1, 0]) == one[[1, 0]]).all()
    finally:
        torch.set_num_threads(before)


def test_first_session_of_drift_is_touch():
    touch, drift = tiny("touch"), tiny("drift")
    assert (touch.labels == drift.labels[:500]).all()
    assert (touch.frames(range(6)) == drift.frames(range(6))).all()
    temperature, session = drift.samples["temperature"], drift.samples["session"]
    assert temperature[session == 1].mean() - temperature[session == 0].mean() > 0.3
    assert (drift.samples["order"][500:] == np.arange(500)).all()


def test_fingerprint_knows_every_setting_and_makes_no_frame():
    made = tiny("touch")
    changed = [
        tiny("touch", "contact.depth=1.7e-3"),
        tiny("touch", "sessions.0.offset=0.1"),
        tiny("touch", sensor=4),
        tiny("touch", samples=6),
        tiny("tactile", "classes.P40.offset=0"),
    ]
    prints = {scene.fingerprint() for scene in [made, tiny("touch"), *changed]}
    assert len(prints) == len(changed) + 1
    assert "path_set" not in vars(made.sensor)


@pytest.mark.parametrize(
    ("name", "override", "message"),
    [
        ("touch", "contact.depth=6e-3", r"scene.contact.depth: .*layer's thickness.*found 0\.006"),
        ("touch", "classes.L1.position=[0.2, 0.0]", "scene.classes.L1.position: .*surface"),
        ("touch", "contact=null", "scene.contact: expected one for class 'L1', found None"),
        ("tactile", "contact.radius=11e-3", r"scene.contact.radius: .*0\.01024 m.*found 0\.011"),
    ],
)  # fmt: skip
def test_bad_values_are_named_before_any_frame(name, override, message):
    with pytest.raises(Exception, match=message):
        tiny(name, override)
