"""What accuracy costs in the simulated sensor: ``experiment=sensor_precision``.

Error against CPU time of the two approximations that no other study measures: a robot's touch is
expanded about its target, and the scattered light is a sum over a finite number of paths.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import torch
from threadpoolctl import threadpool_limits

from experiments.records.measurement import Row, measure
from experiments.studies.numerics.measure import cpu_time
from scenes.sensor.camera import Camera
from scenes.sensor.contact import BoundContact, ExactPress, ExpandedPress, Press, Touch
from scenes.sensor.environment import Thermal
from scenes.sensor.seeds import stream
from scenes.sensor.sensor import Sensor

A, DEPTH = 2.45e-3, 1.8e-3  # m, contact radius and indentation of the scene touch
_REPEATS = 5  # of which the least CPU time counts


def run(
    touches: int = 8,
    pupils: Sequence[int] = (25, 50, 100, 200),
    sensors: int = 24,
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/sensor_precision/``.

    Args:
        touches: number of touches that the error of the expansion is over.
        pupils: diameters of the pupil in pixels; there is a path for each pixel and polarisation.
        sensors: number of sensors that the spread is over.
        force: measure again.

    Returns:
        Path: the folder. The columns of its rows: ``knob``, its ``setting``, ``error`` in ``unit``,
        and ``time_s``, the least CPU time of one thread.
    """
    config = {
        "_target_": f"{__name__}.run",
        "touches": touches,
        "pupils": list(pupils),
        "sensors": sensors,
    }

    def rows() -> Iterator[Row]:
        before = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            with threadpool_limits(1):
                yield from expansion(touches)
                yield from paths(pupils, sensors)
        finally:
            torch.set_num_threads(before)

    return measure("sensor_precision", config, rows, force=force)


def expansion(touches: int) -> Iterator[Row]:
    """Error of the phases of a touch expanded about its target, order by order, and looked up."""
    sensor = Sensor(seed=1)
    press = Press((28e-3, 8e-3), A, DEPTH, 0.01, 0.02e-3)
    exact = ExactPress(press, sensor)
    miss = stream(1, "precision").standard_normal((touches, 2)) * press.position_spread
    missed = [Touch(DEPTH, 28e-3 + x, 8e-3 + y) for x, y in miss]
    reference = [exact(touch) for touch in missed]
    forms: dict[str, BoundContact] = {
        **{str(order): ExpandedPress(press, sensor, order) for order in range(3)},
        "looked up": exact,
    }
    for setting, form in forms.items():
        square = [(form(t) - r).square().mean() for t, r in zip(missed, reference, strict=True)]
        yield {
            "knob": "order of the expansion of a touch",
            "setting": setting,
            "error": math.sqrt(float(np.mean(square))),
            "unit": "rad, root mean square",
            "time_s": cpu_time(partial(form, missed[0]), _REPEATS),
        }


def paths(pupils: Sequence[int], sensors: int) -> Iterator[Row]:
    """Spread, from sensor to sensor, of a frame's correlation before and after a step of 0.1 K."""
    for pupil in pupils:
        camera = Camera(pupil=pupil, unevenness=0)
        mounted, found = camera.on(torch.device("cpu")), []
        for i in range(sensors):
            start = stream(i, "precision").uniform(0, 2 * np.pi, camera.path_count)
            s = Thermal().draw(camera.path_count, stream(i, "thermal"))
            both = mounted.intensity(torch.from_numpy(np.stack([start, start + 0.1 * s])))
            found.append(float(np.corrcoef(both.reshape(2, -1).numpy())[0, 1]))
        phases = torch.from_numpy(start[None])
        yield {
            "knob": "paths",
            "setting": camera.path_count,
            "error": float(np.std(found, ddof=1)),
            "unit": "of a correlation, standard deviation over sensors",
            "time_s": cpu_time(partial(mounted.intensity, phases), _REPEATS),
        }
