"""Any scikit-learn classifier on the flattened pixels.

The estimator comes ready-made from the configuration, so that this file imports no scikit-learn:

    _target_: baselines.sklearn_classifier.SklearnClassifier
    estimator: {_target_: sklearn.linear_model.RidgeClassifier, alpha: 1.0}
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
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
            features[rows] = self._features(self.read(frames, rows))
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

    def state_tensors(self) -> dict[str, Tensor] | None:
        """The numeric arrays in the fitted estimator and its parts, by attribute name.

        None if it keeps anything it learnt in other objects (trees, for instance), or nothing in
        arrays.
        """
        try:
            arrays = dict(_arrays(self.estimator_))
        except (_Unknown, RecursionError):  # the latter where parts refer to one another
            return None
        if not arrays:
            return None
        tensors = {name: in_memory_order(torch.from_numpy(array)) for name, array in arrays.items()}
        return tensors | self.scaling_.state_tensors()

    def _features(self, batch: Tensor) -> np.ndarray:
        return self.scaling_(batch).flatten(1).numpy(force=True)


class _Unknown(Exception):
    """Learnt state that is in no array."""


def _arrays(part: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """The numeric arrays in the attributes, lists and dictionaries of an estimator.

    Raises:
        _Unknown: for an object of which nothing is known, or an array torch cannot share.
    """
    if isinstance(part, np.ndarray):
        if part.dtype.kind not in "biuf" or part.dtype.itemsize > 8 or not part.flags.writeable:
            raise _Unknown
        if part.size:
            yield name, part
    elif isinstance(part, Mapping):
        for key, inner in part.items():
            yield from _arrays(inner, f"{name}.{key}")
    elif isinstance(part, list | tuple):
        for k, inner in enumerate(part):
            yield from _arrays(inner, f"{name}.{k}")
    elif hasattr(part, "get_params") and not isinstance(part, type):
        for key, value in vars(part).items():
            # What the constructor was given is a hyperparameter, except the steps of a pipeline.
            if key != "classes_" and (key == "steps" or key not in part.get_params(deep=False)):
                yield from _arrays(value, f"{name}.{key}".lstrip("."))
    elif part is not None and not isinstance(part, str | int | float | np.generic):
        raise _Unknown
