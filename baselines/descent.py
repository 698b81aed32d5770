"""Gradient descent on softmax regression, in the space of samples: what it does to every logit."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor
from torch.nn import functional as F


class Descent:
    """Gradient descent on softmax regression from several starts at once, in sample space.

    A step on the batch B changes the logits of every frame, seen in training or not, by products
    with the training frames alone, and initial weights enter through their logits:

        Z ← Z − η·(K[:, B] + 1)·(P − Y)[B] / |B|,        K = X·X_trainᵀ.

    Args:
        kernel: K, float64 [N + M, N], training frames first (:meth:`hdc.bank.Bank.kernel`).
        targets: class indices of the training frames, int64 [N].
        n_classes: L.
        rate: η.
        logits: of the V starts, float64 [N + M, L, V], their intercepts included; by default of
            `coefficients` and `intercepts`, one start at zero if there are none.
        coefficients: initial A, float64 [N, L, V], of weights W = Aᵀ·X.
        intercepts: initial b, float64 [L, V].
        decay: λ: weights shrink by 1 − ηλ a step, which is descent with the penalty λ/2·‖W‖².
        batch: frames a step; None for all.
        seed: of the permutation of every epoch, as in :mod:`baselines.training`.

    Attributes:
        logits, coefficients, intercepts: now.
    """

    def __init__(
        self,
        kernel: Tensor,
        targets: Tensor,
        n_classes: int,
        rate: float,
        *,
        logits: Tensor | None = None,
        coefficients: Tensor | None = None,
        intercepts: Tensor | None = None,
        decay: float = 0.0,
        batch: int | None = None,
        seed: int = 0,
    ) -> None:
        self._kernel, self._targets = kernel, targets
        self._rate, self._decay, self._batch = rate, decay, batch
        self._order = torch.Generator().manual_seed(seed)
        onehot = F.one_hot(targets, n_classes).to(kernel.dtype)
        self._onehot = onehot[:, :, None]
        starts = _starts(logits, coefficients)
        if coefficients is None:
            coefficients = kernel.new_zeros(kernel.shape[1], n_classes, starts)
        if intercepts is None:
            intercepts = kernel.new_zeros(n_classes, starts)
        if logits is None:
            logits = torch.einsum("ij,jlv->ilv", kernel, coefficients) + intercepts
        dtype = kernel.dtype
        self.logits = logits.to(dtype).clone().contiguous()
        self.coefficients = coefficients.to(dtype).clone().contiguous()
        self.intercepts = intercepts.to(dtype).clone().contiguous()
        self._parts = self.parts()

    def parts(self) -> Iterator[Tensor | slice]:
        """The training frames of each step, epoch after epoch without end."""
        n = len(self._targets)
        while True:
            if self._batch is None or self._batch >= n:
                yield slice(0, n)
            else:
                order = torch.randperm(n, generator=self._order)
                yield from order.split(self._batch)

    def step(self, part: Tensor | slice | None = None) -> None:
        """One step on these training frames; by default on the next minibatch."""
        if part is None:
            part = next(self._parts)
        probability = self.logits[part].softmax(dim=1)
        residual = probability - self._onehot[part]
        residual *= self._rate / len(residual)
        if self._decay:
            keep = 1 - self._rate * self._decay
            self.logits = keep * (self.logits - self.intercepts) + self.intercepts
            self.coefficients *= keep
        change = residual.sum(dim=0)
        self.coefficients[part] -= residual
        self.intercepts -= change
        kernel = self._kernel[:, part]
        flat = self.logits.view(len(self.logits), -1)
        flat.addmm_(kernel, residual.flatten(1), alpha=-1)
        flat.sub_(change.flatten())

    def losses(self, penalty: bool = False) -> Tensor:
        """Mean cross-entropy of the training frames, float64 [V]; with ``penalty`` plus λ/2·‖W‖²
        of the weights Aᵀ·X."""
        n = len(self._targets)
        logits = self.logits[:n]
        targets = self._targets[:, None].expand(n, logits.shape[2])
        of_frames = F.cross_entropy(logits, targets, reduction="none")
        loss = of_frames.mean(dim=0)
        if penalty:
            a = self.coefficients
            squares = torch.einsum("ilv,ij,jlv->v", a, self._kernel[:n], a)
            loss += 0.5 * self._decay * squares
        return loss

    def drop(self, kept: Tensor) -> None:
        """Go on with these starts only, int64 [V']."""
        for name in ("logits", "coefficients", "intercepts"):
            values = getattr(self, name)[..., kept]
            setattr(self, name, values.contiguous())


def _starts(logits: Tensor | None, coefficients: Tensor | None) -> int:
    """V, how many starts there are."""
    if logits is not None:
        return logits.shape[-1]
    if coefficients is not None:
        return coefficients.shape[-1]
    return 1
