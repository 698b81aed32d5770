"""The hyperdimensional classifier: labels, an encoder, a read-out."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import bits, inputs
from hdc.bank import Bank
from hdc.encoders import ENCODERS, Median, Quantile, Reference, make_encoder
from hdc.encoders.ranks import RankEncoder, ties_of
from hdc.estimator import CHUNK, Estimator, check_share
from hdc.inputs import Label
from hdc.io import check_tensors
from hdc.parameters import available_unless, describe
from hdc.readouts import READOUTS, Counting, Counts, Majority, Updatable, make_readout
from hdc.readouts.base import Readout
from hdc.rejection import KEPT, RATE, Peers, Sample, p_values


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


def _fixed(model: HDCClassifier) -> str | None:
    """Why a model does not adapt to new frames in any way, if it does not."""
    try:
        readout, encoder = make_readout(model.readout), make_encoder(model.encoder)
    except (TypeError, ValueError) as error:
        return str(error)
    if hasattr(readout, "adapt") or isinstance(encoder, Reference):
        return None
    return (
        f"expected another read-out than {readout!r}, or encoder 'reference'; fit anew"
    )


class HDCClassifier(Estimator):
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
        encoder: ``"median"`` as published, ``"quantile"``, ``"levels"`` or ``"reference"``; an
            object of :class:`hdc.encoders.Encoder`; or the dotted name of such a class.
        readout: ``"majority"`` as published, ``"counts"``, ``"ridge"``, ``"neighbours"``,
            ``"lda"`` or ``"trained"``; an object of :class:`hdc.readouts.Readout`; or the dotted
            name of such a class. Prototypes are made with each, for :meth:`distances` and
            :meth:`is_known`.
        device: where frames are encoded and prototypes live.
        backend: ``"numpy"``, ``"compiled"`` (the same bits in less time, needs numba), or
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

    classes_: np.ndarray
    readout_: Readout
    _majority: Counting  # prototypes for distances and rejection: the read-out's own, if it counts
    _index: dict[Label, int]  # label → row
    _sample: Sample
    _waiting: list[tuple[Tensor, Tensor]]
    """Hypervectors and rows of a read-out that wants all."""
    _peers: list[Peers | None] | None  # of sample and prototypes, made when asked for
    _recalibrated: bool

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

    def _train(self, frames: Any, y: Any) -> Iterator[int]:
        """Learn chunk by chunk; yield how many frames there were once all classes have one.

        A read-out that wants all hypervectors at once has them before the last yield.
        """
        frames, labels = self._samples(frames, y)
        classes = inputs.classes_of(labels)
        inputs.check_two_classes(classes)
        inputs.check_discrete(labels)
        self._start(frames, classes.tolist())
        backend = self._backend(frames)
        rows = torch.tensor([self._index[label] for label in labels])
        self._reserve(rows)
        words: Tensor | None = None
        for start in range(0, len(frames), CHUNK):
            part = self._chunk(frames, start)
            chosen = slice(start, start + CHUNK)
            if self._in_one_read(part, backend):
                self._add_in_one_read(part, rows[chosen], labels[chosen], start)
            else:
                # Memory for words is used again where nobody keeps them.
                room = words if isinstance(self.readout_, Counting) else None
                words = self._encode(part, start, backend, room)
                self._add(words, rows[chosen], labels[chosen], backend)
            seen = min(start + CHUNK, len(frames))
            if seen == len(frames):
                self._fit_waiting(backend)
            elif self._waiting:
                continue
            if (self._majority.counters_.n > 0).all():
                yield seen

    def _reserve(self, rows: Tensor) -> None:
        """Make room once for all that will be counted."""
        self._majority.counters_.reserve(int(torch.bincount(rows).max()))

    def _samples(self, frames: Any, y: Any) -> tuple[Any, list[Label]]:
        """Frames with a shape, and their labels; at least one."""
        self._check_parameters()
        frames = self._given(frames, training=True)
        labels = inputs.label_array(y, len(frames)).tolist()
        if not labels:
            raise ValueError("frames: expected at least one frame, found none")
        return frames, labels

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
        frames, labels = self._samples(frames, y)
        allowed = labels
        if classes is not None:
            allowed = inputs.label_array(classes, len(classes)).tolist()
            inputs.check_among(labels, allowed)
        inputs.classes_of([*getattr(self, "_index", ()), *allowed])
        model = self if hasattr(self, "readout_") else self._untrained()
        if model is not self:
            model._columns = self._columns
            model._start(frames, inputs.classes_of(allowed).tolist())
        words = torch.cat(list(model._encoded(frames)))
        model._know(allowed)
        rows = torch.tensor([model._index[label] for label in labels])
        model._add(words, rows, labels, model._backend(frames))
        model._settle()
        if model is not self:
            self._adopt(model)
        return self

    @available_unless(_whole_only)
    def merge(self, other: HDCClassifier) -> Self:
        """Learn what another model was trained on: bit for bit the model of all frames.

        Classes are united; parameters stay those of this model.

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
        if not hasattr(self, "readout_"):
            self._columns = other._columns
            self._take_encoder(other)
            self._begin(other.classes_.tolist())
        inputs.check_shape(other.frame_shape_, self.frame_shape_, type(self).__name__)
        self._check_columns(other._columns)
        self._check_same_encoder(other)
        labels = other.classes_.tolist()
        self._know(labels)
        places = [self._index[label] for label in labels]
        for own, others in zip(self._updated(), other._updated(), strict=True):
            own.merge(others, places)
        self._sample.merge(other._sample)
        self._settle()
        return self

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

        With labels: classes without new frames stay as they are; :meth:`is_known` compares with the
        new frames; ``partial_fit`` and ``merge`` refuse a recalibrated model. Ridge regression goes
        from its old weights to those near them that fit the new frames, neighbours take the new
        frames in place of the kept ones of their classes; neither depends on p.

        Without labels, a model with a reference (``encoder="reference"``) is zeroed again: the
        reference becomes the mean of the new standardised frames, and prototypes stay. The new
        frames have to show what the frames of the old reference showed: all classes about as often,
        or, where the reference was a frame without a touch, no touch. With frames of one class the
        model is spoilt; a warning says so where the model puts them into few classes.

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
        adapt = getattr(self.readout_, "adapt", None)
        if adapt is None:
            raise ValueError(
                f"recalibrate: expected another read-out than {self.readout_!r}"
            )
        frames, labels = self._samples(frames, y)
        inputs.check_among(labels, self._index)
        words = torch.cat(list(self._encoded(frames)))
        rows = torch.tensor([self._index[label] for label in labels])
        changed: Any = copy.copy(self.readout_)
        counting = self._majority is self.readout_
        changed.backend = self._backend(frames)
        changed.adapt(words, rows, p, seed, method)
        majority = changed
        if not counting:
            majority = copy.copy(self._majority)
            majority.adapt(words, rows, p, seed, method)
        sample = Sample()
        sample.add(words, labels)
        for label in set(labels):
            self._sample.put(label, sample.of(label), sample.seen[label])
        self.readout_, self._majority = changed, majority
        self._recalibrated, self._peers = True, None
        return self

    def _zero(self, frames: Any) -> Self:
        """Take the mean of new frames as the reference of the encoder."""
        if not isinstance(self.encoder_, Reference):
            raise ValueError(
                f"recalibrate: expected labels y, or a model with encoder 'reference' to be zeroed "
                f"without any, found {self.encoder_!r}"
            )
        frames = self._given(frames)
        if len(frames) == 0:
            raise ValueError("frames: expected at least one frame, found none")
        inputs.check_shape(frames.shape[1:], self.frame_shape_, type(self).__name__)
        encoder = copy.copy(self.encoder_).zero(frames)
        before, self.encoder_ = self.encoder_, encoder
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
            found = self.classes_[self._scores_of(words).argmax(1).numpy(force=True)]
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
        return float(np.mean([a == b for a, b in zip(predicted, labels, strict=True)]))

    def predict_set(self, frames: Any, alpha: float = 0.1) -> list[np.ndarray]:
        """The classes that each of Q frames may be of: Q arrays of labels.

        For fresh frames exchangeable with the training frames of their class, the set has the right
        label with probability 1 − alpha at least (:mod:`hdc.rejection`). It is empty for a frame
        that is like none of the classes.

        Raises:
            ValueError: as :meth:`is_known`.
        """
        share = check_share(alpha)
        possible = self._p_values(frames, share) > share
        return [self.classes_[row] for row in possible]

    def is_known(self, frames: Any, reject: float = RATE) -> np.ndarray:
        """Whether frames are as near to a prototype as frames of its class are: bool [Q].

        False where :meth:`predict_set` is empty: for a share `reject` of fresh frames of known
        classes at most, if they come as the training frames did, and for noise, a black frame or an
        object that was not trained, as long as there are 1/reject training frames.

        Raises:
            ValueError: for a share outside (0, 1).
        """
        share = check_share(reject)
        return self._p_values(frames, share).max(1) > share

    def decision_function(self, frames: Any) -> np.ndarray:
        """The scores of the read-out, [Q, L], the largest wins.

        Of two classes the difference [Q], positive for the second. Majority and neighbours have
        minus the distance as a share of the bits.
        """
        self._check_is_trained()
        scores = [self._scores_of(words) for words in self._encoded(frames)]
        found = torch.cat(scores).numpy(force=True)
        if found.dtype.kind == "i":
            found = found / self.dimension_
        return found[:, 1] - found[:, 0] if found.shape[1] == 2 else found

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

    @classmethod
    def components(
        cls, encoder: Any = "median", readout: Any = "majority", **_: Any
    ) -> tuple[type, ...]:
        """The classes of the parts that such parameters give by name."""
        given = {"encoder": encoder, "readout": readout}
        named = [name for name in given if isinstance(given[name], str)]
        return tuple(type(cls.parts[name](given[name])) for name in named)

    @property
    def counters_(self) -> Any:
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

    # Files ---------------------------------------------------------------------------------------

    def _stored(self) -> tuple[dict[str, Any], dict[str, Tensor]]:
        classes = self.classes_.tolist()
        seen = [self._sample.seen.get(label, 0) for label in classes]
        kept = [
            self._sample.of(label) for label in classes if label in self._sample.seen
        ]
        tensors = {"sample": torch.cat(kept)}
        tensors |= _prefixed("readout", self.readout_.stored())
        if self._majority is not self.readout_:
            tensors |= _prefixed("majority", self._majority.stored())
        header = {
            "classes": classes,
            "seen": seen,
            "recalibrated": self._recalibrated,
        }
        return header, tensors

    def _restore(self, header: Mapping[str, Any], tensors: dict[str, Tensor]) -> None:
        classes = header["classes"]
        if inputs.classes_of(classes).tolist() != classes or len(classes) < 2:
            raise ValueError(f"classes {classes!r}")
        self._begin(classes)
        self._restore_sample(header["seen"], tensors["sample"])
        groups = {"readout": self.readout_}
        if self._majority is not self.readout_:
            groups["majority"] = self._majority
        for name in tensors:
            if name != "sample" and name.partition(".")[0] not in groups:
                raise ValueError(f"a tensor {name!r}")
        for prefix, part in groups.items():
            own = _without_prefix(prefix, tensors)
            part.restore(own, len(classes), self.dimension_)
        self._recalibrated = bool(header["recalibrated"])

    def _restore_sample(self, seen: Any, words: Tensor) -> None:
        """Keep the hypervectors of a file, of so many that each class has seen."""
        kept = [min(count, KEPT) for count in seen]
        if min(kept) < 0:
            raise ValueError(f"seen {seen!r}")
        width = bits.words_for(self.dimension_)
        check_tensors({"sample": words}, {"sample": (sum(kept), width)})
        bits.check_padding(words, self.dimension_)
        parts = words.split(kept)
        for label, part, n_seen in zip(self._index, parts, seen, strict=True):
            if n_seen:
                self._sample.put(label, part, n_seen)

    # Parts ---------------------------------------------------------------------------------------

    def _check_counts(self, action: str) -> None:
        """Raise ValueError for a trained model whose prototypes are not those of its frames."""
        if not hasattr(self, "readout_"):
            return
        Estimator._check_is_trained(self)
        if self._recalibrated:
            raise ValueError(
                f"{action}: expected a model that was not recalibrated; fit anew"
            )

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

    def _check_is_trained(self) -> None:
        super()._check_is_trained()
        inputs.check_two_classes(self.classes_)

    def _start(self, frames: Any, classes: Sequence[Label]) -> None:
        """Be ready to learn such frames of these classes."""
        self._learn_encoder(frames)
        self._begin(classes)

    def _begin(self, classes: Sequence[Label]) -> None:
        """Be ready to count for these classes, with an encoder that has learned."""
        self.readout_ = make_readout(self.readout).unlearned()
        self.classes_ = inputs.label_array(classes, len(classes))
        self._index = {label: row for row, label in enumerate(self.classes_.tolist())}
        counting = isinstance(self.readout_, Counting)
        self._majority = self.readout_ if counting else Majority()  # type: ignore[assignment]
        self._majority.start(len(classes), self.dimension_, self.device)
        if isinstance(self.readout_, Updatable) and not counting:
            none = self._majority.prototypes_[:0]
            rows = torch.empty(0, dtype=torch.int64)
            self.readout_.fit(none, rows, len(classes), self.dimension_)
        self._sample, self._peers, self._waiting = Sample(), None, []
        self._recalibrated = False

    def _know(self, labels: Iterable[Label]) -> None:
        """Make room for the labels that are new, in the order of classes."""
        if all(label in self._index for label in labels):
            return
        classes = inputs.classes_of([*self._index, *labels])
        index = {label: row for row, label in enumerate(classes.tolist())}
        places = [index[label] for label in self._index]
        for part in self._updated():
            part.arrange(places, len(index))
        self._index, self.classes_ = index, classes

    def _updated(self) -> list[Updatable]:
        """The parts that learn batch by batch, each once."""
        parts: list[Updatable] = [self._majority]
        if isinstance(self.readout_, Updatable) and self.readout_ is not self._majority:
            parts.append(self.readout_)
        return parts

    def _add(
        self, words: Tensor, rows: Tensor, labels: Sequence[Label], backend: str
    ) -> None:
        """Learn hypervectors [N, W] of N labels, which have these rows."""
        for part in self._updated():
            part.backend = backend
            part.add(words, rows)
        if not isinstance(self.readout_, Updatable):
            self._waiting.append((words, rows))
        self._sample.add(words, labels)

    def _in_one_read(self, frames: Any, backend: str) -> bool:
        """Whether compiled kernels encode and count such frames in one read of them."""
        if backend != "compiled" or not isinstance(frames, Tensor):
            return False
        ours = type(self.encoder_) in (Median, Quantile)
        counted = type(self.readout_) in (Majority, Counts)
        return ours and counted and frames.dtype == torch.uint8 and self.dimension_ > 1

    def _add_in_one_read(
        self, frames: Tensor, rows: Tensor, labels: Sequence[Label], first: int
    ) -> None:
        """:meth:`_add` of 8-bit frames, of whose hypervectors only those of the sample are kept."""
        assert isinstance(self.encoder_, RankEncoder)
        inputs.check_shape(frames.shape[1:], self.frame_shape_, type(self).__name__)
        chosen = self._sample.choose(labels)
        (n_ones,) = self.encoder_.ones(self.n_features_in_)
        kept, equal, split = self._majority.add_frames(
            frames, rows, list(chosen), n_ones, self.encoder_.ties
        )
        self._sample.keep(chosen, kept)
        counted = torch.from_numpy(equal), torch.from_numpy(split)
        ties = ties_of(*counted, self.n_features_in_)
        self.encoder_.warn(ties, self.n_features_in_, first)

    def _fit_waiting(self, backend: str) -> None:
        """Have a read-out learn that wants all hypervectors at once."""
        if not self._waiting:
            return
        words, rows = (torch.cat(parts) for parts in zip(*self._waiting, strict=True))
        self._waiting = []
        self.readout_.backend = backend
        self.readout_.fit(words, rows, len(self.classes_), self.dimension_)

    def _settle(self) -> None:
        for part in self._updated():
            part.settle()
        self._peers = None

    def _scores_of(self, words: Tensor) -> Tensor:
        self.readout_.backend = self._backend()
        return self.readout_.scores(words)

    def _distances_of(self, words: Tensor) -> Tensor:
        self._majority.backend = self._backend()
        return self._majority.distances(words)

    # Rejection -----------------------------------------------------------------------------------

    def _p_values(self, frames: Any, alpha: float) -> np.ndarray:
        self._check_is_trained()
        parts = [
            p_values(self._known_peers(), words, alpha)
            for words in self._encoded(frames)
        ]
        return np.concatenate(parts)

    def _known_peers(self) -> list[Peers | None]:
        peers = self._peers  # another thread may be making them, too, and of the same
        if peers is None:
            prototypes, sample = self._majority.deciding(), self._sample
            peers = [
                Peers.of(sample.of(label), prototypes[c])
                if sample.seen.get(label)
                else None
                for c, label in enumerate(self.classes_.tolist())
            ]
            self._peers = peers
        return peers


def _rejected_share(reject: bool | float) -> float | None:
    """The share of known frames that may be lost, of the argument of ``predict``; None: none."""
    if not isinstance(reject, bool | np.bool_):
        return check_share(reject)
    return RATE if reject else None


def _kind(model: HDCClassifier) -> str:
    """What two models must have in common to be merged, in words."""
    return f"{type(model).__name__} with read-out {make_readout(model.readout)!r}"


def _prefixed(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {f"{prefix}.{name}": tensor for name, tensor in tensors.items()}


def _without_prefix(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    start = f"{prefix}."
    return {
        name.removeprefix(start): tensor
        for name, tensor in tensors.items()
        if name.startswith(start)
    }
