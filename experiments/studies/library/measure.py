"""The library's three read-outs against the harness's models and plain NumPy or scikit-learn.

Each read-out of :class:`hdc.HDCClassifier` has a counterpart that is written apart from it: the
majority in NumPy, and ridge regression and the nearest neighbour of :mod:`baselines` and of
scikit-learn, on the same bits. All train on the same frames and are asked about the same ones.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import torch
from sklearn.linear_model import RidgeClassifier
from sklearn.neighbors import KNeighborsClassifier

from baselines.linear_bits import BitReadout
from baselines.nearest_neighbour import NearestNeighbour
from experiments.protocol.draws import draw_split, nested
from experiments.protocol.experiment import Row, Run, experiment
from hdc import HDCClassifier
from hdc.encoders import Median

Frames = np.ndarray  # uint8 or uint16 [N, H, W]


@experiment(revision=1, uses=("hdc.HDCClassifier",), timed=True)
def library(
    run: Run,
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    seeds: Sequence[int] = (0,),
    n_per_class: int = 20,
    most_test: int = 100,
    repeats: int = 3,
) -> Iterator[Row]:
    """One row: a read-out, and an implementation beside the library's: how many of ``n_test``
    predictions are the ``same``, and training and prediction times of both, s.

    Times are the shortest of some repetitions, from frames to answers; ``predict_s`` is of one
    frame at a time. Arguments: configs/experiment/library.yaml.
    """
    for seed, recording in run.scenes(scene, seeds):
        pool, test = draw_split(recording, split, (seed, 0), most_test)
        order, _ = nested(pool, recording.labels, (), (seed, 0))
        chosen = [of_class[:n_per_class] for of_class in order]
        train = np.sort(np.concatenate(chosen))
        frames, queries = (
            recording.frames(part).cpu().numpy() for part in (train, test)
        )
        labels = recording.labels[train]
        for readout in ("majority", "ridge", "neighbours"):
            model = HDCClassifier(encoder=Median(ties="raster"), readout=readout)
            answers, times = _timed(model, frames, labels, queries, repeats)
            for name, peer in _peers(readout, model).items():
                others, of_peer = _timed(peer, frames, labels, queries, repeats)
                yield {
                    "origin": recording.origin,
                    "seed": seed,
                    "readout": readout,
                    "peer": name,
                    "n_train": len(train),
                    "n_test": len(test),
                    "dimension": frames[0].size,
                    "right": int((answers == recording.labels[test]).sum()),
                    "same": int((answers == others).sum()),
                    **times,
                    **{f"peer_{key}": value for key, value in of_peer.items()},
                }
        run.note(f"seed {seed}")


def _peers(readout: str, model: HDCClassifier) -> dict[str, Any]:
    """Other implementations of a read-out; of ridge regression with the library's penalty."""
    if readout == "majority":
        return {"NumPy": _NumPyMajority()}
    if readout == "neighbours":
        nearest = KNeighborsClassifier(1, metric="hamming", algorithm="brute")
        return {
            "harness": _Trained(NearestNeighbour()),
            "scikit-learn": _OnBits(nearest, bool),
        }
    alpha = model.readout_.linear_.penalty  # type: ignore[attr-defined]
    return {
        "harness": _Trained(BitReadout(alpha=alpha)),
        "scikit-learn": _OnBits(RidgeClassifier(alpha, solver="cholesky"), np.float32),
    }


def _timed(
    model: Any,
    frames: Frames,
    labels: np.ndarray,
    queries: Frames,
    repeats: int,
) -> tuple[np.ndarray, dict[str, float]]:
    """Answers to the queries, and the shortest times."""

    def shortest(action: Callable[[], Any]) -> float:
        seconds = []
        for _ in range(repeats):
            start = time.perf_counter()
            action()
            seconds.append(time.perf_counter() - start)
        return min(seconds)

    fit = shortest(partial(model.fit, frames, labels))
    single = [queries[k : k + 1] for k in range(min(10, len(queries)))]
    each = [shortest(partial(model.predict, frame)) for frame in single]
    return np.asarray(model.predict(queries)), {
        "fit_s": fit,
        "predict_s": float(np.median(each)),
    }


def _brighter_half(frames: Frames) -> np.ndarray:
    """Bits [N, D]: the ⌊D/2⌋ brightest pixels of a frame; of equal ones the first."""
    flat = frames.reshape(len(frames), -1)
    order = np.argsort(
        -flat.astype(np.int32),
        axis=1,
        kind="stable",
    )
    chosen = np.zeros(flat.shape, bool)
    np.put_along_axis(chosen, order[:, : flat.shape[1] // 2], True, axis=1)
    return chosen


class _NumPyMajority:
    """The paper's classifier in the fewest lines of NumPy."""

    def fit(self, frames: Frames, labels: np.ndarray) -> None:
        hypervectors = _brighter_half(frames)
        shares = [hypervectors[labels == c].mean(axis=0) for c in np.unique(labels)]
        self.prototypes = np.stack(shares) > 0.5

    def predict(self, frames: Frames) -> np.ndarray:
        differ = _brighter_half(frames)[:, None] != self.prototypes
        return differ.sum(axis=2).argmin(axis=1)


class _OnBits:
    """A scikit-learn classifier of hypervectors."""

    def __init__(self, model: Any, kind: type):
        self.model, self.kind = model, kind

    def _numbers(self, frames: Frames) -> np.ndarray:
        hypervectors = _brighter_half(frames)
        return (
            hypervectors
            if self.kind is bool
            else 2 * hypervectors.astype(self.kind) - 1
        )

    def fit(self, frames: Frames, labels: np.ndarray) -> None:
        self.model.fit(self._numbers(frames), labels)

    def predict(self, frames: Frames) -> np.ndarray:
        return self.model.predict(self._numbers(frames))


class _Trained:
    """A model of the harness."""

    def __init__(self, model: Any):
        self.model = model

    def fit(self, frames: Frames, labels: np.ndarray) -> None:
        for _ in self.model.train(torch.from_numpy(frames), labels):
            pass

    def predict(self, frames: Frames) -> np.ndarray:
        return np.asarray(self.model.predict(torch.from_numpy(frames)))
