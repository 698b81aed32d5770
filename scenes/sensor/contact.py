"""Contact: where and how deep a touch is, and how it varies from touch to touch.

A touch of depth δ at (x, y) adds k0·n·q_s·δ·L(x, y) to the phases, L the lengthening of each path
per metre of indentation (``paths.PathSet.lengthening``). δ = depth·(1 + σ_d·N), and both
coordinates of the centre miss their target by σ_xy·N. The displacement is linear in the depth; at
1.8 mm of a 5 mm layer that is an assumption.

A robot repeats its position to a fraction of the contact radius a. Then L is expanded about the
target to second order, once per class. The neglected rest is about k0·n·q_s·δ·(3σ_xy/a)³/6; where
it exceeds ``EXPANSION`` rad (a finger), every touch looks up its own displacement.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from scenes.sensor.sensor import Sensor
from scenes.validate import require, require_number

EXPANSION = 0.05


@dataclass(frozen=True)
class Touch:
    """One touch as it happened.

    Attributes:
        depth: indentation in m.
        x, y: the centre in m.
        random: the random stream of this touch alone.
    """

    depth: float
    x: float
    y: float
    random: np.random.Generator | None = None


BoundContact = Callable[[Touch], Tensor]
"""Change of phase float64 [P] in rad that a touch causes."""


@dataclass(frozen=True)
class Press:
    """A smooth round contact, pressed to a depth.

    Args:
        position: (x, y) in m.
        radius: a of the Hertz pressure in m.
        depth: mean indentation δ in m.
        depth_spread: σ_d, relative.
        position_spread: σ_xy in m, each axis.
    """

    position: tuple[float, float]
    radius: float
    depth: float
    depth_spread: float = 0.0
    position_spread: float = 0.0

    def __post_init__(self) -> None:
        pair = tuple(map(float, self.position))
        require(
            len(pair) == 2,
            "scene.classes.*.position",
            pair,
            "two coordinates (x, y) in m",
        )
        object.__setattr__(self, "position", pair)
        require_number("scene.contact.radius", self.radius, 0, strict=True)
        for name in ("depth", "depth_spread", "position_spread"):
            require_number(f"scene.contact.{name}", getattr(self, name), 0)

    def draw(self, normals: np.ndarray) -> dict[str, np.ndarray]:
        """Depth and centre of n touches from standard normals [n, 3].

        A depth may be negative; a scene treats this as a touch that does not reach the layer.
        """
        deeper, across, along = normals.T
        x, y = self.position
        return {
            "depth": self.depth * (1 + self.depth_spread * deeper),
            "x": x + self.position_spread * across,
            "y": y + self.position_spread * along,
        }

    def bind(self, sensor: Sensor) -> BoundContact:
        """The phases that this contact causes on a sensor."""
        miss = 3 * self.position_spread / self.radius
        neglected = sensor.paths.wavenumber * self.depth * miss**3 / 6
        if neglected < EXPANSION:
            return ExpandedPress(self, sensor)
        return ExactPress(self, sensor)


class ExactPress:
    """Every touch looks up the displacement of every vertex."""

    def __init__(self, press: Press, sensor: Sensor) -> None:
        self._sensor = sensor
        self._table = sensor.table(press.radius, torch.float32)

    def __call__(self, touch: Touch) -> Tensor:
        sensor = self._sensor
        centre = touch.x, touch.y
        lengthening = sensor.path_set.lengthening(self._table, centre)
        scale = sensor.paths.wavenumber * touch.depth
        return lengthening.to(torch.float64).mul_(scale)


class ExpandedPress:
    """L about the target: L + L_x·ξ + L_y·η + ½L_xx·ξ² + L_xy·ξη + ½L_yy·η², float32 [6, P].

    The derivatives are central differences over the 3 × 3 points at ± two standard deviations.
    """

    def __init__(self, press: Press, sensor: Sensor) -> None:
        self._press = press
        self._wavenumber = sensor.paths.wavenumber
        table = sensor.table(press.radius, torch.float64)
        x, y = press.position
        step = 2 * press.position_spread

        def at(i: int, j: int) -> Tensor:
            point = x + i * step, y + j * step
            return sensor.path_set.lengthening(table, point)

        centre = at(0, 0)
        terms = [centre]
        if step > 0:
            east, west = at(1, 0), at(-1, 0)
            north, south = at(0, 1), at(0, -1)
            corners = at(1, 1) - at(1, -1) - at(-1, 1)
            corners = corners + at(-1, -1)
            terms += [
                (east - west) / (2 * step),
                (north - south) / (2 * step),
                (east - 2 * centre + west) / (2 * step * step),
                corners / (4 * step * step),
                (north - 2 * centre + south) / (2 * step * step),
            ]
        self._terms = [term.to(torch.float32) for term in terms]

    def __call__(self, touch: Touch) -> Tensor:
        x, y = self._press.position
        xi, eta = touch.x - x, touch.y - y
        factors = (xi, eta, xi * xi, xi * eta, eta * eta)
        scale = self._wavenumber * touch.depth
        centre, *derivatives = self._terms
        total = centre.to(torch.float64) * scale
        for derivative, factor in zip(derivatives, factors, strict=False):
            total += derivative.to(torch.float64) * (scale * factor)
        return total


def line(
    start: tuple[float, float],
    stop: tuple[float, float],
    number: int,
) -> Mapping[str, Mapping[str, tuple[float, float]]]:
    """Classes "0", "1", … at ``number`` positions evenly spaced from start to stop (x, y) in m."""
    classes = {}
    for i, (x, y) in enumerate(np.linspace(start, stop, number)):
        classes[str(i)] = {"position": (float(x), float(y))}
    return classes
