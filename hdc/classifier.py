"""The hyperdimensional classifier: labels, an encoder, a read-out."""

from __future__ import annotations

import copy
import inspect
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
from hdc.availability import (
    available_unless,
    fixed,
    not_compared,
    renamed,
    whole_only,
    without_held_out,
    without_reference,
)
from hdc.bank import Bank
from hdc.conformal import RATE
from hdc.encoders import ENCODERS, Encoder, make_encoder
from hdc.estimator import Estimator
from hdc.learned import Learned
from hdc.learner import learn
from hdc.merging import check_kind, check_mergeable
from hdc.parameters import check_share
from hdc.prototypes import Counters
from hdc.readouts import READOUTS, Readout, make_readout

_UNEQUAL = 0.2  # share of more frames of a class that is warned of


class HDCClassifier(Estimator):
    """Classifier on packed hypervectors (Kitagawa et al., Opt. Express 32, 3209 (2024)).

    An encoder makes a hypervector of each frame, and a read-out scores the classes. The published
    form thresholds a frame at its own median. The prototype of a class is the bitwise majority of
    its hypervectors (Eq. 1). A query belongs to the class whose prototype is nearest in Hamming
    distance (Eqs. 2, 3), the first of equally near ones.

    Frames are [N, H, W] or [N, D]. A model of images also takes flattened ones and a single one,
    [H, W]. The columns of a data frame are those of training, in their order. Several threads may
    predict at once; while one trains the model, no other may use it. Start processes by ``spawn``:
    torch may hang in a forked one. With a read-out that counts, :meth:`fit` holds counters and up
    to 19 hypervectors per class, however many frames are given; others hold all hypervectors.

    Args:
        encoder: ``"median"`` as published, ``"quantile"``, ``"levels"``, ``"reference"``,
            ``"reference_levels"``, ``"deviation"`` or ``"smoothed"``; an object of
            :class:`hdc.encoders.Encoder`; or the dotted name of such a class.
        readout: ``"majority"`` as published, ``"counts"``, ``"ridge"``, ``"neighbours"``,
            ``"lda"``, ``"trained"`` or ``"kernel"``; an object of
            :class:`hdc.readouts.Readout`; or the dotted name of such a class. Prototypes are made
            with each, for :meth:`distances`. By ``"majority"`` and ``"counts"`` a class with more
            frames takes frames of the others, as published; to count classes alike:
            ``readout=Majority(balance=True)``.
        device: where frames are encoded and prototypes live.
        backend: ``"numpy"``, ``"compiled"`` (the same hypervectors and counts in less time, needs
            numba; ``"lda"`` may differ in last digits, :mod:`hdc.readouts.lda`), or
            ``"auto"``, by :func:`hdc.backends.choose_backend`. Not saved with the model.

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
    _learned: Learned

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

    def fit(self, frames: Any, y: Any) -> Self:
        """Learn from frames [N, H, W] or [N, D] and N labels y.

        Frames of one class alone make a model for :meth:`is_known`, of the read-outs majority,
        counts and neighbours. A call that raises leaves the model as it was.

        Raises:
            ValueError: for no frames, one class only where the read-out has to tell two apart,
                lengths that differ, pixels that are not finite, labels other than str, int, float
                or bool, or an unknown parameter value.
        """
        trained = self._untrained()
        for _ in trained._train(frames, y):
            pass
        trained._learned.settle()
        trained._warn_of_unequal()
        self._adopt(trained)
        return self

    def _warn_of_unequal(self) -> None:
        """Warn of larger classes, which a read-out that was given by name may favour."""
        more = max(self.counts_) / min(self.counts_) - 1
        if isinstance(self.readout, str) and more > _UNEQUAL:
            warnings.warn(
                f"fit: the largest class has {more:.0%} more frames than the smallest and may be "
                "favoured; record as many of each (in Python, Majority(balance=True) counts "
                "classes alike)",
                stacklevel=3,
            )

    def train(self, frames: Any, y: Any) -> Iterator[dict[str, float]]:
        """:meth:`fit`, yielding ``{"samples_seen": n}`` whenever there is a model to predict with.

        `frames` may be anything with ``shape`` and batches ``frames[a:b]``.
        """
        trained = self._untrained()
        for seen in trained._train(frames, y):
            trained._learned.settle()
            self._adopt(trained)
            yield {"samples_seen": seen}

    def _train(self, frames: Any, y: Any) -> Iterator[int]:
        """Learn, untrained so far; yield as :func:`hdc.learner.learn`."""
        frames, labels = self._samples(frames, y)
        inputs.check_discrete(labels)
        self._learn_encoder(frames)
        self._start(inputs.classes_of(labels).tolist())
        yield from learn(self, self._learned, frames, labels)

    @available_unless(whole_only)
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
        model = self if self._has_learned() else self._untrained()
        frames, labels = model._samples(frames, y)
        allowed = labels
        if classes is not None:
            allowed = list(classes)  # in any order, such as that of a set
            allowed = inputs.label_array(allowed, len(allowed)).tolist()
            inputs.check_among(labels, allowed)
        known = self._learned.index if self._has_learned() else ()
        inputs.classes_of([*known, *allowed])
        if model is not self:
            model._learn_encoder(frames)
            model._start(inputs.classes_of(allowed).tolist())
        words = torch.cat(list(model._encoded(frames)))
        model._learned.make_room_for(allowed)
        model._learned.add(words, labels, model._backend(frames))
        model._learned.settle()
        if model is not self:
            self._adopt(model)
        return self

    @available_unless(whole_only)
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
        check_kind(self, other)
        other._check_is_trained()
        merged = copy.copy(self) if self._has_learned() else self._untrained()
        if merged._has_learned():
            check_mergeable(merged, other)
        else:
            merged._columns = other._columns
            merged._take_encoder(other)
            merged._start(other.classes_.tolist())
        merged._learned = merged._learned.merged(other._learned)
        self._adopt(merged)
        return self

    def _has_learned(self) -> bool:
        return hasattr(self, "_learned")

    def _samples(self, frames: Any, y: Any) -> tuple[Any, list[inputs.Label]]:
        """Frames with a shape, and their labels; at least one."""
        self._check_parameters()
        frames = self._checked_frames(frames)
        labels = inputs.label_array(y, len(frames)).tolist()
        if not labels:
            raise ValueError("frames: expected at least one frame, found none")
        return frames, labels

    def _start(self, classes: Sequence[inputs.Label]) -> None:
        """Be ready to learn hypervectors of these classes."""
        readout = make_readout(self.readout).unlearned()
        self._learned = Learned(readout, classes, self.dimension_, self.device)

    # Adapting ------------------------------------------------------------------------------------

    @available_unless(fixed)
    def recalibrate(
        self,
        frames: Any,
        y: Any = None,
        p: float = 0.5,
        seed: int = 0,
        method: str | None = None,
    ) -> Self:
        """Adapt to a changed environment by new frames with labels.

        Classes without new frames keep their prototypes, and a warning lists them: a drift that all
        classes share costs them accuracy. :meth:`is_known` compares with the new frames.
        ``partial_fit`` and ``merge`` refuse a recalibrated model. Ridge regression moves its
        weights to fit the new frames; neighbours exchange the kept frames for the new ones of their
        classes. Neither depends on p. The read-outs lda and kernel mix their old discriminants with
        those of the new frames. :meth:`rezero` needs no labels.

        Args:
            frames: frames of the changed environment, of the shapes that :meth:`fit` takes.
            y: their labels.
            p: probability that a bit is replaced, or share of the new votes or discriminants.
            seed: of the choice of bits that are replaced. Each recalibration of a model draws its
                own; the model and its file count them.
            method: ``"replace"`` as published, for binary prototypes only, or ``"merge"``, by
                votes (:func:`hdc.prototypes.merged`), which recovers more. By default the former,
                or for counts the latter.

        Raises:
            ValueError: if p is outside [0, 1], or 1 with new frames of a single class for lda and
                kernel; if a label is not among ``classes_``, bits are to be replaced of a class
                that has no training frames, or the read-out does not use an argument.
            AttributeError: for a read-out that does not adapt; ``hasattr`` is False.
        """
        self._check_is_trained()
        if y is None:
            raise ValueError(
                "recalibrate: expected labels y, found None; without labels: rezero(frames)"
            )
        options = {"p": p, "seed": seed, "method": method}
        self._check_used(options)
        frames, labels = self._samples(frames, y)
        inputs.check_among(labels, self._learned.index)
        words = torch.cat(list(self._encoded(frames)))
        # A copy: a call that raises leaves the model as it was.
        backend = self._backend(frames)
        self._learned = self._learned.adapted(words, labels, options, backend)
        return self

    def _check_used(self, given: Mapping[str, Any]) -> None:
        """Raise ValueError for an argument of :meth:`recalibrate` that the read-out ignores."""
        defaults = inspect.signature(HDCClassifier.recalibrate).parameters
        for name, value in given.items():
            default = defaults[name].default
            if name not in self.readout_.adapts_by and value != default:
                raise ValueError(
                    f"{name}: expected {default!r} with the read-out {self.readout_!r}, which "
                    f"does not use it, found {value!r}"
                )

    @available_unless(without_reference)
    def rezero(self, frames: Any) -> Self:
        """Adapt a model with a reference to a changed environment by new frames without labels.

        The reference becomes the mean of the new standardised frames. The new frames have to show
        all classes about as often as the frames of the old reference. Frames of one class can spoil
        the model; a warning appears if the model puts them into few classes. Frames without a touch
        do not help: ten of them improved no model in the study of drift.

        Args:
            frames: frames of the changed environment, of the shapes that :meth:`fit` takes.

        Raises:
            ValueError: for no frames, or frames of another shape; the model stays as it was.
            AttributeError: for an encoder without a reference; ``hasattr`` is False.
        """
        self._check_is_trained()
        frames = self._checked_frames(frames)
        if len(frames) == 0:
            raise ValueError("frames: expected at least one frame, found none")
        inputs.check_shape(frames.shape[1:], self.frame_shape_, type(self).__name__)
        moved: Any = copy.copy(self)
        moved.encoder_ = copy.copy(moved.encoder_).zero(frames)
        found = len(set(moved.predict(frames).tolist()))
        if 2 * found < len(self.classes_):
            warnings.warn(
                f"rezero: the {len(frames)} frames are put into {found} of {len(self.classes_)} "
                "classes; they have to show the classes as the training frames did, or the model "
                "is spoilt",
                stacklevel=2,
            )
        self.encoder_ = moved.encoder_
        return self

    # Answers -------------------------------------------------------------------------------------

    @renamed("reject", "is_known(frames, alpha), which says what is to be rejected")
    def predict(self, frames: Any) -> np.ndarray:
        """Labels [Q] of frames [Q, H, W] or [Q, D], or of a single image [H, W]."""
        self._check_is_trained()
        labels = []
        for words in self._encoded(frames):
            rows = self._scores_of(words).argmax(1).numpy(force=True)
            labels.append(self.classes_[rows])
        return np.concatenate(labels)

    @available_unless(not_compared)
    def predict_set(self, frames: Any, alpha: float = RATE) -> list[np.ndarray]:
        """The classes that each of Q frames may be of: Q arrays of labels.

        The set of a frame that is like none of the classes is empty; any other contains the label
        of :meth:`predict`. With majority and counts, a set contains the right label with
        probability 1 − alpha at least (full conformal prediction), if the frame is exchangeable
        with the training frames of its class. This holds for each class with 1/alpha − 1 training
        frames or more, and for smaller classes together. Other read-outs compare scores with those
        of training frames that were left out. That covers about 1 − alpha, without a guarantee
        (:mod:`hdc.conformal`). A class with fewer frames than 1/alpha − 1 and than 4 is in every
        set. Nothing is promised after drift.

        Args:
            frames: the queries.
            alpha: share of the sets that may lack the right label.

        Raises:
            ValueError: for a share outside (0, 1), or a model that has no frames to compare with;
                it says so.
        """
        share = check_share("alpha", alpha, "(0, 1)")
        self._check_is_trained()
        conformal = self._learned.conformal()
        sets = []
        for words in self._encoded(frames):
            possible = conformal.possible(words, self._scores_of(words), share)
            sets += [self.classes_[row] for row in possible]
        return sets

    @available_unless(not_compared)
    @renamed("reject", "alpha")
    def is_known(self, frames: Any, alpha: float = RATE) -> np.ndarray:
        """Whether frames are like those of some class: bool [Q].

        False where :meth:`predict_set` is empty. This refuses a share `alpha` of new frames of
        known classes at most, if they come as the training frames did. Noise, black frames and
        objects that were not trained are refused if there are 1/alpha training frames, and 4 of
        each class (or 1/alpha − 1 of it).

        Args:
            frames: the queries.
            alpha: share of frames of known classes that may be refused.

        Raises:
            ValueError: as :meth:`predict_set`.
        """
        share = check_share("alpha", alpha, "(0, 1)")
        self._check_is_trained()
        conformal = self._learned.conformal()
        parts = [
            conformal.p_values(words, self._scores_of(words), share).max(1) > share
            for words in self._encoded(frames)
        ]
        return np.concatenate(parts)

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """Labels [Q] of frames of a bank by a model like this one, trained on others of them.

        This model is left as it is. `train` and `queries` are indices of frames.
        """
        trained = self._untrained().fit(bank.at(train), bank.labels[train])
        return trained.predict(bank.at(queries))

    def score(self, frames: Any, y: Any) -> float:
        """Fraction of frames whose predicted label is right.

        Raises:
            ValueError: as :meth:`predict`, or for labels of another kind than those of training,
                such as the text "0" beside the number 0.
        """
        predicted = self.predict(frames).tolist()
        labels = inputs.label_array(y, len(predicted)).tolist()
        inputs.check_one_kind([*labels, *self.classes_.tolist()])
        right = [a == b for a, b in zip(predicted, labels, strict=True)]
        return float(np.mean(right))

    def decision_function(self, frames: Any) -> np.ndarray:
        """The scores of the read-out, [Q, L], the largest wins.

        For two classes the difference [Q], positive for the second. Scores in whole numbers are
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

    @available_unless(without_held_out)
    def predict_proba(self, frames: Any) -> np.ndarray:
        """Probabilities of the classes, float64 [Q, L]: the softmax of the scores.

        Its temperature is fitted to training frames scored as if each had not been learnt
        (:mod:`hdc.probability`). Closed forms give these scores: of up to 19 frames per class for
        majority, counts and neighbours, of all for ridge, of 400 or all for lda and kernel, with 19
        of each class that has them. Other read-outs need five folds of the training frames, when
        first asked or saved. New frames, by :meth:`partial_fit` or :meth:`recalibrate`, have it
        fitted anew.

        Raises:
            ValueError: for training with one frame of each class, or a model that must be fitted
                anew to have probabilities; it says so.
            AttributeError: for a read-out of one's own that learns batch by batch and has no
                ``held_out``; ``hasattr`` is False.
        """
        self._check_is_trained()
        temperature = self._learned.temperature()
        known = self._learned.counts > 0
        parts = [
            temperature.probabilities(self._scores_of(words), known)
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
    def classes_(self) -> np.ndarray:
        return self._trained.labels

    @property
    def readout_(self) -> Readout:
        return self._trained.readout

    @property
    def counters_(self) -> Counters:
        return self._trained.majority.counters_

    @property
    def prototypes_(self) -> Tensor:
        return self._trained.majority.prototypes_

    @property
    def counts_(self) -> np.ndarray:
        return self.counters_.n.numpy()

    @property
    def _trained(self) -> Learned:
        if not self._has_learned():
            raise AttributeError(
                f"{type(self).__name__}: expected a trained model; call fit first"
            )
        return self._learned

    def _check_counts(self, action: str) -> None:
        """Raise ValueError for a trained model whose prototypes are not those of its frames."""
        if not self._has_learned():
            return
        self._check_is_trained()
        if self._learned.recalibrated:
            raise ValueError(
                f"{action}: expected a model that was not recalibrated; fit anew"
            )

    def _scores_of(self, words: Tensor) -> Tensor:
        return self._learned.scores(words, self._backend())

    def _distances_of(self, words: Tensor) -> Tensor:
        return self._learned.distances(words, self._backend())

    # Files ---------------------------------------------------------------------------------------

    def _stored(self) -> tuple[dict[str, Any], dict[str, Tensor]]:
        return self._learned.stored()

    def _restore(self, header: Mapping[str, Any], tensors: dict[str, Tensor]) -> None:
        classes = header["classes"]
        if not classes or inputs.classes_of(classes).tolist() != classes:
            raise ValueError(f"classes {classes!r}")
        self._start(classes)
        self._learned.restore(header, tensors)
