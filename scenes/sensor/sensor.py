"""The sensor that every scene shares: layer, paths, thermal part and camera under one seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import torch
from torch import Tensor

from hdc.parameters import check_integer
from scenes.sensor.camera import Camera, MountedCamera
from scenes.sensor.elastomer import Layer, radial_table
from scenes.sensor.environment import Thermal
from scenes.sensor.paths import Paths, PathSet, Table
from scenes.sensor.seeds import stream


@dataclass(frozen=True)
class Sensor:
    """One calibrated sensor; nothing is drawn before the first frame.

    Each part may be given as an object, or as a mapping of the values that differ from its
    calibrated defaults, so ``+scene.sensor.camera.photons=100`` works on the command line.

    Args:
        seed: which sensor: the paths, their phases and thermal sensitivities.
        device: where frames are computed.
    """

    seed: int = 0
    device: str = "cpu"
    layer: Layer = field(default_factory=Layer)
    paths: Paths = field(default_factory=Paths)
    thermal: Thermal = field(default_factory=Thermal)
    camera: Camera = field(default_factory=Camera)

    def __post_init__(self) -> None:
        check_integer("seed.sensor", self.seed, 0)
        for kind in (Layer, Paths, Thermal, Camera):
            name = kind.__name__.lower()
            part = getattr(self, name)
            if isinstance(part, Mapping):
                object.__setattr__(self, name, kind(**part))

    @cached_property
    def place(self) -> torch.device:
        return torch.device(self.device)

    @cached_property
    def path_set(self) -> PathSet:
        count, rng = self.camera.path_count, stream(self.seed, "paths")
        return self.paths.draw(count, self.layer, rng, self.place)

    @cached_property
    def phase(self) -> Tensor:
        """φ0 float64 [P] in rad."""
        rng = stream(self.seed, "phase")
        values = rng.uniform(0, 2 * torch.pi, self.camera.path_count)
        return torch.from_numpy(values).to(self.place)

    @cached_property
    def sensitivity(self) -> Tensor:
        """S float64 [P] in rad/K."""
        rng = stream(self.seed, "thermal")
        values = self.thermal.draw(self.camera.path_count, rng)
        return torch.from_numpy(values).to(self.place)

    @cached_property
    def mounted(self) -> MountedCamera:
        return MountedCamera(self.camera, self.place)

    def table(self, radius: float, dtype: torch.dtype) -> Table:
        """Displacement under a contact of this radius, at the heights of the paths' vertices."""
        extent = self.paths.length + self.paths.width  # more than the sensor's diagonal
        return Table(radial_table(self.layer, radius, extent), dtype, self.place)
