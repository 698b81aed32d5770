"""The hyperdimensional classifier: count bits per class, keep their majority, compare."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from hdc import bits, inputs, io, planes
from hdc.bank import Bank, Selection
from hdc.encode import warn_of_constant
from hdc.estimator import CHUNK, Estimator, check_share
from hdc.inputs import Label
from hdc.prototypes import Counters, check_probability, merged, replaced_bits
from hdc.readout import Ridge, cosines, ridge
from hdc.rejection import EXTRAS, KEPT, RATE, Peers, Sample, deciding, p_values

PROTOTYPES = ("binary", "integer")
READOUTS = ("prototype", "ridge", "neighbours")
METHODS = ("replace", "merge")


class HDCClassifier(Estimator):
    """Nearest-prototype classifier on packed hypervectors (Kitagawa et al., Opt. Express 32, 3209).

    A frame becomes a hypervector by thresholding at its own median (:func:`hdc.encode.encode`), a
    class prototype is the bitwise majority of its hypervectors (Eq. 1), and a query belongs to the
    class whose prototype is nearest in Hamming distance (Eqs. 2, 3), the first of equally near
    ones. :meth:`fit` needs memory for a chunk of packed hypervectors, counters, and up to 19
    hypervectors per class, however many frames are given.

    Frames are [N, H, W] or [N, D]; a model of images also takes flattened ones and a single one,
    [H, W]; the columns of a data frame are those of training, in their order. Several threads may
    ask a model at once; while one trains it, no other may use it. Start processes by ``spawn``:
    torch may hang in a forked one.

    Args:
        ties: a prototype bit with as many ones as zeros becomes ``"zero"`` (as published),
            ``"one"``, or, with ``"random"``, that of an extra random vector (Schmuck et al., ACM
            JETC 15, 32 (2019)).
        prototype: ``"binary"`` as published, or ``"integer"``: the counters themselves, compared
            by the cosine between 2·count − n and the bipolar query.
        readout: ``"prototype"`` as published; ``"ridge"``: ridge regression of ±1 per class on the
            same bits (:mod:`hdc.readout`); or ``"neighbours"``: the class of most of the
            `n_neighbours` nearest training frames, all of which are kept. Prototypes are made with
            each, for :meth:`distances` and :meth:`is_known`.
        balance: make classes of unequal size comparable. The majority raises a prototype's
            correlation with every frame, the more so the more frames it bundles, and a larger class
            takes frames of the others. With True, prototypes are made as if each class had as many
            frames as the smallest (:meth:`hdc.prototypes.Counters.thinned`); equal classes are as
            published. False is the published rule.
        n_neighbours: how many of the nearest frames vote; a tie goes to the nearest of them.
        seed: seed of the random vectors for ``ties="random"``, and of ``balance``.
        device: where frames are encoded and prototypes live.
        backend: ``"numpy"``, ``"compiled"`` (the same bits in less time, needs numba), or
            ``"auto"``, by :func:`hdc.bits.choose_backend`. Not saved with the model.

    Attributes:
        classes_: array [L] of the labels, sorted: str, int, float or bool.
        counts_: int64 array [L], training samples per class; votes after a recalibration by votes.
        prototypes_: int64 tensor [L, W], the packed prototypes; zeros for a class without samples.
        dimension_, n_features_in_: D, the pixels of a frame.
        frame_shape_: (H, W) or (D,).
        counters_: the counts, :class:`hdc.prototypes.Counters`.
        metadata_: values that :meth:`save` was given to keep with the model.

    Example:
        >>> frames = np.array([[9, 8, 1, 0], [8, 9, 0, 2], [0, 1, 9, 7], [1, 0, 8, 9]], np.uint8)
        >>> model = HDCClassifier().fit(frames, ["left", "left", "right", "right"])
        >>> model.predict(frames[:1])
        array(['left'], dtype='<U5')
    """

    _estimator_type = "classifier"
    _choices: Mapping[str, tuple[Any, ...]] = {
        "ties": bits.TIES, "prototype": PROTOTYPES, "readout": READOUTS, "balance": (True, False)
    }  # fmt: skip

    classes_: np.ndarray
    counters_: Counters
    prototypes_: Tensor
    ridge_: Ridge
    _index: dict[Label, int]  # label → row
    _size: (
        int | None
    )  # samples per class that prototypes count as; −1: none are made yet
    _sample: Sample
    _deciding: (
        Tensor | None
    )  # [L, 5, W], see rejection.EXTRAS, where counters do not tell them
    _peers: list[Peers | None] | None  # made of the last two when asked for
    _frames: (
        tuple[Tensor, list[Label]] | None
    )  # hypervectors [N, W] and labels of all frames
    _recalibrated: bool

    def __init__(
        self,
        ties: str = "zero",
        prototype: str = "binary",
        readout: str = "prototype",
        balance: bool = True,
        n_neighbours: int = 1,
        seed: int = 0,
        device: str = "cpu",
        backend: str = "auto",
    ):
        self.ties = ties
        self.prototype = prototype
        self.readout = readout
        self.balance = balance
        self.n_neighbours = n_neighbours
        self.seed = seed
        self.device = device
        self.backend = backend

    # Training ------------------------------------------------------------------------------------

    def fit(self, frames: Any, y: Any) -> Self:
        """Learn prototypes from frames [N, H, W] or [N, D] and N labels y.

        A call that raises leaves the model as it was.

        Raises:
            ValueError: for no frames, one class only, lengths that differ, pixels that are not
                finite, labels other than str, int, float or bool, or an unknown parameter value.
        """
        trained = self._untrained()
        for _ in trained._train(frames, y):
            pass
        trained._update_prototypes(range(len(trained.classes_)))
        self._adopt(trained)
        return self

    def train(self, frames: Any, y: Any) -> Iterator[dict[str, float]]:
        """:meth:`fit`, yielding ``{"samples_seen": n}`` whenever there is a model to predict with.

        `frames` may be anything with ``shape`` and batches ``frames[a:b]``.
        """
        trained = self._untrained()
        for seen in trained._train(frames, y):
            trained._update_prototypes(range(len(trained.classes_)))
            self._adopt(trained)
            yield {"samples_seen": seen}

    def _train(self, frames: Any, y: Any) -> Iterator[int]:
        """Count frames; yield how many there were once all classes have one, without prototypes."""
        frames, labels = self._samples(frames, y)
        classes = inputs.classes_of(labels)
        inputs.check_two_classes(classes)
        backend = self._backend(frames)
        words: Tensor | None = None
        for start in range(0, len(frames), CHUNK):
            part = self._chunk(frames, start)
            names = labels[start : start + CHUNK]
            if start == 0:  # room once for all that will come
                self._start(part.shape[1:])
                self._know(classes.tolist())
                self.counters_.reserve(max(Counter(labels).values()))
            encoded = isinstance(part, Selection) or part.dtype != torch.uint8
            kernels_read = backend == "compiled" and not encoded
            if kernels_read and self.readout == "prototype" and self.dimension_ > 1:
                self._add_in_one_read(part, names, start)
            else:
                words = self._encode(
                    part, start, backend, words if self._frames is None else None
                )
                self._add(words, names, backend)
            seen = min(start + CHUNK, len(frames))
            if self.readout == "ridge":
                if seen < len(frames):
                    continue
                assert self._frames is not None
                pairs, self._frames = self._targets(*self._frames), None
                self.ridge_, _ = ridge(*pairs, self.dimension_, backend=backend)
            if self._empty() is None:
                yield seen

    def _samples(self, frames: Any, y: Any) -> tuple[Any, list[Label]]:
        """Frames with a shape, and their labels; at least one."""
        self._check_parameters()
        frames = self._given(frames, training=True)
        labels = inputs.label_array(y, len(frames)).tolist()
        if not labels:
            raise ValueError("frames: expected at least one frame, found none")
        return frames, labels

    def partial_fit(self, frames: Any, y: Any, classes: Any = None) -> Self:
        """Add a batch of frames to the counters; a label not met before becomes a new class.

        A call that raises leaves the model as it was.

        Args:
            frames: the batch.
            y: its labels.
            classes: all labels that may come; those without samples are never predicted.

        Raises:
            ValueError: as :meth:`fit`, for a label not among `classes`, or after
                :meth:`recalibrate`, whose prototypes are not those of counted frames.
        """
        self._check_learns("partial_fit")
        frames, labels = self._samples(frames, y)
        allowed = labels
        if classes is not None:
            allowed = inputs.label_array(classes, len(classes)).tolist()
            inputs.check_among(labels, allowed)
        inputs.classes_of([*getattr(self, "_index", ()), *allowed])
        words = torch.cat(list(self._encoded(frames)))
        if not hasattr(self, "counters_"):
            self._start(frames.shape[1:])
        self._know(allowed)
        self._update_prototypes(self._add(words, labels, self._backend(frames)))
        return self

    def merge(self, other: HDCClassifier) -> Self:
        """Add what another model was trained on: bit for bit the model of all frames.

        Classes are united; parameters stay those of this model.

        Raises:
            ValueError: for a model of another kind or frame shape, not trained, or recalibrated.
        """
        kinds = [
            f"{type(m).__name__} with readout {m.readout!r}" for m in (self, other)
        ]
        if kinds[0] != kinds[1]:
            raise ValueError(f"merge: expected a {kinds[0]}, found a {kinds[1]}")
        Estimator._check_is_trained(other)
        for model in (self, other):
            model._check_learns("merge")
        if not hasattr(self, "counters_"):
            self._start(other.frame_shape_)
            self._columns = other._columns
        inputs.check_shape(other.frame_shape_, self.frame_shape_, type(self).__name__)
        self._check_columns(other._columns)
        labels = other.classes_.tolist()
        self._know(labels)
        rows = [self._index[label] for label in labels]
        self.counters_.merge(other.counters_, rows)
        self._sample.merge(other._sample)
        if other._frames is not None:
            self._keep(*other._frames)
        self._update_prototypes(rows)
        return self

    def recalibrate(
        self,
        frames: Any,
        y: Any,
        p: float = 0.5,
        seed: int = 0,
        method: str = "replace",
    ) -> Self:
        """Adapt to a changed environment by new frames.

        Classes without new frames stay as they are; :meth:`is_known` compares with the new frames.
        ``partial_fit`` and ``merge`` refuse a recalibrated model. Ridge regression goes from its
        old weights to those near them that fit the new frames, which replace kept ones of their
        classes; neither depends on p.

        Args:
            frames: frames of the changed environment, of the shapes that :meth:`fit` takes.
            y: their labels.
            p: share of the new: probability with which a bit is replaced, or share of the votes.
            seed: seed of the choice of bits that are replaced.
            method: ``"replace"`` as published, for binary prototypes only, or ``"merge"``, by
                votes (:func:`hdc.prototypes.merged`), which recovers more.

        Raises:
            ValueError: if p is outside [0, 1], or a label is not among ``classes_``.
        """
        self._check_is_trained()
        check_probability(p)
        if method not in METHODS:
            raise ValueError(
                f"method: expected one of {', '.join(METHODS)}, found {method!r}"
            )
        if (
            self.prototype != "binary"
            and self.readout == "prototype"
            and method == "replace"
        ):
            raise ValueError(
                "method: expected 'merge' for integer prototypes, found 'replace'"
            )
        frames, labels = self._samples(frames, y)
        inputs.check_among(labels, self._index)
        words = torch.cat(list(self._encoded(frames)))
        rows = sorted({self._index[label] for label in labels})
        new = Counters(len(rows), self.dimension_, self.device, self._backend(frames))
        new.add(
            words, torch.tensor([rows.index(self._index[label]) for label in labels])
        )
        sample = Sample()
        sample.add(words, labels)

        size = _smallest(new) if self.balance else None
        before, rule = self.prototypes_, (self.ties, self.seed)
        decided = self._deciding_prototypes()
        if method == "merge":
            old, placed = (
                self.counters_,
                Counters(len(before), self.dimension_, self.device),
            )
            if self.balance and not self._recalibrated:
                old = old.thinned(_smallest(old), self.seed)
            placed.merge(new.thinned(size, seed) if size else new, rows)
            counters, weights = merged(old, placed, p)
            after = counters.prototypes(*rule)
            for c in rows:
                decided[c] = deciding(counters, c, *rule, weights[c])
            self.counters_ = counters
        else:
            mask = replaced_bits(len(before), self.dimension_, p, seed).to(
                before.device
            )
            after, fresh = before.clone(), new.prototypes(*rule, size)
            for i, c in enumerate(rows):
                after[c] ^= (before[c] ^ fresh[i]) & mask[c]
                decided[c] = before[c] ^ (
                    (before[c] ^ deciding(new, i, *rule)) & mask[c]
                )
        for label in set(labels):
            self._sample.put(label, sample.of(label), sample.seen[label])
        if self.readout == "ridge":
            self.ridge_, _ = ridge(
                *self._targets(words, labels), self.dimension_, self.ridge_
            )
        elif self._frames is not None:
            kept, names = self._frames
            others = [i for i, name in enumerate(names) if name not in set(labels)]
            self._frames = kept[others], [names[i] for i in others]
            self._keep(words, labels)
        self.prototypes_, self._recalibrated = after, True
        self._deciding, self._peers = decided, None
        return self

    # Answers -------------------------------------------------------------------------------------

    def predict(self, frames: Any, reject: bool | float = False) -> np.ndarray:
        """Labels [Q] of frames [Q, H, W] or [Q, D], or of a single image [H, W].

        Args:
            frames: the queries.
            reject: answer None, in an array of objects, for a frame that :meth:`is_known` does not
                know: the share of frames of known classes that may be lost so; True for 5 %.
        """
        share = (
            None if reject is False else check_share(RATE if reject is True else reject)
        )
        self._check_is_trained()
        labels = []
        for words in self._encoded(frames):
            found = self.classes_[self._scores_of(words).argmin(1).numpy(force=True)]
            if share is not None:
                found = found.astype(object)
                found[p_values(self._known_peers(), words, share).max(1) <= share] = (
                    None
                )
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
        possible = self._p_values(frames, share := check_share(alpha)) > share
        return [self.classes_[row] for row in possible]

    def is_known(self, frames: Any, reject: float = RATE) -> np.ndarray:
        """Whether frames are as near to a prototype as frames of its class are: bool [Q].

        False where :meth:`predict_set` is empty: for a share `reject` of fresh frames of known
        classes at most, if they come as the training frames did, and for noise, a black frame or an
        object that was not trained, as long as there are 1/reject training frames.

        Raises:
            ValueError: for a share outside (0, 1).
        """
        return self._p_values(frames, share := check_share(reject)).max(1) > share

    def decision_function(self, frames: Any) -> np.ndarray:
        """How near each class is, [Q, L]: minus the distance as a share of the pixels.

        Of two classes the difference [Q], positive for the second. Integer prototypes have the
        cosine in place of it.
        """
        near = -self._scores(frames).numpy(force=True)
        if self.readout != "ridge":
            integer = (self.readout, self.prototype) == ("prototype", "integer")
            near = near / self.dimension_ ** (0.5 if integer else 1)
        return near[:, 1] - near[:, 0] if near.shape[1] == 2 else near

    def distances(self, frames: Any) -> np.ndarray:
        """Hamming distances int64 [Q, L] between queries and prototypes (Eq. 2).

        D + 1, farther than anything, from a class without samples.
        """
        self._check_is_trained()
        return torch.cat([*map(self._hamming, self._encoded(frames))]).numpy(force=True)

    def state_tensors(self) -> dict[str, Tensor]:
        """The tensors that have to be stored to predict; they share memory with the model."""
        self._check_is_trained()
        if self.readout == "ridge":
            return {"weights": self.ridge_.planes, "scales": self.ridge_.scales}
        if self._frames is not None:
            return {"frames": self._frames[0]}
        if self.prototype == "binary":
            return {"prototypes": self.prototypes_}
        return {"counters": self.counters_.planes}

    # Files ---------------------------------------------------------------------------------------

    def _stored(self) -> tuple[dict[str, Any], dict[str, Tensor]]:
        classes = self.classes_.tolist()
        seen = [self._sample.seen.get(c, 0) for c in classes]
        tensors = {
            "planes": self.counters_.planes, "n": self.counters_.n, "prototypes": self.prototypes_,
            "sample": torch.cat([self._sample.of(c) for c in classes if c in self._sample.seen]),
        }  # fmt: skip
        if self._deciding is not None:
            tensors["deciding"] = self._deciding
        if self.readout == "ridge":
            tensors |= self.ridge_.tensors()
        if self._frames is not None:
            rows = torch.tensor([self._index[label] for label in self._frames[1]])
            tensors |= {"frames": self._frames[0], "rows": rows}
        return {
            "classes": classes,
            "seen": seen,
            "recalibrated": self._recalibrated,
        }, tensors

    def _restore(self, header: Mapping[str, Any], tensors: dict[str, Tensor]) -> None:
        self._start(self.frame_shape_)
        classes, seen, n = header["classes"], header["seen"], tensors["n"]
        width, n_planes = bits.words_for(self.dimension_), tensors["planes"].shape[1]
        kept = [min(s, KEPT) for s in seen]
        n_frames = len(tensors.get("frames", ()))
        io.check_tensors(tensors, {
            "planes": (len(classes), n_planes, width), "n": (len(classes),),
            "prototypes": (len(classes), width), "deciding": (len(classes), len(EXTRAS), width),
            "rows": (n_frames,), "frames": (n_frames, width), "sample": (sum(kept), width),
            **Ridge.shapes(len(classes), width),
        })  # fmt: skip
        if (n < 0).any() or (n >= 2**53).any() or not n.any():
            raise ValueError(f"sample counts {n.tolist()}")
        self._know(inputs.label_array(classes, len(classes)).tolist())
        if self.classes_.tolist() != classes or len(classes) < 2:
            raise ValueError(f"classes {classes!r}")
        here = {name: tensor.to(self.device) for name, tensor in tensors.items()}
        self.counters_.planes, self.counters_.n = here["planes"], n
        self._size = self._common_size()
        self.prototypes_, self._deciding = here["prototypes"], here.get("deciding")
        self._recalibrated = bool(header["recalibrated"])
        for label, words, n_seen in zip(
            classes, here["sample"].split(kept), seen, strict=True
        ):
            self._sample.put(label, words, n_seen)
        if self.readout == "ridge":
            self.ridge_ = Ridge.of(here, self.dimension_)
        elif self.readout == "neighbours":
            self._frames = (
                here["frames"],
                [classes[row] for row in tensors["rows"].tolist()],
            )

    # Parts ---------------------------------------------------------------------------------------

    def _check_learns(self, action: str) -> None:
        if getattr(self, "_recalibrated", False):
            raise ValueError(
                f"{action}: expected a model that was not recalibrated; fit anew"
            )
        if self.readout == "ridge":
            raise ValueError(
                f"{action}: expected readout 'prototype' or 'neighbours', found 'ridge'; fit anew"
            )

    def _check_is_trained(self) -> None:
        super()._check_is_trained()
        inputs.check_two_classes(self.classes_)

    def _start(self, shape: Sequence[int]) -> None:
        self._set_shape(shape)
        self.counters_ = Counters(0, self.dimension_, self.device)
        self._index, self.classes_ = {}, np.empty(0, object)
        self.prototypes_ = self.counters_.planes[:, 0]
        self._size = None
        self._sample, self._deciding, self._peers, self._frames = (
            Sample(),
            None,
            None,
            None,
        )
        self._recalibrated = False

    def _know(self, labels: Iterable[Label]) -> None:
        """Make room for the labels that are new, in the order of classes."""
        if all(label in self._index for label in labels):
            return
        classes = inputs.classes_of([*self._index, *labels])
        index = {label: i for i, label in enumerate(classes.tolist())}
        counters = Counters(len(index), self.dimension_, self.device)
        counters.merge(self.counters_, [index[label] for label in self._index])
        self._index, self.classes_, self.counters_ = index, classes, counters
        self.prototypes_ = planes.zeros(
            (len(index), bits.words_for(self.dimension_)), self.device
        )
        self._size = -1  # all are to be made: random ties and thinned counts go by rows

    def _add(self, words: Tensor, labels: Sequence[Label], backend: str) -> list[int]:
        """Count hypervectors [N, W] of N labels; return the rows of these."""
        rows = [self._index[label] for label in labels]
        self.counters_.backend = backend
        self.counters_.add(words, torch.tensor(rows, dtype=torch.int64))
        self._sample.add(words, labels)
        if self.readout != "prototype":
            self._keep(words, labels)
        return rows

    def _add_in_one_read(
        self, frames: Tensor, labels: Sequence[Label], first: int
    ) -> None:
        """:meth:`_add` of 8-bit frames, of whose hypervectors only those of the sample are kept."""
        inputs.check_shape(frames.shape[1:], self.frame_shape_, type(self).__name__)
        rows = torch.tensor([self._index[label] for label in labels], dtype=torch.int64)
        chosen = self._sample.choose(labels)
        kept, constant = self.counters_.add_frames(frames, rows, list(chosen))
        self._sample.keep(chosen, kept)
        warn_of_constant(constant, first)

    def _keep(self, words: Tensor, labels: Sequence[Label]) -> None:
        """Keep hypervectors for the read-outs that are made of them."""
        if self._frames is not None:
            words, labels = (
                torch.cat((self._frames[0], words)),
                [*self._frames[1], *labels],
            )
        self._frames = words, list(labels)

    def _targets(self, words: Tensor, labels: Sequence[Label]) -> tuple[Tensor, Tensor]:
        """Hypervectors, and 1 for the class of each and −1 for the others, float64 [N, L]."""
        rows = torch.tensor([self._index[label] for label in labels])
        return words, 2 * torch.eye(len(self._index), dtype=torch.float64)[rows] - 1

    def _common_size(self) -> int | None:
        """Samples a class that prototypes count as, where some classes are thinned."""
        smallest = _smallest(self.counters_)
        return (
            smallest if self.balance and (self.counters_.n > smallest).any() else None
        )

    def _update_prototypes(self, rows: Iterable[int]) -> None:
        """Make the prototypes of classes that have more samples, or all where that changes them."""
        counters, size = self.counters_, self._common_size()
        prototypes = torch.empty_like(
            self.prototypes_
        )  # others may be reading the ones of before
        planes.plain(prototypes)[:] = planes.plain(self.prototypes_)
        for c in set(rows) if size == self._size else range(len(self._index)):
            if counters.n[c]:
                prototypes[c] = counters.prototype(c, self.ties, self.seed, size=size)
        self.prototypes_, self._size, self._peers = prototypes, size, None

    @property
    def counts_(self) -> np.ndarray:
        return self.counters_.n.numpy()

    def _empty(self) -> Tensor | None:
        """Which classes have no samples: bool [L], or None where all have."""
        empty = self.counters_.n == 0
        return empty if empty.any() else None

    def _hamming(self, words: Tensor) -> Tensor:
        distances = bits.hamming(words, self.prototypes_, self._backend())
        if (empty := self._empty()) is not None:
            distances[:, empty] = self.dimension_ + 1
        return distances

    def _scores(self, frames: Any) -> Tensor:
        self._check_is_trained()
        return torch.cat([self._scores_of(words) for words in self._encoded(frames)])

    def _scores_of(self, words: Tensor) -> Tensor:
        """Dissimilarity [Q, L], smaller is nearer."""
        if self.readout == "ridge":
            return -self.ridge_.scores(words, self._backend())
        if self.readout == "neighbours":
            return self._nearest_frames(words)
        if self.prototype == "binary":
            return self._hamming(words)
        size = (
            _smallest(self.counters_)
            if self.balance and not self._recalibrated
            else None
        )
        scores = cosines(self.counters_, words, size)
        if (empty := self._empty()) is not None:
            scores[:, empty] = torch.inf
        return scores

    def _nearest_frames(self, words: Tensor) -> Tensor:
        """The distance of the nearest frame of each class, and far less for one with votes."""
        assert self._frames is not None
        kept, labels = self._frames
        rows = torch.tensor(
            [self._index[label] for label in labels], device=words.device
        )
        distances = bits.hamming(words, kept, self._backend())
        rows = rows.expand_as(distances)
        far = distances.new_full((len(words), len(self._index)), self.dimension_ + 1)
        scores = far.scatter_reduce(1, rows, distances, "amin")
        if self.n_neighbours > 1:
            voting = distances.argsort(dim=1, stable=True)[:, : self.n_neighbours]
            votes = torch.zeros_like(scores)
            votes.scatter_add_(1, rows.gather(1, voting), torch.ones_like(voting))
            scores -= (self.dimension_ + 2) * votes
        return scores

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
            prototypes, sample = self._deciding_prototypes(), self._sample
            peers = [
                Peers.of(sample.of(label), prototypes[c])
                if sample.seen.get(label)
                else None
                for c, label in enumerate(self.classes_.tolist())
            ]
            self._peers = peers
        return peers

    def _deciding_prototypes(self) -> Tensor:
        """Prototypes [L, 5, W] by :data:`hdc.rejection.EXTRAS`."""
        if self._deciding is not None:
            return self._deciding.clone()
        n_classes, width = self.prototypes_.shape
        decided = self.prototypes_.new_zeros(n_classes, len(EXTRAS), width)
        for c in self.counters_.n.nonzero().flatten().tolist():
            decided[c] = deciding(self.counters_, c, self.ties, self.seed)
        return decided


def _smallest(counters: Counters) -> int:
    """Samples of the smallest class that has any."""
    return int(counters.n[counters.n > 0].min()) if counters.n.any() else 0
