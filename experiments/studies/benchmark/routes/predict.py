"""Predict: one frame to its label."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.studies.benchmark.cases import HELD_OUT, Case
from experiments.studies.benchmark.route import Job, ours, route
from experiments.studies.benchmark.routes.bundle import centroid
from experiments.studies.benchmark.routes.encode import histogram_threshold, torch_threshold
from experiments.studies.benchmark.routes.hamming import numpy_hamming
from experiments.studies.benchmark.routes.train import scaled, torchhd_prototypes
from hdc import HDCClassifier


@ours("predict")
def hdc(case: Case, backend: str) -> Job:
    model = _of_many(case, backend)
    return one_by_one(case, lambda frame: model.predict(frame)[0])


@ours("predict_all")
def hdc_all(case: Case, backend: str) -> Job:
    model = _of_many(case, backend)
    frames = case.held[0]
    return lambda: model.predict(frames), lambda labels: labels


@ours("learn_one")
def hdc_learns(case: Case, backend: str) -> Job:
    """Every call learns the next held-out frame, as a stream goes; then the model is asked.

    There is room for the counts, which a stream has to make for all classes now and then: at 2, 4,
    8, … frames of one of them.
    """
    model = _of_many(case, backend)
    model.counters_.reserve(2**8)
    frames, labels = case.held
    turn = itertools.cycle(range(HELD_OUT))

    def call() -> HDCClassifier:
        i = next(turn)
        return model.partial_fit(frames[i : i + 1], labels[i : i + 1])

    return call, lambda model: model.predict(frames)


def _of_many(case: Case, backend: str) -> HDCClassifier:
    """A model that has learnt one frame of each class."""
    return HDCClassifier(device=case.device, backend=backend).partial_fit(case.few_by_few())


@route("predict", "torch.median, torchhd.hamming_similarity", module="torchhd", anywhere=True)
def torchhd_similarity(case: Case) -> Job:
    import torchhd

    frames, labels = case.few
    prototypes = torchhd_prototypes(case, frames, torch.from_numpy(labels))

    def predict(frame: Tensor) -> Tensor:
        query = torchhd.BSCTensor(torch_threshold(frame.to(case.device)))
        return torchhd.hamming_similarity(query, prototypes).argmax()

    return one_by_one(case, predict)


@route("predict", "torch.median, torchhd.models.Centroid", module="torchhd", anywhere=True)
def torchhd_centroid(case: Case) -> Job:
    frames, labels = (torch.as_tensor(x).to(case.device) for x in case.few)
    # Bipolar, as its cosine similarity needs it.
    model = centroid(case, 2 * torch_threshold(frames).float() - 1, labels)

    def predict(frame: Tensor) -> Tensor:
        with torch.no_grad():
            return model(2 * torch_threshold(frame.to(case.device)).float() - 1).argmax()

    return one_by_one(case, predict)


@route("predict", "numpy.bincount, numpy.bitwise_count", module="numpy")
def numpy_bitwise_count(case: Case) -> Job:
    prototypes = HDCClassifier().fit(*case.few).prototypes_.numpy().view(np.uint64)
    width = prototypes.shape[1] * 8

    def predict(frame: Tensor) -> int:
        query = np.zeros(width, np.uint8)
        packed = histogram_threshold(frame.numpy()[0])
        query[: len(packed)] = packed
        return int(numpy_hamming(query.view(np.uint64)[None], prototypes).argmin())

    return one_by_one(case, predict)


@route("predict", "sklearn RidgeClassifier", module="sklearn")
def sklearn_ridge(case: Case) -> Job:
    from sklearn.linear_model import RidgeClassifier

    model = RidgeClassifier().fit(scaled(case.few[0]), case.few[1])
    return one_by_one(case, lambda frame: model.predict(scaled(frame))[0])


@route("predict", "sklearn NearestCentroid", module="sklearn")
def sklearn_centroid(case: Case) -> Job:
    from sklearn.neighbors import NearestCentroid

    model = NearestCentroid().fit(scaled(case.few[0]), case.few[1])
    return one_by_one(case, lambda frame: model.predict(scaled(frame))[0])


def one_by_one(case: Case, predict: Callable[[Tensor], Any]) -> Job:
    """Every call predicts the next held-out frame; all of them are checked."""
    frames = case.held[0]
    turn = itertools.cycle(range(HELD_OUT))

    def call() -> Any:
        i = next(turn)
        return predict(frames[i : i + 1])

    def form(_: Any) -> np.ndarray:
        return np.array([int(predict(frames[i : i + 1])) for i in range(HELD_OUT)])

    return call, form
