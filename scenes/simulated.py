"""The simulated sensor as a source of frames that is pressed.

The sensor is that of the scenes ``touch`` and ``drift``; so that a page keeps up on two cores, its
camera has 250 × 250 pixels and a pupil of half the width (a fourth of the paths): the speckle
grains keep their size in pixels.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from scenes.sensor.camera import Camera
from scenes.sensor.contact import ExactPress, Press, Touch
from scenes.sensor.environment import Room
from scenes.sensor.seeds import stream
from scenes.sensor.sensor import Sensor

# Numbers of configs/scene/touch.yaml.
RADIUS = 2.45e-3
DEPTH_SPREAD = 0.01
POSITION_SPREAD = 0.02e-3
SIXTEEN_DAYS = 0.55  # K, of configs/scene/drift.yaml


class SimulatedSensor:
    """A source of frames (:class:`hdc.live.Source`) that is pressed.

    Each sample is a new touch at the present place. It has a temperature drawn from that of the
    room, and misses place and depth as the robot of the scene ``touch`` does; the seed and the
    number of the touch determine both.

    Args:
        side: pixels a side of the frame.
        seed: of the sensor and of what is drawn.

    Attributes:
        length, width: of the surface in m: x in [0, length], ``|y|`` ≤ width/2.
        offset: temperature drift in K.
        touch: the present one, or None.
    """

    def __init__(self, side: int = 250, seed: int = 0) -> None:
        whole = Camera()
        share = side / whole.crop
        grid, pupil = round(whole.grid * share), round(whole.pupil * share)
        camera = Camera(grid=grid, crop=side, pupil=pupil)
        self._sensor = Sensor(seed, camera=camera)
        self.title = "Simulated sensor, not measured"
        self.shape: tuple[int, ...] = (side, side)
        self.metadata: dict[str, object] = {
            "crop": None,
            "subsample": 1,
            "simulated": True,
        }
        paths = self._sensor.paths
        self.length, self.width = paths.length, paths.width
        self.offset = 0.0
        press = Press(position=(0.0, 0.0), radius=RADIUS, depth=0.0)
        self._press = ExactPress(press, self._sensor)
        self._room = Room()
        self._seed, self._touched, self._frames = seed, 0, 0
        self.press(None)

    def press(self, touch: Touch | None) -> None:
        """Press here until the next call, or lift off."""
        self.touch = touch
        self._pressed, self._temperature, _ = self._draw(touch)

    def frame(self) -> np.ndarray:
        self._frames += 1
        noise = stream(self._seed, "live noise", self._frames)
        return self._exposed(self._pressed, self._temperature, noise)

    def samples(self, n: int) -> list[np.ndarray]:
        return self.touched(n, self.touch)

    def touched(self, n: int, touch: Touch | None) -> list[np.ndarray]:
        """Frames of n new touches at this place."""
        return [self._exposed(*self._draw(touch)) for _ in range(n)]

    def _draw(self, touch: Touch | None) -> tuple[Tensor, float, np.random.Generator]:
        """The change of phase float64 [P] in rad by a touch that misses its place, the temperature
        in K, and the generator for the noise."""
        rng = stream(self._seed, "live touch", self._touched)
        self._touched += 1
        temperature = float(self._room.temperatures(1, rng)[0])
        if touch is None:
            return torch.zeros_like(self._sensor.phase), temperature, rng
        across, along, deeper = rng.standard_normal(3)
        missed = Touch(
            touch.depth * max(0.0, 1 + DEPTH_SPREAD * deeper),
            touch.x + POSITION_SPREAD * across,
            touch.y + POSITION_SPREAD * along,
        )
        return self._press(missed), temperature, rng

    def _exposed(
        self, indented: Tensor, temperature: float, noise: np.random.Generator
    ) -> np.ndarray:
        sensor, camera = self._sensor, self._sensor.mounted
        warmed = sensor.sensitivity * (self.offset + temperature)
        phases = sensor.phase + warmed + indented
        intensity = camera.intensity(phases[None])
        return camera.expose(intensity, [noise])[0].numpy()
