"""Hamming: distances of queries and prototypes."""

from __future__ import annotations

import numpy as np

from experiments.studies.benchmark.cases import Case
from experiments.studies.benchmark.names import NUMKONG, OURS
from experiments.studies.benchmark.route import Job, route
from hdc import bits


@route("hamming", OURS, anywhere=True)
def hdc(case: Case) -> Job:
    queries, prototypes = case.words, case.prototypes
    return lambda: bits.hamming(queries, prototypes), lambda x: x.numpy(force=True)


@route("hamming", NUMKONG, module="numkong")
def numkong_cdist(case: Case) -> Job:
    import numkong

    q, p = (x.numpy().view(np.uint8) for x in (case.words, case.prototypes))
    return lambda: numkong.cdist(q, p, metric="hamming", dtype="uint1"), lambda x: np.asarray(x)


@route("hamming", "faiss.IndexBinaryFlat", module="faiss")
def faiss_index(case: Case) -> Job:
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


@route("hamming", "numpy.bitwise_count", module="numpy")
def numpy_bitwise_count(case: Case) -> Job:
    q, p = (x.numpy().view(np.uint64) for x in (case.words, case.prototypes))
    return lambda: numpy_hamming(q, p), lambda x: x


@route("hamming", "torchhd.hamming_similarity", module="torchhd", anywhere=True)
def torchhd_similarity(case: Case) -> Job:
    import torchhd

    q, p = (torchhd.BSCTensor(bits.unpack(x, case.d)) for x in (case.words, case.prototypes))
    return lambda: torchhd.hamming_similarity(q, p), lambda x: case.d - x.numpy(force=True)


@route("hamming", "torch float32 product of ±1", anywhere=True)
def torch_product(case: Case) -> Job:
    q, p = (2 * bits.unpack(x, case.d).float() - 1 for x in (case.words, case.prototypes))
    return lambda: q @ p.T, lambda x: ((case.d - x.numpy(force=True)) / 2).astype(np.int64)


def numpy_hamming(queries: np.ndarray, prototypes: np.ndarray) -> np.ndarray:
    """Distances int64 [Q, L] of uint64 words [Q, W] and [L, W]."""
    return np.stack([np.bitwise_count(queries ^ p).sum(1, dtype=np.int64) for p in prototypes], 1)
