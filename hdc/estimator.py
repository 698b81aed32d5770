"""Base class of both estimators: encoding of frames, and the conventions of scikit-learn.

scikit-learn itself is not imported: that takes as long as importing torch, and 100 MB.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from math import prod
from operator import attrgetter
from typing import Any, ClassVar

from hdc import backends, inputs
from hdc.availability import UnavailableError
from hdc.hypervectors import Encoding, Hypervectors, joined
from hdc.parameters import Family, Parametrised


def of_training(path: str) -> Any:
    """A property of a trained model, such as ``"_encoding.encoder"``; an untrained one has none."""
    found = attrgetter(path)

    def get(model: Estimator) -> Any:
        model._check_is_trained()
        return found(model)

    return property(get)


class Estimator(Parametrised):
    """An estimator with an encoder and a read-out; its `_encoding` is the trained encoder."""

    _estimator_type: str
    parts: ClassVar[Mapping[str, Family]]
    encoder: Any
    readout: Any
    device: str
    backend: str
    columns_: list[str] | None = None
    """Names of the columns of a table or a data frame of training, where they are known."""
    metadata_: dict[str, Any]
    _encoding: Encoding

    encoder_ = of_training("_encoding.encoder")
    backend_ = of_training("_encoding.backend")
    frame_shape_ = of_training("_encoding.frame_shape")
    dimension_ = of_training("_encoding.dimension")

    @property
    def n_features_in_(self) -> int:
        return prod(self.frame_shape_)

    def encode(self, frames: Any) -> Hypervectors:
        """Hypervectors of frames, which every method but ``rezero`` accepts instead.

        To get labels, sets and probabilities of the same frames, encode them once.

        Raises:
            ValueError: for an untrained model, frames of another shape, pixels that are not finite,
                or hypervectors of another encoder.
        """
        self._check_is_trained()
        with self._computing():
            return joined(self._encoded(frames))

    def _encoded(self, frames: Any) -> Iterator[Hypervectors]:
        """Hypervectors of frames by the trained encoder, a chunk at a time."""
        self._check_columns(frames)
        if isinstance(frames, Hypervectors):
            self._encoding.check_words(frames)
        else:
            frames = inputs.indexable(frames, self.frame_shape_)
        return self._encoding.encoded(frames)

    def _check_columns(self, frames: Any) -> None:
        """Raise ValueError for a data frame of other columns, or in another order."""
        columns = inputs.columns_of(frames)
        if None not in (columns, self.columns_) and columns != self.columns_:
            raise ValueError(
                "frames: expected the columns of training in its order, found others"
            )

    def _computing(self) -> AbstractContextManager[None]:
        """Context in which this thread computes by the chosen backend."""
        return backends.computing(self._encoding.backend)

    def _check_is_trained(self) -> None:
        """Raise for an untrained model."""
        if not hasattr(self, "_encoding"):
            # scikit-learn's kind of error where it is loaded
            module = sys.modules.get("sklearn.exceptions")
            kind = getattr(module, "NotFittedError", UnavailableError)
            raise kind(
                f"{type(self).__name__}: expected a trained model; call fit first"
            )

    def __sklearn_tags__(self) -> Any:
        from sklearn import utils

        # A median threshold leaves one bit of two features: a blob and its mirror are alike.
        classifier = self._estimator_type == "classifier"
        of_classifier = utils.ClassifierTags(poor_score=True) if classifier else None
        return utils.Tags(
            estimator_type=self._estimator_type,
            target_tags=utils.TargetTags(required=True, multi_output=not classifier),
            classifier_tags=of_classifier,
            regressor_tags=None if classifier else utils.RegressorTags(poor_score=True),
            input_tags=utils.InputTags(two_d_array=True, three_d_array=True),
        )
