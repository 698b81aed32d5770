"""A small sensor: the same physics with a hundred times fewer paths and pixels."""

import pytest

from scenes.sensor.camera import Camera
from scenes.sensor.sensor import Sensor

SMALL = Camera(grid=64, crop=60, pupil=24)


@pytest.fixture
def small():
    return Sensor(seed=7, camera=SMALL)
