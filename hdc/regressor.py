"""Numbers from frames: ridge regression or nearest frames on packed hypervectors."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, floor
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from hdc import bits, inputs, io
from hdc.estimator import Estimator, check_share
from hdc.readout import Residuals, Ridge, ridge

READOUTS = ("ridge", "neighbours")


class HDCRegressor(Estimator):
    """Predicts one or several numbers a frame, such as a position in mm, from its hypervector.

    The hypervectors of all training frames are kept (31 kB each at D = 250,000).

    Args:
        readout: ``"ridge"``: ridge regression on the bits (:mod:`hdc.readout`); or
            ``"neighbours"``: the mean of the nearest frames.
        n_neighbours: how many nearest frames.
        device: where frames are encoded and hypervectors live.
        backend: see :class:`hdc.HDCClassifier`.

    Attributes:
        residuals_: exact leave-one-out errors of the training frames, float64 [N, T].
        dimension_, n_features_in_: D, the pixels of a frame.
        frame_shape_: (H, W) or (D,).
        ridge_: weights, for ``readout="ridge"``.
        metadata_: values that :meth:`save` was given to keep with the model.

    Example:
        >>> frames = np.random.default_rng(0).integers(0, 255, (20, 30, 30))
        >>> model = HDCRegressor().fit(frames, np.arange(20.0))
        >>> model.predict(frames[:1]).shape
        (1,)
    """

    _estimator_type = "regressor"
    _choices: Mapping[str, tuple[Any, ...]] = {"readout": READOUTS}

    ridge_: Ridge
    residuals_: np.ndarray
    _held: Residuals  # of readout "ridge"
    _words: Tensor
    _values: Tensor  # float64 [N, T]
    _one: bool  # targets have one dimension
    _recalibrated: bool

    def __init__(
        self,
        readout: str = "ridge",
        n_neighbours: int = 1,
        device: str = "cpu",
        backend: str = "auto",
    ):
        self.readout = readout
        self.n_neighbours = n_neighbours
        self.device = device
        self.backend = backend

    def fit(self, frames: Any, y: Any) -> Self:
        """Learn numbers y [N] or [N, T] of frames [N, H, W] or [N, D].

        A call that raises leaves the model as it was.

        Raises:
            ValueError: for fewer than two frames, lengths that differ, or pixels or numbers that
                are not finite.
        """
        trained = self._untrained()
        trained._learn(*trained._pairs(frames, y))
        self._adopt(trained)
        return self

    def partial_fit(self, frames: Any, y: Any) -> Self:
        """Add frames to those that are kept, and solve again.

        Raises:
            ValueError: as :meth:`fit`, or after :meth:`recalibrate`, which keeps new frames only.
        """
        if not hasattr(self, "_words"):
            return self.fit(frames, y)
        if self._recalibrated:
            raise ValueError(
                "partial_fit: expected a model that was not recalibrated; fit anew"
            )
        words, values = self._pairs(frames, y)
        self._learn(torch.cat((self._words, words)), torch.cat((self._values, values)))
        return self

    def recalibrate(self, frames: Any, y: Any) -> Self:
        """Adapt to a changed environment by few new frames.

        Ridge regression goes from its old weights to those near them that fit the new frames, with
        the penalty of training. The new frames replace those that are kept.

        Raises:
            ValueError: as :meth:`fit`.
        """
        self._check_is_trained()
        self._learn(
            *self._pairs(frames, y), self.ridge_ if self.readout == "ridge" else None
        )
        self._recalibrated = True
        return self

    def _pairs(self, frames: Any, y: Any) -> tuple[Tensor, Tensor]:
        """Hypervectors [N, W], and numbers float64 [N, T] like those of before."""
        self._check_parameters()
        frames = self._given(frames, training=True)
        values = inputs.targets(y, len(frames))
        words = torch.cat(list(self._encoded(frames)))
        table = torch.from_numpy(values.reshape(len(values), -1))
        if not hasattr(self, "_words"):
            self._set_shape(frames.shape[1:])
            self._one = values.ndim == 1
        elif (values.ndim == 1) != self._one or table.shape[1] != self._values.shape[1]:
            raise ValueError(
                f"targets: expected as many a frame as before, found {values.shape}"
            )
        return words, table

    def _learn(self, words: Tensor, values: Tensor, prior: Ridge | None = None) -> None:
        if len(words) < 2:
            raise ValueError(
                f"frames: expected at least two, found {len(words)} sample"
            )
        self._words, self._values, self._recalibrated = words, values, False
        if self.readout == "ridge":
            self.ridge_, self._held = ridge(
                words, values, self.dimension_, prior, self._backend()
            )
            self.residuals_ = self._held.residuals.numpy()
        else:
            self.residuals_ = (values - self._means(words, own=True)[0]).numpy()

    def predict(
        self, frames: Any, return_interval: bool = False, alpha: float = 0.1
    ) -> Any:
        """Numbers [Q] or [Q, T] of frames [Q, H, W] or [Q, D].

        Args:
            frames: the queries.
            return_interval: also return lower and upper ends, of the same shape, of jackknife+
                intervals (Barber et al., Ann. Stat. 49, 486 (2021)). If queries and training frames
                are exchangeable, a number lies in its interval with probability 1 − 2·alpha at
                least, and 1 − alpha in practice (ridge regression: as far as leaving one frame out
                changes neither the penalty nor the rounding of weights). After drift nothing is
                guaranteed. Ends are infinite with fewer than 1/alpha − 1 training frames.
            alpha: share of the numbers that may lie outside, each of T numbers for itself.

        Raises:
            ValueError: for a share outside (0, 1).
        """
        self._check_is_trained()
        alpha = check_share(alpha)
        parts: list[tuple[Tensor, ...]] = []
        for words in self._encoded(frames):
            if self.readout == "neighbours":
                centre, without = self._means(words)
            else:
                centre = self.ridge_.scores(words, self._backend()).cpu()
                if return_interval:
                    change = self._held.changes(words, self.dimension_, self._backend())
                    without = centre[:, None] - change
            ends = _ends(without, self.residuals_, alpha) if return_interval else ()
            parts.append((centre, *ends))
        answers = [torch.cat(part).numpy() for part in zip(*parts, strict=True)]
        answers = [answer[:, 0] if self._one else answer for answer in answers]
        return tuple(answers) if return_interval else answers[0]

    def score(self, frames: Any, y: Any) -> float:
        """R², the share of the variance that is predicted, averaged over targets."""
        found = self.predict(frames)
        values = inputs.targets(y, len(found)).reshape(found.shape)
        error, spread = (
            ((values - found) ** 2).sum(0),
            ((values - values.mean(0)) ** 2).sum(0),
        )
        flat = np.where(error == 0, 1.0, 0.0)
        return float(
            np.mean(np.where(spread > 0, 1 - error / np.maximum(spread, 1e-300), flat))
        )

    def _stored(self) -> tuple[dict[str, Any], dict[str, Tensor]]:
        tensors = {"words": self._words, "values": self._values}
        tensors["residuals"] = torch.from_numpy(self.residuals_)
        if self.readout == "ridge":
            held = {"inverse": self._held.inverse, "means": self._held.means}
            tensors |= self.ridge_.tensors() | held
        return {"recalibrated": self._recalibrated, "one": self._one}, tensors

    def _restore(self, header: Mapping[str, Any], tensors: dict[str, Tensor]) -> None:
        (n, t), width = tensors["values"].shape, bits.words_for(self.dimension_)
        expected = {
            "words": (n, width), "values": (n, t), "residuals": (n, t), "inverse": (n, n),
            "means": (n,), **Ridge.shapes(t, width),
        }  # fmt: skip
        io.check_tensors(tensors, expected)
        here = {name: tensor.to(self.device) for name, tensor in tensors.items()}
        self._words, self._values = here["words"], tensors["values"]
        self._one, self._recalibrated = (
            bool(header["one"]),
            bool(header["recalibrated"]),
        )
        self.residuals_ = tensors["residuals"].numpy()
        if self.readout == "ridge":
            self.ridge_ = Ridge.of(here, self.dimension_)
            parts = (tensors[name] for name in ("inverse", "means", "residuals"))
            self._held = Residuals(self._words, *parts)

    def _means(self, words: Tensor, own: bool = False) -> tuple[Tensor, Tensor]:
        """Means of the nearest frames [Q, T], and those without each frame, [Q, N, T].

        With `own`, the queries are the kept frames, none of which is its own neighbour.
        """
        distances = bits.hamming(words, self._words, self._backend()).cpu().numpy()
        if own:
            np.fill_diagonal(distances, self.dimension_ + 1)
        k = min(self.n_neighbours, len(self._words) - 1)
        places = torch.from_numpy(distances.argsort(axis=1, kind="stable")[:, : k + 1])
        values = self._values[places]  # [Q, k + 1, T]
        means = values[:, :k].mean(1)
        if own:
            return means, means[:, None]
        without = means[:, None].repeat(1, len(self._words), 1)
        change = (values[:, k:] - values[:, :k]) / k
        rows = torch.arange(len(words))[:, None]
        without[rows, places[:, :k]] += change
        return means, without


def _ends(
    without: Tensor, residuals: np.ndarray, alpha: float
) -> tuple[Tensor, Tensor]:
    """Jackknife+ ends [Q, T] of predictions without each frame [Q, N, T] and errors [N, T]."""
    n, spread = len(residuals), torch.from_numpy(residuals).abs()
    low, high = floor(alpha * (n + 1)), ceil((1 - alpha) * (n + 1))
    if low < 1 or high > n:
        infinite = torch.full_like(without[:, 0], torch.inf)
        return -infinite, infinite
    lower = (without - spread).kthvalue(low, dim=1).values
    return lower, (without + spread).kthvalue(high, dim=1).values
