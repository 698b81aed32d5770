"""Rejection of unknown frames, by the distance to the nearest prototype.

This is version 2 of the rule, the same in Python and in an exported header. For every read-out, the
prototype of a class is the majority of its training hypervectors (Eq. 1), and the distance of a
frame is its distance to the nearest prototype. A frame is known unless it is farther than training
frames that were left out of the prototypes: of the m distances of left-out frames in rising order,
the ⌊α(m + 1)⌋-th from the end is the largest at which a frame is known. If the frame and the
training frames are exchangeable, about α of such frames are refused. This is the jackknife, which
has no guarantee for every distribution (Barber et al., Ann. Statist. 49, 486 (2021), Sec. 1).

**Groups.** Two frames of one session, object or video are more alike than frames of two sessions.
If groups are known, a frame is left out together with all frames of its group, of any class, and α
holds for frames of another group. Otherwise frames are left out one by one, and α holds only for
frames recorded under the training conditions, not for another session.

Up to 100 random frames of each class are left out; for a read-out that counts, without groups, the
19 frames that it stores (:class:`hdc.hypervectors.Sample`). Their distances are exact, since the
counts of a class without a frame or a group follow from the counts with it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Self

import torch
from torch import Tensor

from hdc import bits, planes
from hdc.hypervectors import Hypervectors, Sample
from hdc.inputs import Label
from hdc.readouts.base import Readout
from hdc.readouts.majority import Counting
from hdc.tensors import checked
from hdc.warning import warn

VERSION = 2
"""Version of the rule, which an exported header names."""
MOST = 100
"""Frames of a class that are left out at most."""


@dataclass(frozen=True, eq=False)
class Rejection:
    """Prototypes, and the distances of training frames that were left out of them."""

    prototypes: Tensor
    """int64 [K, W], for the classes with training frames."""
    distances: Tensor
    """int64 [m] (CPU), distances of left-out frames in rising order."""
    unit: str
    """The unit that is left out at a time, ``"frame"`` or ``"group"``."""

    @classmethod
    def of(cls, prototypes: Tensor, distances: Sequence[Tensor], unit: str) -> Self:
        """Make the rule from parts of the distances, in any order."""
        none = torch.empty(0, dtype=torch.int64)
        found = torch.cat([none, *(part.cpu() for part in distances)])
        return cls(prototypes.contiguous(), found.sort().values, unit)

    def threshold(self, alpha: float) -> int:
        """The largest distance at which a frame is known; warns if every frame is."""
        share = Fraction(str(alpha))  # 0.05 is 1/20
        m = len(self.distances)
        farther = math.floor(share * (m + 1))
        if farther == 0:
            warn(
                f"alpha={alpha:g} needs at least {math.ceil(1 / share) - 1} training frames to "
                f"leave out, found {m}; no frame is refused",
            )
            return planes.WORD * self.prototypes.shape[1]
        return int(self.distances[-farther])

    def nearest(self, words: Tensor) -> Tensor:
        """Distances int64 [Q] of hypervectors [Q, W] to the nearest prototype."""
        return bits.hamming(words, self.prototypes).amin(1)

    def tensors(self) -> dict[str, Tensor]:
        """The tensors for a file."""
        return {"prototypes": self.prototypes, self.unit: self.distances}

    @classmethod
    def restored(cls, tensors: Mapping[str, Tensor], dimension: int) -> Self | None:
        """The rule from the tensors of a file, if there are any; ValueError if they do not fit."""
        if not tensors:
            return None
        unit = "group" if "group" in tensors else "frame"
        m = len(tensors.get(unit, ()))  # none where each class has a single frame
        kinds = {"prototypes": "int64 K W", unit: "int64 M"}
        found = checked(tensors, kinds, D=dimension, M=m)
        if (found[unit].diff() < 0).any():
            raise ValueError(f"known.{unit}: expected increasing distances")
        return cls(found["prototypes"], found[unit], unit)


# Frame by frame ----------------------------------------------------------------------------------


def by_frames(near: Tensor, kept: Mapping[int, Tensor]) -> Rejection:
    """The rule from frames left out one by one.

    Args:
        near: int64 [L, 3, W], for each class the bits with more than (n − 1)/2, n/2 and (n + 1)/2
            ones among its n hypervectors.
        kept: hypervectors int64 [m, W] to leave out, for each class with frames. The only frame of
            a class is not left out.
    """
    rows = sorted(kept)
    whole = near[rows, 1]
    found = []
    for place, row in enumerate(rows):
        words = kept[row]
        if len(words) > 1:
            if_zero, _, if_one = near[row]
            without = bits.where(words, if_one, if_zero)
            distances = bits.hamming(words, whole)
            distances[:, place] = bits.count_ones(words ^ without)
            found.append(distances.amin(1))
    return Rejection.of(whole, found, "frame")


def of_words(words: Hypervectors, rows: Tensor, n_classes: int) -> Rejection:
    """The rule from N hypervectors and their classes int64 [N], left out one by one."""
    kept = Sample().with_frames(words.packed, rows.tolist(), MOST).kept
    counts, n = planes.counted(words.packed, rows, n_classes)
    near = counts.new_zeros(n_classes, 3, counts.shape[2])
    for row in kept:
        for place, extra in enumerate((-1, 0, 1)):
            near[row, place] = planes.majority(counts[row], int(n[row]) + extra)
    return by_frames(near, kept)


# Group by group ----------------------------------------------------------------------------------


def by_groups(
    words: Hypervectors,
    rows: Tensor,
    groups: Sequence[Label],
    readout: Readout,
    n_classes: int,
) -> tuple[Rejection | None, list[int]]:
    """The rule from N hypervectors that are left out with all others of their group.

    Returns:
        The rule, or None if all frames of each class are of one group; and the classes of which all
        are, which are not left out.

    Args:
        words: N hypervectors.
        rows: their classes int64 [N]; all of 0 … L − 1 occur.
        groups: the group of each, any N labels.
        readout: the read-out, whose rule of ties is used if it counts.
        n_classes: L.
    """
    number = {group: k for k, group in enumerate(dict.fromkeys(groups))}
    of_group = torch.tensor([number[group] for group in groups])
    places = torch.arange(len(rows))[:, None]
    chosen, _ = Sample().with_frames(places, rows.tolist(), MOST).listed()
    chosen = chosen.flatten()
    ties = readout.ties if isinstance(readout, Counting) else "zero"
    whole = planes.majorities(*planes.counted(words.packed, rows, n_classes), ties)
    found, single = [], set()
    for group in of_group[chosen].unique():
        inside = of_group == group
        own = rows[inside].unique()
        others = torch.isin(rows, own) & ~inside
        counted = planes.counted(words[others].packed, rows[others], n_classes)
        rest = planes.majorities(*counted, ties)
        left = whole.clone()
        left[own] = rest[own]
        alone = own[~torch.isin(own, rows[others])]
        single.update(alone.tolist())
        asked = chosen[inside[chosen] & ~torch.isin(rows[chosen], alone)]
        distances = bits.hamming(words[asked].packed, left)
        distances[:, alone] = planes.WORD * left.shape[1]
        found.append(distances.amin(1))
    rule = Rejection.of(whole, found, "group")
    return (rule if len(single) < n_classes else None), sorted(single)
