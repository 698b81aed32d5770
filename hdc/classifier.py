"""The hyperdimensional classifier: an encoder, and a read-out of its hypervectors."""

from __future__ import annotations

import inspect
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np

from hdc import backends, inputs
from hdc.answers import Answering
from hdc.availability import needs
from hdc.encoders import ENCODERS, Encoder
from hdc.head import Head
from hdc.hypervectors import Encoding, Hypervectors, Sample, joined, source
from hdc.readouts import READOUTS, Readout, Updatable
from hdc.tensors import Parts
from hdc.warning import warn

KNOWN = "known"
"""The class of training frames without labels."""
_UNEQUAL = 0.2  # share of more frames of a class that is warned of


class HDCClassifier(Answering):
    """Classifier on packed hypervectors (Kitagawa et al., Opt. Express 32, 3209 (2024)).

    An encoder makes a hypervector of each frame, and a read-out scores the classes. The published
    form thresholds a frame at its own median. The prototype of a class is the bitwise majority of
    its hypervectors (Eq. 1). A query belongs to the class whose prototype is nearest in Hamming
    distance (Eqs. 2, 3), the first of equally near ones.

    Frames are [N, H, W] or [N, D]. A model of images also takes flattened images, and a single
    image [H, W]. The columns of a data frame are pixels in its order. Several threads may
    predict at once, but while one thread trains the model, no other may use it. Start processes by
    ``spawn``, since torch may hang in a forked one. With a read-out that counts, :meth:`fit` holds
    counters and up to 19 hypervectors per class, however many frames there are; other read-outs
    hold all hypervectors.

    Args:
        encoder: ``"median"`` as published, ``"quantile"``, ``"levels"``, ``"reference"``,
            ``"reference_levels"``, ``"deviation"`` or ``"smoothed"``; an object of
            :class:`hdc.encoders.Encoder`; or the dotted name of such a class.
        readout: ``"majority"`` as published, ``"counts"``, ``"ridge"``, ``"neighbours"``,
            ``"lda"``, ``"trained"`` or ``"kernel"``; an object of
            :class:`hdc.readouts.Readout`; or the dotted name of such a class. ``"majority"`` and
            ``"counts"``, as published, favour classes with more training frames;
            ``readout=Majority(class_weight="balanced")`` does not.
        device: the device that computes and holds the model.
        backend: ``"numpy"``; ``"compiled"``, which needs numba and gives the same hypervectors and
            counts in less time, though ``"lda"`` may differ in its last digits
            (:mod:`hdc.readouts.lda`); or ``"auto"``, which chooses once, at fit or load
            (:func:`hdc.backends.choose_backend`). It is not saved with the model.

    Parameters of the parts are ``encoder__ties``, ``readout__ties`` and so on.

    Attributes:
        encoder_: the encoder, trained.
        readout_, state_: the read-out, and what it has learned.
        classes_: array [L] of the labels, sorted: str, int, float or bool.
        counts_: int64 array [L], training frames per class, or votes after a recalibration by
            votes.
        prototypes_: int64 tensor [L, W], the packed prototypes of the read-outs majority, counts
            and trained; zeros for a class without training frames.
        prediction_bytes_: bytes of memory that a prediction needs.
        n_features_in_: pixels of a frame.
        dimension_: D, bits of a hypervector.
        frame_shape_: (H, W) or (pixels,).
        left_out_: ``"group"`` if :meth:`is_known` is calibrated for frames of another group, else
            ``"frame"``.
        metadata_: the metadata that were saved with the model.

    Example:
        >>> frames = np.array([[9, 8, 1, 0], [8, 9, 0, 2], [0, 1, 9, 7], [1, 0, 8, 9]], np.uint8)
        >>> model = HDCClassifier().fit(frames, ["left", "left", "right", "right"])
        >>> model.predict(frames[:1])
        array(['left'], dtype='<U5')
    """

    _estimator_type = "classifier"
    parts: ClassVar = {"encoder": ENCODERS, "readout": READOUTS}

    def __init__(
        self,
        encoder: Encoder | str = "median",
        readout: Readout | str = "majority",
        device: str = "cpu",
        backend: str = "auto",
    ):
        self.encoder = encoder
        self.readout = readout
        self.device = device
        self.backend = backend

    # Training ------------------------------------------------------------------------------------

    def fit(self, frames: Any, y: Any = None, groups: Any = None) -> Self:
        """Learn from frames [N, H, W] or [N, D] and N labels y.

        `groups` are N labels of what was recorded together, such as the session or the object of
        each frame. :meth:`is_known` is then calibrated for frames of another group; nothing else
        depends on groups. With groups, all hypervectors are held during the training.

        With the read-outs majority, counts and neighbours, frames of a single class make a model
        for :meth:`is_known`. They need no labels; their class is then ``"known"``. A call that
        raises leaves the model unchanged.

        Raises:
            ValueError: for no frames; a single class, if the read-out needs two; different lengths;
                pixels that are not finite; labels other than str, int, float or bool; or an unknown
                parameter value.
        """
        readout = self.fresh("readout")
        columns, frames = inputs.columns_of(frames), source(frames)
        if y is None and isinstance(readout, Updatable):
            y = [KNOWN] * len(frames)
        labels = inputs.label_array(y, len(frames)).tolist()
        inputs.check_discrete(labels)
        together = None
        if groups is not None:
            together = inputs.label_array(groups, len(frames), "groups").tolist()
        classes = inputs.classes_of(labels)
        _check_several(readout, classes.tolist())
        self._learn(readout, frames, labels, classes, columns, together)
        self._warn_of_unequal(self._head.sample.seen.values())
        return self

    def _learn(
        self,
        readout: Readout,
        frames: Any,
        labels: Sequence[inputs.Label],
        classes: np.ndarray,
        columns: list[str] | None,
        together: Sequence[inputs.Label] | None = None,
    ) -> None:
        """Learn anew; some of the classes may have no frames if the read-out is updatable."""
        encoder = self.fresh("encoder")
        encoding = Encoding.learned(encoder, frames, self.device, self.backend)
        with backends.computing(encoding.backend):
            words = encoding.encoded(frames)
            head = Head(readout, None, Sample(), classes, encoding.dimension)
            head = head.learned(words, labels, self.device, together)
        self._encoding, self._head = encoding, head
        self.columns_, self.metadata_ = columns, {}

    def _warn_of_unequal(self, seen: Collection[int]) -> None:
        """Warn of larger classes, which a read-out with default parameters may favour."""
        more = max(seen) / min(seen) - 1
        if isinstance(self.readout, str) and more > _UNEQUAL:
            warn(
                f"fit: the largest class has {100 * more:.0f} % more frames than the smallest and "
                "may be favoured; record as many of each (in Python, "
                "Majority(class_weight='balanced') counts classes alike)",
            )

    @needs("readout", "add", "a read-out that learns batch by batch")
    def partial_fit(self, frames: Any, y: Any, classes: Any = None) -> Self:
        """Learn a further batch of frames; a new label becomes a new class.

        An encoder that learns, such as a reference, learns only from the first batch. A call that
        raises leaves the model unchanged.

        Args:
            frames: the batch.
            y: its labels.
            classes: all labels that may occur; a class without frames is never predicted.

        Raises:
            ValueError: as :meth:`fit`; for a label not among `classes`; or after
                :meth:`recalibrate`, since the prototypes no longer follow from the counters.
            AttributeError: if the read-out needs all frames at once; ``hasattr`` is then False.
        """
        head: Head | None = vars(self).get("_head")
        if head is not None and head.recalibrated:
            raise ValueError(
                "partial_fit: expected a model that was not recalibrated; fit anew"
            )
        columns = inputs.columns_of(frames)
        frames = source(frames) if head is None else self.encode(frames)
        inputs.check_any(frames)
        labels = inputs.label_array(y, len(frames)).tolist()
        allowed = labels
        if classes is not None:
            allowed = list(classes)  # a set, for example
            allowed = inputs.label_array(allowed, len(allowed)).tolist()
            inputs.check_among(labels, allowed)
        if head is None:
            readout = self.fresh("readout")
            self._learn(readout, frames, labels, inputs.classes_of(allowed), columns)
            return self
        with self._computing():
            self._head = head.with_classes(allowed).extended([frames], labels)
        return self

    # Adapting ------------------------------------------------------------------------------------

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
        words = self.encode(frames)
        inputs.check_any(words)
        labels = inputs.label_array(y, len(words)).tolist()
        inputs.check_among(labels, self._head.index)
        with self._computing():
            self._head = self._head.adapted(words, labels, options)
        return self

    def _check_used(self, given: Mapping[str, Any]) -> None:
        """Raise ValueError for a given argument that the read-out does not use."""
        defaults = inspect.signature(HDCClassifier.recalibrate).parameters
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
        self._check_columns(frames)
        frames = inputs.indexable(frames, self.frame_shape_)
        inputs.check_any(frames)
        inputs.check_shape(frames.shape[1:], self.frame_shape_)
        encoding = replace(self._encoding, encoder=self.encoder_.unlearned())
        with backends.computing(encoding.backend):
            encoding.encoder.zero(frames)
            words = joined(encoding.encoded(frames))
            found = len(self._head.scores(words).argmax(1).unique())
        if 2 * found < len(self.classes_):
            warn(
                f"rezero: the {len(frames)} frames are put into {found} of {len(self.classes_)} "
                "classes; they have to show all classes about as often as the training frames did, "
                "or the model is spoiled",
            )
        self._encoding = encoding
        return self

    # Files ---------------------------------------------------------------------------------------

    def _stored(self) -> tuple[dict[str, Any], Parts]:
        return self._head.stored()

    def _restore(self, readout: Any, header: Mapping[str, Any], tensors: Parts) -> None:
        _check_several(readout, header["classes"])
        self._head = Head.restored(readout, header, tensors, self.dimension_)


def _check_several(readout: Readout, classes: Sequence[inputs.Label]) -> None:
    """Raise ValueError for a single class, if the read-out needs two."""
    if len(classes) == 1 and not isinstance(readout, Updatable):
        raise ValueError(
            f"labels: expected at least two classes for {readout!r}, found one class, "
            f"{classes[0]!r}; the read-out 'majority' tells it from what is unknown"
        )
