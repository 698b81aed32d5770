"""Touches, too deep and too light; references are mpmath and the same paths in float64."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import mpmath
import numpy as np
import torch

from experiments.studies.stability.case import Trial, case
from scenes.sensor.camera import Camera
from scenes.sensor.contact import ExactPress, Press, Touch
from scenes.sensor.scene import SpeckleScene
from scenes.sensor.seeds import stream
from scenes.sensor.sensor import Sensor

A = 2.45e-3  # m, radius of the robot's contact

sensor_case = partial(case, "sensor")


@sensor_case(
    extreme="a touch 1.8 mm deep: 6,000 rad for a path that lengthens as much; float32 tables",
    expected="0.01 rad, as the table's float32 is multiplied in float64",
    reference="the same paths with everything in float64",
    unit="rad",
    naive="all of it in float32",
    ours="ExactPress",
    tolerance=0.01,
    small={"pupil": 30},
)
def phases_of_a_deep_touch(pupil: int = 200) -> Trial:
    sensor = Sensor(seed=1, camera=Camera(grid=512, crop=500, pupil=pupil))
    press = Press((28e-3, 8e-3), A, 1.8e-3)
    touch = Touch(1.8e-3, 28e-3, 8e-3)
    paths = sensor.path_set
    double = replace(paths, x=paths.x.double(), y=paths.y.double(), bend=paths.bend.double())
    table = sensor.table(A, torch.float64)
    before = sensor.phase + sensor.sensitivity * 0.2
    change = double.lengthening(table, (touch.x, touch.y)) * sensor.paths.wavenumber * touch.depth
    exact, bound, single = before + change, ExactPress(press, sensor), before.float()
    scale = torch.tensor(sensor.paths.wavenumber * touch.depth, dtype=torch.float32)
    rough = sensor.table(A, torch.float32)
    return Trial(
        naive=lambda: single + paths.lengthening(rough, (touch.x, touch.y)) * scale,
        ours=lambda: before + bound(touch),
        error=lambda found: float((found.double() - exact).abs().max()),
    )


@sensor_case(
    extreme="an indentation of 1 pm: 10^-11 of a path's length",
    expected="five digits; a difference of lengths keeps four of the 16",
    reference="difference of the polylines' lengths, mpmath, 40 digits",
    unit="relative",
    naive="length after − length before, float64",
    ours="PathSet.lengthening",
    tolerance=1e-5,
    small={"pupil": 5},
)
def an_indentation_of_one_picometre(pupil: int = 11, depth: float = 1e-12) -> Trial:
    sensor = Sensor(camera=Camera(grid=16, crop=16, pupil=pupil))
    paths, ends, middle = sensor.path_set, sensor.paths, sensor.layer.thickness / 2
    centre, table = (20e-3, 0.0), sensor.table(A, torch.float64)
    start, stop = [*ends.fibre, middle], [*ends.camera, middle]
    vertices = np.stack(
        [paths.x.numpy(), paths.y.numpy(), sensor.layer.heights[paths.level.numpy()]], axis=-1
    )  # [V, P, 3]
    moved = np.empty_like(vertices)
    for v, vertex in enumerate(vertices):
        offset = vertex[:, :2] - centre
        r = torch.from_numpy(np.hypot(*offset.T))
        outward, down = (u.numpy() for u in table.look_up(r, paths.level[v]))
        moved[v] = depth * np.column_stack([offset * outward[:, None], down])

    def longer(number: Callable[[float], Any], root: Callable[[Any], Any], path: int) -> Any:
        lengths = []
        for step in (0, 1):
            points = [[number(x) for x in start]]
            points += [
                [number(x) + step * number(u) for x, u in zip(vertex, move, strict=True)]
                for vertex, move in zip(
                    vertices[:, path].tolist(), moved[:, path].tolist(), strict=True
                )
            ]
            points.append([number(x) for x in stop])
            legs = itertools.pairwise(points)
            lengths.append(
                sum(root(sum((a - b) ** 2 for a, b in zip(*leg, strict=True))) for leg in legs)
            )
        return lengths[1] - lengths[0]

    with mpmath.workdps(40):
        exact = np.array(
            [float(longer(mpmath.mpf, mpmath.sqrt, path)) for path in range(len(paths))]
        )
    return Trial(
        naive=lambda: np.array([longer(float, math.sqrt, path) for path in range(len(paths))]),
        ours=lambda: paths.lengthening(table, centre).numpy() * depth,
        error=lambda found: float(np.abs(found - exact).max() / np.abs(exact).max()),
    )


@sensor_case(
    extreme="an indentation of zero",
    expected="phases unchanged, to the bit",
    reference="the phases without a touch",
    unit="rad",
    naive="phases in float32",
    ours="ExactPress",
    small={"pupil": 30},
)
def no_indentation(pupil: int = 200) -> Trial:
    sensor = Sensor(camera=Camera(grid=512, crop=500, pupil=pupil))
    bound = ExactPress(Press((28e-3, 8e-3), A, 0.0), sensor)
    touch = Touch(0.0, 28e-3, 8e-3)
    before = sensor.phase + sensor.sensitivity * 0.2
    return Trial(
        naive=lambda: before.float() + bound(touch).float(),
        ours=lambda: before + bound(touch),
        error=lambda found: float((found.double() - before).abs().max()),
    )


def pressed(**contact: Any) -> SpeckleScene:
    """A scene of one class, pressed by a robot."""
    classes = {"touched": {"position": (28e-3, 8e-3)}}
    return SpeckleScene(Sensor(), classes, partial(Press, radius=A, **contact))


@sensor_case(
    extreme="depths that vary by 60 %: one in twenty would pull at the layer",
    expected="no negative indentation: a contact that is not glued can only press",
    reference="zero touches",
    unit="of 100 touches",
    naive="depth·(1 + spread·ξ)",
    ours="SpeckleScene.samples",
)
def an_indentation_is_never_negative(depth: float = 1e-3, spread: float = 0.6) -> Trial:
    return Trial(
        naive=lambda: depth * (1 + spread * stream(0, "stability").standard_normal(100)),
        ours=lambda: pressed(depth=depth, depth_spread=spread).samples["depth"],
        error=lambda depths: int((depths < 0).sum()),
    )
