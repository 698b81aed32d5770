"""Shared by both estimators: chunks of hypervectors, files, and scikit-learn's conventions.

scikit-learn is not imported: it takes as long as torch, and 100 MB.
"""

from __future__ import annotations

import inspect
import sys
import warnings
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from math import prod
from numbers import Integral
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from hdc import backends, inputs, io
from hdc.bank import Selection
from hdc.encoders import Encoder, encode_with, make_encoder
from hdc.parameters import Named, Parametrised, describe, rebuild
from hdc.tensors import prefixed, without_prefix

CHUNK = 256  # frames encoded at a time: 8 MB of packed bits at D = 250,000


class Estimator(Parametrised, ABC):
    """Parameters by name, tags, chunks of frames, and how an untrained model is refused."""

    _estimator_type: str
    _known: ClassVar[Mapping[str, Named]]  # our own classes of each part
    encoder: Any
    readout: Any
    device: str
    backend: str
    encoder_: Encoder
    frame_shape_: tuple[int, ...]
    n_features_in_: int
    dimension_: int
    metadata_: dict[str, Any]
    _columns: list[str | int] | None = None
    """Columns of the data frame that the model learned from."""
    _used: dict[str, Any]
    """The parameters of the parts that were trained."""
    _trained_on: str
    """The device of training."""

    @classmethod
    def components(cls, **parameters: Any) -> tuple[type, ...]:
        """The classes of the parts that such parameters give by name, or leave as they are."""
        defaults = inspect.signature(cls).parameters
        found = []
        for name, make in cls.parts.items():
            part = parameters.get(name, defaults[name].default)
            if isinstance(part, str):
                found.append(type(make(part)))
        return tuple(found)

    def _check_parameters(self) -> None:
        for name, make in self.parts.items():
            make(getattr(self, name)).check()
        check_device(self.device)
        self._backend()

    def _check_is_trained(self) -> None:
        """Raise for a model that has learned nothing, or whose parts were set since."""
        if not hasattr(self, "dimension_"):
            # scikit-learn's kind of error where it is loaded
            module = sys.modules.get("sklearn.exceptions")
            kind = getattr(module, "NotFittedError", ValueError)
            raise kind(
                f"{type(self).__name__}: expected a trained model; call fit first"
            )
        for name, used in self._used.items():
            if getattr(self, name) is not used:
                raise ValueError(f"{name}: changed after training; call fit again")
        if str(self.device) != self._trained_on:
            raise ValueError(
                f"device: expected {self._trained_on!r}, where the model was trained, found "
                f"{self.device!r}; call fit again"
            )

    @property
    def feature_names_in_(self) -> np.ndarray:
        """Names of the columns of training, object [D], where all are text."""
        names = self._columns or [0]
        if not all(isinstance(name, str) for name in names):
            raise AttributeError(
                f"{type(self).__name__}: expected training on a data frame with names, found none"
            )
        return np.array(names, dtype=object)

    def _set_shape(self, shape: Sequence[int]) -> None:
        self.frame_shape_ = tuple(shape)
        self.n_features_in_ = prod(self.frame_shape_)

    def _learn_encoder(self, frames: Any) -> None:
        """Have the encoder learn what it learns of training frames."""
        encoder = make_encoder(self.encoder).unlearned()
        if encoder.learns:
            encoder.fit(frames)
        self._set_shape(frames.shape[1:])
        self._use_encoder(encoder)

    def _take_encoder(self, other: Estimator) -> None:
        """Take over the trained encoder of another model, and the shape of its frames."""
        self._set_shape(other.frame_shape_)
        self._use_encoder(other.encoder_)

    def _use_encoder(self, encoder: Encoder) -> None:
        """Encode by this from now on; the parameters of now are those of training."""
        self.encoder_ = encoder
        self.dimension_ = encoder.dimension(self.n_features_in_)
        self._used = {name: getattr(self, name) for name in self.parts}
        self._trained_on = str(self.device)

    def _backend(self, frames: Any = None) -> str:
        """The backend to encode a chunk with, or (None) one that is loaded already."""
        n_pixels = 0 if frames is None else prod(frames.shape)
        return backends.choose_backend(self.backend, self.device, n_pixels)

    def _checked_frames(self, frames: Any) -> Any:
        """Frames with a shape; those of a data frame have the columns of training, in its order.

        A model that has learned nothing takes these columns for those of training.

        Raises:
            ValueError: for other columns, or pixels that are masked.
        """
        columns = _columns_of(frames)
        if not hasattr(self, "dimension_"):
            self._columns = columns
        self._check_columns(columns)
        return inputs.indexable(frames, getattr(self, "frame_shape_", None))

    def _check_columns(self, columns: list[str | int] | None) -> None:
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
        return encode_with(self.encoder_, frames, first, backend, out)

    def _chunk(self, frames: Any, start: int) -> Any:
        """Frames from `start` on: a tensor on the model's device, or a selection of a bank, which
        has hypervectors."""
        if isinstance(frames, Selection):
            return frames.part(start, start + CHUNK)
        return inputs.tensor(frames[start : start + CHUNK]).to(self.device)

    def _encoded(self, frames: Any) -> Iterator[Tensor]:
        """Hypervectors of frames, a chunk at a time."""
        frames = self._checked_frames(frames)
        for start in range(0, max(1, len(frames)), CHUNK):
            part = self._chunk(frames, start)
            yield self._encode(part, start, self._backend(part))

    def _untrained(self) -> Self:
        """A model of the same parameters, the very same objects, that has learned nothing."""
        return type(self)(**self.get_params(deep=False))

    def _adopt(self, trained: Self) -> None:
        """Take over all that another model of the same parameters has learned."""
        parameters = self.get_params(deep=False)
        learned = dict(vars(trained))
        for name in parameters:
            learned.pop(name, None)
        for name in list(vars(self)):
            if name.endswith("_") and name not in learned:
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
            ValueError: for a model that could not be loaded again, such as one with a read-out of a
                class that is not at the top of a module, or with a parameter that is no JSON;
                nothing is written.
        """
        self._check_is_trained()
        if metadata is None:
            metadata = getattr(self, "metadata_", {})
        metadata = dict(metadata)
        # Not the backend: the best one depends on the machine, and the model does not.
        parameters: dict[str, Any] = {"device": str(self.device)}
        for name in self.parts:
            # The trained part: the object that was given may have been changed since.
            trained = getattr(self, f"{name}_")
            parameters[name] = describe(trained, self._known[name])
        header, tensors = self._stored()
        tensors |= prefixed("encoder", self.encoder_.state())
        header = {"kind": type(self).__name__, **header}
        header |= {"parameters": parameters, "frame_shape": self.frame_shape_}
        header |= {"columns": self._columns, "metadata": metadata}
        io.write_model(Path(path), header, tensors, self._check_loads)
        self.metadata_ = metadata

    def _check_loads(
        self, header: Mapping[str, Any], tensors: dict[str, Tensor]
    ) -> None:
        """Raise ValueError for what :meth:`load` would refuse."""
        try:
            self._rebuilt(header, tensors, trusted=None)
        except Exception as error:
            kind = type(self).__name__
            raise ValueError(
                f"a {kind} that could not be loaded again: {error}"
            ) from error

    @classmethod
    def load(cls, path: str | Path, trusted: str | Collection[str] = ()) -> Self:
        """Read a model that :meth:`save` wrote; one of a missing GPU computes on the CPU.

        Args:
            path: file name.
            trusted: dotted name or names of encoders and read-outs of one's own. The module of such
                a class is imported, which runs its code; a file that names one that is not trusted
                is refused before that.

        Raises:
            ValueError: if the file is not such a model, of another class, or damaged; it is named.
        """
        if isinstance(trusted, str):  # of which parts are no names
            trusted = (trusted,)
        try:
            header, tensors = io.read_model(Path(path))
            kind = header["kind"]
            if kind != cls.__name__:
                raise ValueError(f"a saved {kind}; load it with {kind}.load")
            device = header["parameters"]["device"]
            if device.startswith("cuda") and not torch.cuda.is_available():
                header["parameters"]["device"] = "cpu"
                warnings.warn(
                    f"{path}: trained on a GPU, not here: on the CPU", stacklevel=2
                )
            return cls._rebuilt(header, tensors, trusted)
        except FileNotFoundError:
            raise
        # A hostile header reaches numpy and torch in many ways.
        except Exception as error:
            raise ValueError(
                f"{path}: expected a saved {cls.__name__}, found {error}"
            ) from error

    @classmethod
    def _rebuilt(
        cls,
        header: Mapping[str, Any],
        tensors: dict[str, Tensor],
        trusted: Collection[str] | None,
    ) -> Self:
        """The model of a header and tensors, which may be anything; errors of any kind.

        `trusted` as of :func:`hdc.parameters.rebuild`.
        """
        parameters = dict(header["parameters"])
        for name in cls.parts:
            part = rebuild(parameters[name], name, cls._known[name], trusted)
            parameters[name] = part
        model = cls(**parameters)
        model._check_parameters()
        shape = header["frame_shape"]
        whole = all(type(n) is int and n > 0 for n in shape)
        if not whole or not 1 <= len(shape) <= 2:
            raise ValueError(f"frame_shape {shape!r}")
        model._set_shape(shape)
        own = {name: tensor.to(model.device) for name, tensor in tensors.items()}
        model._restore_encoder(own)
        model._restore(header, own)
        model._columns = header.get("columns")
        model.metadata_ = dict(header["metadata"])
        return model

    def _restore_encoder(self, tensors: dict[str, Tensor]) -> None:
        """Have the encoder learn its own of the tensors, which are taken out."""
        encoder = make_encoder(self.encoder).unlearned()
        learned = without_prefix("encoder", tensors)
        for name in learned:
            del tensors[f"encoder.{name}"]
        encoder.restore(learned, self.n_features_in_)
        self._use_encoder(encoder)

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

        # A median threshold leaves one bit of two features: a blob and its mirror are alike.
        classifier = self._estimator_type == "classifier"
        return Tags(
            estimator_type=self._estimator_type,
            target_tags=TargetTags(required=True, multi_output=not classifier),
            classifier_tags=ClassifierTags(poor_score=True) if classifier else None,
            regressor_tags=None if classifier else RegressorTags(poor_score=True),
            input_tags=InputTags(two_d_array=True, three_d_array=True),
        )


def check_device(device: Any) -> None:
    """Raise ValueError, one line, for a device that this machine has not, or that holds nothing."""
    try:
        if torch.empty(1, device=torch.device(device)).is_meta:
            raise ValueError("it has no memory")
    # Each kind of device has errors of its own.
    except Exception as error:
        expected = "'cpu'"
        if torch.cuda.is_available():
            expected += " or 'cuda'"
        reason = str(error).partition("\n")[0]
        raise ValueError(
            f"device: expected {expected}, found {device!r}: {reason}"
        ) from error


def _columns_of(frames: Any) -> list[str | int] | None:
    """Names of the columns of a data frame; None for frames that are none."""
    if not hasattr(frames, "columns"):
        return None
    return [_column_name(name) for name in frames.columns]


def _column_name(name: Any) -> str | int:
    """A name that JSON has: a number stays one."""
    return int(name) if isinstance(name, Integral) else str(name)
