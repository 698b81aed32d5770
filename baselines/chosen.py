"""Models that choose their form among a few, by cross-validation on their training frames alone.

Candidates stand in an order, the simplest first. Chosen is the first of those that are no worse
than the best by more than a margin in standard errors of the paired differences between them (the
rule of one standard error: Breiman et al., Classification and Regression Trees (1984), 3.4.3).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from baselines.base import Classifier, FrameSource
from baselines.discriminant import GreysKernel, GreysLDA
from hdc import inputs
from hdc.bank import Bank, Selection
from hdc.classifier import HDCClassifier
from hdc.encoders import Smoothed, make_encoder
from hdc.parameters import check_choice, is_number
from hdc.readouts import make_readout
from hdc.selection import Fold, Frames, folds

READOUTS = ("lda", "kernel")


@dataclass(kw_only=True, eq=False)
class Chosen(Classifier):
    """The simplest of its candidates that no other is clearly better than.

    Folds keep frames of one group together. Where there are none (a class has one frame, or one
    group), the form `fixed` is taken.

    Args:
        fixed: name of the candidate where nothing can be chosen.
        folds: how many at most, from 2; fewer where a class has fewer frames, or groups.
        margin: in standard errors; 0 is the candidate of least error, the first of equal ones.

    Attributes:
        form_: name of the candidate that was chosen.
        model_: that model, trained.
    """

    fixed: str
    folds: int = 5
    margin: float = 1.0

    prediction_batch: ClassVar[int] = 500

    @abstractmethod
    def candidates(self) -> dict[str, Any]:
        """Untrained models by name, the simplest first."""

    def choose(self, bank: Bank, train: np.ndarray) -> tuple[str, Any]:
        """The name of the form for some frames of a bank, and that model, untrained.

        Raises:
            ValueError: naming the field that is wrong.
        """
        tried = self.candidates()
        check_choice("fixed", self.fixed, tuple(tried))
        if not is_number(self.margin) or self.margin < 0:
            raise ValueError(f"margin: expected 0 or more, found {self.margin!r}")
        data = Frames(bank, (), (), None, None, group=bank.groups)
        made, _ = folds(data, np.asarray(train), self.folds)
        name = self.fixed
        if made:
            losses = {key: self._losses(tried[key], bank, made) for key in tried}
            name = simplest(losses, self.margin)
        return name, tried[name]

    def _losses(self, model: Any, bank: Bank, made: Sequence[Fold]) -> np.ndarray:
        """1 for each wrong answer, 0 for each right one, of all folds."""
        wrong = []
        for train, test in made:
            found = model.predict_from(bank, train, test)
            wrong.append(found != bank.labels[test])
        return np.concatenate(wrong).astype(float)

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[Mapping[str, float]]:
        """Choose and learn; yields as the chosen model does."""
        targets = self.start(frames, labels).cpu().numpy()
        groups = None
        if isinstance(frames, Selection) and frames.bank.groups is not None:
            groups = frames.bank.groups[frames.rows]
        images = self.take(frames, slice(0, len(frames))).cpu()
        bank = Bank(images, targets, len(self.classes_), groups)
        self.form_, self.model_ = self.choose(bank, np.arange(len(bank)))
        yield from self.model_.train(images, targets)

    def predict(self, frames: Any) -> np.ndarray:
        """As of :meth:`baselines.base.Classifier.predict`."""
        if not hasattr(self, "classes_"):
            raise RuntimeError(
                f"{type(self).__name__}: predict needs train or fit first"
            )
        frames = inputs.indexable(frames, self.shape_)
        inputs.check_shape(frames.shape[1:], self.shape_, type(self).__name__)
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
        return model.predict_from(bank, train, queries)

    def state_tensors(self) -> dict[str, Tensor] | None:
        """Those of the chosen model."""
        return self.model_.state_tensors()


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
class Family(Chosen):
    """Forms of one family: each read-out on frames smoothed by each Gaussian.

    Candidates are named ``"lda"``, ``"lda, smooth 1"`` and so on; the first read-out at all
    deviations, then the next.

    Args:
        readouts: ``lda``, ``kernel`` or both, the simpler first.
        smooth: deviations of the Gaussian in pixels, 0 for none, rising.
    """

    fixed: str = "lda"
    readouts: Sequence[str] = READOUTS
    smooth: Sequence[int] = (0, 1, 2, 4)

    def candidates(self) -> dict[str, Any]:
        found = {}
        for readout in self.readouts:
            check_choice("readouts", readout, READOUTS)
            for deviation in self.smooth:
                name = f"{readout}, smooth {deviation}" if deviation else readout
                found[name] = self.form(readout, deviation)
        return found

    @abstractmethod
    def form(self, readout: str, smooth: int) -> Any:
        """An untrained model."""


@dataclass(kw_only=True, eq=False)
class BitsChosen(Family):
    """HDC, with an encoder of one's choice on smoothed frames.

    Args:
        encoder: of :mod:`hdc.encoders`, a name or an object.
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

    def form(self, readout: str, smooth: int) -> HDCClassifier:
        encoder = Smoothed(self.encoder, smooth) if smooth else self.encoder
        return HDCClassifier(encoder, readout, self.device, self.backend)

    def scores(self, batch: Tensor) -> Tensor:
        """As of :meth:`hdc.HDCClassifier.decision_function`, two columns for two classes."""
        found = torch.from_numpy(self.model_.decision_function(batch))
        return found if found.ndim == 2 else torch.stack([-found, found], 1)


@dataclass(kw_only=True, eq=False)
class GreysChosen(Family):
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

    def form(self, readout: str, smooth: int) -> Classifier:
        kind = {"lda": GreysLDA, "kernel": GreysKernel}[readout]
        return kind(pixels=self.pixels, smooth=smooth, device=self.device)
