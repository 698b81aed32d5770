"""How far a frame of a class may be from its prototype, as one number per class.

The model's own rejection (:mod:`hdc.conformal`) asks, for every new frame x, how far each kept
training frame would be from the prototype with x in its place. A board has no room for that. Here
kept frames are compared once with the prototype made without them, and a new frame with the
prototype as it is: the jackknife, which unlike conformal prediction guarantees nothing for every
distribution (Barber et al., Ann. Statist. 49, 486 (2021), Sec. 1).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from fractions import Fraction

from hdc.conformal import FEWEST, Peers


def distance_thresholds(
    peers: Sequence[Peers], share: Fraction, farthest: int
) -> list[int]:
    """The largest distance to each prototype at which a frame counts as known.

    From m kept frames of a class, ⌊share·(m + 1)⌋ − 1 are farther. Where that is none that can be
    left out, the deviations from the mean of their class are taken of all classes together, as in
    :func:`hdc.conformal.Conformal.p_values`.

    Args:
        peers: kept frames of each class.
        share: of frames of known classes that may be refused, in (0, 1).
        farthest: largest distance there is; the threshold where no frame can be refused, which a
            warning says.
    """
    held_out = [_leave_one_out(own) for own in peers]
    pool = _deviations(held_out)
    least = min(map(len, held_out))
    too_few = least < FEWEST and share * (least + 1) < 1
    if too_few or share * (len(pool) + 1) < 1:
        warnings.warn(
            f"{float(share):g} of known frames: expected at least {FEWEST} kept frames of each "
            f"class, and {math.ceil(1 / share) - 1} in all, found {len(pool)}; no frame is refused",
            stacklevel=2,
        )
        return [farthest] * len(peers)
    farther = int(share * (len(pool) + 1))
    deviation = sorted(pool, reverse=True)[farther - 1]
    thresholds = []
    for own in held_out:
        farther = int(share * (len(own) + 1))
        if farther >= 1:
            thresholds.append(sorted(own, reverse=True)[farther - 1])
        else:
            mean = Fraction(sum(own), len(own))
            thresholds.append(min(farthest, math.floor(mean + deviation)))
    return thresholds


def _leave_one_out(own: Peers) -> list[int]:
    """Distances of kept frames to the prototype made without them; none of a single frame."""
    found: list[int] = own.held_out.tolist()
    return found if len(found) > 1 else []


def _deviations(held_out: Sequence[Sequence[int]]) -> list[Fraction]:
    """Distances of all classes less the mean of their class."""
    found = []
    for own in held_out:
        found += [distance - Fraction(sum(own), len(own)) for distance in own]
    return found
