"""Numbers from frames: an encoder and a read-out of numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, floor
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import backends, inputs
from hdc.accuracy import r_squared
from hdc.encoders import ENCODERS, Encoder
from hdc.hypervectors import Encoding, Hypervectors, joined, source
from hdc.parameters import check_share
from hdc.readouts import VALUE_READOUTS
from hdc.readouts.values import ValueReadout, ValueState
from hdc.saved import Saved
from hdc.tensors import Parts, check_parts, checked


class HDCRegressor(Saved):
    """Regression of one or several numbers per frame, such as a position in mm.

    The hypervectors of all training frames are kept (31 kB each at D = 250,000).

    Args:
        encoder: as in :class:`hdc.HDCClassifier`.
        readout: ``"ridge"`` or ``"neighbours"``; an object of
            :class:`hdc.readouts.ValueReadout`; or the dotted name of such a class.
        device: the device that computes and holds the model.
        backend: as in :class:`hdc.HDCClassifier`.

    Attributes:
        encoder_: the encoder, trained.
        readout_, state_: the read-out, and what it has learned.
        prediction_bytes_: bytes of memory that a prediction with intervals needs.
        mean_: mean of the training numbers, float64 [T].
        n_features_in_: pixels of a frame.
        dimension_: D, bits of a hypervector.
        frame_shape_: (H, W) or (pixels,).
        metadata_: the metadata that were saved with the model.

    Example:
        >>> frames = np.random.default_rng(0).integers(0, 255, (20, 30, 30))
        >>> model = HDCRegressor().fit(frames, np.arange(20.0))
        >>> model.predict(frames[:1]).shape
        (1,)
    """

    _estimator_type = "regressor"
    parts: ClassVar = {"encoder": ENCODERS, "readout": VALUE_READOUTS}

    readout_: ValueReadout
    state_: ValueState
    _one: bool  # targets have one dimension
    _recalibrated: bool

    def __init__(
        self,
        encoder: Encoder | str = "median",
        readout: ValueReadout | str = "ridge",
        device: str = "cpu",
        backend: str = "auto",
    ):
        self.encoder = encoder
        self.readout = readout
        self.device = device
        self.backend = backend

    def fit(self, frames: Any, y: Any) -> Self:
        """Learn from frames [N, H, W] or [N, D] and numbers y [N] or [N, T].

        A call that raises leaves the model unchanged.

        Raises:
            ValueError: for fewer than two frames, different lengths, or pixels or numbers that are
                not finite.
        """
        encoder, readout = self.fresh("encoder"), self.fresh("readout")
        columns, frames = inputs.columns_of(frames), source(frames)
        values = _numbers(y, len(frames))
        _check_enough(frames)
        encoding = Encoding.learned(encoder, frames, self.device, self.backend)
        with backends.computing(encoding.backend):
            words = joined(encoding.encoded(frames))
            state = readout.fit(words, _table(values))
        self._encoding = encoding
        self.columns_, self.metadata_ = columns, {}
        self._one = values.ndim == 1
        self.readout_, self.state_ = readout, state
        self._recalibrated = False
        return self

    def recalibrate(self, frames: Any, y: Any) -> Self:
        """Adapt to a changed environment by a few new frames, which replace the stored ones.

        Ridge regression fits the new frames, and applies the penalty of training to the change of
        its weights. A call that raises leaves the model unchanged.

        Raises:
            ValueError: as :meth:`fit`.
        """
        words = self.encode(frames)
        _check_enough(words)
        table = self._more_targets(_numbers(y, len(words)))
        with self._computing():
            self.state_ = self.readout_.adapt(self.state_, words, table)
        self._recalibrated = True
        return self

    def _more_targets(self, values: np.ndarray) -> Tensor:
        """:func:`_table` of further numbers; ValueError unless as many a frame as in training."""
        table = _table(values)
        if table.shape[1] != self.state_.targets.shape[1]:
            raise ValueError(
                f"targets: expected as many a frame as before, found {values.shape}"
            )
        return table

    @property
    def mean_(self) -> np.ndarray:
        return self.state_.targets.mean(dim=0).numpy()

    def predict(
        self, frames: Any, return_interval: bool = False, alpha: float = 0.1
    ) -> Any:
        """Numbers [Q] or [Q, T] of frames [Q, H, W] or [Q, D].

        Args:
            frames: the queries.
            return_interval: also return the lower and the upper ends, of the same shape, of
                jackknife+ intervals (Barber et al., Ann. Stat. 49, 486 (2021)). If queries and
                training frames are exchangeable, a number lies in its interval with probability at
                least 1 − 2·alpha, and about 1 − alpha in practice. For ridge regression this
                assumes that leaving one frame out changes neither the penalty nor the rounding of
                weights. Nothing is guaranteed after drift. The ends are infinite with fewer than
                1/alpha − 1 training frames.
            alpha: share of the numbers that may lie outside, for each of the T numbers separately.

        Raises:
            ValueError: for a share outside (0, 1), or a read-out without intervals.
        """
        self._check_is_trained()
        share = check_share("alpha", alpha, "(0, 1)")
        readout, state = self.readout_, self.state_
        with self._computing():
            batches = self._encoded(frames)
            if not return_interval:
                return self._shaped([readout.values(state, words) for words in batches])
            parts = []
            for words in batches:
                centre, without = readout.without(state, words)
                parts.append((centre, *_ends(without, state.residuals, share)))
        return tuple(self._shaped(part) for part in zip(*parts, strict=True))

    def _shaped(self, parts: Sequence[Tensor]) -> np.ndarray:
        """Predictions [Q, T] in parts, as one array in the shape of the training numbers."""
        answers = torch.cat(list(parts)).numpy()
        return answers[:, 0] if self._one else answers

    def score(self, frames: Any, y: Any) -> float:
        """R², the share of the variance that is predicted, averaged over the targets.

        Raises:
            ValueError: as :meth:`predict`; for no frames; or for numbers that :meth:`fit` refuses,
                or more or fewer a frame than in training.
        """
        found = self.predict(frames)
        inputs.check_any(found)
        truth = self._more_targets(_numbers(y, len(found))).numpy()
        answers = _table(found).numpy()
        pairs = zip(truth.T, answers.T, strict=True)
        return float(np.mean([r_squared(*pair) for pair in pairs]))

    @property
    def prediction_bytes_(self) -> int:
        tensors = [*self.encoder_.state().values(), *self.state_.tensors().values()]
        tensors += [self.state_.words.packed, self.state_.targets]
        return sum(tensor.nbytes for tensor in tensors)

    def _stored(self) -> tuple[dict[str, Any], Parts]:
        state = self.state_
        learnt = {"words": state.words.packed, "values": state.targets}
        header = {"recalibrated": self._recalibrated, "one": self._one}
        return header, {"": learnt, "readout": state.tensors()}

    def _restore(self, readout: Any, header: Mapping[str, Any], tensors: Parts) -> None:
        if header.get("period") is not None:  # an earlier version
            raise ValueError("one with a period; train again on cosine and sine")
        kinds = {"words": "int64 N W", "values": "float64 N T"}
        check_parts(tensors, ("", "readout"))
        packed, values = checked(tensors[""], kinds, D=self.dimension_).values()
        self._one = bool(header["one"])
        words = Hypervectors(packed, self.dimension_, self.encoder_, self.frame_shape_)
        self.readout_ = readout
        self.state_ = readout.restored(tensors["readout"], words, values)
        self._recalibrated = bool(header["recalibrated"])


def _numbers(values: Any, n: int) -> np.ndarray:
    """Check the numbers to predict: float64 [n] or [n, T].

    Raises:
        ValueError: for a wrong number of them, masked ones, dates, or values that are not finite
            numbers.
    """
    values = inputs.one_a_frame("targets", values, n)
    if np.asarray(values).dtype.kind in "mM":  # whose unit would be lost
        raise ValueError("targets: expected numbers, found dates or times")
    array = np.asarray(values, dtype=np.float64)
    if array.ndim > 2:
        raise ValueError(f"targets: expected shape [N] or [N, T], found {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError("targets: expected finite numbers, found NaN or infinity in y")
    return array


def _table(values: np.ndarray) -> Tensor:
    """Numbers [N] or [N, T] as targets, float64 [N, T]."""
    return torch.from_numpy(values.reshape(len(values), -1))


def _check_enough(frames: Any) -> None:
    if len(frames) < 2:
        raise ValueError(f"frames: expected at least two, found {len(frames)} sample")


def _ends(
    without: Tensor, residuals: Tensor | None, alpha: float
) -> tuple[Tensor, Tensor]:
    """Jackknife+ ends [Q, T] from leave-one-out predictions [Q, N, T] and errors [N, T]."""
    assert residuals is not None  # a read-out with leave-one-out predictions has them
    n = len(residuals)
    spread = residuals.abs()
    low = floor(alpha * (n + 1))
    high = ceil((1 - alpha) * (n + 1))
    if low < 1 or high > n:
        infinite = torch.full_like(without[:, 0], torch.inf)
        return -infinite, infinite
    lower = (without - spread).kthvalue(low, dim=1).values
    upper = (without + spread).kthvalue(high, dim=1).values
    return lower, upper
