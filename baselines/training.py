"""One training loop for every model that learns by gradients.

Minimises the mean cross-entropy of the softmax of a network's outputs,

    F(θ) = 1/N Σᵢ −log softmax(f_θ(xᵢ))[yᵢ]  (+ ‖W‖² / (2CN) with ``C`` set),

over minibatches drawn by a seeded permutation in each epoch. The published recipe gives the
learning rate 1e-4 and no more (Kitagawa et al., Sec. III.A); Adam, batches of 20 and no penalty
are our choices, the most usual ones.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from baselines.base import Classifier, FrameSource, choose, in_memory_order
from baselines.pixels import PixelScaling, fit_scaling


@dataclass(kw_only=True, eq=False)
class IterativeClassifier(Classifier):
    """A network trained by minibatches; a subclass writes ``build``.

    Args:
        pixels: one of the scalings in baselines.pixels, by name.
        optimizer: ``Adam``, ``SGD``, or ``LBFGS`` with strong-Wolfe line search (full batch).
        lr: learning rate; the published one is 1e-4.
        batch_size: frames a step; None for the whole training set, which makes SGD plain
            gradient descent.
        max_epochs: passes over the training frames after which ``train`` returns.
        C: inverse strength of the L2 penalty on weights (biases go free), as in scikit-learn's
            LogisticRegression; None for no penalty.
        dtype: ``float32``, or ``bfloat16`` for the products alone (autocast: the weights, their
            gradients and the optimiser stay in float32).
        memory_format: ``contiguous`` or ``channels_last``.
        micro_batch: frames held as activations at a time; only memory and speed change. None for
            the whole batch.
        reports_per_epoch: how often in an epoch ``train`` yields.
        init: initial weights. ``linear``: PyTorch's own, weights and biases uniform within ±1/√n
            for n inputs of a unit. ``normal``: weights normal with ``init_std``, biases zero.
            ``zeros``: all zero.
        init_std: standard deviation for ``init="normal"``, at least zero.
        seed: of the initial weights and the permutations.
        device: where the network lives.

    Attributes:
        network_: the trained ``torch.nn.Module``.
        scaling_: the scaling of pixels in front of it.
    """

    pixels: str = "unit"
    optimizer: str = "Adam"
    lr: float = 1e-4
    batch_size: int | None = 20
    max_epochs: int = 100
    C: float | None = None
    dtype: str = "float32"
    memory_format: str = "contiguous"
    micro_batch: int | None = None
    reports_per_epoch: int = 1
    init: str = "linear"
    init_std: float = 0.01
    seed: int = 0

    @abstractmethod
    def build(self, shape: tuple[int, int], classes: int) -> nn.Module:
        """The untrained network: float32 [n, 1, H, W] → logits [n, L]."""

    def train(self, frames: FrameSource, labels: np.ndarray) -> Iterator[dict[str, float]]:
        """Train from new initial weights; yields samples_seen, epoch, steps and loss.

        ``samples_seen`` counts a frame every time it is used, ``epoch`` is samples_seen / N,
        ``steps`` are the optimiser's, and ``loss`` is the mean of F over those of the last epoch.
        Stopping is up to the caller, also at a loss that is not finite; L-BFGS returns on
        convergence.
        """
        for name in ("batch_size", "micro_batch", "reports_per_epoch"):
            if (value := getattr(self, name)) is not None and value < 1:
                raise ValueError(f"{name}: expected at least 1, found {value}")
        targets = self.start(frames, labels)
        choose("dtype", self.dtype, DTYPES)
        choose("init", self.init, INITS)
        if self.init == "normal" and not 0 <= self.init_std < math.inf:
            raise ValueError(f"init_std: expected a number from zero, found {self.init_std}")
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.seed)
            network = self.build(self.shape_, len(self.classes_))
            for parameter in network.parameters() if self.init != "linear" else ():
                if self.init == "normal" and parameter.ndim > 1:
                    nn.init.normal_(parameter, std=self.init_std)
                else:
                    nn.init.zeros_(parameter)
        layout = choose("memory_format", self.memory_format, MEMORY_FORMATS)
        # The stubs of torch do not know this keyword of Module.to.
        self.network_ = network.to(device=self.device, memory_format=layout)  # type: ignore[call-overload]
        optimizer = choose("optimizer", self.optimizer, OPTIMIZERS)(
            self.network_.parameters(), self.lr
        )
        if isinstance(optimizer, torch.optim.LBFGS) and self.batch_size is not None:
            raise ValueError(
                f"batch_size: LBFGS needs the whole training set (null), found {self.batch_size}"
            )
        self.scaling_ = fit_scaling(self.pixels, self, frames)
        yield from self._epochs(frames, targets, optimizer)

    def scores(self, batch: Tensor) -> Tensor:
        """Logits float32 [n, L]."""
        # Prediction runs channels last whatever the training does: the same logits but for their
        # rounding, in half the time.
        layout = MEMORY_FORMATS[self.memory_format if torch.is_grad_enabled() else "channels_last"]
        # [n, 1, H, W] is the same memory in both layouts, so this only renames the strides.
        inputs = self.scaling_(batch)[:, None].to(memory_format=layout)
        kind = torch.device(self.device).type
        with torch.autocast(kind, torch.bfloat16, enabled=self.dtype == "bfloat16"):
            return self.network_(inputs).float()

    def state_tensors(self) -> dict[str, Tensor]:
        """The parameters of the network, and the maps of a pixel-by-pixel scaling."""
        parameters = {
            name: in_memory_order(p.detach()) for name, p in self.network_.named_parameters()
        }
        maps = vars(self.scaling_) if isinstance(self.scaling_, PixelScaling) else {}
        return parameters | {f"pixel_{k}": v for k, v in maps.items() if isinstance(v, Tensor)}

    def _epochs(
        self, frames: FrameSource, targets: Tensor, optimizer: torch.optim.Optimizer
    ) -> Iterator[dict[str, float]]:
        n = len(frames)
        size = n if self.batch_size is None else min(self.batch_size, n)
        steps = math.ceil(n / size)
        parts = self.reports_per_epoch
        reports = {math.ceil(steps * k / parts) for k in range(1, parts + 1)}
        order = torch.Generator().manual_seed(self.seed)
        seen, taken, mean, previous = 0, 0, math.nan, math.inf
        losses: deque[Tensor] = deque(maxlen=steps)
        while seen < self.max_epochs * n:
            # In a full batch the order is of no consequence, and a slice costs no copy.
            permutation = torch.randperm(n, generator=order) if size < n else None
            for step in range(1, steps + 1):
                first, last = (step - 1) * size, min(step * size, n)
                evaluated: list[Tensor] = []

                def closure(first: int = first, last: int = last, into: Any = evaluated) -> Any:
                    optimizer.zero_grad(set_to_none=True)
                    into.append(self._backward(frames, targets, permutation, first, last))  # noqa: B023
                    return into[-1]

                optimizer.step(closure)
                # The first evaluation is at the weights before the step, for every optimiser.
                losses.append(evaluated[0])
                taken += 1
                seen += len(evaluated) * (last - first)
                if step in reports:
                    mean = torch.stack(list(losses)).mean().item()
                    yield {"samples_seen": seen, "epoch": seen / n, "steps": taken, "loss": mean}
            if isinstance(optimizer, torch.optim.LBFGS):
                if abs(previous - mean) <= LBFGS_TOLERANCE * abs(mean):
                    return
                previous = mean

    def _backward(
        self, frames: FrameSource, targets: Tensor, order: Tensor | None, first: int, last: int
    ) -> Tensor:
        """Loss of one batch, its gradient left in the parameters."""
        size = self.micro_batch or (DEFAULT_FULL_CHUNK if order is None else last - first)
        # Near the optimum log-sum-exp and logit nearly cancel: in float32 the rounding of a logit
        # of 5 is a thousandth of such a loss, and the line search of L-BFGS stalls.
        exact = torch.float32 if targets.device.type == "mps" else torch.float64
        loss = torch.zeros((), dtype=exact, device=self.device)
        for start in range(first, last, size):
            chunk = slice(start, min(start + size, last))
            index = chunk if order is None else order[chunk]
            logits = self.scores(self.read(frames, index)).to(exact)
            part = F.cross_entropy(logits, targets[index], reduction="sum") / (last - first)
            part.backward()
            loss += part.detach()
        if self.C is not None:
            weights = [p for p in self.network_.parameters() if p.ndim > 1]
            squares = torch.stack([p.square().sum() for p in weights]).sum()
            penalty = squares / (2 * self.C * len(frames))
            penalty.backward()
            loss += penalty.detach()
        return loss


INITS = dict.fromkeys(["linear", "normal", "zeros"])
DEFAULT_FULL_CHUNK = 20  # frames scaled at a time in a full batch
LBFGS_TOLERANCE = 1e-7  # relative change of the loss between two reports: float32 has no more


def _lbfgs(parameters: Iterable[nn.Parameter], lr: float) -> torch.optim.Optimizer:
    return torch.optim.LBFGS(
        parameters,
        lr,
        max_iter=5,  # iterations between two reports
        history_size=10,
        tolerance_grad=0.0,
        tolerance_change=0.0,
        line_search_fn="strong_wolfe",
    )


# fused: one pass over the parameters a step instead of several; the arithmetic is the same.
OPTIMIZERS: dict[str, Callable[[Iterable[nn.Parameter], float], torch.optim.Optimizer]] = {
    "Adam": lambda parameters, lr: torch.optim.Adam(parameters, lr, fused=True),
    "SGD": lambda parameters, lr: torch.optim.SGD(parameters, lr, fused=True),
    "LBFGS": _lbfgs,
}
DTYPES = {"float32": torch.float32, "bfloat16": torch.bfloat16}
MEMORY_FORMATS = {
    "contiguous": torch.contiguous_format,
    "channels_last": torch.channels_last,
}
