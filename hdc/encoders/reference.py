"""Encoders of frames relative to a reference frame, by another encoder."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from hdc.encoders.named import Around
from hdc.encoders.relative import RelativeEncoder


class Reference(Around, RelativeEncoder):
    """Standardises each frame, subtracts a reference frame, and encodes the difference.

    A standardised frame is (x − mean(x))/std(x), in steps of 2⁻¹⁶. The reference is the mean of the
    standardised training frames, or of the frames given to :meth:`zero`, such as frames without a
    touch. All arithmetic is in integers, so every machine computes the same bits. Subtracting a
    mean frame is unsupervised re-centring (Vidaurre et al., IEEE TBME 58, 587 (2011)).

    Args:
        base: the encoder of the differences, a name or an object; one that learns nothing.
        frame: reference frame [H, W] or [D], or several [n, H, W] or [n, D], which are standardised
            and averaged; by default the training frames. A saved model keeps the reference but not
            these frames: in a loaded model the parameter is ``"given"``, and has to be set before
            :meth:`fit`.

    Attributes:
        reference_: int32 [D], the reference in steps of 2⁻¹⁶ of a standard deviation.
    """

    def __init__(self, base: Any = "median", frame: Any = None):
        self.base = base
        self.frame = frame

    def check(self) -> None:
        super().check()
        if self.base_.learns:
            raise ValueError(
                f"base: expected an encoder that learns nothing, found {self.base_!r}"
            )

    def of_differences(self, differences: Tensor, first: int) -> Tensor:
        return self.encode_by_base(differences, first)


class ReferenceLevels(Reference):
    """Levels of each frame minus a reference frame: :class:`Reference` with ``base="levels"``.

    Args: as of :class:`Reference`.
    """

    def __init__(self, base: Any = "levels", frame: Any = None):
        super().__init__(base, frame)
