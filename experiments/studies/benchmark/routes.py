"""Every way to carry out an operation on the same bytes: ours, the peers', the machine's limits.

:data:`OPERATIONS` is the registry: a function an operation, which yields its routes for a case. The
routes of a case share its inputs, in the form that their users have at hand; anything else that a
call needs is prepared by the first call, which is not timed. A new peer is one more ``yield``.
"""

from __future__ import annotations

import contextlib
import io
import itertools
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from importlib import import_module as load
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from experiments.studies.benchmark.cases import HELD_OUT, Case, pack_bits, unpack_bits
from hdc import HDCClassifier, bits
from hdc.encode import encode
from hdc.prototypes import Counters

OURS, OURS_COMPILED = "hdc", "hdc, compiled"
READ, COPY = "one read of the bytes", "one copy of the bytes"
DECODED = "OpenCV in as many threads, no more"
LIMITS = (READ, COPY, DECODED)  # they have no result
RIDGE = "sklearn RidgeClassifier"
NUMKONG, TORCHHD_BUNDLE = "numkong.cdist", "torchhd.multiset"
TORCHHD_TRAIN = "torch.median, torchhd.multiset"
ORDINARY_ROUTES = (TORCHHD_TRAIN, "numpy.median, torchhd.multiset")
"""Frames to prototypes by the functions that numpy, torch and torchhd offer."""


class Route(NamedTuple):
    """One way to carry out an operation: its name, the package it needs, the call."""

    name: str
    module: str
    call: Callable[[], Any]


def encode_routes(case: Case) -> Iterator[Route]:
    """Frames to hypervectors."""
    frames, array = case.pixels, case.pixels.numpy()
    yield from ours(lambda backend: partial(encode, frames, backend=backend))
    yield from limits(frames, copy=True)
    yield Route("numpy.median, compare", "numpy", lambda: numpy_bits(array))
    if case.dtype != np.uint16:  # torch does not sort it
        yield Route("torch.median, compare", "torch", lambda: torch_bits(frames))
    if case.dtype != np.float32:
        call = partial(histogram_rows, array, opencv_counts)
        yield Route("cv2.calcHist, compare, packbits", "cv2", call)


def bundle_routes(case: Case) -> Iterator[Route]:
    """Hypervectors to prototypes."""
    words, labels = case.words, torch.from_numpy(case.labels)

    def count(backend: str) -> Tensor:
        counters = Counters(case.l, case.d, backend=backend)
        counters.add(words, labels)
        return counters.majority()

    ones = cache(lambda: bits.unpack(words, case.d))  # as torchhd has them, a byte a bit
    classes = cache(lambda: by_class(case, ones()))
    yield from ours(lambda backend: partial(count, backend))
    yield from limits(words)
    yield Route(TORCHHD_BUNDLE, "torchhd", lambda: multisets(classes()))
    yield Route(
        "numpy.add.reduce of bytes",
        "numpy",
        lambda: np.stack([2 * x.numpy().sum(0, dtype=np.int16) > len(x) for x in classes()]),
    )


def hamming_routes(case: Case) -> Iterator[Route]:
    """Distances of queries and prototypes."""
    pair = case.words, case.prototypes
    q, p = (x.numpy().view(np.uint8) for x in pair)

    @cache
    def index() -> Any:
        index = load("faiss").IndexBinaryFlat(8 * p.shape[1])
        index.add(p)
        return index

    def faiss_distances() -> np.ndarray:
        distances, order = index().search(q, len(p))
        return np.take_along_axis(distances, order.argsort(1), 1)

    def numkong_distances() -> Any:
        return load("numkong").cdist(q, p, metric="hamming", dtype="uint1")

    yield from ours(lambda backend: partial(bits.hamming, *pair, backend))
    yield from limits(*pair)
    yield Route(NUMKONG, "numkong", numkong_distances)
    yield Route("faiss.IndexBinaryFlat", "faiss", faiss_distances)
    yield Route("numpy.bitwise_count", "numpy", lambda: numpy_hamming(q, p))


