"""What a trained memory answers: labels, distances, probabilities, and whether it knows at all."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
from hdc.estimator import Classifier
from hdc.memory import AssociativeMemory
from hdc.rejection import RATE, Calibration

CHUNK = 256  # frames encoded at a time: 8 MB of packed bits at D = 250,000


class Predictor(AssociativeMemory, Classifier):
    """The answers of :class:`hdc.HDCClassifier`."""

    def predict(self, frames: Any, reject: bool | float = False) -> np.ndarray:
        """Labels [Q] of frames [Q, H, W] or [Q, D], or of a single image [H, W].

        Args:
            frames: the queries.
            reject: answer None, in an array of objects, for a frame of none of the classes, as
                :meth:`is_known` has it: a share of frames of known classes that may be lost so;
                True for 1 %.
        """
        limits = None if reject is False else self.limits(RATE if reject is True else reject)
        nearest, known = self._nearest(frames, limits)
        labels = self.classes_[nearest]
        if limits is None:
            return labels
        labels = inputs.object_array(inputs.values(labels))
        labels[~known] = None
        return labels

    def score(self, frames: Any, y: Any) -> float:
        """Fraction of frames whose predicted label is right."""
        predicted = inputs.values(self.predict(frames))
        labels = inputs.values(inputs.label_array(y, len(predicted)))
        return float(np.mean([a == b for a, b in zip(predicted, labels, strict=True)]))

    def is_known(self, frames: Any, reject: float = RATE) -> np.ndarray:
        """Whether frames are as near to a prototype as frames of its class are: bool [Q].

        Noise, a black frame, or an object that was not trained is near to none. The limit is set so
        that of new frames of known classes about a share `reject` is refused, if they come as the
        training frames did (:mod:`hdc.rejection` has the formula; it needs about ten frames of each
        class).

        Raises:
            ValueError: for a share outside (0, 0.5], or a model that was never calibrated: of one
                frame a class, of counters alone (see :meth:`calibrate`).
        """
        return self._nearest(frames, self.limits(float(reject)))[1]

    def limits(self, reject: float = RATE) -> np.ndarray:
        """The largest Hamming distance [L] at which :meth:`is_known` knows a frame of each class.

        Raises:
            ValueError: as :meth:`is_known`.
        """
        if not 0 < reject <= 0.5:
            raise ValueError(f"reject: expected a share in (0, 0.5], found {reject}")
        return self._calibrated().limits(reject)

    def predict_proba(self, frames: Any) -> np.ndarray:
        """Probabilities [Q, L] of the classes, given that it is one of them: softmax(−distance/T).

        T is fitted to training frames by leaving each out (:mod:`hdc.rejection`).

        Raises:
            ValueError: for a model that was never calibrated, as :meth:`is_known`.
        """
        scores = self._scores(frames).numpy(force=True).astype(np.float64)
        if (empty := self._empty()) is not None:
            scores[:, empty.numpy()] = np.inf
        return self._calibrated().probabilities(scores)

    def decision_function(self, frames: Any) -> np.ndarray:
        """How near each class is, [Q, L]: minus the distance as a share of the pixels.

        Of two classes the difference [Q], positive for the second. Integer prototypes have the
        cosine in place of it.
        """
        scores = self._scores(frames).numpy(force=True)
        near = -scores / (self.dimension_ if self.prototype == "binary" else self.dimension_**0.5)
        return near[:, 1] - near[:, 0] if near.shape[1] == 2 else near

    def distances(self, frames: Any) -> np.ndarray:
        """Hamming distances int64 [Q, L] between queries and prototypes (Eq. 2).

        D + 1, farther than anything, from a class without samples.
        """
        self._check_is_trained()
        return torch.cat([self._hamming(words) for words in self._encoded(frames)]).numpy(
            force=True
        )

    def state_tensors(self) -> dict[str, Tensor]:
        """What has to be stored to predict; shares memory with the model."""
        self._check_is_trained()
        if self.prototype == "binary":
            return {"prototypes": self.prototypes_}
        self._made.lent = True
        return {"counters": self.counters_.planes}

    def _check_is_trained(self) -> None:
        if not hasattr(self, "counters_"):
            raise self._not_trained()
        if len(self.classes_) < 2:
            raise inputs.one_class(self.classes_)

    def _encoded(self, frames: Any) -> Iterator[Tensor]:
        names, expected = inputs.feature_names(frames), getattr(self, "feature_names_in_", None)
        if names is not None and expected is not None and list(names) != list(expected):
            raise ValueError(
                f"frames: expected columns {list(expected)} as in training, found {list(names)}"
            )
        frames = inputs.indexable(frames, self.frame_shape_)
        backend = self._backend(frames)
        for start in range(0, max(1, len(frames)), CHUNK):
            yield self._encode(frames[start : start + CHUNK], start, backend)

    def _scores(self, frames: Any) -> Tensor:
        self._check_is_trained()
        return torch.cat([self._scores_of(words) for words in self._encoded(frames)])

    def _nearest(self, frames: Any, limits: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Rows [Q] of the nearest classes, and whether they are within limits [L]."""
        self._check_is_trained()
        rows, known = [], []
        for words in self._encoded(frames):
            scores = self._scores_of(words)
            row = scores.argmin(1)
            rows.append(row.numpy(force=True))
            if limits is not None:
                distances = scores if self.prototype == "binary" else self._hamming(words)
                nearest = distances.gather(1, row[:, None])[:, 0].numpy(force=True)
                known.append(nearest <= limits[rows[-1]])
        return np.concatenate(rows), np.concatenate(known) if known else np.empty(0, bool)

    def _calibrated(self) -> Calibration:
        self._check_is_trained()
        if (found := self._try_calibration()) is None:
            raise ValueError(
                "calibration: expected a model that was trained on two frames or more of a class, "
                f"found {self.counts_.tolist()} and none to leave out; call calibrate with frames "
                "that it was not trained on"
            )
        return found
