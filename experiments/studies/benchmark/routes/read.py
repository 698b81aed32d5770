"""The machine's own limit: every byte of an operation's input, read once."""

from __future__ import annotations

import functools

import numpy as np
import torch
from torch import Tensor

from experiments.studies.benchmark.cases import Case
from experiments.studies.benchmark.names import OPERATIONS, READ
from experiments.studies.benchmark.route import Job, route


def one_read(operation: str, case: Case) -> Job:
    inputs = {
        "encode": lambda: [case.frames],
        "bundle": lambda: [case.words],
        "hamming": lambda: [case.words, case.prototypes],
        "train": lambda: [case.frames],
        "predict": lambda: [case.held[0][:1], case.prototypes],
        "predict_all": lambda: [case.held[0], case.prototypes],
        "learn_one": lambda: [case.held[0][:1]],
    }[operation]()
    if case.device != "cpu":
        tensors = [_wide(x.to(case.device)) for x in inputs]
        return lambda: [x.sum() for x in tensors], lambda _: None
    arrays = [_wide(x).numpy() for x in inputs]
    return lambda: [np.bitwise_xor.reduce(x, axis=0) for x in arrays], lambda _: None


def _wide(x: Tensor) -> Tensor:
    """The same bytes as 64-bit words, or else as bytes."""
    whole = x.shape[1] * x.element_size() % 8 == 0
    return x.view(torch.int64) if whole else x.view(torch.uint8)


for _operation in OPERATIONS[:-1]:  # a folder is not read but decoded
    route(_operation, READ, anywhere=True)(functools.partial(one_read, _operation))