def train_routes(case: Case) -> Iterator[Route]:
    """Frames to prototypes, or to another model that predicts."""
    frames, array = case.pixels, case.pixels.numpy()

    def numpy_multisets() -> Tensor:
        return multisets(by_class(case, torch.from_numpy(numpy_bits(array))))

    yield from ours(lambda backend: lambda: HDCClassifier(backend=backend).fit(frames, case.labels))
    yield from limits(frames, copy=True)
    yield Route(TORCHHD_TRAIN, "torchhd", lambda: multisets(by_class(case, torch_bits(frames))))
    yield Route(ORDINARY_ROUTES[1], "torchhd", numpy_multisets)
    yield Route(RIDGE, "sklearn", lambda: ridge(frames, case.labels))


def predict_routes(case: Case) -> Iterator[Route]:
    """A frame to its label; successive calls take successive held-out frames."""
    frames = case.held_out[0].split(1)
    packed = cache(lambda: encode(case.examples[0]).numpy().view(np.uint8))
    ones = cache(lambda: load("torchhd").BSCTensor(torch_bits(case.examples[0])))
    model = cache(lambda: ridge(*case.examples))

    def numpy_label(frame: Tensor) -> np.intp:
        query = np.zeros((1, packed().shape[1]), np.uint8)
        query[:, : -(-case.d // 8)] = histogram_rows(frame.numpy())
        return numpy_hamming(query, packed()).argmin()

    def torchhd_label(frame: Tensor) -> Tensor:
        query = load("torchhd").BSCTensor(torch_bits(frame))
        return load("torchhd").hamming_similarity(query, ones()).argmax()

    def each(label: Callable[[Tensor], Any]) -> Callable[[], Any]:
        turn = itertools.cycle(frames)
        return lambda: label(next(turn))

    yield from ours(
        lambda backend: each(HDCClassifier(backend=backend).fit(*case.examples).predict)
    )
    yield from limits(frames[0], case.prototypes)
    yield Route("torch.median, torchhd.hamming_similarity", "torchhd", each(torchhd_label))
    yield Route("numpy.bincount, numpy.bitwise_count", "numpy", each(numpy_label))
    yield Route(RIDGE, "sklearn", each(lambda frame: model().predict(scaled(frame))[0]))


def file_routes(case: Case) -> Iterator[Route]:
    """Images or a video to a saved model, as ``hdc train`` does it once it has started."""

    def train() -> Path:
        main = load("hdc.command").main
        with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
            main(["train", str(recording), "-o", str(model)])
        return model

    def decode(file: Path) -> bool:
        cv2 = load("cv2")
        data = np.frombuffer(file.read_bytes(), np.uint8)
        return cv2.imdecode(data, cv2.IMREAD_UNCHANGED) is not None

    def decode_folder() -> int:
        with ThreadPoolExecutor(torch.get_num_threads()) as executor:
            return sum(executor.map(decode, sorted(recording.rglob("*.png"))))

    def decode_video() -> int:
        cv2 = load("cv2")
        threads = [cv2.CAP_PROP_N_THREADS, torch.get_num_threads()]
        video = cv2.VideoCapture(str(recording), cv2.CAP_ANY, threads)
        return sum(1 for _ in iter(lambda: video.read()[0], False))

    model = Path(case.folder.name, "model.safetensors")
    recording = write_recording(case, Path(case.folder.name))
    yield Route(OURS, "cv2", train)
    yield Route(DECODED, "cv2", decode_folder if case.operation == "folder" else decode_video)


OPERATIONS: Mapping[str, Callable[[Case], Iterator[Route]]] = {
    "encode": encode_routes,
    "bundle": bundle_routes,
    "hamming": hamming_routes,
    "train": train_routes,
    "predict": predict_routes,
    "folder": file_routes,
    "video": file_routes,
}


def common_form(case: Case, call: Callable[[], Any]) -> np.ndarray:
    """The result of a call: packed bits uint8, distances, or labels of the held-out frames."""
    one_by_one = case.operation == "predict"
    result: Any = np.array([call() for _ in range(HELD_OUT)]).ravel() if one_by_one else call()
    if isinstance(result, Path):
        result = HDCClassifier.load(result)
    if isinstance(result, HDCClassifier):
        result = result.prototypes_
    elif hasattr(result, "predict"):
        result = result.predict(scaled(case.held_out[0]))
    array = result.numpy(force=True) if isinstance(result, Tensor) else np.asarray(result)
    if array.dtype == np.bool_:
        return pack_bits(array)
    words = isinstance(result, Tensor) and case.operation != "hamming"
    return pack_bits(unpack_bits(result, case.d)) if words else array


# Parts of routes ----------------------------------------------------------------------------------


def ours(build: Callable[[str], Callable[[], Any]]) -> Iterator[Route]:
    """Routes of both backends of hdc, by a function that makes a call of its name."""
    yield Route(OURS, "torch", build("numpy"))
    yield Route(OURS_COMPILED, "numba", build("compiled"))


def limits(*inputs: Tensor, copy: bool = False) -> Iterator[Route]:
    """One read of the inputs, as 64-bit words where the rows allow it; one copy of the first."""
    arrays = [x.numpy().view(np.uint8) for x in inputs]
    wide = [x.view(np.uint64) if x.shape[1] % 8 == 0 else x for x in arrays]
    yield Route(READ, "numpy", lambda: [np.bitwise_xor.reduce(x, axis=0) for x in wide])
    if copy:
        copied = torch.empty_like(inputs[0])
        yield Route(COPY, "torch", lambda: copied.copy_(inputs[0]))


def torch_bits(frames: Tensor) -> Tensor:
    """Pixels above the median of their frame, bool [N, D]."""
    return frames > frames.median(1, keepdim=True).values


def numpy_bits(frames: np.ndarray) -> np.ndarray:
    """The same by numpy."""
    return frames > np.median(frames, axis=1, keepdims=True)


def histogram_rows(
    frames: np.ndarray, counter: Callable[[np.ndarray], np.ndarray] = np.bincount
) -> np.ndarray:
    """The same, packed, by a function that counts grey levels."""
    middle = (frames.shape[1] + 1) // 2
    rows = [pack_bits(x > np.searchsorted(counter(x).cumsum(), middle)) for x in frames]
    return np.stack(rows)


def opencv_counts(pixels: np.ndarray) -> np.ndarray:
    """How often each grey level occurs; exact to 2^24, as float32 is."""
    levels = np.iinfo(pixels.dtype).max + 1
    counts = load("cv2").calcHist([pixels], [0], None, [levels], [0, levels])
    return counts.reshape(-1).astype(np.int64)


def by_class(case: Case, ones: Tensor) -> list[Tensor]:
    """Hypervectors bool [N, D], class by class."""
    return [ones[case.labels == c] for c in range(case.l)]


def multisets(classes: list[Tensor]) -> Tensor:
    """Prototypes by torchhd, bool [L, D]."""
    torchhd = load("torchhd")
    prototypes = [torchhd.multiset(torchhd.BSCTensor(ones)) for ones in classes]
    return torch.stack(prototypes).as_subclass(Tensor)


def numpy_hamming(queries: np.ndarray, prototypes: np.ndarray) -> np.ndarray:
    """Distances int64 [Q, L] of packed hypervectors uint8 [Q, 8 W] and [L, 8 W]."""
    q, p = queries.view(np.uint64), prototypes.view(np.uint64)
    return np.stack([np.bitwise_count(q ^ row).sum(1, dtype=np.int64) for row in p], 1)


def ridge(frames: Tensor, labels: np.ndarray) -> Any:
    """scikit-learn's linear model of scaled pixels, which it may overwrite: a copy less."""
    model = load("sklearn.linear_model").RidgeClassifier(copy_X=False)
    return model.fit(scaled(frames), labels)


def scaled(frames: Tensor) -> np.ndarray:
    """Frames as scikit-learn wants them; part of the work, so timed."""
    return frames.numpy().astype(np.float32) / 255


def write_recording(case: Case, folder: Path) -> Path:
    """The case's frames as PNGs in a folder a class, or as a lossless video with its intervals."""
    cv2, side = load("cv2"), round(case.d**0.5)
    height, width = (side, side) if side * side == case.d else (1, case.d)
    frames = case.pixels.numpy().reshape(-1, height, width)
    if case.operation == "video":
        codec = cv2.VideoWriter.fourcc(*"FFV1")
        video = cv2.VideoWriter(str(folder / "touches.avi"), codec, 25, (width, height), False)
        for frame in frames:
            video.write(frame)
        video.release()
        rows = [f"{max(0, i - 0.3) / 25},{(i + 0.3) / 25},{x}" for i, x in enumerate(case.labels)]
        (folder / "touches.csv").write_text("\n".join(["start_s,end_s,label", *rows]))
        return folder / "touches.avi"
    for i, (frame, label) in enumerate(zip(frames, case.labels, strict=True)):
        file = folder / "touches" / str(label) / f"{i}.png"
        file.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(file), frame)
    return folder / "touches"
