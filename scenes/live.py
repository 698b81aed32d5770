"""The simulated sensor as a page to touch: ``python -m scenes.live``.

Press the silicone with mouse or finger, teach three touches, let 16 days pass, recalibrate. See
:mod:`scenes.pressed` for the page and :mod:`scenes.simulated` for the sensor.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import torch

from scenes.simulated import SimulatedSensor


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m scenes.live", description=__doc__)
    parser.add_argument("--port", type=int, default=8080, help="default: 8080")
    given = parser.parse_args(arguments)
    torch.set_num_threads(1)  # the other core is the page's
    sensor = SimulatedSensor()
    from hdc.live.page import serve
    from scenes.pressed import PressedPage, PressedSession

    try:
        serve(PressedSession(sensor), port=given.port, page=PressedPage)
    except OSError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
