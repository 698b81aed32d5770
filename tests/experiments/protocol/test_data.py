"""Frames reach a model unchanged, whether they lie in memory, on disk, or are made when asked."""

import multiprocessing
import time
from typing import ClassVar

import numpy as np
import pytest
import torch
from rich.console import Console

from experiments.protocol import data
from experiments.protocol.clock import Clock
from scenes.frames import Frames

QUIET = Console(quiet=True)


class Interrupted(Frames):
    """Frames whose making breaks off half-way."""

    def frames(self, indices):
        if max(indices) > 30:
            raise KeyboardInterrupt
        return super().frames(indices)


# Lazy frames ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "index", [slice(8, 200), [4, 0, 4], torch.tensor([5, 3]), -1], ids=repr
)
def test_lazy_frames_index_as_a_tensor_does(index, make_scene):
    scene = make_scene(dtype=np.uint16)
    chosen = np.random.default_rng(1).permutation(60)[:12]
    lazy = data.LazyFrames(scene, chosen, Clock())
    whole = scene.frames(chosen)
    assert lazy.shape == tuple(whole.shape)
    assert len(lazy) == 12
    expected = whole.numpy()[
        index.numpy() if isinstance(index, torch.Tensor) else index
    ]
    assert lazy[index].dtype == whole.dtype
    np.testing.assert_array_equal(lazy[index].numpy(), expected)


def test_take_reads_lazily_above_the_limit_and_gives_the_same(monkeypatch, make_scene):
    scene = make_scene(dtype=np.uint16)
    indices = np.arange(40)[::-1].copy()
    in_memory = data.take(scene, indices, Clock())
    assert isinstance(in_memory, torch.Tensor)
    monkeypatch.setattr(data, "IN_MEMORY_BYTES", in_memory.nbytes)
    assert isinstance(data.take(scene, indices, Clock()), torch.Tensor)
    monkeypatch.setattr(data, "IN_MEMORY_BYTES", in_memory.nbytes - 1)
    lazy = data.take(scene, indices, Clock())
    assert isinstance(lazy, data.LazyFrames)
    assert torch.equal(lazy[:], in_memory)
    labels = scene.labels[indices]
    assert data.digest(lazy, labels) == data.digest(in_memory, labels)


# The cache -----------------------------------------------------------------------------------


def test_frames_that_break_off_leave_no_file(tmp_path, monkeypatch, make_scene):
    scene = make_scene()
    broken = Interrupted(
        scene.images, scene.labels, scene.classes, scene.samples, scene.origin
    )
    monkeypatch.setattr(Interrupted, "fingerprint", lambda self: scene.fingerprint())
    with pytest.raises(KeyboardInterrupt):
        data.cached(broken, tmp_path, QUIET)
    assert {f.suffix for f in tmp_path.iterdir()} == {".lock"}
    data.cached(scene, tmp_path, QUIET)
    (path,) = tmp_path.glob("*.npy")
    # A killed process leaves its part, which is overwritten.
    path.rename(path.with_suffix(".partial")).write_bytes(b"half")
    assert torch.equal(
        data.cached(scene, tmp_path, QUIET).frames([59]), scene.images[[59]]
    )
    assert {f.suffix for f in tmp_path.iterdir()} == {".npy", ".lock"}


class Counted(Frames):
    """Frames that take a while; each request leaves a mark."""

    made: ClassVar = multiprocessing.get_context("fork").Value("i", 0)

    def frames(self, indices):
        with self.made.get_lock():
            self.made.value += len(indices)
        time.sleep(0.02)
        return super().frames(indices)


def test_frames_wanted_by_several_processes_are_made_by_one(tmp_path, make_scene):
    scene = Counted(*vars(make_scene()).values())
    scene.made.value = 0
    fork = multiprocessing.get_context("fork")
    processes = [
        fork.Process(target=data.cached, args=(scene, tmp_path, QUIET))
        for _ in range(3)
    ]
    for process in processes:
        process.start()
    for process in processes:
        process.join(30)
    assert ([process.exitcode for process in processes], scene.made.value) == (
        [0, 0, 0],
        60,
    )


@pytest.mark.parametrize("damage", ["truncated", "other"])
def test_a_damaged_cache_file_is_named(tmp_path, damage, make_scene):
    scene = make_scene()
    data.cached(scene, tmp_path, QUIET)
    (path,) = tmp_path.glob("*.npy")
    if damage == "other":
        np.save(path, np.zeros((60, 5, 8), np.uint8))
    else:
        path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(ValueError, match="expected 60 frames") as caught:
        data.cached(scene, tmp_path, QUIET)
    assert str(path) in str(caught.value)


# Which pixels and which samples --------------------------------------------------------------


def test_fewer_pixels_are_some_of_more(make_scene):
    scene = make_scene(dtype=np.uint16)
    few, more = data.PixelSubset(scene, 6, 1), data.PixelSubset(scene, 20, 1)
    assert few.shape == (1, 6)
    assert few.frames([0, 5]).shape == (2, 1, 6)
    assert set(few._chosen) < set(more._chosen)
    every = data.PixelSubset(scene, 35, 1)
    assert torch.equal(every.frames([2])[0, 0], scene.frames([2]).flatten())
    names = {
        s.fingerprint()
        for s in (scene, few, more, every, data.PixelSubset(scene, 6, 2))
    }
    assert len(names) == 5
    for pixels in (1, 36, 2.5, True):
        with pytest.raises(
            ValueError, match=r"^data\.pixels: expected an integer in \[2, 35\]"
        ):
            data.PixelSubset(scene, pixels, 0)


def test_frames_are_made_again_for_other_code_of_a_scene_or_of_an_own_part(
    tmp_path, monkeypatch, make_scene
):
    """A contact of one's own, say: the fingerprint has its parameters, not its code."""
    scene, config = make_scene(), {"contact": {"_target_": "an_own_press.Press"}}

    def files(digest, revision):
        code = {"a.py": digest}
        with monkeypatch.context() as patch:
            patch.setattr(data.revision, "_of_target", lambda *_: code)
            patch.setattr(Frames, "revision", revision, raising=False)
            data.cached(scene, tmp_path, QUIET, config)
        return len(list(tmp_path.glob("*.npy")))

    states = (("a", 1), ("a", 1), ("b", 1), ("b", 99))
    assert [files(*state) for state in states] == [1, 1, 2, 3]
