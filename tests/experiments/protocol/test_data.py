"""Frames reach a model unchanged, whether they lie in memory, on disk, or are made when asked."""

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


def test_frames_that_break_off_leave_no_file(tmp_path, monkeypatch, make_scene):
    scene, real = make_scene(), Frames.frames

    def interrupted(scene, indices):
        if max(indices) > 30:
            raise KeyboardInterrupt
        return real(scene, indices)

    with monkeypatch.context() as patch:
        patch.setattr(Frames, "frames", interrupted)
        with pytest.raises(KeyboardInterrupt):
            data.cached(scene, tmp_path, QUIET)
    assert {f.suffix for f in tmp_path.iterdir()} == {".lock"}
    data.cached(scene, tmp_path, QUIET)
    (path,) = tmp_path.glob("*.npy")
    # A killed process leaves its part, which is overwritten.
    path.rename(path.with_suffix(".partial")).write_bytes(b"half")
    assert torch.equal(
        data.cached(scene, tmp_path, QUIET).frames([59]), scene.images[[59]]
    )
    assert {f.suffix for f in tmp_path.iterdir()} == {".npy", ".lock"}


def test_frames_wanted_by_several_processes_are_made_by_one(
    tmp_path, monkeypatch, make_scene
):
    scene, fork = make_scene(), multiprocessing.get_context("fork")
    made, real = fork.Value("i", 0), Frames.frames

    def slow(scene, indices):
        with made.get_lock():
            made.value += len(indices)
        time.sleep(0.02)
        return real(scene, indices)

    monkeypatch.setattr(Frames, "frames", slow)
    about = {"target": data.cached, "args": (scene, tmp_path, QUIET)}
    processes = [fork.Process(**about) for _ in range(3)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(30)
    assert [process.exitcode for process in processes] == [0, 0, 0]
    assert made.value == 60


# Which pixels and which samples --------------------------------------------------------------


def test_pixels_that_are_seen_have_a_name_of_their_own_and_are_there(make_scene):
    """Which they are: golden numbers."""
    scene = make_scene(dtype=np.uint16)
    subsets = [
        data.PixelSubset(scene, *of) for of in ((6, 1), (20, 1), (35, 1), (6, 2))
    ]
    names = {scene.fingerprint(), *(subset.fingerprint() for subset in subsets)}
    assert len(names) == 5
    assert torch.equal(subsets[2].frames([2])[0, 0], scene.frames([2]).flatten())
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
