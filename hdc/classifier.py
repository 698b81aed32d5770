"""The hyperdimensional classifier: an encoder, and a read-out of its hypervectors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from math import prod
from typing import Any, ClassVar, Self

import numpy as np
from torch import Tensor

from hdc import backends, inputs
from hdc.adapting import Adapting
from hdc.availability import needs
from hdc.encoders import ENCODERS, Encoder, make_encoder
from hdc.estimator import joined
from hdc.head import Head
from hdc.hypervectors import Hypervectors
from hdc.readouts import READOUTS, Readout, Updatable, make_readout
from hdc.rejection import by_groups, of_words
from hdc.sample import Sample
from hdc.warning import warn

KNOWN = "known"
"""The class of training frames without labels."""
_UNEQUAL = 0.2  # share of more frames of a class that is warned of


class HDCClassifier(Adapting):
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
    parts: ClassVar = {"encoder": make_encoder, "readout": make_readout}
    _known: ClassVar = {"encoder": ENCODERS, "readout": READOUTS}

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
        columns, frames = inputs.columns_of(frames), inputs.source(frames)
        if y is None and isinstance(readout, Updatable):
            y = [KNOWN] * len(frames)
        labels = inputs.label_array(y, len(frames)).tolist()
        inputs.check_discrete(labels)
        together = None
        if groups is not None:
            together = inputs.label_array(groups, len(frames), "groups").tolist()
        classes = inputs.classes_of(labels)
        _check_several(readout, classes.tolist())
        self._learn(readout, frames, labels, classes, together)
        self.columns_ = columns
        self._warn_of_unequal(self._head.sample.seen.values())
        return self

    def _learn(
        self,
        readout: Readout,
        frames: Any,
        labels: Sequence[inputs.Label],
        classes: np.ndarray,
        together: Sequence[inputs.Label] | None = None,
    ) -> None:
        """Learn anew; some of the classes may have no frames if the read-out is updatable."""
        encoder, backend = self.fresh("encoder"), self._decided(frames)
        with backends.computing(backend):
            encoder, shape = self._learned_encoder(encoder, frames)
            words = self._batches(frames, encoder, shape)
            dimension = encoder.dimension(prod(shape))
            head = _learned(
                readout, words, labels, classes, dimension, self.device, together
            )
        self._begin(encoder, shape, dimension, backend)
        self._head = head

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
        frames = self._further(frames)
        labels = inputs.label_array(y, len(frames)).tolist()
        allowed = labels
        if classes is not None:
            allowed = list(classes)  # a set, for example
            allowed = inputs.label_array(allowed, len(allowed)).tolist()
            inputs.check_among(labels, allowed)
        if head is None:
            readout = self.fresh("readout")
            self._learn(readout, frames, labels, inputs.classes_of(allowed))
            return self
        with self._computing():
            words = self._encoded(frames)
            self._head = head.with_classes(allowed).extended(words, labels)
        return self

    # Files ---------------------------------------------------------------------------------------

    def _stored(self) -> tuple[dict[str, Any], dict[str, Tensor]]:
        return self._head.stored()

    def _restore(
        self, readout: Any, header: Mapping[str, Any], tensors: dict[str, Tensor]
    ) -> None:
        _check_several(readout, header["classes"])
        self._head = Head.restored(readout, header, tensors, self.dimension_)


def _check_several(readout: Readout, classes: Sequence[inputs.Label]) -> None:
    """Raise ValueError for a single class, if the read-out needs two."""
    if len(classes) == 1 and not isinstance(readout, Updatable):
        raise ValueError(
            f"labels: expected at least two classes for {readout!r}, found one class, "
            f"{classes[0]!r}; the read-out 'majority' tells it from what is unknown"
        )


def _learned(
    readout: Readout,
    batches: Iterable[Hypervectors],
    labels: Sequence[inputs.Label],
    classes: np.ndarray,
    dimension: int,
    device: str,
    together: Sequence[inputs.Label] | None,
) -> Head:
    """The head of a read-out that is trained on batches of hypervectors with N labels."""
    head = Head(readout, None, Sample(), classes, dimension)
    rows, n_classes = head.rows_of(labels), len(classes)
    calibrated = None
    if together is not None:
        words = joined(batches)
        batches = [words]
        calibrated, single = by_groups(words, rows, together, readout, n_classes)
        _warn_of_single_groups(classes[single].tolist())
    if isinstance(readout, Updatable):
        empty = replace(head, state=readout.empty(n_classes, dimension, device))
        return replace(empty.extended(batches, labels), calibrated=calibrated)
    words = joined(batches)
    state = readout.fit(words, rows, n_classes)
    sample = Sample(Counter(rows.tolist()))
    closed = type(readout).held_out is not Readout.held_out
    return replace(
        head,
        state=state,
        sample=sample,
        calibrated=calibrated or of_words(words, rows, n_classes),
        training=None if closed or state.held_out is not None else (words, rows),
    )


def _warn_of_single_groups(labels: Sequence[inputs.Label]) -> None:
    """Warn of classes whose frames are of a single group."""
    if labels:
        named = ", ".join(map(repr, labels[:5]))
        warn(
            f"fit: groups: expected two or more of each class, found one of {named}; is_known is "
            "not calibrated for another group of these",
        )
