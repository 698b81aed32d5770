"""The trained state of a classifier: an immutable value, from which new ones are made."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
from hdc.conformal import Conformal
from hdc.hypervectors import Hypervectors, Sample, joined
from hdc.inputs import Label
from hdc.parameters import is_number
from hdc.probability import cross_validated, of_several, sharpness
from hdc.readouts.base import HeldOut, Readout, Updatable
from hdc.readouts.majority import Counting
from hdc.rejection import Rejection, by_frames, by_groups, of_words
from hdc.tensors import Parts, check_parts, checked
from hdc.warning import warn


@dataclass(frozen=True, eq=False)
class Head:
    """A read-out and its state; methods such as :meth:`extended` return a new head."""

    readout: Readout
    state: Any
    """The trained state of the read-out."""
    sample: Sample
    labels: np.ndarray
    """[L], the label of each row."""
    dimension: int
    """D, bits of a hypervector."""
    calibrated: Rejection | None = None
    """The rule of rejection, if it does not follow from the state and the sample."""
    recalibrated: bool = False
    """Whether the prototypes no longer follow from the counters."""
    training: tuple[Hypervectors, Tensor] | None = None
    """Training hypervectors and their rows, for a read-out that is cross-validated."""

    @functools.cached_property
    def index(self) -> dict[Label, int]:
        """Row of each label."""
        return {label: row for row, label in enumerate(self.labels.tolist())}

    @property
    def counts(self) -> Tensor:
        """Training frames of each class, int64 [L] (CPU); votes after a recalibration by votes."""
        if isinstance(self.readout, Counting):
            counts: Tensor = self.state.n
            return counts
        return torch.tensor(self._seen)

    @property
    def _seen(self) -> list[int]:
        """Training frames of each class."""
        return [self.sample.seen[row] for row in range(len(self.labels))]

    def rows_of(self, labels: Iterable[Label]) -> Tensor:
        """Rows int64 [N] of N labels."""
        return torch.tensor([self.index[label] for label in labels])

    # Learning ------------------------------------------------------------------------------------

    def learned(
        self,
        batches: Iterable[Hypervectors],
        labels: Sequence[Label],
        device: str,
        together: Sequence[Label] | None,
    ) -> Head:
        """The head after a training on batches of N hypervectors, in place of an empty one.

        Args:
            batches: the hypervectors.
            labels: their labels [N].
            device: the device that holds the state of a read-out that learns batch by batch.
            together: their groups [N], if known.
        """
        readout, n_classes = self.readout, len(self.labels)
        rows, calibrated = self.rows_of(labels), None
        if together is not None:
            words = joined(batches)
            batches = [words]
            calibrated, single = by_groups(words, rows, together, readout, n_classes)
            _warn_of_single_groups(self.labels[single].tolist())
        if isinstance(readout, Updatable):
            state = readout.empty(n_classes, self.dimension, device)
            learned = replace(self, state=state).extended(batches, labels)
            return replace(learned, calibrated=calibrated)
        words = joined(batches)
        state = readout.fit(words, rows, n_classes)
        return replace(
            self,
            state=state,
            sample=Sample(Counter(rows.tolist())),
            calibrated=calibrated or of_words(words, rows, n_classes),
            training=(words, rows) if state.held_out is None else None,
        )

    def extended(
        self, batches: Iterable[Hypervectors], labels: Sequence[Label]
    ) -> Head:
        """A head that has also learned batches of N hypervectors with some of its labels."""
        readout: Any = self.readout
        rows, sample = self.rows_of(labels), self.sample

        def sampled() -> Iterator[tuple[Hypervectors, Tensor]]:
            nonlocal rows, sample
            for words in batches:
                own, rows = rows[: len(words)], rows[len(words) :]
                sample = sample.with_frames(words.packed, own.tolist())
                yield words, own

        state = readout.add(self.state, sampled())
        return replace(self, state=state, sample=sample, calibrated=None)

    def with_classes(self, labels: Iterable[Label]) -> Head:
        """A head with rows for these labels, too; some of them may be new."""
        labels = list(labels)
        inputs.check_one_kind([*self.index, *labels])  # True equals 1
        new = [label for label in labels if label not in self.index]
        if not new:
            return self
        found = inputs.classes_of([*self.index, *new])
        rows = {label: row for row, label in enumerate(found.tolist())}
        readout: Any = self.readout
        places = [rows[label] for label in self.index]
        state = readout.arrange(self.state, places, len(found))
        sample = self.sample.arranged(places)
        return replace(self, state=state, sample=sample, labels=found)

    def adapted(
        self, words: Hypervectors, labels: Sequence[Label], options: Mapping[str, Any]
    ) -> Head:
        """A head that is adapted to N hypervectors by the arguments of ``recalibrate``."""
        rows = self.rows_of(labels)
        found = set(labels)
        missing = [name for name in self.index if name not in found]
        _warn_of_missing(missing)
        readout: Any = self.readout
        used = [options[name] for name in readout.adapts_by]
        state = readout.adapt(self.state, words, rows, *used)
        if missing and state.held_out is not None:
            # The old and the new scores have different units.
            state = replace(state, held_out=None)
        calibrated = None
        sample = self.sample.replaced(words.packed, rows.tolist())
        if not isinstance(readout, Updatable):
            sample = Sample(sample.seen)
            if not missing:
                calibrated = of_words(words, rows, len(self.index))
        return replace(
            self,
            state=state,
            sample=sample,
            recalibrated=True,
            training=None,
            calibrated=calibrated,
        )

    # Answers -------------------------------------------------------------------------------------

    def scores(self, words: Hypervectors) -> Tensor:
        """Scores [Q, L] of the read-out."""
        return self.readout.scores(self.state, words)

    def probabilities(self, words: Hypervectors) -> Tensor:
        """Probabilities float64 [Q, L]; 0 for a class without training frames."""
        exponents = self.sharpness * self.scores(words).double().cpu()
        exponents[:, self.counts == 0] = -torch.inf
        return torch.softmax(exponents, dim=1)

    @functools.cached_property
    def held_out(self) -> HeldOut | None:
        """Scores of left-out training frames: in closed form, from a file, or cross-validated.

        None if the model has none of these.
        """
        readout = self.readout
        if isinstance(readout, Updatable):
            words, rows = self._kept()
            return readout.held_out(self.state, words, rows)
        found = readout.held_out(self.state, None, torch.empty(0))
        if found is None and self.training is not None:
            found = cross_validated(readout, *self.training, len(self.labels))
        return found

    def _kept(self) -> tuple[Hypervectors, Tensor]:
        """The hypervectors of the sample, and their rows."""
        words, rows = self.sample.listed()
        return Hypervectors(words, self.dimension), rows

    @functools.cached_property
    def rejection(self) -> Rejection:
        """The rule that tells known frames from unknown ones.

        Raises:
            ValueError: if the model keeps no training frames that could be left out.
        """
        if self.calibrated is not None:
            return self.calibrated
        if not self.sample.kept:
            raise ValueError(
                "is_known: expected distances of left-out frames, found a model that was "
                f"recalibrated for some classes alone, or saved without them, of {self.readout!r}; "
                "fit anew, or recalibrate by frames of all classes"
            )
        if isinstance(self.readout, Counting):
            near = self.readout.deciding(self.state)[:, 1:4]
            return by_frames(near, self.sample.kept)
        words, rows = self._kept()
        return of_words(words, rows, len(self.index))

    @functools.cached_property
    def conformal(self) -> Conformal:
        """Left-out training frames, with which new frames are compared.

        Raises:
            ValueError: if the model has no scores of left-out frames.
        """
        if isinstance(self.readout, Counting):
            return Conformal.of_counting(self.readout, self.state, self.sample)
        return Conformal.of_scores(self._needed("predict_set"), self.counts)

    @functools.cached_property
    def sharpness(self) -> float:
        """One over the temperature of the probabilities; raises as :attr:`conformal`."""
        return sharpness(of_several(self._needed("predict_proba"), self.counts))

    def _needed(self, method: str) -> HeldOut:
        if self.held_out is None:
            raise ValueError(
                f"{method}: expected a model fresh from fit, found one that was recalibrated, or "
                f"saved by version 2.0, of {self.readout!r}; fit anew, or recalibrate by frames of "
                "all classes"
            )
        return self.held_out

    # Files ---------------------------------------------------------------------------------------

    def stored(self) -> tuple[dict[str, Any], Parts]:
        """Header and tensors for a file."""
        tensors = {"readout": self.state.tensors()}
        if self.sample.kept:
            words, _ = self.sample.listed()
            tensors[""] = {"sample": words}
        # Those of other read-outs follow from the state and the sample.
        if not isinstance(self.readout, Updatable) and self.held_out is not None:
            tensors["held_out"] = self.held_out._asdict()
        if self.calibrated is not None:
            tensors["known"] = self.calibrated.tensors()
        header = {
            "classes": self.labels.tolist(),
            "seen": self._seen,
            "recalibrated": self.recalibrated,
        }
        return header, tensors

    @classmethod
    def restored(
        cls,
        readout: Readout,
        header: Mapping[str, Any],
        tensors: Parts,
        dimension: int,
    ) -> Head:
        """The head of a header and tensors from a file, which may be anything.

        Raises:
            ValueError: if they do not fit together.
        """
        classes = header["classes"]
        if not classes or inputs.classes_of(classes).tolist() != classes:
            raise ValueError(f"classes {classes!r}")
        # Up to version 3, whole read-outs had a sample, and all that do not count a majority.
        parts = ["readout", "", "held_out", "known"]
        if not isinstance(readout, Counting):
            parts.append("majority")
        check_parts(tensors, parts)
        n_classes = len(classes)
        kept = tensors[""]
        if isinstance(readout, Updatable) and not kept:
            raise ValueError("no tensor 'sample'")
        state = readout.restored(tensors["readout"], n_classes, dimension)
        head = cls(
            readout,
            replace(state, held_out=_held_out_of(tensors["held_out"], n_classes)),
            Sample.restored(n_classes, header["seen"], kept, dimension),
            inputs.label_array(classes, n_classes),
            dimension,
            Rejection.restored(tensors["known"], dimension),
            bool(header["recalibrated"]),
        )
        found = header.get("sharpness")
        if found is not None:  # version 2.0 kept it in place of the scores
            if not is_number(found) or found <= 0:
                raise ValueError(f"sharpness {found!r}")
            vars(head)["sharpness"] = found
        return head


def _warn_of_single_groups(labels: Sequence[Label]) -> None:
    """Warn of classes whose frames are of a single group."""
    if labels:
        named = ", ".join(map(repr, labels[:5]))
        warn(
            f"fit: groups: expected two or more of each class, found one of {named}; is_known is "
            "not calibrated for another group of these",
        )


def _warn_of_missing(missing: Sequence[Label]) -> None:
    """Warn of classes without new frames, which are not adapted."""
    if not missing:
        return
    named = ", ".join(map(repr, missing[:5])) + (" …" if len(missing) > 5 else "")
    warn(
        f"recalibrate: no new frames of {named}; where a drift moves the frames of all classes "
        "alike, frames of these classes will be taken for the others",
    )


def _held_out_of(tensors: Mapping[str, Tensor], n_classes: int) -> HeldOut | None:
    """The scores of left-out frames in a file, if there are any."""
    if not tensors:
        return None
    kinds = {"scores": "float64 N L", "rows": "int64 N"}
    n = len(tensors.get("rows", ()))  # none where each class has a single frame
    found = HeldOut(**checked(tensors, kinds, N=n, L=n_classes))
    if ((found.rows < 0) | (found.rows >= n_classes)).any():
        raise ValueError(f"held_out.rows: expected classes in [0, {n_classes})")
    return found
