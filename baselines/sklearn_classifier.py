"""Any scikit-learn classifier on the flattened pixels, from a config alone (docs/extend.md).

This file imports no scikit-learn: the estimator is an argument.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from baselines.base import Classifier, FrameSource, in_memory_order
from baselines.pixels import scaling


@dataclass(kw_only=True, eq=False)
class SklearnClassifier(Classifier):
    """Adapter from frames to an estimator with ``fit`` and ``predict`` on float32 [N, D].

    Args:
        estimator: an unfitted estimator; a copy of it is fitted.
        pixels: one of the scalings in baselines.pixels, by name.
        seed: given to the estimator as ``random_state`` where it has one that is not set.

    Attributes:
        estimator_: the fitted copy.
    """

    estimator: Any
    pixels: str = "unit"
    seed: int = 0

    revision: ClassVar[int] = 1

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """Fit; yields once: samples_seen = N."""
        targets = self.start(frames, labels)
        self.scaling_ = scaling(self.pixels, self.frame_dtype_)
        features = self._features(self.read(frames, slice(0, len(frames))))
        estimator = copy.deepcopy(self.estimator)
        if estimator.get_params().get("random_state", 0) is None:
            estimator.set_params(random_state=self.seed)
        self.estimator_ = estimator.fit(features, targets.numpy(force=True))
        # A caller that keeps this generator suspended would keep them alive.
        del features
        yield {"samples_seen": len(frames)}

    def scores(self, batch: Tensor) -> Tensor:
        """1 for the predicted class, 0 for the others; [n, L]."""
        predicted = self.estimator_.predict(self._features(batch))
        labels = torch.from_numpy(np.asarray(predicted))
        return F.one_hot(labels.long(), len(self.classes_))

    def state_tensors(self) -> dict[str, Tensor] | None:
        """The arrays of a linear estimator, ``coef_`` and ``intercept_``; None for any other, whose
        state has no known form."""
        learnt, names = vars(self.estimator_), ("coef_", "intercept_")
        if not set(names) <= learnt.keys():
            return None
        tensors = {name: torch.from_numpy(learnt[name]) for name in names}
        return {name: in_memory_order(tensor) for name, tensor in tensors.items()}

    def _features(self, batch: Tensor) -> np.ndarray:
        return self.scaling_(batch).flatten(1).numpy(force=True)
