"""Models that choose their form among a few, by cross-validation on their training frames alone.

Candidates stand in an order, the simplest first. Chosen is the first of those that are no worse
than the best by more than a margin in standard errors of the paired differences between them (the
rule of one standard error: Breiman et al., Classification and Regression Trees (1984), 3.4.3).
"""

from __future__ import annotations

import itertools
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from baselines import library
from baselines.bank import Bank, Rows
from baselines.base import Classifier, FrameSource
from baselines.discriminant import GreysKernel, GreysLDA
from baselines.folds import Fold, folds
from baselines.smoothing import smoothed_part
from baselines.softmax_dual import DualSoftmaxRegression
from hdc import HDCClassifier
from hdc.encoders import Encoder, Smoothed, make_encoder
from hdc.encoders.relative import RelativeEncoder
from hdc.encoders.standardised import standardised
from hdc.parameters import check_choice, is_number
from hdc.readouts import make_readout

READOUTS = ("lda", "kernel")
Form = tuple[Any, Any]
"""What tells one form of a family from another."""
_STEP = 32  # frames encoded at a time


@dataclass(kw_only=True, eq=False)
class Chosen(Classifier):
    """The simplest form of a family that no other is clearly better than.

    Folds keep frames of one group together.

    Args:
        fixed: name of the form where there are no folds: a class has one frame, or one group.
        folds: how many at most, from 2; fewer where a class has fewer frames, or groups.
        margin: in standard errors; 0 is the form of least error, the first of equal ones.

    Attributes:
        form_: name of the form that was chosen.
        model_: that model, trained.
    """

    fixed: str
    folds: int = 5
    margin: float = 1.0

    prediction_batch: ClassVar[int] = 500

    @abstractmethod
    def forms(self) -> dict[str, Form]:
        """Each form by its name, the simplest first.

        Raises:
            ValueError: for one that is none.
        """

    @abstractmethod
    def form(self, form: Form) -> Any:
        """An untrained model."""

    @abstractmethod
    def answers(
        self, bank: Bank, made: Sequence[Fold]
    ) -> Iterator[tuple[Form, np.ndarray]]:
        """Each form, and its labels of the test frames of all folds."""

    def choose(self, bank: Bank, train: np.ndarray) -> tuple[str, Any]:
        """The name of the form for some frames of a bank, and that model, untrained.

        Raises:
            ValueError: naming the field that is wrong.
        """
        forms = self.forms()
        check_choice("fixed", self.fixed, tuple(forms))
        if not is_number(self.margin) or self.margin < 0:
            raise ValueError(f"margin: expected 0 or more, found {self.margin!r}")
        losses = self._losses(_part(bank, train))
        name = self.fixed
        if losses:
            in_order = {name: losses[form] for name, form in forms.items()}
            name = simplest(in_order, self.margin)
        return name, self.form(forms[name])

    def _losses(self, bank: Bank) -> dict[Form, np.ndarray]:
        """1 for each wrong answer, 0 for each right one, of all folds, by form; none without
        folds."""
        made, _ = folds(bank.labels, np.arange(len(bank)), self.folds, bank.groups)
        if not made:
            return {}
        truth = bank.labels[np.concatenate([test for _, test in made])]
        every = self.answers(bank, made)
        return {form: (labels != truth).astype(float) for form, labels in every}

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[Mapping[str, float]]:
        """Choose and learn; yields as the chosen model does."""
        targets = self.start(frames, labels).cpu().numpy()
        groups = None
        if isinstance(frames, Rows):
            groups = frames.bank.groups_of(frames.rows)
        images = self.take(frames, slice(0, len(frames))).cpu()
        bank = Bank(images, targets, len(self.classes_), groups)
        self.form_, self.model_ = self.choose(bank, np.arange(len(bank)))
        yield from library.train(self.model_, images, targets)

    def predict(self, frames: Any) -> np.ndarray:
        """As of :meth:`baselines.base.Classifier.predict`."""
        frames = self.queries(frames)
        found = [np.empty(0, np.int64)]
        for start in range(0, len(frames), self.prediction_batch):
            rows = slice(start, start + self.prediction_batch)
            found.append(self.model_.predict(self.take(frames, rows)))
        return self.classes_[np.concatenate(found)]

    def scores(self, batch: Tensor) -> Tensor:
        """Those of the chosen model."""
        return self.model_.scores(batch)

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """See :func:`experiments.protocol.evaluate.evaluate`."""
        _, model = self.choose(bank, train)
        return library.predict_from(model, bank, train, queries)

    def state_tensors(self) -> dict[str, Tensor] | None:
        """Those of the chosen model."""
        return library.state_tensors(self.model_)


