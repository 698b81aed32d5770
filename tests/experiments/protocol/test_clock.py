"""What counts as training: the time inside the model, without that of acquiring frames."""

import types

import numpy as np
import pytest
import torch

from experiments.protocol import clock as clock_module
from experiments.protocol.clock import Clock
from experiments.protocol.data import LazyFrames


@pytest.fixture
def now(monkeypatch):
    """A time that passes only when told to: ``now.t += seconds``."""
    now = types.SimpleNamespace(t=100.0)
    monkeypatch.setattr(clock_module.time, "perf_counter", lambda: now.t)
    return now


class SlowScene:
    """Acquiring a frame takes 10 s."""

    def __init__(self, now):
        self.now, self.shape = now, (2, 3)

    def frames(self, indices):
        self.now.t += 10 * len(indices)
        return (
            torch.from_numpy(np.asarray(indices))
            .to(torch.uint8)[:, None, None]
            .expand(-1, 2, 3)
        )


def test_the_clock_is_held_while_lazy_frames_are_acquired(now):
    clock = Clock()
    frames = LazyFrames(SlowScene(now), np.arange(8), clock)
    with clock.running():
        now.t += 1
        assert frames[2:5][:, 0, 0].tolist() == [2, 3, 4]
        now.t += 2
        frames[torch.tensor([7, 0])]
        now.t += 4
    assert clock.seconds == 7
    assert now.t == 157


def test_an_error_while_acquiring_or_training_stops_the_clock(now):
    clock = Clock()

    def fail():
        with clock.running():
            now.t += 1
            with clock.held():
                now.t += 10
                raise OSError("camera unplugged")

    with pytest.raises(OSError, match="unplugged"):
        fail()
    now.t += 100
    with clock.running():
        now.t += 1
    assert clock.seconds == 2
