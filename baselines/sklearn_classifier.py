"""Any scikit-learn classifier on the flattened pixels.

The estimator comes ready-made from the configuration, so that this file imports no scikit-learn:

    _target_: baselines.sklearn_classifier.SklearnClassifier
    estimator: {_target_: sklearn.linear_model.RidgeClassifier, alpha: 1.0}
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines.base import Classifier, FrameSource, in_memory_order
from baselines.pixels import fit_scaling

FRAMES = 20  # scaled at a time into the one float32 array


@dataclass(kw_only=True, eq=False)
class SklearnClassifier(Classifier):
    """Adapter from frames to an estimator with ``fit`` and ``predict`` on float32 [N, D].

    Args:
        estimator: an unfitted estimator; it is copied, never fitted itself.
        pixels: one of the scalings in baselines.pixels, by name.
        seed: given to the estimator as ``random_state`` where it has one that is not set.

    Attributes:
        estimator_: the fitted copy.
    """

    estimator: Any
    pixels: str = "unit"
    seed: int = 0

    def train(self, frames: FrameSource, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """Fit; yields once: samples_seen = N."""
        targets = self.start(frames, labels)
        self.scaling_ = fit_scaling(self.pixels, self, frames)
        features = np.empty((len(frames), self.shape_[0] * self.shape_[1]), dtype=np.float32)
        for start in range(0, len(frames), FRAMES):
            rows = slice(start, start + FRAMES)
            features[rows] = self._features(self.load(frames, rows))
        estimator = copy.deepcopy(self.estimator)
        if estimator.get_params().get("random_state", 0) is None:
            estimator.set_params(random_state=self.seed)
        self.estimator_ = estimator.fit(features, targets.numpy(force=True))
        del features  # whoever asks for no more than this keeps the generator, and them with it
        yield {"samples_seen": len(frames)}

    def scores(self, batch: Tensor) -> Tensor:
        """One for the class predicted, zero for the others; [n, L]."""
        predicted = torch.from_numpy(np.asarray(self.estimator_.predict(self._features(batch))))
        return torch.nn.functional.one_hot(predicted.long(), len(self.classes_))

    def state_tensors(self) -> dict[str, Tensor]:
        """Every numeric array in the fitted estimator or in a part of it, by attribute name.

        Raises:
            TypeError: if it keeps what it learnt anywhere else (trees, for instance).
        """
        arrays = dict(_arrays(self.estimator_))
        if not arrays:
            raise TypeError(
                f"{type(self.estimator_).__name__}: expected learnt parameters in NumPy arrays, "
                "found none"
            )
        tensors = {name: in_memory_order(torch.from_numpy(array)) for name, array in arrays.items()}
        return tensors | self.scaling_.state_tensors()

    def _features(self, batch: Tensor) -> np.ndarray:
        return self.scaling_(batch).flatten(1).numpy(force=True)


def _arrays(part: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """The writable numeric arrays in the attributes, lists and tuples of an estimator."""
    if isinstance(part, np.ndarray):
        if part.dtype.kind in "fiu" and part.flags.writeable and part.size:
            yield name, part
    elif isinstance(part, list | tuple):
        for k, inner in enumerate(part):
            yield from _arrays(inner, f"{name}.{k}")
    elif hasattr(part, "get_params"):
        for key, value in vars(part).items():
            # What the constructor was given is a hyperparameter, except the steps of a pipeline.
            if key != "classes_" and (key == "steps" or key not in part.get_params(deep=False)):
                yield from _arrays(value, f"{name}.{key}".lstrip("."))
