"""The simulated sensor as a page to touch: ``python -m scenes.live``.

Press the silicone with mouse or finger, teach three touches, let 16 days pass, recalibrate. See
:mod:`hdc.live` for the page. The sensor is that of the scenes ``touch`` and ``drift``; so that the
page keeps up on two cores, its camera has 250 × 250 pixels and a pupil of half the width (a fourth
of the paths) unless ``--full`` is given: the speckle grains keep their size in pixels.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from hdc.live import Touch
from scenes.sensor.camera import Camera
from scenes.sensor.contact import ExactPress, Press
from scenes.sensor.contact import Touch as Contact
from scenes.sensor.environment import Room
from scenes.sensor.seeds import stream
from scenes.sensor.sensor import Sensor

RADIUS, DEPTH_SPREAD, POSITION_SPREAD = 2.45e-3, 0.01, 0.02e-3  # of configs/scene/touch.yaml
SIXTEEN_DAYS = 0.55  # K, of configs/scene/drift.yaml


class SimulatedSensor:
    """A :class:`hdc.live.Pressable` of the simulated sensor.

    Each touch comes at another time of the day: its temperature is drawn from the room's
    distribution (:class:`scenes.sensor.environment.Room`), and it misses place and depth as the
    robot of the scene ``touch`` does. Of several touches at once the displacements add up, as in
    any linear elastic layer. What the k-th press and the k-th fresh touch draw is determined by the
    seed and k.

    Args:
        side: pixels a side of the frame: 250, or 500 as in the scenes.
        seed: of the sensor and of what is drawn.
    """

    label = None
    deepest, sixteen_days, most = 2e-3, SIXTEEN_DAYS, 1.2

    def __init__(self, side: int = 250, seed: int = 0) -> None:
        whole = Camera()
        share = side / whole.crop
        camera = Camera(grid=round(whole.grid * share), crop=side, pupil=round(whole.pupil * share))
        self._sensor = Sensor(seed, camera=camera)
        self.title = "Simulated sensor"
        self.note = (
            f"Simulated, not measured: a camera of {side} × {side} pixels looks into soft "
            f"silicone. Each touch misses its place by some {POSITION_SPREAD * 1e3:g} mm, as a "
            "robot does, and the temperature of the room varies from touch to touch."
        )
        self.shape = (side, side)
        self.metadata: dict[str, object] = {"crop": None, "subsample": 1, "simulated": True}
        paths = self._sensor.paths
        self.length, self.width = paths.length, paths.width
        self.fibre, self.camera = paths.fibre, paths.camera
        self.offset = 0.0
        self._press = ExactPress(Press((0.0, 0.0), RADIUS, 0.0), self._sensor)
        self._room = Room()
        self._seed, self._presses, self._fresh, self._frames = seed, 0, 0, 0
        self._lengthening: dict[tuple[float, float], Tensor] = {}
        self.touches: tuple[Touch, ...] = ()
        self._missed: list[Touch] = []
        self._temperature = 0.0

    def press(self, touches: Sequence[Touch], moved: bool = False) -> None:
        self.touches = tuple(touches)
        if moved:
            self._missed = list(touches)
        else:
            rng = stream(self._seed, "live press", self._presses)
            self._presses += 1
            self._temperature = float(self._room.temperatures(1, rng)[0])
            self._missed = [_missed(touch, rng) for touch in touches]
        self._lengthening = {}

    def frame(self) -> np.ndarray:
        self._frames += 1
        noise = stream(self._seed, "live noise", self._frames)
        phases = self._phases(self._missed, self._temperature, self._lengthening)
        return self._exposed(phases, noise)

    def samples(self, n: int, touches: Sequence[Touch] = ()) -> list[np.ndarray]:
        return [self._sample(touches) for _ in range(n)]

    def _sample(self, touches: Sequence[Touch]) -> np.ndarray:
        rng = stream(self._seed, "live fresh", self._fresh)
        self._fresh += 1
        temperature = float(self._room.temperatures(1, rng)[0])
        missed = [_missed(touch, rng) for touch in touches]
        return self._exposed(self._phases(missed, temperature, {}), rng)

    def _phases(
        self,
        touches: Sequence[Touch],
        temperature: float,
        known: dict[tuple[float, float], Tensor],
    ) -> Tensor:
        """φ float64 [P] in rad; ``known``: lengthening a metre of depth of what stays pressed."""
        sensor = self._sensor
        phases = sensor.phase + sensor.sensitivity * (self.offset + temperature)
        for touch in touches:
            place = touch.x, touch.y
            if place not in known:
                known[place] = self._press(Contact(1.0, *place))
            phases.add_(known[place], alpha=touch.depth)
        return phases

    def _exposed(self, phases: Tensor, noise: np.random.Generator) -> np.ndarray:
        camera = self._sensor.mounted
        return camera.expose(camera.intensity(phases[None]), [noise])[0].numpy()


def _missed(touch: Touch, rng: np.random.Generator) -> Touch:
    across, along, deeper = rng.standard_normal(3)
    return Touch(
        touch.x + POSITION_SPREAD * across,
        touch.y + POSITION_SPREAD * along,
        touch.depth * max(0.0, 1 + DEPTH_SPREAD * deeper),
    )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m scenes.live", description=__doc__)
    parser.add_argument("--full", action="store_true", help="500 × 500 pixels, as in the scenes")
    parser.add_argument("--seed", type=int, default=0, help="which sensor (default: 0)")
    parser.add_argument("--port", type=int, default=8080, help="default: 8080")
    parser.add_argument("--host", help="address to listen at; others then need the token printed")
    given = parser.parse_args(arguments)
    torch.set_num_threads(1)  # the other core is the page's and ridge regression's
    if given.seed < 0:
        parser.error(f"--seed: expected an integer from 0, found {given.seed}")
    sensor = SimulatedSensor(500 if given.full else 250, given.seed)
    from hdc.live.page import serve

    try:
        serve(sensor, given.host, given.port)
    except OSError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
