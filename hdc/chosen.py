"""A classifier whose encoder and read-out are chosen by cross-validation on its training frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, Self

import numpy as np
from torch import Tensor

from hdc import inputs
from hdc.bank import Bank
from hdc.classifier import HDCClassifier
from hdc.selection import (
    Combination,
    Frames,
    combinations,
    cross_validate,
    folds,
    in_bank,
)


class Chosen:
    """The best of some forms of :class:`hdc.HDCClassifier`, by the folds of ``hdc train --choose``.

    Where a class has a single training frame there are no folds, and the first form is taken.
    Nothing is drawn at random but the folds, which are the same for the same frames.

    Args:
        forms: pairs of an encoder and a read-out, by name, the one to fall back on first.
        backend: as of :class:`hdc.HDCClassifier`.
        device: where frames are encoded.

    Attributes:
        form_: name of the form that was chosen, ``"encoder, readout"``.
        model_: that classifier, trained.

    Example:
        >>> import torch
        >>> frames = torch.tensor([[[0, 9, 8, 1]], [[9, 1, 0, 8]]] * 4, dtype=torch.uint8)
        >>> labels = np.array([0, 1] * 4)
        >>> model = Chosen([["median", "majority"], ["median", "lda"]]).fit(frames, labels)
        >>> model.form_
        'median, majority'
    """

    revision: ClassVar[int] = 1
    """Raised by hand in the commit that changes which form is chosen."""

    form_: str
    model_: HDCClassifier

    def __init__(
        self,
        forms: Sequence[Sequence[str]],
        backend: str = "auto",
        device: str = "cpu",
    ) -> None:
        self.forms = forms
        self.backend = backend
        self.device = device

    @classmethod
    def components(cls, **parameters: Any) -> tuple[type, ...]:
        """The classes of the parts that its forms name."""
        found: dict[type, None] = {HDCClassifier: None}
        for encoder, readout in parameters.get("forms", ()):
            parts = HDCClassifier.components(encoder=encoder, readout=readout)
            found |= dict.fromkeys(parts)
        return tuple(found)

    def choose(self, bank: Bank, train: np.ndarray) -> tuple[str, HDCClassifier]:
        """The name of the best form on some frames of a bank, and that classifier, untrained.

        Frames of one group of the bank are in one fold.

        Raises:
            ValueError, TypeError: for a form that is not a known encoder and a known read-out.
        """
        forms = self._forms()
        frames = Frames(bank, (), (), bank.groups, None, self.backend)
        made, _ = folds(frames, train)
        best = forms[0]
        if made:
            scores = cross_validate(forms, frames, made)
            found = scores.best(Combination)
            if isinstance(found, Combination):
                best = found
        model = HDCClassifier(best.encoder, best.readout, self.device, self.backend)
        return best.name, model

    def train(self, frames: Any, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """Choose and learn from frames uint8 or uint16 [N, H, W] or [N, D] and their labels [N];
        yields once, ``{"samples_seen": N}``.

        Raises:
            ValueError: for frames of another type, which a bank does not take.
        """
        labels = inputs.label_array(labels, len(frames))
        bank, rows = in_bank(frames, labels)
        self.form_, model = self.choose(bank, rows)
        self.model_ = model.fit(frames, labels)
        yield {"samples_seen": len(frames)}

    def fit(self, frames: Any, labels: Any) -> Self:
        """Choose and learn; frames as of :meth:`train`, labels and errors as of
        :meth:`hdc.HDCClassifier.fit` and :meth:`choose`."""
        for _ in self.train(frames, labels):
            pass
        return self

    def predict(self, frames: Any) -> np.ndarray:
        """Labels [Q] of frames [Q, H, W] or [Q, D]."""
        return self.model_.predict(frames)

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """Labels [Q] of frames of a bank by a model like this one, trained on others of them."""
        _, model = self.choose(bank, train)
        return model.predict_from(bank, train, queries)

    def state_tensors(self) -> dict[str, Tensor]:
        """Those of the chosen classifier."""
        return self.model_.state_tensors()

    def _forms(self) -> list[Combination]:
        for form in self.forms:
            if isinstance(form, str) or len(form) != 2:
                raise ValueError(
                    f"forms: expected pairs of an encoder and a read-out, found {form!r}"
                )
            combinations([form[0]], [form[1]], learns_values=False)  # checks both
        if not self.forms:
            raise ValueError("forms: expected at least one, found none")
        return [Combination(encoder, readout) for encoder, readout in self.forms]
