"""Every way to carry out an operation on the same bytes: ours, the peers', the machine's limits.

:data:`OPERATIONS` is the registry: a function per operation, which yields its routes for a case.
The routes of a case share its inputs, in the form that their users have at hand. A call prepares
anything else that it needs when it is first made, which is not timed. Routes on a GPU find their
input in its memory; those that train or predict begin in the machine's, as all others do.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from importlib import import_module as load
from typing import Any, NamedTuple

import numpy as np
import torch

from experiments.protocol.clock import synchronise
from hdc import HDCClassifier, bits
from hdc.encoders import Median
from hdc.prototypes import Counters
from hdc.readers import open_recording
from tests.benchmark.cases import HELD_OUT, pack_bits, unpack_bits
from tests.hdc import own

OURS, OURS_COMPILED, OURS_GPU = "hdc", "hdc, compiled", "hdc, on the GPU"
READ = "one read of the bytes"
NUMKONG, TORCHHD_BUNDLE = "numkong.cdist", "torchhd.multiset"
TORCHHD_TRAIN = "torch.median, torchhd.multiset"
DECODE_IMAGES = "cv2.imread alone, as many threads"
NO_RESULT = (READ, DECODE_IMAGES)


class Route(NamedTuple):
    """One way to carry out an operation: its name, the package it needs, the call."""

    name: str
    module: str
    call: Callable[[], Any]


def encode_routes(case):
    """Frames to hypervectors."""
    frames = case.pixels
    yield from ours(by(partial(Median().encode, frames)))
    yield from on_gpu(case, lambda gpu: partial(Median().encode, frames.to(gpu)))
    yield Route("torch.median, compare", "torch", lambda: torch_bits(frames))


def bundle_routes(case):
    """Hypervectors to prototypes."""
    # As torchhd has them, a byte per bit.
    classes = cache(lambda: by_class(case, bits.unpack(case.words, case.d)))
    yield from ours(by(partial(count, case, case.words)))
    yield from on_gpu(case, lambda gpu: partial(count, case, case.words.to(gpu)))
    yield Route(TORCHHD_BUNDLE, "torchhd", lambda: multisets(classes()))


def hamming_routes(case):
    """Distances of queries and prototypes."""
    pair = case.words, case.prototypes
    queries, prototypes = (words.numpy().view(np.uint8) for words in pair)

    def numkong_distances():
        numkong = load("numkong")
        return numkong.cdist(queries, prototypes, metric="hamming", dtype="uint1")

    yield from ours(by(partial(bits.hamming, *pair)))
    yield from on_gpu(
        case, lambda gpu: partial(bits.hamming, pair[0].to(gpu), pair[1].to(gpu))
    )
    yield Route(NUMKONG, "numkong", numkong_distances)


def train_routes(case):
    """Frames to prototypes."""
    frames = case.pixels
    pixels = frames.numpy()

    def train(backend, device="cpu"):
        model = HDCClassifier(backend=backend, device=device)
        return model.fit(frames, case.labels)

    def read():
        return np.bitwise_xor.reduce(pixels.view(np.uint64))

    yield from ours(lambda backend: partial(train, backend))
    yield from on_gpu(case, lambda gpu: partial(train, "auto", gpu))
    yield Route(READ, "numpy", read)
    yield Route(
        TORCHHD_TRAIN, "torchhd", lambda: multisets(by_class(case, torch_bits(frames)))
    )


def multisets(classes):
    """Prototypes bool [L, D] by torchhd, of hypervectors bool [N_l, D] of each class."""
    torchhd = load("torchhd")
    prototypes = [torchhd.multiset(torchhd.BSCTensor(ones)) for ones in classes]
    return torch.stack(prototypes).as_subclass(torch.Tensor)


def predict_routes(case):
    """A frame to its label; successive calls take successive held-out frames."""
    frames, labels = case.held_out.split(1), np.arange(case.l)

    @cache
    def ones():
        return load("torchhd").BSCTensor(torch_bits(case.examples))

    def torchhd_label(frame):
        torchhd = load("torchhd")
        query = torchhd.BSCTensor(torch_bits(frame))
        return torchhd.hamming_similarity(query, ones()).argmax()

    def each(label):
        turn = itertools.cycle(frames)
        return lambda: label(next(turn))

    def predict(backend, device="cpu"):
        model = HDCClassifier(backend=backend, device=device)
        return each(model.fit(case.examples, labels).predict)

    yield from ours(predict)
    yield from on_gpu(case, lambda gpu: predict("auto", gpu))
    yield Route(
        "torch.median, torchhd.hamming_similarity", "torchhd", each(torchhd_label)
    )


def folder_routes(case):
    """Images of a folder to prototypes, as ``hdc train`` makes them."""
    files = [str(file) for file in case.folder.glob("*/*.png")]

    def decode():
        cv2 = load("cv2")
        read = partial(cv2.imread, flags=cv2.IMREAD_UNCHANGED)
        with ThreadPoolExecutor() as pool:
            for _ in pool.map(read, files):
                pass

    yield from ours(partial(trained_on, case.folder))
    yield Route(DECODE_IMAGES, "cv2", decode)


def trained_on(path, backend):
    """A call that trains on a recording."""

    def train():
        recording = open_recording(path, check=False)
        frames = recording.batches(np.arange(len(recording)))
        return HDCClassifier(backend=backend).fit(frames, recording.names)

    return train


OPERATIONS = {
    "encode": encode_routes,
    "bundle": bundle_routes,
    "hamming": hamming_routes,
    "train": train_routes,
    "predict": predict_routes,
    "folder": folder_routes,
}


def common_form(case, call):
    """The result of a call: packed bits uint8, distances, or labels of the held-out frames."""
    if case.operation == "predict":
        return np.array([call() for _ in range(HELD_OUT)]).ravel()
    result = call()
    result = getattr(result, "prototypes_", result)  # of a model
    result = getattr(result, "cpu", lambda: result)()
    if case.operation == "hamming":
        return np.asarray(result)
    if getattr(result, "dtype", None) == torch.int64:
        result = unpack_bits(result, case.d)
    array = np.asarray(result)
    return pack_bits(array) if array.dtype == np.bool_ else array


def ours(build):
    """Routes of both backends of hdc, by a function that makes a call of its name."""
    yield Route(OURS, "torch", build("numpy"))
    yield Route(OURS_COMPILED, "numba", build("compiled"))


def on_gpu(case, build):
    """The route on the GPU, where the case has one, by a function that makes a call there.

    It ends when the GPU has finished its queue.
    """
    if case.device == "cpu":
        return
    call = build(case.device)

    def finished():
        result = call()
        synchronise(case.device)
        return result

    yield Route(OURS_GPU, "torch", finished)


def by(call):
    """A function that makes the call by a backend."""
    return lambda backend: partial(own.by, backend, call)


def count(case, words):
    """Prototypes int64 [L, W] of the case's hypervectors by our counters, on their device."""
    counters = Counters(case.l, case.d, words.device)
    counters.add(words, torch.from_numpy(case.labels))
    return counters.majority()


def torch_bits(frames):
    """Pixels above the median of their frame, bool [N, D]."""
    return frames > frames.median(1, keepdim=True).values


def by_class(case, ones):
    """Hypervectors bool [N, D], class by class."""
    return [ones[case.labels == c] for c in range(case.l)]
