"""One training loop for every model that learns by gradients.

Minimises F(θ) = 1/N Σᵢ −log softmax(f_θ(xᵢ))[yᵢ]  (+ ‖W‖² / (2CN) with ``C`` set) over minibatches
drawn by a seeded permutation in each epoch. The paper gives the learning rate 1e-4 and no more
(Kitagawa et al., Sec. III.A); everything else is our choice of the most usual value.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from baselines import optimisers
from baselines.base import Classifier, FrameSource, in_memory_order
from baselines.pixels import scaling
from hdc.parameters import check_choice

INITS = ("linear", "normal", "zeros")
FULL_CHUNK = 20  # frames scaled at a time in a full batch
# fused: one pass over the parameters a step instead of several; the arithmetic is the same.
OPTIMIZERS: dict[str, Callable[..., torch.optim.Optimizer]] = {
    "Adam": partial(optimisers.Adam, fused=True),
    "SGD": partial(optimisers.SGD, fused=True),
}


@dataclass(kw_only=True, eq=False)
class IterativeClassifier(Classifier):
    """A network trained by minibatches; a subclass writes ``build``.

    Args:
        pixels: one of the scalings in baselines.pixels, by name.
        optimizer: ``Adam`` or ``SGD``.
        lr: learning rate; the published one is 1e-4.
        batch_size: frames per step; None for all, which makes SGD plain gradient descent.
        max_epochs: passes over the training frames after which ``train`` returns.
        C: inverse strength of the L2 penalty on weights (biases go free), as in scikit-learn's
            LogisticRegression; None for no penalty.
        micro_batch: frames held as activations at a time (None: the whole batch), for less memory.
        reports_per_epoch: how often in an epoch ``train`` yields.
        init: initial weights. ``linear``: PyTorch's own, weights and biases uniform within ±1/√n
            for n inputs of a unit. ``normal``: weights normal with the standard deviation
            ``init_std``, biases zero. ``zeros``: all zero.
        seed: of the initial weights and the permutations.

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
    micro_batch: int | None = None
    reports_per_epoch: int = 1
    init: str = "linear"
    init_std: float = 0.01
    seed: int = 0

    @abstractmethod
    def build(
        self,
        shape: tuple[int, int],
        classes: int,
    ) -> nn.Module:
        """The untrained network: float32 [n, 1, H, W] → logits [n, L]."""

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """Train from new initial weights; yields samples_seen, epoch, steps, loss, batch_accuracy.

        ``samples_seen`` counts a frame every time it is used, ``steps`` are the optimiser's, and
        ``loss`` is the mean of F over the frames of the last epoch. ``batch_accuracy`` is the share
        of frames since the last report that the network classified correctly just before it learnt
        from them, which needs no extra pass. The caller decides when to stop, also at a loss that
        is not finite.
        """
        self._check_parameters()
        targets = self.start(frames, labels)
        network = self._initial_network()
        # Channels last: convolutions are faster on a CPU. The stubs of torch do not know this
        # keyword of Module.to.
        self.network_ = network.to(
            device=self.device, memory_format=torch.channels_last
        )  # type: ignore[call-overload]
        make_optimizer = OPTIMIZERS[self.optimizer]
        optimizer = make_optimizer(self.network_.parameters(), lr=self.lr)
        self.scaling_ = scaling(self.pixels, self.frame_dtype_)
        yield from self._epochs(frames, targets, optimizer)

    def _check_parameters(self) -> None:
        for name in ("batch_size", "micro_batch", "reports_per_epoch"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f"{name}: expected at least 1, found {value}")
        check_choice("init", self.init, INITS)
        check_choice("optimizer", self.optimizer, OPTIMIZERS)

    def _initial_network(self) -> nn.Module:
        """The network with its initial weights; the global random state is left as it was."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.seed)
            network = self.build(self.shape_, len(self.classes_))
            if self.init == "linear":
                return network
            for parameter in network.parameters():
                if self.init == "normal" and parameter.ndim > 1:
                    nn.init.normal_(parameter, std=self.init_std)
                else:
                    nn.init.zeros_(parameter)
        return network

    def scores(self, batch: Tensor) -> Tensor:
        """Logits float32 [n, L]."""
        # [n, 1, H, W] is the same memory in both layouts, so this only renames the strides.
        inputs = self.scaling_(batch)[:, None].to(memory_format=torch.channels_last)
        return self.network_(inputs)

    def state_tensors(self) -> dict[str, Tensor]:
        """The parameters of the network."""
        parameters = self.network_.named_parameters()
        return {name: in_memory_order(tensor.detach()) for name, tensor in parameters}

    def _epochs(
        self, frames: FrameSource, targets: Tensor, optimizer: torch.optim.Optimizer
    ) -> Iterator[dict[str, float]]:
        n = len(frames)
        size = n if self.batch_size is None else min(self.batch_size, n)
        steps = math.ceil(n / size)
        parts = self.reports_per_epoch
        numbers = range(1, parts + 1)
        reports = {math.ceil(steps * number / parts) for number in numbers}
        order = torch.Generator().manual_seed(self.seed)
        seen, taken = 0, 0
        losses: deque[Tensor] = deque(maxlen=steps)
        right: list[Tensor] = []  # of the batches since the last report
        asked = 0
        while seen < self.max_epochs * n:
            # In a full batch the order has no effect, and a slice needs no copy.
            permutation = torch.randperm(n, generator=order) if size < n else None
            for step in range(1, steps + 1):
                last = min(step * size, n)
                rows = range((step - 1) * size, last)
                optimizer.zero_grad(set_to_none=True)
                loss, hits = self._evaluate(frames, targets, permutation, rows)
                optimizer.step()
                losses.append(loss)
                right.append(hits)
                asked += len(rows)
                taken += 1
                seen += len(rows)
                if step in reports:
                    yield {
                        "samples_seen": seen,
                        "epoch": seen / n,
                        "steps": taken,
                        "loss": torch.stack(list(losses)).mean().item(),
                        "batch_accuracy": torch.stack(right).sum().item() / asked,
                    }
                    right, asked = [], 0

    def _evaluate(
        self,
        frames: FrameSource,
        targets: Tensor,
        order: Tensor | None,
        rows: range,
    ) -> tuple[Tensor, Tensor]:
        """Loss of one batch and the number of its frames that were right; the gradient is added to
        that of the parameters."""
        size = self.micro_batch or (FULL_CHUNK if order is None else len(rows))
        # Near the optimum log-sum-exp and logit nearly cancel: in float32 the rounding of a logit
        # of 5 is a thousandth of such a loss.
        exact = torch.float32 if targets.device.type == "mps" else torch.float64
        loss = torch.zeros((), dtype=exact, device=self.device)
        right = torch.zeros((), dtype=torch.int64, device=self.device)
        for start in range(rows.start, rows.stop, size):
            chunk = slice(start, min(start + size, rows.stop))
            index = chunk if order is None else order[chunk]
            logits = self.scores(self.read(frames, index)).to(exact)
            part = F.cross_entropy(logits, targets[index], reduction="sum")
            part = part / len(rows)
            part.backward()
            loss += part.detach()
            right += (logits.detach().argmax(dim=1) == targets[index]).sum()
        if self.C is not None:
            parameters = self.network_.parameters()
            weights = [weight for weight in parameters if weight.ndim > 1]
            squares = torch.stack([weight.square().sum() for weight in weights]).sum()
            penalty = squares / (2 * self.C * len(frames))
            penalty.backward()
            loss += penalty.detach()
        return loss, right
