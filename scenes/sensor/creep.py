"""Creep: what the silicone does between two sessions, whoever touches it.

Silicone relaxes over days, and every path changes its length a little. The
change of phase is Gaussian and independent of the path's thermal sensitivity,

    φ_creep,p = spread·g_p,    g standard normal,

so the field of the later session correlates with that of the earlier by e^{−spread²/2}, whatever
the path. A temperature offset instead leaves the insensitive paths alone and scrambles the others.
The published drift is a single number, which cannot tell the two apart; the scene ``drift`` uses an
offset and no creep.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from scenes.sensor.seeds import stream
from scenes.validate import require_number

if TYPE_CHECKING:
    from scenes.sensor.sensor import Sensor


@dataclass(frozen=True)
class Creep:
    """Args:
    spread: standard deviation of the phase change since the first session, in rad.
    """

    spread: float

    def __post_init__(self) -> None:
        require_number("scene.sessions.creep.spread", self.spread, 0)

    def phases(self, sensor: Sensor) -> Tensor:
        """float64 [P] in rad; the same for every sample of the session."""
        g = stream(sensor.seed, "creep").standard_normal(sensor.camera.path_count)
        return torch.from_numpy(self.spread * g).to(sensor.place)
