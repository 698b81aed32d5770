"""What a classifier learns of labelled frames: a read-out, prototypes, a sample of each class."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from hdc import bits, inputs
from hdc.encoders import Median, Quantile
from hdc.encoders.ranks import RankEncoder, ties_of
from hdc.estimator import CHUNK, Estimator
from hdc.inputs import Label
from hdc.io import check_tensors, prefixed, without_prefix
from hdc.parameters import is_number
from hdc.probability import Calibration, cross_validated, sharpness
from hdc.readouts import Counting, Counts, Majority, Updatable, make_readout
from hdc.readouts.base import HeldOut, Readout
from hdc.rejection import KEPT, Rejecting, Sample


class Learner(Rejecting):
    """Labelled frames in chunks to hypervectors, and these to all that learns of them.

    Attributes:
        readout_: the read-out, trained.
        classes_: array [L] of the labels, sorted.
    """

    readout_: Readout
    _index: dict[Label, int]  # label → row
    _waiting: list[tuple[Tensor, Tensor]]
    """Hypervectors and rows of a read-out that wants all."""
    _recalibrated: bool
    _calibration: Calibration

    def _train(self, frames: Any, y: Any) -> Iterator[int]:
        """Learn chunk by chunk; yield how many frames there were once all classes have one.

        A read-out that wants all hypervectors at once has them before the last yield.
        """
        frames, labels = self._samples(frames, y)
        inputs.check_discrete(labels)
        classes = inputs.classes_of(labels)
        inputs.check_two_classes(classes)
        self._start(frames, classes.tolist())
        rows = torch.tensor([self._index[label] for label in labels])
        self._reserve(rows)
        words: Tensor | None = None
        for start in range(0, len(frames), CHUNK):
            part = self._chunk(frames, start)
            backend = self._backend(part)
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
        frames = self._checked_frames(frames)
        labels = inputs.label_array(y, len(frames)).tolist()
        if not labels:
            raise ValueError("frames: expected at least one frame, found none")
        return frames, labels

    def _start(self, frames: Any, classes: Sequence[Label]) -> None:
        """Be ready to learn such frames of these classes."""
        self._learn_encoder(frames)
        self._begin(classes)

    def _begin(self, classes: Sequence[Label]) -> None:
        """Be ready to count for these classes, with an encoder that has learned."""
        self.readout_ = make_readout(self.readout).unlearned()
        self.classes_ = inputs.label_array(classes, len(classes))
        self._index = {label: row for row, label in enumerate(self.classes_.tolist())}
        if isinstance(self.readout_, Counting):
            self._majority = self.readout_
        else:
            self._majority = Majority()
        self._majority.start(len(classes), self.dimension_, self.device)
        if isinstance(self.readout_, Updatable) and self.readout_ is not self._majority:
            no_words = self._majority.prototypes_[:0]
            no_rows = torch.empty(0, dtype=torch.int64)
            self.readout_.fit(no_words, no_rows, len(classes), self.dimension_)
        self._sample = Sample()
        self._peers = None
        self._calibration = Calibration()
        self._waiting = []
        self._recalibrated = False

    def _make_room_for(self, labels: Iterable[Label]) -> None:
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
        if not ours or not counted:
            return False
        return frames.dtype == torch.uint8 and self.dimension_ > 1

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
        words = torch.cat([words for words, _ in self._waiting])
        rows = torch.cat([rows for _, rows in self._waiting])
        self._waiting = []
        self.readout_.backend = backend
        self.readout_.fit(words, rows, len(self.classes_), self.dimension_)
        if type(self.readout_).held_out is Readout.held_out:
            self._calibration = Calibration(learnt=(words, rows))

    def _settle(self) -> None:
        for part in self._updated():
            part.settle()
        self._peers = None
        self._calibration = Calibration(learnt=self._calibration.learnt)

    # Probabilities -------------------------------------------------------------------------------

    def _known_sharpness(self) -> float:
        """The sharpness of probabilities, found when first asked for.

        Raises:
            ValueError: where no training frames can be scored as if they had not been learnt.
        """
        calibration = self._calibration
        if calibration.sharpness is not None:
            return calibration.sharpness
        found = self._held_out()
        if found is None and calibration.learnt is not None:
            words, rows = calibration.learnt
            n_classes = len(self.classes_)
            found = cross_validated(
                self.readout_, words, rows, n_classes, self.dimension_
            )
        if found is None:
            raise ValueError(
                f"predict_proba: expected a model fresh from fit, found one with {self.readout_!r} "
                "that was recalibrated, or saved before it was asked; fit anew"
            )
        calibration.sharpness = sharpness(self._of_several(found))
        return calibration.sharpness

    def _held_out(self) -> HeldOut | None:
        """Scores of training frames as if not learnt, where the read-out has a closed form."""
        words = []
        rows = []
        for label, row in self._index.items():
            if self._sample.seen.get(label):
                kept = self._sample.of(label)
                words.append(kept)
                rows += [row] * len(kept)
        return self.readout_.held_out(torch.cat(words), torch.tensor(rows))

    def _of_several(self, found: HeldOut) -> HeldOut:
        """Those of classes that have two frames or more, for classes that have any.

        Raises:
            ValueError: if there are none.
        """
        counts = self._majority.counters_.n.cpu()
        chosen = counts[found.rows] > 1
        if not chosen.any():
            raise ValueError(
                "predict_proba: expected two training frames or more of a class, found one of each"
            )
        known = counts > 0
        place = known.cumsum(0) - 1
        return HeldOut(found.scores[chosen][:, known], place[found.rows[chosen]])

    def _sharpness_to_save(self) -> float | None:
        """What a file has: none where a loaded model finds it itself, or nobody asked for it."""
        if isinstance(self.readout_, Updatable):
            return None
        several = (self._majority.counters_.n > 1).any()
        if several and self._held_out() is not None:
            return self._known_sharpness()
        return self._calibration.sharpness

    def _check_is_trained(self) -> None:
        super()._check_is_trained()
        inputs.check_two_classes(self.classes_)

    def _check_counts(self, action: str) -> None:
        """Raise ValueError for a trained model whose prototypes are not those of its frames."""
        if not hasattr(self, "readout_"):
            return
        Estimator._check_is_trained(self)
        if self._recalibrated:
            raise ValueError(
                f"{action}: expected a model that was not recalibrated; fit anew"
            )

    # Files ---------------------------------------------------------------------------------------

    def _stored(self) -> tuple[dict[str, Any], dict[str, Tensor]]:
        classes = self.classes_.tolist()
        seen = self._sample.seen
        kept = [self._sample.of(label) for label in classes if label in seen]
        tensors = {"sample": torch.cat(kept)}
        tensors |= prefixed("readout", self.readout_.stored())
        if self._majority is not self.readout_:
            tensors |= prefixed("majority", self._majority.stored())
        header = {
            "classes": classes,
            "seen": [seen.get(label, 0) for label in classes],
            "recalibrated": self._recalibrated,
            "sharpness": self._sharpness_to_save(),
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
            own = without_prefix(prefix, tensors)
            part.restore(own, len(classes), self.dimension_)
        self._recalibrated = bool(header["recalibrated"])
        self._calibration = Calibration(sharpness=_sharpness_of(header))

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


def _sharpness_of(header: Mapping[str, Any]) -> float | None:
    """The sharpness that a file has, if it has one."""
    found = header.get("sharpness")
    if found is not None and (not is_number(found) or found <= 0):
        raise ValueError(f"sharpness {found!r}")
    return found
