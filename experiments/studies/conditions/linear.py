"""Initial weights of softmax regression, and the logits they give :mod:`baselines.descent`.

The initial weights W₀ enter gradient descent in sample space through Z₀ = X·W₀ᵀ + b₀ alone. W₀ is
the sum of a part in the span of the training frames and a part orthogonal to it. Gradients never
change the second part and training frames do not see it. A start projected on the span therefore
trains alike, and its test logits differ by X_test·W₀ᵀ − K_test·K⁻¹·X_train·W₀ᵀ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from hdc.bank import Bank

_COLUMNS = 8192  # pixels of all frames in float64 at a time
_RANK = 1e-12  # eigenvalues of K below this fraction of the largest count as zero


@dataclass(frozen=True)
class Start:
    """Distribution of the initial weights.

    Rules: ``zeros``; ``linear``: PyTorch's default for ``nn.Linear``, weights and intercepts
    uniform within ±1/√D; ``glorot``: Keras's default for ``Dense``, weights uniform within
    ±√(6/(D + L)); ``normal``: standard deviation ``std``. Other intercepts start at zero.
    """

    rule: str
    std: float = 0.0

    @property
    def family(self) -> str:
        """Distribution of the draws it scales: ``normal`` or ``uniform``."""
        return "normal" if self.rule == "normal" else "uniform"

    def factor(self, pixels: int, classes: int) -> float:
        """Scale of a draw of its family (uniform in ±1, or of unit variance)."""
        factors = {
            "zeros": 0.0,
            "linear": 1 / math.sqrt(pixels),
            "glorot": math.sqrt(6 / (pixels + classes)),
            "normal": self.std,
        }
        return factors[self.rule]

    def sigma(self, pixels: int, classes: int) -> float:
        """Standard deviation of a weight."""
        factor = self.factor(pixels, classes)
        if self.family == "normal":
            return factor
        return factor * (1 / math.sqrt(3))


def draw(
    seed: int,
    number: int,
    classes: int,
    pixels: int,
) -> dict[str, Tensor]:
    """Initial weights of unit size, different for each number at a seed: ``uniform`` (in ±1) and
    ``normal`` weights float32 [L, D], ``intercepts`` in ±1, float64 [L]."""
    sequence = np.random.SeedSequence([seed, number])
    state = int(sequence.generate_state(1)[0])
    random = torch.Generator().manual_seed(state)
    uniform = torch.rand(classes, pixels, generator=random)
    normal = torch.randn(classes, pixels, generator=random)
    intercepts = torch.rand(classes, generator=random).double()
    return {
        "uniform": uniform.mul_(2).sub_(1),
        "normal": normal,
        "intercepts": intercepts.mul_(2).sub_(1),
    }


class StartProducts:
    """Inner products of raw frames among themselves and with initial weights.

    All scalings x ↦ a·(x − c) share them.

    Args:
        frames: uint8 [n, H, W].
        seed, draws, classes: of the initial weights.

    Attributes:
        pixels: D.
        gram: of the frames, float64 [n, n], exact for 8-bit pixels.
        sums: of the pixels of each frame, float64 [n].
        logits: of the frames, by family of weights, float64 [draws, n, L].
        weight_sums: of the weights of a class, by family, float64 [draws, L].
        intercepts: in ±1, float64 [draws, L].
    """

    def __init__(
        self,
        frames: Tensor,
        seed: int,
        draws: int,
        classes: int,
    ):
        flat = frames.flatten(1)
        n, self.pixels = flat.shape
        everyone = np.arange(n)
        bank = Bank(frames, np.zeros(n, np.int64), 1)
        self.gram, _ = bank.kernel(everyone, everyone[:0], "raw")
        self.sums = flat.sum(dim=1, dtype=torch.float64)
        numbers = range(draws)
        drawn = [draw(seed, number, classes, self.pixels) for number in numbers]
        self.intercepts = torch.stack([one["intercepts"] for one in drawn])
        self.logits, self.weight_sums = {}, {}
        for family in ("uniform", "normal"):
            weights = torch.cat([one[family] for one in drawn])
            logits = _products_with(flat, weights).view(n, draws, classes)
            self.logits[family] = logits.transpose(0, 1)
            of_weights = weights.double().sum(dim=1)
            self.weight_sums[family] = of_weights.view(-1, classes)


def _products_with(flat: Tensor, weights: Tensor) -> Tensor:
    """x·w of frames [n, D] and weights [k, D], float64 [n, k]."""
    products = torch.zeros(len(flat), len(weights), dtype=torch.float64)
    for first in range(0, flat.shape[1], _COLUMNS):
        part = slice(first, first + _COLUMNS)
        of_frames, of_weights = flat[:, part], weights[:, part]
        products.addmm_(of_frames.double(), of_weights.T.double())
    return products


class Problem:
    """Scaled frames of one split as softmax regression sees them, training frames first.

    ``kernel`` is K = X·X_trainᵀ, float64 [N + M, N]; ``targets`` are class indices int64 [N + M];
    ``across`` is the mean length of the part of a test frame orthogonal to all training frames.

    Args:
        known: products of all frames.
        labels: of all frames; `train` and `test` are indices of them.
        scaling: of ``baselines.pixels``: unit, raw, standard_global.
    """

    def __init__(
        self,
        known: StartProducts,
        labels: np.ndarray,
        train: np.ndarray,
        test: np.ndarray,
        scaling: str,
    ):
        self.n_train = n = len(train)
        self._known, pixels = known, known.pixels
        order = torch.from_numpy(np.concatenate([train, test]))
        self._order = order
        sums = known.sums[order]
        gram = known.gram[order][:, order]
        scale, offset = (1.0 if scaling == "raw" else 1 / 255), 0.0
        if scaling == "standard_global":
            count = n * pixels
            squares = gram.diagonal()[:n]
            offset = float(sums[:n].sum()) / count
            square = float(squares.sum()) / count
            scale = (square - offset**2) ** -0.5
        self._scale, self._offset = scale, offset
        both = sums[:, None] + sums
        inner = scale**2 * (gram - offset * both + offset**2 * pixels)
        self.kernel = inner[:, :n]
        self.targets = torch.from_numpy(labels)[order]
        inverse = torch.linalg.pinv(
            self.kernel[:n],
            rtol=_RANK,
            hermitian=True,
        )
        self._inverse = self.kernel[n:] @ inverse
        within = (self._inverse * self.kernel[n:]).sum(dim=1)
        across = inner.diagonal()[n:] - within
        lengths = across.clamp(min=0).sqrt()
        self.across = float(lengths.mean())

    def start(self, start: Start, number: int) -> tuple[Tensor, Tensor]:
        """Initial logits [N + M, L] of a draw, and the change [M, L] of the test logits when the
        weights are projected on the span of the training frames."""
        family = start.family
        raw = self._known.logits[family][number][self._order]
        weights = self._known.weight_sums[family][number]
        _, classes = raw.shape
        factor = start.factor(self._known.pixels, classes)
        scaled = self._scale * (raw - self._offset * weights)
        logits = factor * scaled
        within = self._inverse @ logits[: self.n_train]
        shift = within - logits[self.n_train :]
        if start.rule == "linear":
            logits = logits + factor * self._known.intercepts[number]
        return logits, shift
