"""PyTorch's optimisers, which import no compiler where nothing is compiled.

Optimisers of PyTorch 2.13 guard their methods against ``torch.compile``. The guards import
``torch._dynamo`` and with it sympy, more than 800 modules and 85 MB, when an optimiser is made.
Here the same methods are called without their guards; the arithmetic is PyTorch's.
"""

from __future__ import annotations

from typing import Any

import torch


def _unguarded(method: Any) -> Any:
    """A method below its guard; the method itself where it has none."""
    return getattr(method, "__wrapped__", method)


class _Eager(torch.optim.Optimizer):
    add_param_group = _unguarded(torch.optim.Optimizer.add_param_group)
    zero_grad = _unguarded(torch.optim.Optimizer.zero_grad)


class Adam(_Eager, torch.optim.Adam):
    """:class:`torch.optim.Adam`."""

    step = torch.no_grad()(_unguarded(torch.optim.Adam.step))


class SGD(_Eager, torch.optim.SGD):
    """:class:`torch.optim.SGD`."""

    step = torch.no_grad()(_unguarded(torch.optim.SGD.step))
