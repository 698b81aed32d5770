"""Learned from labelled hypervectors: a read-out, prototypes, a sample."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

import torch
from torch import Tensor

from hdc import inputs
from hdc.conformal import Conformal
from hdc.inputs import Label
from hdc.parameters import is_number
from hdc.probability import Temperature, cross_validated
from hdc.readouts import Counting, Majority, Updatable
from hdc.readouts.base import HeldOut, Readout, with_backend
from hdc.sample import KEPT, Sample
from hdc.tensors import check_parts, checked, prefixed, without_prefix

ANEW = "expected a model fresh from fit, found one that was recalibrated, or saved by version 2.0"


class Learned:
    """A read-out and all that is learned beside it, of hypervectors of known classes.

    Args:
        readout: untrained.
        classes: labels, sorted and different.
        dimension: D, bits of a hypervector.
        device: where prototypes live.

    Attributes:
        labels: array [L].
        index: row of each label.
        majority: prototypes for distances; the read-out itself if it counts.
        sample: hypervectors of some training frames of each class.
        recalibrated: whether prototypes are no longer those of the counted hypervectors.

    Raises:
        ValueError: for one class, of a read-out that has to tell two apart.
    """

    def __init__(
        self, readout: Readout, classes: Sequence[Label], dimension: int, device: str
    ):
        if len(classes) == 1 and not isinstance(readout, Updatable):
            raise ValueError(
                f"labels: expected at least two classes for {readout!r}, found one class, "
                f"{classes[0]!r}; the read-out 'majority' tells it from what is unknown"
            )
        self.readout = readout
        self.dimension = dimension
        self._name(classes)
        if isinstance(readout, Counting):
            self.majority: Counting = readout
        else:
            self.majority = Majority(balance=True)
        self.majority.start(len(classes), dimension, device)
        if isinstance(readout, Updatable) and readout is not self.majority:
            no_words = self.majority.prototypes_[:0]
            no_rows = torch.empty(0, dtype=torch.int64)
            readout.fit(no_words, no_rows, len(classes), dimension)
        self.sample = Sample()
        self.recalibrated = False
        self._waiting: list[tuple[Tensor, Tensor]] = []
        self._forget()
        self._all: tuple[Tensor, Tensor] | None = None

    def _name(self, classes: Any) -> None:
        self.labels = inputs.label_array(classes, len(classes))
        self.index = {label: row for row, label in enumerate(self.labels.tolist())}

    def _forget(self, held_out: HeldOut | None = None) -> None:
        """Have all be made anew that follows from what was learned."""
        self._held_out = held_out
        self._conformal: Conformal | None = None
        self._temperature: Temperature | None = None

    def rows_of(self, labels: Iterable[Label]) -> Tensor:
        """Rows int64 [N] of N labels."""
        return torch.tensor([self.index[label] for label in labels])

    @property
    def counts(self) -> Tensor:
        """Training frames of each class, int64 [L] (CPU)."""
        return self.majority.counters_.n.cpu()

    # Learning ------------------------------------------------------------------------------------

    def updated(self) -> list[Updatable]:
        """The parts that learn batch by batch, each once."""
        parts: list[Updatable] = [self.majority]
        if isinstance(self.readout, Updatable) and self.readout is not self.majority:
            parts.append(self.readout)
        return parts

    def make_room_for(self, labels: Iterable[Label]) -> None:
        """Make room for the labels that are new, in the order of classes."""
        labels = list(labels)
        if all(label in self.index for label in labels):
            return
        before = list(self.index)
        self._name(inputs.classes_of([*before, *labels]))
        places = [self.index[label] for label in before]
        for part in self.updated():
            part.arrange(places, len(self.index))

    def add(self, words: Tensor, labels: Sequence[Label], backend: str) -> None:
        """Learn hypervectors int64 [N, W] of N labels that have a row."""
        rows = self.rows_of(labels)
        for part in self.updated():
            part.backend = backend
            part.add(words, rows)
        if not isinstance(self.readout, Updatable):
            self._waiting.append((words, rows))
        self.sample.add(words, labels)

    def finish(self, backend: str) -> None:
        """Have a read-out learn that wants all hypervectors at once."""
        if not self._waiting:
            return
        words = torch.cat([words for words, _ in self._waiting])
        rows = torch.cat([rows for _, rows in self._waiting])
        self._waiting = []
        self.readout.backend = backend
        self.readout.fit(words, rows, len(self.labels), self.dimension)
        if type(self.readout).held_out is Readout.held_out:
            self._all = words, rows

    @property
    def waits(self) -> bool:
        """Whether the read-out has not learnt all yet."""
        return bool(self._waiting)

    def settle(self) -> None:
        """Make once what :meth:`add` leaves to be made."""
        for part in self.updated():
            part.settle()
        self._forget()

    def merged(self, other: Learned) -> Self:
        """Both parts learned by this and another, for read-outs that go on learning; both stay."""
        merged = copy.deepcopy(self)
        labels = other.labels.tolist()
        merged.make_room_for(labels)
        places = [merged.index[label] for label in labels]
        for own, others in zip(merged.updated(), other.updated(), strict=True):
            own.merge(others, places)
        merged.sample.merge(other.sample)
        merged.settle()
        return merged

    def adapted(
        self,
        words: Tensor,
        labels: Sequence[Label],
        options: Mapping[str, Any],
        backend: str,
    ) -> Self:
        """This, moved to hypervectors [N, W] of N of its labels by the options of recalibrate."""
        rows = self.rows_of(labels)
        self._warn_of_missing(labels)
        before = self._held_out
        if before is None and not isinstance(self.readout, Updatable):
            before = self.readout.held_out(*self._kept())
        adapted = copy.copy(self)
        readout: Any = copy.copy(self.readout)
        readout.backend = backend
        used = [options[name] for name in readout.adapts_by]
        factor = readout.adapt(words, rows, *used)
        adapted.readout = adapted.majority = readout
        if self.majority is not self.readout:
            adapted.majority = copy.copy(self.majority)
            adapted.majority.adapt(words, rows, *options.values())
        adapted.sample = copy.copy(self.sample)
        adapted.sample.replace(words, labels)
        adapted.recalibrated = True
        adapted._all = None
        adapted._forget()
        if not isinstance(readout, Updatable):
            after = readout.held_out(*adapted._kept())
            factor = 1.0 if factor is None else factor
            change = self._change_to(adapted, factor, backend)
            adapted._held_out = _with_others(after, before, rows, factor, change)
        return adapted

    def _change_to(self, adapted: Self, factor: float, backend: str) -> Tensor:
        """Mean change of the scores of the sample beyond a factor, by class: float64 [L, L]."""
        words, rows = self._kept()
        old, new = (
            one.scores(words, backend).double().cpu() for one in (self, adapted)
        )
        sums = torch.zeros(len(self.labels), len(self.labels), dtype=torch.float64)
        sums.index_add_(0, rows, new - factor * old)
        counts = torch.bincount(rows, minlength=len(sums))
        return sums / counts.clamp(min=1)[:, None]

    def _warn_of_missing(self, labels: Sequence[Label]) -> None:
        """Warn where classes have no new frames: they keep prototypes of before the change."""
        found = set(labels)
        missing = [name for name in self.index if name not in found]
        if not missing:
            return
        named = ", ".join(map(repr, missing[:5])) + (" …" if len(missing) > 5 else "")
        warnings.warn(
            f"recalibrate: no new frames of {named}; where a drift moves the frames of all classes "
            "alike, frames of these classes will be taken for the others",
            stacklevel=4,
        )

    # Derived --------------------------------------------------------------------------------

    def scores(self, words: Tensor, backend: str) -> Tensor:
        """Scores [Q, L] of hypervectors [Q, W] by the read-out."""
        return with_backend(self.readout, backend).scores(words)

    def distances(self, words: Tensor, backend: str) -> Tensor:
        """Hamming distances int64 [Q, L] to the prototypes."""
        return with_backend(self.majority, backend).distances(words)

    def held_out(self) -> HeldOut | None:
        """Scores of training frames as if not learnt, in closed form, of a file, or by folds.

        None for a model that has none of these.
        """
        if isinstance(self.readout, Updatable):
            return self.readout.held_out(*self._kept())
        if self._held_out is None:
            found = self.readout.held_out(*self._kept())
            if found is None and self._all is not None:
                n_classes = len(self.labels)
                found = cross_validated(
                    self.readout, *self._all, n_classes, self.dimension
                )
            self._held_out = found
        return self._held_out

    def _kept(self) -> tuple[Tensor, Tensor]:
        """The hypervectors of the sample, and their rows."""
        words = []
        rows = []
        for label, row in self.index.items():
            if self.sample.seen.get(label):
                kept = self.sample.of(label)
                words.append(kept)
                rows += [row] * len(kept)
        return torch.cat(words), torch.tensor(rows)

    def conformal(self) -> Conformal:
        """Samples that new frames are compared with, made when first asked for.

        Raises:
            ValueError: where no training frames can be scored as if they had not been learnt.
        """
        found = self._conformal  # another thread may be making it, too, and of the same
        if found is None:
            if self.majority is self.readout:
                labels = self.labels.tolist()
                found = Conformal.of_counting(self.majority, self.sample, labels)
            else:
                found = Conformal.of_scores(self._needed("predict_set"), self.counts)
            self._conformal = found
        return found

    def temperature(self) -> Temperature:
        """The temperature of probabilities, fitted when first asked for; errors as above."""
        found = self._temperature
        if found is None:
            held_out = _of_several(self._needed("predict_proba"), self.counts)
            found = self._temperature = Temperature.fit(held_out)
        return found

    def _needed(self, method: str) -> HeldOut:
        found = self.held_out()
        if found is None:
            raise ValueError(f"{method}: {ANEW}, of {self.readout!r}; fit anew")
        return found

    # Files ---------------------------------------------------------------------------------------

    def stored(self) -> tuple[dict[str, Any], dict[str, Tensor]]:
        """Header and tensors of a file."""
        classes = self.labels.tolist()
        seen = self.sample.seen
        kept = [self.sample.of(label) for label in classes if label in seen]
        tensors = {"sample": torch.cat(kept)}
        tensors |= prefixed("readout", self.readout.stored())
        if self.majority is not self.readout:
            tensors |= prefixed("majority", self.majority.stored())
        held_out = self._held_out_to_save()
        if held_out is not None:
            tensors |= prefixed("held_out", held_out._asdict())
        header = {
            "classes": classes,
            "seen": [seen.get(label, 0) for label in classes],
            "recalibrated": self.recalibrated,
        }
        return header, tensors

    def _held_out_to_save(self) -> HeldOut | None:
        """Scores that a loaded read-out cannot make again."""
        if isinstance(self.readout, Updatable):
            return None
        try:
            return self.held_out()
        # A read-out of one's own may not learn four fifths of the frames.
        except Exception as error:
            warnings.warn(
                f"save: the loaded model will have no sets and probabilities: {error}",
                stacklevel=5,
            )
            return None

    def restore(self, header: Mapping[str, Any], tensors: dict[str, Tensor]) -> None:
        """Become what :meth:`stored` describes; both may be anything.

        Raises:
            ValueError: for what does not fit.
        """
        n_classes = len(self.labels)
        self._restore_sample(header["seen"], tensors["sample"])
        groups = {"readout": self.readout}
        if self.majority is not self.readout:
            groups["majority"] = self.majority
        check_parts(tensors, (*groups, "sample", "held_out"))
        for prefix, part in groups.items():
            own = without_prefix(prefix, tensors)
            part.restore(own, n_classes, self.dimension)
        self.recalibrated = bool(header["recalibrated"])
        held_out = _held_out_of(without_prefix("held_out", tensors), n_classes)
        self._forget(held_out)
        sharpness = header.get("sharpness")  # of version 2.0
        if sharpness is not None:
            if not is_number(sharpness) or sharpness <= 0:
                raise ValueError(f"sharpness {sharpness!r}")
            self._temperature = Temperature(sharpness)

    def _restore_sample(self, seen: Any, words: Tensor) -> None:
        """Keep the hypervectors of a file, of so many that each class has seen."""
        kept = [min(count, KEPT) for count in seen]
        if min(kept) < 0:
            raise ValueError(f"seen {seen!r}")
        n = sum(kept)
        checked({"sample": words}, {"sample": "int64 N W"}, N=n, D=self.dimension)
        parts = words.split(kept)
        for label, part, n_seen in zip(self.index, parts, seen, strict=True):
            if n_seen:
                self.sample.put(label, part, n_seen)


def _held_out_of(tensors: Mapping[str, Tensor], n_classes: int) -> HeldOut | None:
    """The scores that a file has, if it has any."""
    if not tensors:
        return None
    kinds = {"scores": "float64 N L", "rows": "int64 N"}
    n = len(tensors.get("rows", ()))  # none where each class has a single frame
    found = HeldOut(**checked(tensors, kinds, N=n, L=n_classes))
    if ((found.rows < 0) | (found.rows >= n_classes)).any():
        raise ValueError(f"held_out.rows: expected classes in [0, {n_classes})")
    return found


def _with_others(
    found: HeldOut | None,
    before: HeldOut | None,
    rows: Tensor,
    factor: float,
    change: Tensor,
) -> HeldOut | None:
    """Scores of frames of the classes `rows`, and those of before of the others, as these moved."""
    if found is None or before is None:
        return found
    others = ~torch.isin(before.rows, rows)
    kept = before.rows[others]
    moved = factor * before.scores[others] + change[kept]
    return HeldOut(torch.cat((moved, found.scores)), torch.cat((kept, found.rows)))


def _of_several(found: HeldOut, counts: Tensor) -> HeldOut:
    """Those of classes that have two frames or more, for classes that have any.

    Raises:
        ValueError: if there are none.
    """
    chosen = counts[found.rows] > 1
    if not chosen.any():
        raise ValueError(
            "predict_proba: expected two training frames or more of a class, found one of each"
        )
    known = counts > 0
    place = known.cumsum(0) - 1
    return HeldOut(found.scores[chosen][:, known], place[found.rows[chosen]])
