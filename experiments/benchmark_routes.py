"""Routes of the benchmark: the same operation on the same bytes, ours and the peers' ways.

A route is one function below, registered under an operation. Given a case (frames of one size) it
prepares what its users would have at hand, and returns the call that is timed and a function that
brings the call's result into the operation's common form, in which it is compared with a reference
computed in plain numpy: bits packed into bytes, distances, or predicted labels.

Ours is measured with both backends. The compiled one's kernels are compiled, or read from their
cache, when the route is built, so no time contains that.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.benchmark_cases import HELD_OUT, Case, pack_bits, packed_bytes, unpack_bits
from hdc import HDCClassifier, bits
from hdc.encode import encode
from hdc.prototypes import Counters

OPERATIONS = ("encode", "bundle", "hamming", "train", "predict")
OURS = "hdc"
OURS_COMPILED = "hdc, compiled"
READ = "one read of the bytes"

Form = Callable[[Any], np.ndarray | None]
Job = tuple[Callable[[], Any], Form]


@dataclass(frozen=True)
class Route:
    """One way to carry out an operation.

    Attributes:
        module: what has to be installed for it.
        anywhere: whether it runs on an accelerator too.
    """

    operation: str
    name: str
    build: Callable[[Case], Job]
    module: str = "torch"
    anywhere: bool = False


ROUTES: list[Route] = []


def _route(operation: str, name: str, module: str = "torch", anywhere: bool = False):
    def register(build: Callable[[Case], Job]) -> Callable[[Case], Job]:
        ROUTES.append(Route(operation, name, build, module, anywhere))
        return build

    return register


def _ours(operation: str):
    """Register a function of (case, backend) for each of our backends."""

    def register(build: Callable[[Case, str], Job]) -> Callable[[Case, str], Job]:
        def compiled(case: Case) -> Job:
            bits.kernels("compiled", case.device)  # compiles
            return build(case, "compiled")

        _route(operation, OURS, anywhere=True)(lambda case: build(case, "numpy"))
        _route(operation, OURS_COMPILED, "numba")(compiled)
        return build

    return register


def _from_mask(mask: Tensor | np.ndarray) -> np.ndarray:
    return pack_bits(mask if isinstance(mask, np.ndarray) else mask.numpy(force=True))


# Encode: frames → hypervectors -------------------------------------------------------------------


@_ours("encode")
def _(case: Case, backend: str) -> Job:
    frames = case.frames.to(case.device)
    return lambda: encode(frames, backend=backend), lambda words: packed_bytes(words, case.d)


@_route("encode", "torch.median, compare", anywhere=True)
def _(case: Case) -> Job:
    frames = case.frames.to(case.device)
    return lambda: _torch_threshold(frames), _from_mask


@_route("encode", "numpy.median, compare")
def _(case: Case) -> Job:
    frames = case.frames.numpy()
    return lambda: frames > np.median(frames, axis=1, keepdims=True), _from_mask


@_route("encode", "numpy.bincount, compare, packbits")
def _(case: Case) -> Job:
    frames = case.frames.numpy()

    def call() -> np.ndarray:
        out = np.empty((case.n, -(-case.d // 8)), np.uint8)
        for row, pixels in zip(out, frames, strict=True):
            row[:] = _histogram_threshold(pixels)
        return out

    return call, lambda x: x


def _torch_threshold(frames: Tensor) -> Tensor:
    return frames > frames.median(1, keepdim=True).values


def _histogram_threshold(pixels: np.ndarray) -> np.ndarray:
    """A median by counting grey levels, and packed bits: the best that plain numpy offers."""
    below = np.bincount(pixels, minlength=256).cumsum()
    return pack_bits(pixels > np.searchsorted(below, (len(pixels) + 1) // 2))


# Bundle: hypervectors → prototypes ---------------------------------------------------------------


@_ours("bundle")
def _(case: Case, backend: str) -> Job:
    words, labels = case.words, torch.from_numpy(case.labels)

    def call() -> Tensor:
        counters = Counters(case.n_classes, case.d, case.device, backend)
        counters.add(words, labels)
        return counters.majority()

    return call, lambda prototypes: packed_bytes(prototypes, case.d)


@_route("bundle", "torchhd.multiset", "torchhd", anywhere=True)
def _(case: Case) -> Job:
    import torchhd

    hypervectors = _bsc(case)
    classes = [hypervectors[case.labels == c] for c in range(case.n_classes)]  # sorted for it
    return lambda: torch.stack([torchhd.multiset(x) for x in classes]), _from_mask


@_route("bundle", "torchhd.models.Centroid", "torchhd", anywhere=True)
def _(case: Case) -> Job:
    hypervectors = _bsc(case).as_subclass(Tensor)
    labels = torch.from_numpy(case.labels).to(case.device)
    counts = torch.bincount(labels, minlength=case.n_classes)[:, None]
    call = functools.partial(_centroid, case, hypervectors, labels)
    return call, lambda model: _from_mask(2 * model.weight.detach() > counts)


@_route("bundle", "numpy.add.reduce of bytes")
def _(case: Case) -> Job:
    packed = packed_bytes(case.words, case.d)
    classes = [unpack_bits(packed[case.labels == c], case.d) for c in range(case.n_classes)]
    return lambda: np.stack([2 * x.sum(0, dtype=np.int16) > len(x) for x in classes]), _from_mask


def _bsc(case: Case) -> Any:
    """Hypervectors as torchhd has them: a byte a bit."""
    import torchhd

    return torchhd.BSCTensor(bits.unpack(case.words, case.d))


def _centroid(case: Case, hypervectors: Tensor, labels: Tensor) -> Any:
    from torchhd.models import Centroid

    model = Centroid(case.d, case.n_classes, device=case.device)
    model.add(hypervectors.float(), labels)
    return model


# Hamming: distances of queries and prototypes ----------------------------------------------------


@_route("hamming", OURS, anywhere=True)
def _(case: Case) -> Job:
    queries, prototypes = case.words, case.prototypes
    return lambda: bits.hamming(queries, prototypes), lambda x: x.numpy(force=True)


@_route("hamming", "numkong.cdist", "numkong")
def _(case: Case) -> Job:
    import numkong

    q, p = (x.numpy().view(np.uint8) for x in (case.words, case.prototypes))
    return lambda: numkong.cdist(q, p, metric="hamming", dtype="uint1"), lambda x: np.asarray(x)


@_route("hamming", "faiss.IndexBinaryFlat", "faiss")
def _(case: Case) -> Job:
    import faiss

    q, p = (x.numpy().view(np.uint8) for x in (case.words, case.prototypes))
    index = faiss.IndexBinaryFlat(8 * p.shape[1])
    index.add(p)

    def form(result: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        distances, order = result
        out = np.empty_like(distances)
        np.put_along_axis(out, order, distances, 1)
        return out

    return lambda: index.search(q, len(p)), form


@_route("hamming", "numpy.bitwise_count")
def _(case: Case) -> Job:
    q, p = (x.numpy().view(np.uint64) for x in (case.words, case.prototypes))
    return lambda: _numpy_hamming(q, p), lambda x: x


@_route("hamming", "torchhd.hamming_similarity", "torchhd", anywhere=True)
def _(case: Case) -> Job:
    import torchhd

    q, p = (torchhd.BSCTensor(bits.unpack(x, case.d)) for x in (case.words, case.prototypes))
    return lambda: torchhd.hamming_similarity(q, p), lambda x: case.d - x.numpy(force=True)


@_route("hamming", "torch float32 product of ±1", anywhere=True)
def _(case: Case) -> Job:
    q, p = (2 * bits.unpack(x, case.d).float() - 1 for x in (case.words, case.prototypes))
    return lambda: q @ p.T, lambda x: ((case.d - x.numpy(force=True)) / 2).astype(np.int64)


def _numpy_hamming(queries: np.ndarray, prototypes: np.ndarray) -> np.ndarray:
    return np.stack([np.bitwise_count(queries ^ p).sum(1, dtype=np.int64) for p in prototypes], 1)


# Train: uint8 frames in memory → a model ---------------------------------------------------------


@_ours("train")
def _(case: Case, backend: str) -> Job:
    frames, labels = case.frames, case.labels
    return lambda: HDCClassifier(device=case.device, backend=backend).fit(frames, labels), (
        lambda model: packed_bytes(model.prototypes_, case.d)
    )


@_route("train", "torch.median, torchhd.multiset", "torchhd", anywhere=True)
def _(case: Case) -> Job:
    frames, labels = case.frames, torch.from_numpy(case.labels)
    return lambda: _torchhd_prototypes(case, frames, labels), _from_mask


@_route("train", "torch.median, torchhd.models.Centroid", "torchhd", anywhere=True)
def _(case: Case) -> Job:
    frames, labels = case.frames, torch.from_numpy(case.labels)
    counts = torch.bincount(labels, minlength=case.n_classes)[:, None].to(case.device)

    def call() -> Any:
        return _centroid(case, _torch_threshold(frames.to(case.device)), labels.to(case.device))

    return call, lambda model: _from_mask(2 * model.weight.detach() > counts)


@_route("train", "sklearn RidgeClassifier", "sklearn")
def _(case: Case) -> Job:
    from sklearn.linear_model import RidgeClassifier

    def call() -> RidgeClassifier:
        # It may overwrite the pixels, which were scaled for it: faster, and a copy less.
        return RidgeClassifier(copy_X=False).fit(_scaled(case.frames), case.labels)

    return call, _held_labels(case)


@_route("train", "sklearn NearestCentroid", "sklearn")
def _(case: Case) -> Job:
    from sklearn.neighbors import NearestCentroid

    return lambda: NearestCentroid().fit(_scaled(case.frames), case.labels), _held_labels(case)


def _torchhd_prototypes(case: Case, frames: Tensor, labels: Tensor) -> Tensor:
    import torchhd

    hypervectors = torchhd.BSCTensor(_torch_threshold(frames.to(case.device)))
    return torch.stack([torchhd.multiset(hypervectors[labels == c])
                        for c in range(case.n_classes)])  # fmt: skip


def _scaled(frames: Tensor) -> np.ndarray:
    """Frames as scikit-learn wants them; part of the work, so timed."""
    return frames.numpy().astype(np.float32) / 255


def _held_labels(case: Case) -> Form:
    return lambda model: model.predict(_scaled(case.held[0]))


# Predict: one frame → its label ------------------------------------------------------------------


def _one_by_one(case: Case, predict: Callable[[Tensor], Any]) -> Job:
    """Every call predicts the next held-out frame; all of them are checked."""
    frames = case.held[0]
    turn = itertools.cycle(range(HELD_OUT))

    def call() -> Any:
        i = next(turn)
        return predict(frames[i : i + 1])

    def form(_: Any) -> np.ndarray:
        return np.array([int(predict(frames[i : i + 1])) for i in range(HELD_OUT)])

    return call, form


@_ours("predict")
def _(case: Case, backend: str) -> Job:
    model = HDCClassifier(device=case.device, backend=backend).fit(*case.few)
    return _one_by_one(case, lambda frame: model.predict(frame)[0])


@_route("predict", "torch.median, torchhd.hamming_similarity", "torchhd", anywhere=True)
def _(case: Case) -> Job:
    import torchhd

    frames, labels = case.few
    prototypes = _torchhd_prototypes(case, frames, torch.from_numpy(labels))

    def predict(frame: Tensor) -> Tensor:
        query = torchhd.BSCTensor(_torch_threshold(frame.to(case.device)))
        return torchhd.hamming_similarity(query, prototypes).argmax()

    return _one_by_one(case, predict)


@_route("predict", "torch.median, torchhd.models.Centroid", "torchhd", anywhere=True)
def _(case: Case) -> Job:
    frames, labels = (torch.as_tensor(x).to(case.device) for x in case.few)
    # Bipolar, as its cosine similarity needs it.
    model = _centroid(case, 2 * _torch_threshold(frames).float() - 1, labels)

    def predict(frame: Tensor) -> Tensor:
        with torch.no_grad():
            return model(2 * _torch_threshold(frame.to(case.device)).float() - 1).argmax()

    return _one_by_one(case, predict)


@_route("predict", "numpy.bincount, numpy.bitwise_count")
def _(case: Case) -> Job:
    prototypes = HDCClassifier().fit(*case.few).prototypes_.numpy().view(np.uint64)
    width = prototypes.shape[1] * 8

    def predict(frame: Tensor) -> int:
        query = np.zeros(width, np.uint8)
        packed = _histogram_threshold(frame.numpy()[0])
        query[: len(packed)] = packed
        return int(_numpy_hamming(query.view(np.uint64)[None], prototypes).argmin())

    return _one_by_one(case, predict)


@_route("predict", "sklearn RidgeClassifier", "sklearn")
def _(case: Case) -> Job:
    from sklearn.linear_model import RidgeClassifier

    model = RidgeClassifier().fit(_scaled(case.few[0]), case.few[1])
    return _one_by_one(case, lambda frame: model.predict(_scaled(frame))[0])


@_route("predict", "sklearn NearestCentroid", "sklearn")
def _(case: Case) -> Job:
    from sklearn.neighbors import NearestCentroid

    model = NearestCentroid().fit(_scaled(case.few[0]), case.few[1])
    return _one_by_one(case, lambda frame: model.predict(_scaled(frame))[0])


# The machine's own limit: every byte of the operation's input once -------------------------------


def _read_job(operation: str, case: Case) -> Job:
    inputs = {
        "encode": lambda: [case.frames],
        "bundle": lambda: [case.words],
        "hamming": lambda: [case.words, case.prototypes],
        "train": lambda: [case.frames],
        "predict": lambda: [case.held[0][:1], case.prototypes],
    }[operation]()
    if case.device != "cpu":
        tensors = [_wide(x.to(case.device)) for x in inputs]
        return lambda: [x.sum() for x in tensors], lambda _: None
    arrays = [_wide(x).numpy() for x in inputs]
    return lambda: [np.bitwise_xor.reduce(x, axis=0) for x in arrays], lambda _: None


def _wide(x: Tensor) -> Tensor:
    """The same bytes as 64-bit words where they divide."""
    return x.view(torch.int64) if x.shape[1] * x.element_size() % 8 == 0 else x


ROUTES += [
    Route(operation, READ, functools.partial(_read_job, operation), anywhere=True)
    for operation in OPERATIONS
]
