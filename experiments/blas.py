"""Threads of the numerical libraries that torch does not speak for.

numpy, scipy and scikit-learn bring OpenBLAS and OpenMP libraries of their own, with a thread a core
each; a run that says ``threads=1`` has to tell them as well. Only scikit-learn's estimators compute
with them, so that no other run imports threadpoolctl.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from experiments import sources


@contextmanager
def limited(model: Mapping[str, Any], threads: int) -> Iterator[list[dict[str, Any]]]:
    """Give the libraries of a scikit-learn model this many threads; gives what they then have.

    Args:
        model: its resolved configuration.
        threads: of each library.
    """
    estimators = [name for name in sources.targets(model) if name.startswith("sklearn.")]
    if not estimators:
        yield []
        return
    from threadpoolctl import threadpool_info, threadpool_limits

    for name in estimators:  # a limit binds what is loaded, and nothing that comes later
        importlib.import_module(name.rpartition(".")[0])
    with threadpool_limits(threads):
        yield [
            {
                "library": library["prefix"],
                "version": library["version"],
                "threads": library["num_threads"],
            }
            for library in threadpool_info()
        ]
