"""Models trained on many subsets of the same frames, in the space of samples.

The weights of a linear classifier with an L2 penalty are combinations of its training frames
(baselines.dual), and so are the templates of the correlation classifier. So the products of all
pairs of frames, made once, train and ask such a model on any subset: a subset costs its number of
samples squared, however many pixels there are.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from omegaconf import OmegaConf
from torch import Tensor
from torch.nn import functional as F

from baselines.correlation import CorrelationClassifier
from baselines.dual import PIXELS, DualLinearClassifier
from baselines.integer import integer_product
from experiments.protocol.trial import instantiate
from hdc import HDCClassifier

Model = HDCClassifier | DualLinearClassifier | CorrelationClassifier


def models_of(configs: Mapping[str, Any]) -> dict[str, Model]:
    """The models of these configurations, by name: what a file of ``configs/model`` holds.

    Raises:
        ValueError: naming the key of one that cannot be trained on subsets.
    """
    made = {}
    for name, part in configs.items():
        model = instantiate(OmegaConf.create(part["model"]), "model")
        key, kind = f"task.models.{name}", type(model).__name__
        if isinstance(model, DualLinearClassifier):
            if model.pixels != "unit":
                raise ValueError(f"{key}.pixels: expected unit, found {model.pixels!r}")
        elif isinstance(model, HDCClassifier):
            if model.prototype != "binary":
                raise ValueError(f"{key}.prototype: expected binary, found {model.prototype!r}")
        elif not isinstance(model, CorrelationClassifier):
            raise ValueError(
                f"{key}: expected HDC, a linear model in its dual form or image correlation, "
                f"found {kind}"
            )
        made[name] = model
    return made


class Products:
    """Products of frames with those that may train.

    Args:
        frames: uint8 [N, H, W].
        labels: int64 [N].
        n_classes: L.
        n_train: the first so many may train; all, if None.

    Attributes:
        gram: Σ over pixels of (x − 128)(x′ − 128), float64 [N, M], exact.
        labels: int64 [N].

    Raises:
        ValueError: for frames of another type.
    """

    def __init__(
        self, frames: Tensor, labels: np.ndarray, n_classes: int, n_train: int | None = None
    ):
        if frames.dtype != torch.uint8:
            raise ValueError(f"frames: expected uint8, found {frames.dtype}")
        self.labels, self.n_classes = torch.from_numpy(labels), n_classes
        pixels = frames.flatten(1)
        self._dimension = pixels.shape[1]
        n_train = len(frames) if n_train is None else n_train
        self.gram = torch.zeros(len(frames), n_train, dtype=torch.float64)
        self._sums = torch.zeros(len(frames), dtype=torch.float64)
        for start in range(0, self._dimension, PIXELS):
            shifted = (pixels[:, start : start + PIXELS] ^ 128).view(torch.int8)
            self.gram += integer_product(shifted, shifted[:n_train].T)
            self._sums += shifted.sum(1, dtype=torch.int64)

    def scores(self, model: Model, train: np.ndarray, asked: np.ndarray) -> Tensor:
        """What a model trained on some samples says of others: float64 [n, L], the largest wins.

        Args:
            model: one of baselines.dual, or the correlation classifier; it is left as it was.
            train: indices below M; one that stands there k times counts k times.
            asked: indices [n].
        """
        if isinstance(model, CorrelationClassifier):
            return self._correlations(train, asked)
        assert isinstance(model, DualLinearClassifier)
        solver = copy.copy(model)
        solver.classes_ = np.arange(self.n_classes)
        inside, across = self.centred(train, asked)
        coefficients, bias, _ = solver.solve(inside, self.labels[train])
        return across @ (coefficients - coefficients.mean(0)) + bias

    def centred(self, train: np.ndarray, asked: np.ndarray) -> tuple[Tensor, Tensor]:
        """Products of pixels in 0…1, less the mean of the training frames: of these with each
        other [N, N], and of those asked for with them [n, N]."""
        inside, across = (self.gram[np.ix_(rows, train)] / 255**2 for rows in (train, asked))
        mean, square = inside.mean(0), inside.mean()
        return (
            inside - mean - mean[:, None] + square,
            across - mean - across.mean(1, keepdim=True) + square,
        )

    def _correlations(self, train: np.ndarray, asked: np.ndarray) -> Tensor:
        """Zero-mean correlation with the mean frames of the classes, but for a factor a frame."""
        member = F.one_hot(self.labels[train], self.n_classes).double()
        member /= member.sum(0)
        inside, across = (
            self.gram[np.ix_(rows, train)]
            - torch.outer(self._sums[rows], self._sums[train]) / self._dimension
            for rows in (train, asked)
        )
        return across @ member / torch.einsum("kc,kj,jc->c", member, inside, member).sqrt()
