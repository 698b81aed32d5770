"""The hyperdimensional classifier: labels, an encoder, a read-out."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
from hdc.bank import Bank
from hdc.encoders import ENCODERS, make_encoder
from hdc.estimator import Estimator
from hdc.inputs import check_share
from hdc.parameters import available_unless, describe
from hdc.probability import probabilities
from hdc.prototypes import Counters
from hdc.readouts import READOUTS, Counting, Readout, Updatable, make_readout
from hdc.recalibration import Recalibrating
from hdc.rejection import RATE, p_values


def _whole_only(model: HDCClassifier) -> str | None:
    """Why the read-out of a model does not learn batch by batch, if it does not."""
    try:
        readout = make_readout(model.readout)
    except (TypeError, ValueError) as error:
        return str(error)
    if isinstance(readout, Updatable):
        return None
    return (
        f"expected a read-out that learns batch by batch, found {readout!r}, which needs all "
        "frames at once; fit anew"
    )


def _without_held_out(model: HDCClassifier) -> str | None:
    """Why a model has no probabilities, if it has none."""
    try:
        readout = make_readout(model.readout)
    except (TypeError, ValueError) as error:
        return str(error)
    own = type(readout).held_out is not Readout.held_out
    if own or not isinstance(readout, Updatable):
        return None
    return f"expected a read-out with a method held_out, found {readout!r}"


class HDCClassifier(Recalibrating):
    """Classifier on packed hypervectors (Kitagawa et al., Opt. Express 32, 3209 (2024)).

    An encoder makes a hypervector of each frame, a read-out scores the classes. As published, a
    frame is thresholded at its own median, a class prototype is the bitwise majority of its
    hypervectors (Eq. 1), and a query belongs to the class whose prototype is nearest in Hamming
    distance (Eqs. 2, 3), the first of equally near ones. With a read-out that counts, :meth:`fit`
    needs memory for a chunk of packed hypervectors, counters, and up to 19 hypervectors per class,
    however many frames are given; with others, all hypervectors are held.

    Frames are [N, H, W] or [N, D]; a model of images also takes flattened ones and a single one,
    [H, W]; the columns of a data frame are those of training, in their order. Several threads may
    ask a model at once; while one trains it, no other may use it. Start processes by ``spawn``:
    torch may hang in a forked one.

    Args:
        encoder: ``"median"`` as published, ``"quantile"``, ``"levels"``, ``"reference"``,
            ``"reference_levels"``, ``"deviation"`` or ``"smoothed"``; an object of
            :class:`hdc.encoders.Encoder`; or the dotted name of such a class.
        readout: ``"majority"`` as published, ``"counts"``, ``"ridge"``, ``"neighbours"``,
            ``"lda"``, ``"trained"`` or ``"kernel"``; an object of
            :class:`hdc.readouts.Readout`; or the dotted name of such a class. Prototypes are made
            with each, for :meth:`distances` and :meth:`is_known`.
        device: where frames are encoded and prototypes live.
        backend: ``"numpy"``, ``"compiled"`` (the same hypervectors and counts in less time, needs
            numba; ``"lda"`` may differ in last digits, :mod:`hdc.readouts.lda`), or
            ``"auto"``, by :func:`hdc.bits.choose_backend`. Not saved with the model.

    Parameters of the parts are ``encoder__ties``, ``readout__balance`` and so on.

    Attributes:
        encoder_, readout_: the parts, trained.
        classes_: array [L] of the labels, sorted: str, int, float or bool.
        counts_: int64 array [L], training samples per class; votes after a recalibration by votes.
        prototypes_: int64 tensor [L, W], the packed prototypes; zeros for a class without samples.
        n_features_in_: pixels of a frame.
        dimension_: D, bits of a hypervector.
        frame_shape_: (H, W) or (pixels,).
        counters_: the counts, :class:`hdc.prototypes.Counters`.
        metadata_: values that :meth:`save` was given to keep with the model.

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
        encoder: Any = "median",
        readout: Any = "majority",
        device: str = "cpu",
        backend: str = "auto",
    ):
        self.encoder = encoder
        self.readout = readout
        self.device = device
        self.backend = backend

    # Training ------------------------------------------------------------------------------------

    def fit(self, frames: Any, y: Any) -> Self:
        """Learn from frames [N, H, W] or [N, D] and N labels y.

        A call that raises leaves the model as it was.

        Raises:
            ValueError: for no frames, one class only, lengths that differ, pixels that are not
                finite, labels other than str, int, float or bool, or an unknown parameter value.
        """
        trained = self._untrained()
        for _ in trained._train(frames, y):
            pass
        trained._settle()
        self._adopt(trained)
        return self

    def train(self, frames: Any, y: Any) -> Iterator[dict[str, float]]:
        """:meth:`fit`, yielding ``{"samples_seen": n}`` whenever there is a model to predict with.

        `frames` may be anything with ``shape`` and batches ``frames[a:b]``.
        """
        trained = self._untrained()
        for seen in trained._train(frames, y):
            trained._settle()
            self._adopt(trained)
            yield {"samples_seen": seen}

    @available_unless(_whole_only)
    def partial_fit(self, frames: Any, y: Any, classes: Any = None) -> Self:
        """Learn a further batch of frames; a label not met before becomes a new class.

        An encoder that learns, such as a reference, has learned of the first batch alone. A call
        that raises leaves the model as it was.

        Args:
            frames: the batch.
            y: its labels.
            classes: all labels that may come; those without samples are never predicted.

        Raises:
            ValueError: as :meth:`fit`, for a label not among `classes`, or after
                :meth:`recalibrate`, whose prototypes are not those of counted frames.
            AttributeError: for a read-out that needs all frames at once; ``hasattr`` is False.
        """
        self._check_counts("partial_fit")
        model = self if hasattr(self, "readout_") else self._untrained()
        frames, labels = model._samples(frames, y)
        allowed = labels
        if classes is not None:
            allowed = inputs.label_array(classes, len(classes)).tolist()
            inputs.check_among(labels, allowed)
        inputs.classes_of([*getattr(self, "_index", ()), *allowed])
        if model is not self:
            model._start(frames, inputs.classes_of(allowed).tolist())
        words = torch.cat(list(model._encoded(frames)))
        model._make_room_for(allowed)
        rows = torch.tensor([model._index[label] for label in labels])
        model._add(words, rows, labels, model._backend(frames))
        model._settle()
        if model is not self:
            self._adopt(model)
        return self

    @available_unless(_whole_only)
    def merge(self, other: HDCClassifier) -> Self:
        """Learn what another model was trained on: bit for bit the model of all frames.

        Classes are united; parameters stay those of this model. A call that raises leaves the model
        as it was. Which frames :meth:`is_known` compares with is drawn anew.

        Raises:
            ValueError: for a model of another kind, frame shape or encoder, not trained, or
                recalibrated.
            AttributeError: as :meth:`partial_fit`.
        """
        for model in (self, other):
            model._check_counts("merge")
        mine, theirs = _kind(self), _kind(other)
        if mine != theirs:
            raise ValueError(f"merge: expected a {mine}, found a {theirs}")
        Estimator._check_is_trained(other)
        merged = self._copied() if hasattr(self, "readout_") else self._untrained()
        merged._merge(other)
        self._adopt(merged)
        return self

    def _merge(self, other: HDCClassifier) -> None:
        """:meth:`merge` of checked models; where it raises, this one is spoilt."""
        if not hasattr(self, "readout_"):
            self._columns = other._columns
            self._take_encoder(other)
            self._begin(other.classes_.tolist())
        inputs.check_shape(other.frame_shape_, self.frame_shape_, type(self).__name__)
        self._check_columns(other._columns)
        self._check_same_encoder(other)
        labels = other.classes_.tolist()
        self._make_room_for(labels)
        places = [self._index[label] for label in labels]
        for own, others in zip(self._updated(), other._updated(), strict=True):
            own.merge(others, places)
        self._sample.merge(other._sample)
        self._settle()

    def _copied(self) -> Self:
        """A model whose counts and frames are no longer those of this one."""
        copied = copy.copy(self)
        learned = self.readout_, self._majority, self._sample
        copied.readout_, copied._majority, copied._sample = copy.deepcopy(learned)
        return copied

    # Answers -------------------------------------------------------------------------------------

    def predict(self, frames: Any, reject: bool | float = False) -> np.ndarray:
        """Labels [Q] of frames [Q, H, W] or [Q, D], or of a single image [H, W].

        Args:
            frames: the queries.
            reject: answer None, in an array of objects, for a frame that :meth:`is_known` does not
                know: the share of frames of known classes that may be lost so; True for 5 %.
        """
        share = _rejected_share(reject)
        self._check_is_trained()
        labels = []
        for words in self._encoded(frames):
            rows = self._scores_of(words).argmax(1).numpy(force=True)
            found = self.classes_[rows]
            if share is not None:
                found = found.astype(object)
                likeness = p_values(self._known_peers(), words, share).max(1)
                found[likeness <= share] = None
            labels.append(found)
        return np.concatenate(labels)

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """Labels [Q] of frames of a bank by a model like this one, trained on others of them.

        This model is left as it is. `train` and `queries` are indices of frames.
        """
        trained = self._untrained().fit(bank.at(train), bank.labels[train])
        return trained.predict(bank.at(queries))

    def score(self, frames: Any, y: Any) -> float:
        """Fraction of frames whose predicted label is right."""
        predicted = self.predict(frames).tolist()
        labels = inputs.label_array(y, len(predicted)).tolist()
        right = [a == b for a, b in zip(predicted, labels, strict=True)]
        return float(np.mean(right))

    def decision_function(self, frames: Any) -> np.ndarray:
        """The scores of the read-out, [Q, L], the largest wins.

        Of two classes the difference [Q], positive for the second. Scores in whole numbers are
        divided by D: majority, trained and a single neighbour have minus the distance as a share of
        the bits.
        """
        self._check_is_trained()
        scores = [self._scores_of(words) for words in self._encoded(frames)]
        found = torch.cat(scores).numpy(force=True)
        if found.dtype.kind == "i":
            found = found / self.dimension_
        if found.shape[1] == 2:
            return found[:, 1] - found[:, 0]
        return found

    @available_unless(_without_held_out)
    def predict_proba(self, frames: Any) -> np.ndarray:
        """Probabilities of the classes, float64 [Q, L]: the softmax of the scores.

        Its temperature is fitted to training frames scored as if each had not been learnt
        (:mod:`hdc.probability`): in closed form, of up to 19 frames a class, for majority, counts
        and neighbours, of all for ridge and of up to 400 for lda and kernel; else by five folds of
        the training frames, when first asked. Files keep it, that of five folds if it was asked for
        before; new frames, by ``partial_fit`` or with labels by ``recalibrate``, have it fitted
        anew.

        Raises:
            ValueError: for training with one frame of each class, or a model that must be fitted
                anew to have probabilities; it says so.
            AttributeError: for a read-out of one's own that learns batch by batch and has no
                ``held_out``; ``hasattr`` is False.
        """
        self._check_is_trained()
        beta = self._known_sharpness()
        known = self._majority.counters_.n.cpu() > 0
        parts = [
            probabilities(self._scores_of(words), beta, known)
            for words in self._encoded(frames)
        ]
        return torch.cat(parts).numpy()

    def distances(self, frames: Any) -> np.ndarray:
        """Hamming distances int64 [Q, L] between queries and prototypes (Eq. 2).

        D + 1, farther than anything, from a class without samples.
        """
        self._check_is_trained()
        found = [self._distances_of(words) for words in self._encoded(frames)]
        return torch.cat(found).numpy(force=True)

    def state_tensors(self) -> dict[str, Tensor]:
        """The tensors that have to be stored to predict; they share memory with the model."""
        self._check_is_trained()
        return {**self.encoder_.state(), **self.readout_.state()}

    @property
    def counters_(self) -> Counters:
        return self._trained_majority.counters_

    @property
    def prototypes_(self) -> Tensor:
        return self._trained_majority.prototypes_

    @property
    def counts_(self) -> np.ndarray:
        return self.counters_.n.numpy()

    @property
    def _trained_majority(self) -> Counting:
        if not hasattr(self, "_majority"):
            raise AttributeError(
                f"{type(self).__name__}: expected a trained model; call fit first"
            )
        return self._majority

    def _check_same_encoder(self, other: HDCClassifier) -> None:
        mine, theirs = self.encoder_, other.encoder_
        if describe(mine, ENCODERS) != describe(theirs, ENCODERS):
            raise ValueError(f"merge: expected the encoder {mine!r}, found {theirs!r}")
        learned = theirs.state()
        for name, tensor in mine.state().items():
            if not torch.equal(tensor, learned[name]):
                raise ValueError(
                    f"merge: expected two encoders {mine!r} that have learned the same, found "
                    "two that have learned of different frames; fit anew on all of them"
                )

    def _scores_of(self, words: Tensor) -> Tensor:
        self.readout_.backend = self._backend()
        return self.readout_.scores(words)

    def _distances_of(self, words: Tensor) -> Tensor:
        self._majority.backend = self._backend()
        return self._majority.distances(words)


def _rejected_share(reject: bool | float) -> float | None:
    """The share of known frames that may be lost, of the argument of ``predict``; None: none."""
    if not isinstance(reject, bool | np.bool_):
        return check_share(reject)
    return RATE if reject else None


def _kind(model: HDCClassifier) -> str:
    """What two models must have in common to be merged, in words."""
    return f"{type(model).__name__} with read-out {make_readout(model.readout)!r}"
