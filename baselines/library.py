"""Training, predictions and stored tensors of the library's classifiers, for the harness.

Models of :mod:`baselines` have methods of these names; an :class:`hdc.HDCClassifier` does not, so
that the functions here take their place.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from torch import Tensor

from baselines.bank import Bank
from hdc import HDCClassifier, backends
from hdc.hypervectors import CHUNK, Encoding, Hypervectors, joined
from hdc.inputs import FrameSource


def can_train(model: Any) -> bool:
    """Whether an object can train and predict."""
    if isinstance(model, HDCClassifier):
        return True
    return all(callable(getattr(model, name, None)) for name in ("train", "predict"))


def train(
    model: Any, frames: FrameSource, labels: np.ndarray
) -> Iterator[Mapping[str, float]]:
    """Start anew, and yield whenever the model can predict, with ``samples_seen``."""
    if hasattr(model, "train"):
        return model.train(frames, labels)
    return _train(model, frames, labels)


def _train(
    model: HDCClassifier, frames: FrameSource, labels: np.ndarray
) -> Iterator[Mapping[str, float]]:
    """:func:`train`; a read-out that goes on learning can predict once all classes have a frame."""
    n = len(frames)
    if n <= CHUNK or not hasattr(model, "partial_fit"):
        model.fit(frames, labels)
        yield {"samples_seen": n}
        return
    encoder = model.fresh("encoder")
    encoding = Encoding.learned(encoder, frames, model.device, model.backend)
    classes = np.unique(labels)
    learned = HDCClassifier(**model.get_params(deep=False))
    for start in range(0, n, CHUNK):
        rows = slice(start, start + CHUNK)
        with backends.computing(encoding.backend):
            words = joined(encoding.encoded(frames[rows]))
        learned.partial_fit(words, labels[rows], classes)
        vars(model).update(vars(learned))
        if model.counts_.all():
            yield {"samples_seen": start + len(words)}


def predict_from(
    model: Any, bank: Bank, train: np.ndarray, queries: np.ndarray
) -> np.ndarray:
    """Labels [Q] of frames of a bank by a model like this one, trained on others of them.

    The model is left as it is. `train` and `queries` are indices of frames.
    """
    if not isinstance(model, HDCClassifier):
        found: np.ndarray = model.predict_from(bank, train, queries)
        return found
    trained = trained_on(model, bank, train)
    return trained.predict(words_of(model, bank, queries, train))


def trained_on(model: HDCClassifier, bank: Bank, train: np.ndarray) -> HDCClassifier:
    """A model like this one, trained on frames of a bank."""
    trained = HDCClassifier(**model.get_params(deep=False))
    return trained.fit(words_of(model, bank, train, train), bank.labels[train])


def words_of(
    model: HDCClassifier, bank: Bank, rows: np.ndarray, train: np.ndarray
) -> Hypervectors:
    """Hypervectors of frames of a bank by the encoder of a model that is trained on others."""
    n_pixels = len(rows) * bank.dimension
    backend = backends.choose_backend(model.backend, model.device, n_pixels)
    with backends.computing(backend):
        return bank.words(rows, model.fresh("encoder"), train).to(model.device)


def has_predict_from(model: Any) -> bool:
    """Whether :func:`predict_from` can use a model."""
    return isinstance(model, HDCClassifier) or hasattr(model, "predict_from")


def state_tensors(model: Any) -> dict[str, Tensor] | None:
    """The tensors that have to be stored to predict; they share memory with the model."""
    if not isinstance(model, HDCClassifier):
        found: dict[str, Tensor] | None = model.state_tensors()
        return found
    model._check_is_trained()
    readout = model.readout_.needed(model.state_)
    return {**model.encoder_.state(), **readout}


def components(kind: Any, **parameters: Any) -> tuple[Any, ...]:
    """The classes of the encoder and the read-out of a model, given by name or by default."""
    if hasattr(kind, "components"):
        found: tuple[Any, ...] = tuple(kind.components(**parameters))
        return found
    if kind is not HDCClassifier:
        return ()
    defaults = inspect.signature(kind).parameters
    parts = []
    for name, make in kind.parts.items():
        part = parameters.get(name, defaults[name].default)
        if isinstance(part, str):
            parts.append(type(make(part)))
    return tuple(parts)
