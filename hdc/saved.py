"""Saving of models to files, and loading them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Mapping
from math import prod
from pathlib import Path
from typing import Any, Self

from torch import Tensor

from hdc import backends, io
from hdc.described import describe, rebuild
from hdc.encoders import Encoder
from hdc.estimator import Estimator
from hdc.hypervectors import Encoding
from hdc.tensors import Parts, by_part, compact, flat
from hdc.warning import warn


class Saved(Estimator):
    """An estimator that can be saved to a file and loaded."""

    def save(self, path: str | Path, metadata: Mapping[str, Any] | None = None) -> None:
        """Write the model to a safetensors file, atomically.

        Args:
            path: file name, in an existing folder; a saved model of that name is replaced.
            metadata: JSON values to keep with the model, such as how frames are cropped; by
                default the metadata of the file that the model was loaded from.

        Raises:
            TypeError: for metadata that JSON cannot hold.
            FileNotFoundError: for a folder that does not exist.
            FileExistsError: if the name belongs to something other than a saved model.
            ValueError: for a model that could not be loaded again, such as one with a read-out of a
                class that is not at the top level of a module, or with a parameter that JSON
                cannot hold; nothing is written.
        """
        self._check_is_trained()
        header, tensors = self._contents()
        if metadata is not None:
            header["metadata"] = dict(metadata)
        # Without the backend, since the best one depends on the machine.
        header["parameters"] = {"device": str(self.device)}
        for name in self.parts:
            # The trained part, since the given object may have been changed.
            known = self.parts[name]
            described = describe(getattr(self, f"{name}_"), known)
            try:
                rebuild(described, name, known)
            except (TypeError, ValueError) as error:
                raise ValueError(
                    f"{path}: a {type(self).__name__} that could not be loaded again: {error}"
                ) from error
            header["parameters"][name] = described
        io.write_model(Path(path), header, tensors)
        self.metadata_ = header["metadata"]

    def _contents(self) -> tuple[dict[str, Any], dict[str, Tensor]]:
        """Header, yet without parameters, and tensors, of which :meth:`_fill` makes the model."""
        with self._computing():
            stored, parts = self._stored()
        tensors = flat({**parts, "encoder": self.encoder_.state()})
        header = {
            "kind": type(self).__name__,
            **stored,
            "parameters": {},
            "frame_shape": self.frame_shape_,
            "revisions": {
                name: getattr(self, f"{name}_").revision for name in self.parts
            },
            "columns": self.columns_,
            "metadata": self.metadata_,
        }
        return header, {name: compact(tensor) for name, tensor in tensors.items()}

    def __getstate__(self) -> dict[str, Any]:
        """Parameters, trained parts without what they learned, and the content of a file."""
        if not hasattr(self, "_encoding"):
            return vars(self)
        parts = {name: getattr(self, f"{name}_").unlearned() for name in self.parts}
        learned = (*self._contents(), parts)
        return {**self.get_params(deep=False), "learned": learned}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Restore a copied or pickled model; the backend is chosen on the machine that does."""
        parameters = dict(state)
        learned = parameters.pop("learned", None)
        vars(self).update(parameters)
        if learned is not None:
            self._fill(*learned)

    def to(self, device: str) -> Self:
        """Move the trained model to a device, where it computes from now on.

        Raises:
            ValueError: for a device that this machine does not have.
        """
        self._check_is_trained()
        backends.choose_backend(self.backend, device)
        self.__setstate__({**self.__getstate__(), "device": device})
        return self

    @classmethod
    def load(
        cls,
        path: str | Path,
        trusted: str | Collection[str] = (),
        device: str = "cpu",
    ) -> Self:
        """Read a model that :meth:`save` wrote.

        Args:
            path: file name.
            trusted: dotted name or names of your own encoders and read-outs. Loading imports the
                module of such a class, which runs its code; a file that names any other module is
                refused before that.
            device: device to compute on, whatever the device of training was.

        Raises:
            FileNotFoundError: if there is no such file.
            ValueError: naming the file, if it is no saved model, a model of another class, or
                damaged; or for a device that this machine does not have.
        """
        if isinstance(trusted, str):  # or each letter would be a name
            trusted = (trusted,)
        backends.check_device(device)
        try:
            header, tensors = io.read_model(Path(path))
            kind = header["kind"]
            if kind != cls.__name__:
                raise ValueError(f"a saved {kind}; load it with {kind}.load")
            parameters = header["parameters"] | {"device": device}
            for name, known in cls.parts.items():
                parameters[name] = rebuild(parameters[name], name, known, trusted)
            model = cls(**parameters)
            parts = {name: model.fresh(name) for name in cls.parts}
            model._fill(header, tensors, parts)
        except FileNotFoundError:
            raise
        # A hostile header reaches numpy and torch in many ways.
        except Exception as error:
            raise ValueError(
                f"{path}: expected a saved {cls.__name__}, found {error}"
            ) from error
        model._warn_of_revisions(header.get("revisions", {}), path)
        return model

    def _fill(
        self,
        header: Mapping[str, Any],
        tensors: Mapping[str, Tensor],
        parts: Mapping[str, Any],
    ) -> None:
        """Set all that was learned; raises errors of any kind, since a file may hold anything."""
        backend = backends.choose_backend(self.backend, self.device)
        shape = header["frame_shape"]
        whole = all(type(n) is int and n > 0 for n in shape)
        if not whole or not 1 <= len(shape) <= 2:
            raise ValueError(f"frame_shape {shape!r}")
        own = by_part({name: x.to(self.device) for name, x in tensors.items()})
        encoder: Encoder = parts["encoder"]
        encoder.restore(own.pop("encoder", {}), prod(shape))
        self._encoding = Encoding(encoder, tuple(shape), self.device, backend)
        columns = header.get("columns")
        self.columns_ = None if columns is None else list(columns)
        self._restore(parts["readout"], header, own)
        self.metadata_ = dict(header["metadata"])

    def _warn_of_revisions(self, made_by: Mapping[str, Any], path: str | Path) -> None:
        """Warn of a file by another revision of a part; files up to 3.0 hold no revisions."""
        for name in self.parts:
            now = getattr(self, f"{name}_").revision
            if made_by.get(name, now) != now:
                warn(
                    f"{path}: made by revision {made_by[name]} of the {name}, now {now}, which "
                    "gives other numbers; fit anew",
                )

    @abstractmethod
    def _stored(self) -> tuple[dict[str, Any], Parts]:
        """Header and tensors of the estimator itself."""

    @abstractmethod
    def _restore(self, readout: Any, header: Mapping[str, Any], tensors: Parts) -> None:
        """Set what an untrained read-out has learned from a header and tensors."""
