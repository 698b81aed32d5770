import numpy as np
import pytest

from scenes.sensor.environment import Room, Thermal
from scenes.sensor.seeds import stream


def test_slow_part_is_uniform_and_bounded():
    t = Room(fast=0).temperatures(200_000, stream(0, "room"))
    assert np.abs(t).max() <= 0.18
    assert t.std() == pytest.approx(0.18 / np.sqrt(3), rel=0.05)
    assert t.mean() == pytest.approx(0, abs=0.01)


def test_fast_part_is_ornstein_uhlenbeck():
    t = Room(slow=0, fast=0.03, fast_time=3).temperatures(400_000, stream(1, "room"))
    lags = np.array([1, 3, 9])
    correlation = [np.mean(t[:-n] * t[n:]) / np.mean(t * t) for n in lags]
    assert correlation == pytest.approx(np.exp(-lags / 3), abs=0.01)
    assert t.std() == pytest.approx(0.03, rel=0.01)


def test_sensitivity_is_lognormal_in_the_bulk_and_bounded():
    s = Thermal().draw(200_000, stream(0, "thermal"))
    assert np.abs(s).max() <= 1000
    assert abs(np.mean(s > 0) - 0.5) < 0.005
    assert np.median(np.abs(s)) == pytest.approx(68, rel=0.05)
    tail = np.abs(s)[np.abs(s) > 999]
    assert len(np.unique(tail)) == len(tail)  # no common value that would stay coherent