def _part(bank: Bank, rows: np.ndarray) -> Bank:
    """A bank of some of its frames."""
    groups = bank.groups_of(rows)
    return Bank(bank.frames[rows], bank.labels[rows], bank.n_classes, groups)


def simplest(losses: Mapping[str, np.ndarray], margin: float) -> str:
    """The first name whose losses [n] are no worse than the least by more than the margin.

    Args:
        losses: of the same frames, by name, the simplest first.
        margin: in standard errors of the mean of the paired differences.
    """
    best = min(losses.values(), key=lambda own: own.mean())
    for name, own in losses.items():
        more = own - best
        error = more.std(ddof=1) / np.sqrt(len(more))
        if more.mean() <= margin * error:
            return name
    raise ValueError("losses: expected at least one form, found none")


@dataclass(kw_only=True, eq=False)
class ReadoutChosen(Chosen):
    """Forms are each read-out on frames smoothed by each Gaussian, named ``"lda"``, ``"lda, smooth
    1"`` and so on; the first read-out at all deviations, then the next.

    Args:
        readouts: ``lda``, ``kernel`` or both, the simpler first.
        smooth: deviations of the Gaussian in pixels, 0 for none, rising.
    """

    fixed: str = "lda"
    readouts: Sequence[str] = READOUTS
    smooth: Sequence[int] = (0, 1, 2, 4)

    @abstractmethod
    def prepared(self, bank: Bank, smooth: int) -> tuple[Bank, Callable[[str], Any]]:
        """Functions that make untrained models of the read-outs, and the bank of their frames.

        All that does not depend on the fold is computed here, once for all folds and read-outs.
        """

    def forms(self) -> dict[str, Form]:
        found: dict[str, Form] = {}
        for readout in self.readouts:
            check_choice("readouts", readout, READOUTS)
            for deviation in self.smooth:
                name = f"{readout}, smooth {deviation}" if deviation else readout
                found[name] = readout, deviation
        return found

    def answers(
        self, bank: Bank, made: Sequence[Fold]
    ) -> Iterator[tuple[Form, np.ndarray]]:
        for deviation in self.smooth:
            seen, make = self.prepared(bank, deviation)
            found: dict[str, list[np.ndarray]] = {name: [] for name in self.readouts}
            for train, test in made:
                for readout, parts in found.items():
                    model = make(readout)
                    parts.append(library.predict_from(model, seen, train, test))
            for readout, parts in found.items():
                yield (readout, deviation), np.concatenate(parts)


@dataclass(kw_only=True, eq=False)
class BitsChosen(ReadoutChosen):
    """HDC, with an encoder relative to a reference, of smoothed frames.

    Args:
        encoder: one of :mod:`hdc.encoders` that is relative to the mean of the training frames, a
            name or an object.
        backend: as of :class:`hdc.HDCClassifier`.
    """

    encoder: Any = "deviation"
    backend: str = "auto"

    revision: ClassVar[int] = 1

    @classmethod
    def components(cls, **parameters: Any) -> tuple[type, ...]:
        """The classes of the parts that take part."""
        encoder = parameters.get("encoder", "deviation")
        if isinstance(encoder, dict):  # as in a config; it has a target of its own
            encoder = "deviation"
        readouts = [type(make_readout(name)) for name in READOUTS]
        return HDCClassifier, Smoothed, type(make_encoder(encoder)), *readouts

    def form(self, form: Form) -> HDCClassifier:
        readout, smooth = form
        encoder = Smoothed(self.encoder, smooth) if smooth else self.encoder
        return HDCClassifier(encoder, readout, self.device, self.backend)

    def prepared(self, bank: Bank, smooth: int) -> tuple[Bank, Callable[[str], Any]]:
        base = make_encoder(self.encoder)
        if not isinstance(base, RelativeEncoder) or base.frame is not None:
            raise ValueError(
                "encoder: expected one relative to the mean of the training frames, such as "
                f"deviation, found {self.encoder!r}"
            )

        def make(readout: str) -> HDCClassifier:
            return HDCClassifier(self.encoder, readout, self.device, self.backend)

        return _Standardised(bank, _values(bank, smooth)), make

    def scores(self, batch: Tensor) -> Tensor:
        """Like :meth:`hdc.HDCClassifier.decision_function`, two columns for two classes."""
        found = torch.from_numpy(self.model_.decision_function(batch))
        return found if found.ndim == 2 else torch.stack([-found, found], 1)


