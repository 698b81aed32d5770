"""The settings of a recording, as every reader takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hdc.readers.files import SettingError, wrong


@dataclass(frozen=True)
class Window:
    """Pixels of an image that are kept: a crop (x, y, width, height), then every n-th of it.

    A frame that is a vector [D] has no crop; every n-th of its numbers is kept. With an `image`
    (H, W), images of another size are refused.
    """

    crop: Sequence[int] | None = None
    subsample: int = 1
    image: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        if self.crop is not None:
            crop = tuple(self.crop)
            whole = all(isinstance(n, int | np.integer) for n in crop)
            if len(crop) != 4 or not whole or min(crop) < 0 or min(crop[2:]) < 1:
                expected = "null or [x, y, width, height], integers ≥ 0 and sizes ≥ 1"
                raise wrong("crop", self.crop, expected)
            object.__setattr__(self, "crop", crop)
        if not isinstance(self.subsample, int | np.integer) or self.subsample < 1:
            raise wrong("subsample", self.subsample, "an integer ≥ 1")

    def shape(self, *sides: int) -> tuple[int, ...]:
        """(H, W) that is kept of an image [height, width], or (D,) of a vector.

        Raises:
            SettingError: the crop does not lie inside it, or is of images of another size.
        """
        return self.of(np.broadcast_to(np.uint8(0), sides)).shape

    def of(self, image: np.ndarray) -> np.ndarray:
        """A view [H, W], [H, W, channels] or [D] of the pixels that are kept."""
        return image[self._slices(image.shape[:2])]

    def _slices(self, sides: tuple[int, ...]) -> tuple[slice, ...]:
        step = self.subsample
        if len(sides) == 1:
            if self.crop is not None:
                raise wrong("crop", self.crop, "null for frames that are vectors")
            return (slice(None, None, step),)
        height, width = sides
        if self.image is not None and self.image != sides:
            wanted = f"images {self.image[1]} px wide and {self.image[0]} px high as in training"
            raise SettingError(f"crop: expected {wanted}, found {width} × {height}")
        x, y, w, h = self.crop or (0, 0, width, height)
        if x + w > width or y + h > height:
            wanted = f"a window inside frames {width} px wide and {height} px high"
            raise wrong("crop", [x, y, w, h], wanted)
        return slice(y, y + h, step), slice(x, x + w, step)


class Asked(NamedTuple):
    """Settings of a recording, as every reader takes them; see :func:`hdc.readers.open_recording`.

    Attributes:
        window: pixels that are kept.
        labels: name of the array of labels.
        table: a CSV.
        values: columns or arrays that are values; None means all numbers.
        sessions, groups: names of the columns or arrays that are these.
        dataset: name of the array of frames; "" where the file has one that can be.
    """

    window: Window
    labels: str | None = None
    table: Path | None = None
    values: Sequence[str] | None = ()
    sessions: str | None = None
    groups: str | None = None
    fewest_classes: int = 2
    axes: Sequence[str] | None = None
    dataset: str = ""
    template: str | None = None
    image_column: str = "image"

    def of_part(self, dataset: str = "") -> Asked:
        """The same of one of several files or arrays, which may have neither labels nor values."""
        own = self._replace(template=None, sessions=None, groups=None, values=())
        return own._replace(fewest_classes=0, dataset=dataset)
