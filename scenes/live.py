"""The simulated sensor as a page to touch: ``python -m scenes.live``.

Press the silicone with mouse or finger, teach three touches, let 16 days pass, recalibrate. See
:mod:`scenes.pressed` for the page. The sensor is that of the scenes ``touch`` and ``drift``; so
that the page keeps up on two cores, its camera has 250 × 250 pixels and a pupil of half the width
(a fourth of the paths): the speckle grains keep their size in pixels.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from scenes.pressed import Touch
from scenes.sensor.camera import Camera
from scenes.sensor.contact import ExactPress, Press
from scenes.sensor.contact import Touch as Contact
from scenes.sensor.environment import Room
from scenes.sensor.seeds import stream
from scenes.sensor.sensor import Sensor

# Numbers of configs/scene/touch.yaml.
RADIUS = 2.45e-3
DEPTH_SPREAD = 0.01
POSITION_SPREAD = 0.02e-3
SIXTEEN_DAYS = 0.55  # K, of configs/scene/drift.yaml


class SimulatedSensor:
    """A :class:`scenes.pressed.Pressable` of the simulated sensor.

    Each touch has a temperature drawn from that of the room, and misses place and depth as the
    robot of the scene ``touch`` does; the seed and the number of the touch determine both.
    Displacements of several touches add up, as in any linear elastic layer.

    Args:
        side: pixels a side of the frame.
        seed: of the sensor and of what is drawn.
    """

    label = None
    deepest, sixteen_days = 2e-3, SIXTEEN_DAYS

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
        self.touches: tuple[Touch, ...] = ()
        self._temperature = 0.0  # of the present touches, in K
        self._indented = self._indentation(())

    def press(self, touches: Sequence[Touch]) -> None:
        self.touches = tuple(touches)
        missed, self._temperature, _ = self._draw(touches)
        self._indented = self._indentation(missed)

    def frame(self) -> np.ndarray:
        self._frames += 1
        noise = stream(self._seed, "live noise", self._frames)
        return self._exposed(self._indented, self._temperature, noise)

    def samples(self, n: int) -> list[np.ndarray]:
        return self.touched(n, self.touches)

    def touched(self, n: int, touches: Sequence[Touch]) -> list[np.ndarray]:
        frames = []
        for _ in range(n):
            missed, temperature, rng = self._draw(touches)
            indented = self._indentation(missed)
            frames.append(self._exposed(indented, temperature, rng))
        return frames

    def _draw(
        self, touches: Sequence[Touch]
    ) -> tuple[list[Touch], float, np.random.Generator]:
        """Touches that miss their places, the temperature in K, and the generator for the noise."""
        rng = stream(self._seed, "live touch", self._touched)
        self._touched += 1
        temperature = float(self._room.temperatures(1, rng)[0])
        missed = []
        for touch in touches:
            across, along, deeper = rng.standard_normal(3)
            x = touch.x + POSITION_SPREAD * across
            y = touch.y + POSITION_SPREAD * along
            depth = touch.depth * max(0.0, 1 + DEPTH_SPREAD * deeper)
            missed.append(Touch(x, y, depth))
        return missed, temperature, rng

    def _indentation(self, touches: Sequence[Touch]) -> Tensor:
        """Change of phase float64 [P] in rad."""
        changes = [torch.zeros_like(self._sensor.phase)]
        for touch in touches:
            contact = Contact(touch.depth, touch.x, touch.y)
            changes.append(self._press(contact))
        return torch.stack(changes).sum(0)

    def _exposed(
        self, indented: Tensor, temperature: float, noise: np.random.Generator
    ) -> np.ndarray:
        sensor, camera = self._sensor, self._sensor.mounted
        warmed = sensor.sensitivity * (self.offset + temperature)
        phases = sensor.phase + warmed + indented
        intensity = camera.intensity(phases[None])
        return camera.expose(intensity, [noise])[0].numpy()


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m scenes.live", description=__doc__)
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        help="which sensor (default: 0)",
    )
    parser.add_argument(
        "--port",
        type=int,
        default=8080,
        help="default: 8080",
    )
    parser.add_argument(
        "--host", help="address to listen at (default: this computer alone)"
    )
    given = parser.parse_args(arguments)
    torch.set_num_threads(1)  # the other core is the page's
    sensor = SimulatedSensor(seed=given.seed)
    from hdc.live.page import serve
    from scenes.pressed import PressedPage, PressedSession

    try:
        serve(PressedSession(sensor), given.host, given.port, PressedPage)
    except OSError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