def _values(bank: Bank, smooth: int) -> Tensor:
    """Smoothed and standardised frames of a bank, int32 [N, D]."""
    parts: Any = bank.frames.split(_STEP)
    if smooth:
        parts = map(Smoothed("median", smooth).fit(bank.frames).images, parts)
    return torch.cat([standardised(part) for part in parts])


class _Standardised(Bank):
    """A bank whose frames were smoothed and standardised before, once for all folds.

    Args:
        bank: of the frames.
        values: the standardised frames, int32 [N, D].
    """

    def __init__(self, bank: Bank, values: Tensor) -> None:
        super().__init__(bank.frames, bank.labels, bank.n_classes, bank.groups)
        self.values = values

    def learned(self, encoder: Encoder, train: np.ndarray) -> Encoder:
        base: Any = encoder.unlearned()
        total = self.values[train].sum(0, dtype=torch.int64)
        base.reference_ = (total // len(train)).to(torch.int32)
        learned: Encoder = base
        return learned

    def encoded(self, encoder: Encoder, rows: np.ndarray) -> Tensor:
        relative: Any = encoder
        words = []
        for part in torch.from_numpy(rows).split(_STEP):
            differences = self.values[part] - relative.reference_
            words.append(relative.of_differences(differences, 0))
        return torch.cat(words)


@dataclass(kw_only=True, eq=False)
class GreysChosen(ReadoutChosen):
    """The same read-outs on grey values.

    Args:
        pixels: as of :class:`baselines.discriminant.GreysLDA`.
    """

    pixels: str = "standardised"

    revision: ClassVar[int] = 1

    @classmethod
    def components(cls, **parameters: Any) -> tuple[type, ...]:
        """The classes of the forms."""
        return GreysLDA, GreysKernel

    def form(self, form: Form) -> Classifier:
        readout, smooth = form
        kind = {"lda": GreysLDA, "kernel": GreysKernel}[readout]
        return kind(pixels=self.pixels, smooth=smooth, device=self.device)

    def prepared(self, bank: Bank, smooth: int) -> tuple[Bank, Callable[[str], Any]]:
        part, _ = smoothed_part(bank, smooth, np.arange(len(bank)))
        return part, lambda readout: self.form((readout, 0))


@dataclass(kw_only=True, eq=False)
class SoftmaxChosen(Chosen):
    """Converged softmax regression of raw or standardised frames with a penalty.

    Forms are each scaling with each strength, named ``"unit, C = 1"`` and so on.

    Args:
        pixels: scalings of :mod:`baselines.pixels`.
        strengths: values of C, the inverse strength of the penalty.
    """

    fixed: str = "standardised, C = 1"
    margin: float = 0.0
    pixels: Sequence[str] = ("standardised", "unit")
    strengths: Sequence[float] = (1.0, 0.01, 100.0)

    revision: ClassVar[int] = 1

    @classmethod
    def components(cls, **parameters: Any) -> tuple[type, ...]:
        """The class of the forms."""
        return (DualSoftmaxRegression,)

    def forms(self) -> dict[str, Form]:
        every = itertools.product(self.pixels, self.strengths)
        return {f"{pixels}, C = {c:g}": (pixels, c) for pixels, c in every}

    def form(self, form: Form) -> DualSoftmaxRegression:
        pixels, c = form
        return DualSoftmaxRegression(pixels=pixels, C=c, device=self.device)

    def answers(
        self, bank: Bank, made: Sequence[Fold]
    ) -> Iterator[tuple[Form, np.ndarray]]:
        for form in self.forms().values():
            model = self.form(form)
            parts = [model.predict_from(bank, train, test) for train, test in made]
            yield form, np.concatenate(parts)
