"""Train: frames in memory to a model."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.studies.benchmark.cases import Case, pack_bits, packed_bytes
from experiments.studies.benchmark.names import ORDINARY_ROUTES, TORCHHD_TRAIN
from experiments.studies.benchmark.route import Form, Job, ours, route
from experiments.studies.benchmark.routes.bundle import centroid, centroid_majority
from experiments.studies.benchmark.routes.encode import torch_threshold
from hdc import HDCClassifier


@ours("train")
def hdc(case: Case, backend: str) -> Job:
    frames, labels = case.frames, case.labels
    return lambda: HDCClassifier(device=case.device, backend=backend).fit(frames, labels), (
        lambda model: packed_bytes(model.prototypes_, case.d)
    )


@route("train", TORCHHD_TRAIN, module="torchhd", anywhere=True)
def torchhd_multiset(case: Case) -> Job:
    frames, labels = case.frames, torch.from_numpy(case.labels)
    return lambda: torchhd_prototypes(case, frames, labels), pack_bits


@route("train", ORDINARY_ROUTES[1], module="torchhd")
def numpy_multiset(case: Case) -> Job:
    import torchhd

    frames, labels = case.frames.numpy(), torch.from_numpy(case.labels)

    def call() -> Tensor:
        ones = torch.from_numpy(frames > np.median(frames, axis=1, keepdims=True))
        hypervectors = torchhd.BSCTensor(ones)
        classes = [hypervectors[labels == c] for c in range(case.n_classes)]
        return torch.stack([torchhd.multiset(x) for x in classes])

    return call, pack_bits


@route("train", "torch.median, torchhd.models.Centroid", module="torchhd", anywhere=True)
def torchhd_centroid(case: Case) -> Job:
    frames, labels = case.frames, torch.from_numpy(case.labels)

    def call() -> Any:
        return centroid(case, torch_threshold(frames.to(case.device)), labels.to(case.device))

    return call, functools.partial(centroid_majority, case)


@route("train", "sklearn RidgeClassifier", module="sklearn")
def sklearn_ridge(case: Case) -> Job:
    from sklearn.linear_model import RidgeClassifier

    def call() -> RidgeClassifier:
        # It may overwrite the pixels, which were scaled for it: faster, and a copy less.
        return RidgeClassifier(copy_X=False).fit(scaled(case.frames), case.labels)

    return call, _held_labels(case)


@route("train", "sklearn NearestCentroid", module="sklearn")
def sklearn_centroid(case: Case) -> Job:
    from sklearn.neighbors import NearestCentroid

    return lambda: NearestCentroid().fit(scaled(case.frames), case.labels), _held_labels(case)


def torchhd_prototypes(case: Case, frames: Tensor, labels: Tensor) -> Tensor:
    """Prototypes of frames by torchhd: a byte a bit, [L, D]."""
    import torchhd

    hypervectors = torchhd.BSCTensor(torch_threshold(frames.to(case.device)))
    return torch.stack([torchhd.multiset(hypervectors[labels == c]) for c in range(case.n_classes)])


def scaled(frames: Tensor) -> np.ndarray:
    """Frames as scikit-learn wants them; part of the work, so timed."""
    return frames.numpy().astype(np.float32) / 255


def _held_labels(case: Case) -> Form:
    return lambda model: model.predict(scaled(case.held[0]))
