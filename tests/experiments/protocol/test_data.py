"""Frames reach a model unchanged, whether they lie in memory, on disk, or are made when asked."""

import io
import multiprocessing
import time

import numpy as np
import pytest
import torch
from rich.console import Console

from experiments.protocol import data
from experiments.protocol.clock import Clock
from scenes.frames import Frames

QUIET = Console(quiet=True)


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


# The cache -----------------------------------------------------------------------------------


@pytest.fixture
def folder(results):
    return results / "cache"


def test_frames_that_break_off_leave_no_file(folder, monkeypatch, make_scene):
    scene, real = make_scene(), Frames.frames

    def interrupted(scene, indices):
        if max(indices) > 30:
            raise KeyboardInterrupt
        return real(scene, indices)

    with monkeypatch.context() as patch:
        patch.setattr(Frames, "frames", interrupted)
        with pytest.raises(KeyboardInterrupt):
            data.cached(scene, {}, QUIET)
    assert {f.suffix for f in folder.iterdir()} == {".lock"}
    said = io.StringIO()
    data.cached(scene, {}, Console(file=said, width=500))
    (path,) = folder.glob("*.npy")
    expected = f"kept 0 MB of frames in {folder} (cache=false keeps none)"
    assert said.getvalue().strip() == expected
    # A killed process leaves its part, which is overwritten.
    path.rename(path.with_suffix(".partial")).write_bytes(b"half")
    assert torch.equal(data.cached(scene, {}, QUIET).frames([59]), scene.images[[59]])
    assert {f.suffix for f in folder.iterdir()} == {".npy", ".lock"}


def test_frames_wanted_by_several_processes_are_made_by_one(
    folder, monkeypatch, make_scene
):
    scene, fork = make_scene(), multiprocessing.get_context("fork")
    made, real = fork.Value("i", 0), Frames.frames

    def slow(scene, indices):
        with made.get_lock():
            made.value += len(indices)
        time.sleep(0.02)
        return real(scene, indices)

    monkeypatch.setattr(Frames, "frames", slow)
    about = {"target": data.cached, "args": (scene, {}, QUIET)}
    processes = [fork.Process(**about) for _ in range(3)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(30)
    assert [process.exitcode for process in processes] == [0, 0, 0]
    assert made.value == 60


# Which pixels and which samples --------------------------------------------------------------


def test_pixels_that_are_seen_are_there(make_scene):
    """Which they are: golden numbers."""
    scene = make_scene(dtype=np.uint16)
    few, all_of_them = (data.pixel_subset(scene, n, 1) for n in (6, 35))
    assert (few.shape, len(few.frames([2])[0, 0])) == ((1, 6), 6)
    assert torch.equal(all_of_them.frames([2])[0, 0], scene.frames([2]).flatten())
    for pixels in (1, 36, 2.5, True):
        with pytest.raises(
            ValueError, match=r"^data\.pixels: expected an integer in \[2, 35\]"
        ):
            data.pixel_subset(scene, pixels, 0)


def test_frames_are_made_again_for_other_code_of_a_scene_or_of_an_own_part(
    folder, monkeypatch, make_scene
):
    """A contact of one's own, say: the fingerprint has its parameters, not its code."""
    scene, config = make_scene(), {"contact": {"_target_": "an_own_press.Press"}}

    def files(digest):
        with monkeypatch.context() as patch:
            patch.setattr(data.revision, "_of_target", lambda *_: {"a.py": digest})
            data.cached(scene, config, QUIET)
        return len(list(folder.glob("*.npy")))

    assert [files(digest) for digest in "aab"] == [1, 1, 2]
