"""Adaptation of a trained classifier to a drift of its environment."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any, Self

from hdc import inputs
from hdc.answers import Answering
from hdc.availability import needs
from hdc.estimator import joined
from hdc.hypervectors import Hypervectors
from hdc.warning import warn


class Adapting(Answering):
    """Recalibration by frames with labels, and re-referencing by frames without."""

    @needs("readout", "adapt", "a read-out that adapts")
    def recalibrate(
        self,
        frames: Any,
        y: Any = None,
        p: float = 0.5,
        random_state: int = 0,
        method: str | None = None,
    ) -> Self:
        """Adapt to a changed environment by new labelled frames.

        Classes without new frames keep their prototypes, and a warning lists them: they lose
        accuracy if the drift affects all classes. :meth:`is_known` then compares with the new
        frames. ``partial_fit`` refuses a recalibrated model.

        Each read-out adapts in its own way. Ridge regression moves its weights to fit the new
        frames, and neighbours replace the stored frames of each class by its new ones; neither uses
        p. lda mixes the old discriminants and the new ones. To adapt without labels, see
        :meth:`rezero`.

        Args:
            frames: frames of the changed environment, of the shapes that :meth:`fit` takes.
            y: their labels.
            p: probability that a bit is replaced, or weight of the new votes or discriminants.
            random_state: seed of the choice of bits to replace. The model counts its
                recalibrations, also in its file, and each of them draws other bits.
            method: ``"replace"``, as published, for binary prototypes only; or ``"merge"``, by
                votes (:func:`hdc.prototypes.merged`), which recovers more. The default is
                ``"replace"``, and ``"merge"`` for the read-out counts.

        Raises:
            ValueError: if p is outside [0, 1]; if p is 1 and all new frames are of one class, for
                lda; if a label is not among ``classes_``; if bits are to be replaced in
                a class without training frames; or if the read-out does not use an argument.
            AttributeError: if the read-out cannot adapt; ``hasattr`` is then False.
        """
        self._check_is_trained()
        if y is None:
            raise ValueError(
                "recalibrate: expected labels y, found None; without labels: rezero(frames)"
            )
        options = {"p": p, "random_state": random_state, "method": method}
        self._check_used(options)
        frames = self._further(frames)
        labels = inputs.label_array(y, len(frames)).tolist()
        inputs.check_among(labels, self._head.index)
        with self._computing():
            words = joined(self._encoded(frames))
            self._head = self._head.adapted(words, labels, options)
        return self

    def _check_used(self, given: Mapping[str, Any]) -> None:
        """Raise ValueError for a given argument that the read-out does not use."""
        defaults = inspect.signature(Adapting.recalibrate).parameters
        for name, value in given.items():
            default = defaults[name].default
            if name not in self.readout_.adapts_by and value != default:
                raise ValueError(
                    f"{name}: expected {default!r} with the read-out {self.readout_!r}, which "
                    f"does not use it, found {value!r}"
                )

    @needs("encoder", "zero", "an encoder with a reference, such as 'reference'")
    def rezero(self, frames: Any) -> Self:
        """Replace the reference by the mean of new unlabelled frames, standardised.

        The classes should be about as frequent in the new frames as in the frames of the old
        reference. Frames of a single class, such as frames without a touch, can ruin the model; a
        warning appears if the model assigns them to few classes.

        Args:
            frames: frames of the changed environment, of the shapes that :meth:`fit` takes.

        Raises:
            ValueError: for no frames, or frames of another shape; the model is then unchanged.
            TypeError: for hypervectors, which hold no grey values.
            AttributeError: if the encoder has no reference; ``hasattr`` is then False.
        """
        self._check_is_trained()
        if isinstance(frames, Hypervectors):
            raise TypeError(
                "rezero: expected frames, found hypervectors, which hold no grey values"
            )
        frames = self._further(frames)
        inputs.check_shape(frames.shape[1:], self.frame_shape_, type(self).__name__)
        encoder: Any = self.encoder_.unlearned()
        with self._computing():
            encoder.zero(frames)
            words = joined(self._batches(frames, encoder, self.frame_shape_))
            found = len(self._head.scores(words).argmax(1).unique())
        if 2 * found < len(self.classes_):
            warn(
                f"rezero: the {len(frames)} frames are put into {found} of {len(self.classes_)} "
                "classes; they have to show all classes about as often as the training frames did, "
                "or the model is spoiled",
            )
        self.encoder_ = encoder
        return self
