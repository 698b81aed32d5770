"""Initial weights of softmax regression and the logits they give, for ``baselines.dual.Descent``.

The initial weights W₀ enter gradient descent in sample space through Z₀ = X·W₀ᵀ + b₀ alone. W₀ is
the sum of a part in the span of the training frames and a part orthogonal to it. Gradients never
change the second part and training frames do not see it. A start projected on the span therefore
trains alike, and its test logits differ by X_test·W₀ᵀ − K_test·K⁻¹·X_train·W₀ᵀ.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from baselines import dual

_COLUMNS = 8192  # pixels of all frames in float64 at a time
_RANK = 1e-12  # eigenvalues of K below this fraction of the largest count as zero


@dataclass(frozen=True)
class Start:
    """Distribution of the initial weights.

    Args:
        rule: ``zeros``; ``linear``: PyTorch's default for ``nn.Linear``, weights and intercepts
            uniform within ±1/√D; ``glorot``: Keras's default for ``Dense``, weights uniform within
            ±√(6/(D + L)); ``normal``: standard deviation ``std``. Intercepts start at zero except
            for ``linear``.
        std: for ``normal``, above zero.
    """

    rule: str
    std: float = 0.0

    @property
    def family(self) -> str:
        """Distribution of the draws it scales: ``normal`` or ``uniform``."""
        return "normal" if self.rule == "normal" else "uniform"

    def factor(self, pixels: int, classes: int) -> float:
        """Scale of a draw of its family (uniform in ±1, or of unit variance)."""
        limits = {"linear": 1 / math.sqrt(pixels), "glorot": math.sqrt(6 / (pixels + classes))}
        return (limits | {"zeros": 0.0, "normal": self.std})[self.rule]

    def sigma(self, pixels: int, classes: int) -> float:
        """Standard deviation of a weight."""
        deviation = 1.0 if self.family == "normal" else 1 / math.sqrt(3)
        return self.factor(pixels, classes) * deviation


def draw(seed: int, number: int, classes: int, pixels: int) -> dict[str, Tensor]:
    """Initial weights of unit size, different for each number at a seed: ``uniform`` (in ±1) and
    ``normal`` weights float32 [L, D], ``intercepts`` in ±1, float64 [L]."""
    state = np.random.SeedSequence([seed, number]).generate_state(1)[0]
    random = torch.Generator().manual_seed(int(state))
    return {
        "uniform": torch.rand(classes, pixels, generator=random).mul_(2).sub_(1),
        "normal": torch.randn(classes, pixels, generator=random),
        "intercepts": torch.rand(classes, generator=random).double().mul_(2).sub_(1),
    }


@dataclass(frozen=True)
class Products:
    """Inner products of raw frames among themselves and with initial weights.

    All scalings x ↦ a·(x − c) share them.
    """

    gram: Tensor  # float64 [n, n] of the frames, exact for 8-bit pixels
    sums: Tensor  # float64 [n], of the pixels of each frame
    pixels: int
    logits: Mapping[str, Tensor]  # by family, float64 [draws, n, L]
    weight_sums: Mapping[str, Tensor]  # by family, of a class, float64 [draws, L]
    intercepts: Tensor  # float64 [draws, L], in ±1


def products(frames: Tensor, seed: int, draws: int, classes: int) -> Products:
    """Inner products of frames uint8 [n, H, W]."""
    flat = frames.flatten(1)
    n, pixels = flat.shape
    drawn = [draw(seed, number, classes, pixels) for number in range(draws)]
    weights = {name: torch.cat([one[name] for one in drawn]) for name in ("uniform", "normal")}
    logits = {name: torch.zeros(n, len(w), dtype=torch.float64) for name, w in weights.items()}
    for first in range(0, pixels, _COLUMNS):
        part = slice(first, first + _COLUMNS)
        block = flat[:, part].double()
        for name, w in weights.items():
            logits[name].addmm_(block, w[:, part].T.double())
    everyone = np.arange(n)
    gram, _ = dual.Products(frames, np.zeros(n), 1).kernel(everyone, everyone[:0], "raw")
    return Products(
        gram,
        flat.sum(dim=1, dtype=torch.float64),
        pixels,
        {name: z.view(n, draws, classes).transpose(0, 1) for name, z in logits.items()},
        {name: w.double().sum(dim=1).view(-1, classes) for name, w in weights.items()},
        torch.stack([one["intercepts"] for one in drawn]),
    )


@dataclass(frozen=True)
class Problem:
    """Scaled frames of one split as softmax regression sees them, training frames first.

    ``across`` is the mean length of the part of a test frame orthogonal to all training frames.
    """

    kernel: Tensor  # K = X·X_trainᵀ, float64 [N + M, N]
    targets: Tensor  # class indices, int64 [N + M]
    across: float
    _scaling: tuple[float, float]
    _products: Products
    _order: Tensor
    _inverse: Tensor

    @property
    def n_train(self) -> int:
        return self.kernel.shape[1]

    def start(self, start: Start, number: int) -> tuple[Tensor, Tensor]:
        """Initial logits [N + M, L] of a draw, and the change [M, L] of the test logits when the
        weights are projected on the span of the training frames."""
        known, (scale, offset) = self._products, self._scaling
        raw = known.logits[start.family][number][self._order]
        factor = start.factor(known.pixels, raw.shape[1])
        logits = factor * (scale * (raw - offset * known.weight_sums[start.family][number]))
        within = self._inverse @ logits[: self.n_train]
        intercepts = known.intercepts[number] * (factor if start.rule == "linear" else 0.0)
        return logits + intercepts, within - logits[self.n_train :]


def problem(
    known: Products, labels: np.ndarray, train: np.ndarray, test: np.ndarray, scaling: str
) -> Problem:
    """Training and test frames in a scaling of ``baselines.pixels``: unit, raw, standard_global."""
    order = torch.from_numpy(np.concatenate([train, test]))
    n, pixels = len(train), known.pixels
    sums, gram = known.sums[order], known.gram[order][:, order]
    scale, offset = (1.0 if scaling == "raw" else 1 / 255), 0.0
    if scaling == "standard_global":
        offset = float(sums[:n].sum()) / (n * pixels)
        scale = (float(gram.diagonal()[:n].sum()) / (n * pixels) - offset**2) ** -0.5
    inner = scale**2 * (gram - offset * (sums[:, None] + sums) + offset**2 * pixels)
    kernel = inner[:, :n]
    inverse = kernel[n:] @ torch.linalg.pinv(kernel[:n], rtol=_RANK, hermitian=True)
    across = inner.diagonal()[n:] - (inverse * kernel[n:]).sum(dim=1)
    return Problem(
        kernel,
        torch.from_numpy(labels)[order],
        float(across.clamp(min=0).sqrt().mean()),
        (scale, offset),
        known,
        order,
        inverse,
    )
