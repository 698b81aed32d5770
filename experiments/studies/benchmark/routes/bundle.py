"""Bundle: hypervectors to prototypes."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.studies.benchmark.cases import Case, pack_bits, packed_bytes, unpack_bits
from experiments.studies.benchmark.names import TORCHHD_BUNDLE
from experiments.studies.benchmark.route import Job, ours, route
from hdc import bits
from hdc.prototypes import Counters


@ours("bundle")
def hdc(case: Case, backend: str) -> Job:
    words, labels = case.words, torch.from_numpy(case.labels)

    def call() -> Tensor:
        counters = Counters(case.n_classes, case.d, case.device, backend)
        counters.add(words, labels)
        return counters.majority()

    return call, lambda prototypes: packed_bytes(prototypes, case.d)


@route("bundle", TORCHHD_BUNDLE, module="torchhd", anywhere=True)
def torchhd_multiset(case: Case) -> Job:
    import torchhd

    # Hypervectors as torchhd has them, a byte a bit, and sorted for it.
    hypervectors = torchhd.BSCTensor(bits.unpack(case.words, case.d))
    classes = [hypervectors[case.labels == c] for c in range(case.n_classes)]
    return lambda: torch.stack([torchhd.multiset(x) for x in classes]), pack_bits


@route("bundle", "torchhd.models.Centroid", module="torchhd", anywhere=True)
def torchhd_centroid(case: Case) -> Job:
    hypervectors = bits.unpack(case.words, case.d)
    labels = torch.from_numpy(case.labels).to(case.device)
    call = functools.partial(centroid, case, hypervectors, labels)
    return call, functools.partial(centroid_majority, case)


@route("bundle", "numpy.add.reduce of bytes", module="numpy")
def numpy_sum(case: Case) -> Job:
    packed = packed_bytes(case.words, case.d)
    classes = [unpack_bits(packed[case.labels == c], case.d) for c in range(case.n_classes)]
    return lambda: np.stack([2 * x.sum(0, dtype=np.int16) > len(x) for x in classes]), pack_bits


def centroid(case: Case, hypervectors: Tensor, labels: Tensor) -> Any:
    """torchhd's model of these hypervectors."""
    from torchhd.models import Centroid

    model = Centroid(case.d, case.n_classes, device=case.device)
    model.add(hypervectors.float(), labels)
    return model


def centroid_majority(case: Case, model: Any) -> np.ndarray:
    """Packed prototypes of a model that has added up hypervectors of 0 and 1."""
    counts = torch.from_numpy(np.bincount(case.labels, minlength=case.n_classes))[:, None]
    return pack_bits(2 * model.weight.detach().cpu() > counts)
