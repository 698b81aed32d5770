"""Adapting a trained classifier to a changed environment by few new frames."""

from __future__ import annotations

import copy
import warnings
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import torch

from hdc import inputs
from hdc.encoders import RelativeEncoder, make_encoder
from hdc.learner import Learner
from hdc.parameters import available_unless
from hdc.probability import Calibration
from hdc.readouts import make_readout
from hdc.rejection import Sample


def _fixed(model: Learner) -> str | None:
    """Why a model does not adapt to new frames in any way, if it does not."""
    try:
        readout, encoder = make_readout(model.readout), make_encoder(model.encoder)
    except (TypeError, ValueError) as error:
        return str(error)
    if hasattr(readout, "adapt") or isinstance(encoder, RelativeEncoder):
        return None
    return (
        f"expected another read-out than {readout!r}, or an encoder with a reference "
        "('reference', 'deviation'); fit anew"
    )


class Recalibrating(Learner):
    """A classifier that moves to new frames: its prototypes by labels, its reference without."""

    @abstractmethod
    def predict(self, frames: Any) -> np.ndarray:
        """Labels [Q] of frames."""

    @available_unless(_fixed)
    def recalibrate(
        self,
        frames: Any,
        y: Any = None,
        p: float = 0.5,
        seed: int = 0,
        method: str = "replace",
    ) -> Self:
        """Adapt to a changed environment by new frames, with labels or without.

        With labels: prototypes of classes without new frames stay as they are, and a warning says
        so, as a drift that all classes share then costs them their frames; :meth:`is_known`
        compares with the new frames; ``partial_fit`` and ``merge`` refuse a recalibrated model.
        Ridge regression goes from its old weights to those near them that fit the new frames,
        neighbours take the new frames in place of the kept ones of their classes; neither depends
        on p.

        Without labels, a model with a reference (``encoder="reference"`` or ``"deviation"``) is
        zeroed again: the reference becomes the mean of the new standardised frames, and prototypes
        stay. The new frames have to show what the frames of the old reference showed: all classes
        about as often. Frames of one class can spoil the model; a warning says so where the model
        puts them into few classes. Frames without a touch are no way around it: in the study of
        drift ten of them improved no model, even where the old reference was without a touch.

        Args:
            frames: frames of the changed environment, of the shapes that :meth:`fit` takes.
            y: their labels, or None.
            p: share of the new: probability with which a bit is replaced, or share of the votes.
            seed: seed of the choice of bits that are replaced.
            method: ``"replace"`` as published, for binary prototypes only, or ``"merge"``, by
                votes (:func:`hdc.prototypes.merged`), which recovers more.

        Raises:
            ValueError: if p is outside [0, 1], a label is not among ``classes_``, or there are
                neither labels nor a reference.
        """
        self._check_is_trained()
        if y is None:
            return self._zero(frames)
        if getattr(self.readout_, "adapt", None) is None:
            raise ValueError(
                f"recalibrate: expected another read-out than {self.readout_!r}"
            )
        frames, labels = self._samples(frames, y)
        inputs.check_among(labels, self._index)
        self._warn_of_missing(labels)
        words = torch.cat(list(self._encoded(frames)))
        rows = torch.tensor([self._index[label] for label in labels])
        # Copies: a call that raises leaves the model as it was.
        changed: Any = copy.copy(self.readout_)
        changed.backend = self._backend(frames)
        changed.adapt(words, rows, p, seed, method)
        if self._majority is self.readout_:
            majority = changed
        else:
            majority = copy.copy(self._majority)
            majority.adapt(words, rows, p, seed, method)
        sample = Sample()
        sample.add(words, labels)
        for label in set(labels):
            self._sample.put(label, sample.of(label), sample.seen[label])
        self.readout_ = changed
        self._majority = majority
        self._recalibrated = True
        self._peers = None
        self._calibration = Calibration()
        return self

    def _warn_of_missing(self, labels: Sequence[inputs.Label]) -> None:
        """Warn where classes have no new frames: they keep prototypes of before the change."""
        missing = [name for name in self.classes_.tolist() if name not in set(labels)]
        if not missing:
            return
        named = ", ".join(map(repr, missing[:5])) + (" …" if len(missing) > 5 else "")
        warnings.warn(
            f"recalibrate: no new frames of {named}; where a drift moves the frames of all classes "
            "alike, frames of these classes will be taken for the others",
            stacklevel=3,
        )

    def _zero(self, frames: Any) -> Self:
        """Take the mean of new frames as the reference of the encoder."""
        if not isinstance(self.encoder_, RelativeEncoder):
            raise ValueError(
                f"recalibrate: expected labels y, or a model with encoder 'reference' or "
                f"'deviation' to be zeroed without any, found {self.encoder_!r}"
            )
        frames = self._checked_frames(frames)
        if len(frames) == 0:
            raise ValueError("frames: expected at least one frame, found none")
        inputs.check_shape(frames.shape[1:], self.frame_shape_, type(self).__name__)
        before = self.encoder_
        self.encoder_ = copy.copy(before).zero(frames)
        try:
            found = len(set(self.predict(frames).tolist()))
        except BaseException:
            self.encoder_ = before
            raise
        if 2 * found < len(self.classes_):
            warnings.warn(
                f"recalibrate: the {len(frames)} frames are put into {found} of "
                f"{len(self.classes_)} classes; they have to show the classes as the training "
                "frames did, or the model is spoilt",
                stacklevel=3,
            )
        return self
