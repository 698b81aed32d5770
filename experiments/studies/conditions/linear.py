"""Softmax regression from any start, exactly, in the space of samples.

Gradient descent on the mean cross-entropy of Z = X·Wᵀ + b changes the logits of every frame, seen
in training or not, by inner products with the training frames alone: a step on the batch B is

    Z ← (1 − ηλ)·Z − η·(K[:, B] + 1)·(P − Y)[B] / |B|,        K = X·X_trainᵀ,

with the intercept a pixel that is always one, and weight decay λ on weights and intercept, as
``torch.optim.SGD`` has it. The initial weights enter through Z₀ = X·W₀ᵀ + b₀ and nowhere else, so
that a step costs N² operations instead of N·D, and nothing is approximated. All scalings
x ↦ a·(x − c) share one Gram matrix of the frames, and all sizes of one draw of W₀ one product.

W₀ is the sum of a part in the span of the training frames and one orthogonal to it. Training frames
do not see the second part and gradients never change it, so that a start projected on the span
trains alike and differs in its test logits only: by X_test·W₀ᵀ − K_test·K⁻¹·X_train·W₀ᵀ.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

_COLUMNS = 8192  # pixels of all frames that are float64 at a time
_RANK = 1e-12  # eigenvalues of K below this part of the largest are none
RULES = ("zeros", "linear", "glorot", "normal")
SCALINGS = ("unit", "raw", "standard_global", "unit_frame_centred")
FAMILIES = ("uniform", "normal")


@dataclass(frozen=True)
class Start:
    """How initial weights are drawn.

    Args:
        rule: ``zeros``; ``linear``: PyTorch's own of ``nn.Linear``, weights and intercepts uniform
            within ±1/√D; ``glorot``: Keras's own of ``Dense``, weights uniform within
            ±√(6/(D + L)); ``normal``: with standard deviation ``std``. Intercepts start at zero but
            for ``linear``.
        std: for ``normal``.
        gain: factor on all of it.

    Raises:
        ValueError: for another rule, or without a standard deviation where one is needed.
    """

    rule: str
    std: float | None = None
    gain: float = 1.0

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise ValueError(f"rule: expected one of {', '.join(RULES)}, found {self.rule!r}")
        if self.rule == "normal" and not (isinstance(self.std, float) and 0 < self.std < math.inf):
            raise ValueError(f"std: expected a number above zero, found {self.std!r}")

    @property
    def family(self) -> str:
        """Which draws it is a multiple of."""
        return "normal" if self.rule == "normal" else "uniform"

    def factor(self, pixels: int, classes: int) -> float:
        """By what a draw of its family, in ±1 or of deviation 1, is multiplied."""
        factors = {
            "zeros": 0.0,
            "linear": 1 / math.sqrt(pixels),
            "glorot": math.sqrt(6 / (pixels + classes)),
            "normal": self.std or 0.0,
        }
        return self.gain * factors[self.rule]

    def sigma(self, pixels: int, classes: int) -> float:
        """Standard deviation of a weight."""
        uniform = 1 if self.family == "normal" else 1 / math.sqrt(3)
        return self.factor(pixels, classes) * uniform

    def intercept(self, draw: Tensor, pixels: int) -> Tensor:
        """Initial intercepts, of a draw in ±1."""
        return draw * (self.gain / math.sqrt(pixels) if self.rule == "linear" else 0.0)


def starts_of(config: Mapping[str, Mapping[str, Any]], key: str) -> dict[str, Start]:
    """The starts of a config by name; ``of``, who starts so, is for readers.

    Raises:
        ValueError: naming the key of one that is none.
    """
    found = {}
    for name, part in config.items():
        rest = {k: v for k, v in part.items() if k != "of"}
        try:
            found[name] = Start(**rest)
        except (TypeError, ValueError) as error:
            raise ValueError(f"{key}.{name}: {error}") from error
    return found


@dataclass(frozen=True)
class Draw:
    """One draw of initial weights and intercepts of unit size, by family.

    Attributes:
        weights: float32 [L, D]: ``uniform`` in ±1, ``normal`` of deviation 1.
        intercepts: float64 [L], uniform in ±1.
    """

    weights: dict[str, Tensor]
    intercepts: Tensor


def draw(seed: int, number: int, classes: int, pixels: int) -> Draw:
    """The draw of this number at a seed; each is another."""
    state = np.random.SeedSequence([seed, number]).generate_state(1)[0]
    random = torch.Generator().manual_seed(int(state))
    return Draw(
        {
            "uniform": torch.rand(classes, pixels, generator=random).mul_(2).sub_(1),
            "normal": torch.randn(classes, pixels, generator=random),
        },
        torch.rand(classes, generator=random).double().mul_(2).sub_(1),
    )


@dataclass(frozen=True)
class Products:
    """All that linear models can tell of frames: inner products, in raw pixels.

    Attributes:
        gram: float64 [n, n] of the frames among themselves, exact for 8-bit pixels.
        sums: float64 [n] of the pixels of each frame.
        pixels: D.
        draws: of initial weights.
        logits: by family, float64 [draws, n, L] of the frames with the weights of each draw.
        sums_of_draws: by family, float64 [draws, L] of the weights of each.
    """

    gram: Tensor
    sums: Tensor
    pixels: int
    draws: Sequence[Draw]
    logits: Mapping[str, Tensor]
    sums_of_draws: Mapping[str, Tensor]


def products(frames: Tensor, draws: Sequence[Draw]) -> Products:
    """Inner products of frames uint8 [n, H, W] among themselves and with draws, in one pass."""
    flat = frames.flatten(1)
    n, pixels = flat.shape
    gram = torch.zeros(n, n, dtype=torch.float64)
    weights = {name: torch.cat([one.weights[name] for one in draws]) for name in FAMILIES}
    logits = {name: torch.zeros(n, len(w), dtype=torch.float64) for name, w in weights.items()}
    for first in range(0, pixels, _COLUMNS):
        part = slice(first, first + _COLUMNS)
        block = flat[:, part].double()
        gram.addmm_(block, block.T)
        for name, w in weights.items():
            logits[name].addmm_(block, w[:, part].T.double())
    classes = len(draws[0].intercepts)
    return Products(
        gram,
        flat.sum(dim=1, dtype=torch.float64),
        pixels,
        draws,
        {name: z.view(n, len(draws), classes).transpose(0, 1) for name, z in logits.items()},
        {name: w.double().sum(dim=1).view(-1, classes) for name, w in weights.items()},
    )


@dataclass(frozen=True)
class Problem:
    """Frames of one scaling and split as the softmax sees them, training frames first.

    Attributes:
        kernel: K + 1, float64 [N + M, N].
        targets: class indices, int64 [N + M].
        classes: L.
        across: length of the part of a test frame, as scaled, that is orthogonal to all training
            frames; mean.
    """

    kernel: Tensor
    targets: Tensor
    classes: int
    across: float
    _scaling: tuple[float, float]
    _centred: bool
    _products: Products
    _order: Tensor
    _inverse: Tensor

    @property
    def n_train(self) -> int:
        return self.kernel.shape[1]

    def start(self, start: Start, number: int) -> tuple[Tensor, Tensor]:
        """Initial logits of a draw [N + M, L], and what projecting the weights on the span of the
        training frames adds to those of the test frames [M, L]."""
        known, (scale, offset) = self._products, self._scaling
        raw = known.logits[start.family][number][self._order]
        logits = scale * (raw - offset * known.sums_of_draws[start.family][number])
        if self._centred:
            logits = logits - logits[: self.n_train].mean(dim=0)
        logits = start.factor(known.pixels, self.classes) * logits
        within = self._inverse @ logits[: self.n_train]
        intercepts = start.intercept(known.draws[number].intercepts, known.pixels)
        return logits + intercepts, within - logits[self.n_train :]


def problem(
    known: Products, labels: np.ndarray, train: np.ndarray, test: np.ndarray, scaling: str
) -> Problem:
    """The problem of training and test frames in a scaling of ``baselines.pixels``, 8 bits a pixel.

    ``unit_frame_centred`` is 0…1 less the mean training frame, pixel by pixel: what all frames have
    in common is gone.

    Raises:
        ValueError: for another scaling.
    """
    if scaling not in SCALINGS:
        expected = ", ".join(SCALINGS)
        raise ValueError(f"task.pixels: expected some of {expected}, found {scaling!r}")
    order = torch.from_numpy(np.concatenate([train, test]))
    n, pixels = len(train), known.pixels
    sums, gram = known.sums[order], known.gram[order][:, order]
    scale, offset = (1.0 if scaling == "raw" else 1 / 255), 0.0
    if scaling == "standard_global":
        offset = float(sums[:n].sum()) / (n * pixels)
        scale = (float(gram.diagonal()[:n].sum()) / (n * pixels) - offset**2) ** -0.5
    inner = scale**2 * (gram - offset * (sums[:, None] + sums) + offset**2 * pixels)
    if centred := scaling == "unit_frame_centred":
        rows = inner[:, :n].mean(dim=1)
        inner = inner - rows[:, None] - rows + inner[:n, :n].mean()
    kernel = inner[:, :n]
    inverse = kernel[n:] @ torch.linalg.pinv(kernel[:n], rtol=_RANK, hermitian=True)
    across = inner.diagonal()[n:] - (inverse * kernel[n:]).sum(dim=1)
    targets = torch.from_numpy(labels)[order]
    return Problem(
        kernel + 1,
        targets,
        int(targets.max()) + 1,
        float(across.clamp(min=0).sqrt().mean()),
        (scale, offset),
        centred,
        known,
        order,
        inverse,
    )


class Descent:
    """Gradient descent from several starts at once, on the same frames in the same order.

    Args:
        problem: the frames.
        logits: of the starts, float64 [N + M, L, V].
        decay: weight decay λ of each, float64 [V].
        rate: η.
        batch: frames a step; None for all.
        seed: of the permutation of every epoch.

    Attributes:
        logits: now.
        shrunk: what weight decay has left of the initial weights, float64 [V].
    """

    def __init__(
        self,
        problem: Problem,
        logits: Tensor,
        decay: Tensor,
        rate: float,
        batch: int | None,
        seed: int = 0,
    ):
        self._problem, self._rate, self._batch, self._seed = problem, rate, batch, seed
        self._onehot = torch.nn.functional.one_hot(
            problem.targets[: problem.n_train], problem.classes
        ).double()[:, :, None]
        self.logits, self._keep = logits.contiguous(), 1 - rate * decay
        self.shrunk = torch.ones_like(decay)

    def parts(self) -> Iterator[Tensor | slice]:
        """The frames of each step, epoch after epoch without end."""
        n, random = self._problem.n_train, torch.Generator().manual_seed(self._seed)
        while True:
            if self._batch is None:
                yield slice(0, n)
            else:
                yield from torch.randperm(n, generator=random).split(self._batch)

    def step(self, part: Tensor | slice) -> None:
        """One step on these training frames."""
        residual = self.logits[part].softmax(dim=1) - self._onehot[part]
        flat = self.logits.view(len(self.logits), -1)
        if bool((self._keep != 1).any()):
            self.logits *= self._keep
            self.shrunk *= self._keep
        columns = self._problem.kernel[:, part]
        flat.addmm_(columns, residual.flatten(1), alpha=-self._rate / columns.shape[1])

    def drop(self, kept: Tensor) -> None:
        """Go on with these starts only, int64 [V']."""
        self.logits = self.logits[:, :, kept].contiguous()
        self._keep, self.shrunk = self._keep[kept], self.shrunk[kept]
