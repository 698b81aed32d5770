"""What both estimators share: chunks of hypervectors, files, and scikit-learn's conventions.

scikit-learn is not imported: it takes as long as torch, and 100 MB.
"""

from __future__ import annotations

import sys
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import bits, inputs, io
from hdc.bank import Selection
from hdc.encoders import Encoder, encode_with, make_encoder
from hdc.parameters import Parametrised, describe, rebuild

CHUNK = 256  # frames encoded at a time: 8 MB of packed bits at D = 250,000


class Estimator(Parametrised, ABC):
    """Parameters by name, tags, chunks of frames, and how an untrained model is refused."""

    _estimator_type: str
    _known: ClassVar[
        Mapping[str, Mapping[str, type]]
    ]  # our own parts, by parameter and name
    encoder: Any
    readout: Any
    device: str
    backend: str
    encoder_: Encoder
    frame_shape_: tuple[int, ...]
    n_features_in_: int
    dimension_: int
    metadata_: dict[str, Any]
    _columns: list[str] | None = None  # of the data frame that the model learned from

    def _check_parameters(self) -> None:
        for name, make in self.parts.items():
            make(getattr(self, name)).check()
        self._backend()

    def _check_is_trained(self) -> None:
        if not hasattr(
            self, "dimension_"
        ):  # scikit-learn's kind of error where it is loaded
            module = sys.modules.get("sklearn.exceptions")
            kind = getattr(module, "NotFittedError", ValueError)
            raise kind(
                f"{type(self).__name__}: expected a trained model; call fit first"
            )

    def _set_shape(self, shape: Sequence[int]) -> None:
        self.frame_shape_ = tuple(shape)
        self.n_features_in_ = prod(self.frame_shape_)

    def _learn_encoder(self, frames: Any) -> None:
        """Have the encoder learn what it learns of training frames."""
        encoder = make_encoder(self.encoder).unlearned()
        if encoder.learns:
            encoder.fit(frames)
        self._set_shape(frames.shape[1:])
        self.encoder_ = encoder
        self.dimension_ = encoder.dimension(self.n_features_in_)

    def _take_encoder(self, other: Estimator) -> None:
        """Take over the trained encoder of another model, and the shape of its frames."""
        self._set_shape(other.frame_shape_)
        self.encoder_, self.dimension_ = other.encoder_, other.dimension_

    def _backend(self, frames: Any = None) -> str:
        """The backend to encode frames with, or (None) one that is loaded already."""
        n_pixels = 0 if frames is None else prod(frames.shape)
        return bits.choose_backend(self.backend, self.device, n_pixels)

    def _given(self, frames: Any, training: bool = False) -> Any:
        """Frames with a shape; those of a data frame have the columns of training, in its order.

        Raises:
            ValueError: for other columns, or pixels that are masked.
        """
        columns = (
            [str(name) for name in frames.columns]
            if hasattr(frames, "columns")
            else None
        )
        if training and not hasattr(self, "dimension_"):
            self._columns = columns
        self._check_columns(columns)
        if np.ma.is_masked(frames):
            raise ValueError("frames: expected all pixels, found masked ones")
        return inputs.indexable(frames, getattr(self, "frame_shape_", None))

    def _check_columns(self, columns: list[str] | None) -> None:
        if None not in (columns, self._columns) and columns != self._columns:
            raise ValueError(
                "frames: expected the columns of training in its order, found others"
            )

    def _encode(
        self, frames: Any, first: int, backend: str, out: Tensor | None = None
    ) -> Tensor:
        """Hypervectors [N, W] of one chunk of frames, the first of all being frame `first`."""
        if len(frames):
            inputs.check_shape(frames.shape[1:], self.frame_shape_, type(self).__name__)
        if isinstance(frames, Selection):
            return frames.words(self.encoder_, backend).to(self.device)
        tensor = inputs.tensor(frames).to(self.device)
        return encode_with(self.encoder_, tensor, first, backend, out)

    def _chunk(self, frames: Any, start: int) -> Any:
        """Frames from `start` on: a tensor, or a selection of a bank, which has hypervectors."""
        if isinstance(frames, Selection):
            return frames.part(start, start + CHUNK)
        return inputs.tensor(frames[start : start + CHUNK])

    def _encoded(self, frames: Any) -> Iterator[Tensor]:
        """Hypervectors of frames, a chunk at a time."""
        frames = self._given(frames)
        backend = self._backend(frames)
        for start in range(0, max(1, len(frames)), CHUNK):
            yield self._encode(self._chunk(frames, start), start, backend)

    def _untrained(self) -> Self:
        """A model of the same parameters, the very same objects, that has learned nothing."""
        return type(self)(**self.get_params(deep=False))

    def _adopt(self, trained: Self) -> None:
        """Take over all that another model of the same parameters has learned."""
        parameters = self.get_params(deep=False)
        learned = {k: v for k, v in vars(trained).items() if k not in parameters}
        for name in [n for n in vars(self) if n.endswith("_") and n not in learned]:
            delattr(self, name)
        vars(self).update(learned)

    # Files ---------------------------------------------------------------------------------------

    def save(self, path: str | Path, metadata: Mapping[str, Any] | None = None) -> None:
        """Write the model to a safetensors file, whole or not at all.

        Args:
            path: file name, in a folder that exists; an older model of that name is replaced.
            metadata: JSON values to keep with the model, such as how frames are cropped. By default
                those of the file the model was read from.

        Raises:
            TypeError: for metadata that are no JSON.
            FileNotFoundError: for a folder that does not exist.
            FileExistsError: where something other than a saved model has the name.
        """
        self._check_is_trained()
        metadata = dict(
            getattr(self, "metadata_", {}) if metadata is None else metadata
        )
        # Not the backend: the best one depends on the machine, and the model does not.
        parameters: dict[str, Any] = {"device": str(self.device)}
        for name, make in self.parts.items():
            parameters[name] = describe(make(getattr(self, name)), self._known[name])
        header, tensors = self._stored()
        learned = self.encoder_.state().items()
        tensors |= {f"encoder.{name}": tensor for name, tensor in learned}
        header |= {"parameters": parameters, "frame_shape": self.frame_shape_}
        header["columns"] = self._columns
        kind = type(self).__name__
        io.write_model(
            Path(path), {"kind": kind, **header, "metadata": metadata}, tensors
        )
        self.metadata_ = metadata

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a model that :meth:`save` wrote; one of a missing GPU computes on the CPU.

        Raises:
            ValueError: if the file is not such a model, of another class, or damaged; it is named.
        """
        try:
            header, tensors = io.read_model(Path(path))
            if header["kind"] != cls.__name__:
                raise ValueError(
                    f"a saved {header['kind']}; load it with {header['kind']}.load"
                )
            parameters = dict(header["parameters"])
            for name in cls.parts:
                parameters[name] = rebuild(parameters[name], name, cls._known[name])
            model = cls(**parameters)
            if model.device.startswith("cuda") and not torch.cuda.is_available():
                warnings.warn(
                    f"{path}: trained on a GPU, not here: on the CPU", stacklevel=2
                )
                model.device = "cpu"
            model._check_parameters()
            shape = header["frame_shape"]
            if not 1 <= len(shape) <= 2 or not all(
                type(n) is int and n > 0 for n in shape
            ):
                raise ValueError(f"frame_shape {shape!r}")
            model._set_shape(shape)
            model._restore_encoder(tensors)
            model._restore(header, tensors)
            model._columns = header.get("columns")
            model.metadata_ = dict(header["metadata"])
            return model
        except FileNotFoundError:
            raise
        except (
            Exception
        ) as error:  # a hostile header reaches numpy and torch in many ways
            raise ValueError(
                f"{path}: expected a saved {cls.__name__}, found {error}"
            ) from error

    def _restore_encoder(self, tensors: dict[str, Tensor]) -> None:
        encoder = make_encoder(self.encoder).unlearned()
        learned = {
            name.removeprefix("encoder."): tensors.pop(name)
            for name in list(tensors)
            if name.startswith("encoder.")
        }
        encoder.restore(learned, self.n_features_in_)
        self.encoder_ = encoder
        self.dimension_ = encoder.dimension(self.n_features_in_)

    @abstractmethod
    def _stored(self) -> tuple[dict[str, Any], dict[str, Tensor]]:
        """Header and tensors of the estimator itself."""

    @abstractmethod
    def _restore(self, header: Mapping[str, Any], tensors: dict[str, Tensor]) -> None:
        """Become the model of :meth:`_stored`."""

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import (
            ClassifierTags,
            InputTags,
            RegressorTags,
            Tags,
            TargetTags,
        )

        # A median threshold leaves one bit of two features: no blob is told from its mirror.
        classifier = self._estimator_type == "classifier"
        return Tags(
            estimator_type=self._estimator_type,
            target_tags=TargetTags(required=True, multi_output=not classifier),
            classifier_tags=ClassifierTags(poor_score=True) if classifier else None,
            regressor_tags=None if classifier else RegressorTags(poor_score=True),
            input_tags=InputTags(two_d_array=True, three_d_array=True),
        )


def check_share(share: Any) -> float:
    """A share of frames that may be missed, as a float.

    Raises:
        ValueError: if it is not in (0, 1).
    """
    if (
        isinstance(share, bool)
        or not isinstance(share, float | np.floating)
        or not 0 < share < 1
    ):
        raise ValueError(f"reject, alpha: expected a share in (0, 1), found {share!r}")
    return float(share)
