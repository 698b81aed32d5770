"""What ``hdc compare`` compares, each with settings that are said on its page.

Every method learns from frames uint8 or uint16 [N, H, W] and labels int [N] in [0, L), and tells
their classes. All but HDC see pixels scaled to 0…1. Ridge and softmax are scikit-learn's, solved
exactly in the space that the N centred training frames span: for an L2 penalty the weights lie in
it, and N is far below the number D of pixels. Frames stay integers in memory; floats are made block
by block.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np
import torch
from sklearn.linear_model import LogisticRegression, RidgeClassifier
from torch import Tensor, nn

from hdc import HDCClassifier

COLUMNS = 2**14  # pixels made floats at a time
EPOCHS, PATIENCE, BATCH = 100, 10, 20
RATES = {"softmax": 1e-4, "network": 1e-3}  # of Adam; the first as published for softmax
FILTERS, KERNEL, FINEST = 16, 5, 128  # FINEST: places a side, from which on the kernel is strided


class Method(Protocol):
    """A classifier, made anew for each training."""

    def fit(self, frames: np.ndarray, labels: np.ndarray) -> None: ...

    def predict(self, frames: np.ndarray) -> np.ndarray:
        """Classes int [n]."""
        ...

    @property
    def bytes(self) -> int:
        """What a prediction needs of what was learnt."""
        ...


class Hyperdimensional:
    """This package's classifier, as ``hdc train`` makes it."""

    def fit(self, frames: np.ndarray, labels: np.ndarray) -> None:
        self._model = HDCClassifier().fit(frames, labels)

    def predict(self, frames: np.ndarray) -> np.ndarray:
        return self._model.predict(frames)

    @property
    def bytes(self) -> int:
        return self._model.prototypes_.numel() * self._model.prototypes_.element_size()


class Linear:
    """w·x + b of the pixels x, solved by a classifier of scikit-learn.

    Args:
        solver: makes it; its penalty is on ‖w‖² and not on b, so that coordinates of the frames
            in an orthonormal basis of their span give the same w as the frames themselves.
    """

    def __init__(self, solver: Callable[[], LogisticRegression | RidgeClassifier]) -> None:
        self._solver = solver

    def fit(self, frames: np.ndarray, labels: np.ndarray) -> None:
        flat = frames.reshape(len(frames), -1)
        mean = np.empty(flat.shape[1], np.float32)
        gram = np.zeros((len(flat), len(flat)))
        for part, block in _blocks(flat):
            mean[part] = block.mean(axis=0)
            block -= mean[part]
            gram += block @ block.T
        # gram = V·S²·Vᵀ; rows of Z = V·S are the frames in the basis S⁻¹·Vᵀ·X.
        squares, basis = np.linalg.eigh(gram)
        kept = squares > len(flat) * np.finfo(np.float32).eps * max(squares[-1], 0)
        scale, basis = np.sqrt(squares[kept]), basis[:, kept]
        if not len(scale):
            raise ValueError("frames: expected some that differ, found all alike")
        solved = self._solver().fit(basis * scale, labels)
        # Of two classes there is one row of weights, the second's, and RidgeClassifier's is flat.
        dual = (np.atleast_2d(solved.coef_) / scale) @ basis.T
        self._weights = np.empty((len(dual), flat.shape[1]), np.float32)
        for part, block in _blocks(flat):
            self._weights[:, part] = dual @ (block - mean[part])
        bias = np.atleast_1d(solved.intercept_)
        self._bias = (bias - self._weights @ mean).astype(np.float32)

    def predict(self, frames: np.ndarray) -> np.ndarray:
        flat = frames.reshape(len(frames), -1)
        scores = np.tile(self._bias, (len(flat), 1))
        for part, block in _blocks(flat):
            scores += block @ self._weights[:, part].T
        return scores.argmax(axis=1) if len(self._bias) > 1 else (scores[:, 0] > 0).astype(int)

    @property
    def bytes(self) -> int:
        return self._weights.nbytes + self._bias.nbytes


class Stepwise:
    """A torch module trained by Adam until it has been right on every training frame for
    ``PATIENCE`` epochs together, or for ``EPOCHS``.

    Args:
        build: makes it for frames (H, W) and L classes.
        rate: learning rate.
        seed: of the initial weights and of the order of frames.
    """

    def __init__(
        self, build: Callable[[tuple[int, ...], int], nn.Module], rate: float, seed: int
    ) -> None:
        self._build, self._rate, self._seed = build, rate, seed

    def fit(self, frames: np.ndarray, labels: np.ndarray) -> None:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self._seed)
            self._module = self._build(frames.shape[1:], int(labels.max()) + 1)
            optimizer = torch.optim.Adam(self._module.parameters(), lr=self._rate)
            perfect = 0
            for _ in range(EPOCHS):
                perfect = perfect + 1 if self._epoch(optimizer, frames, labels) else 0
                if perfect == PATIENCE:
                    break

    def _epoch(
        self, optimizer: torch.optim.Optimizer, frames: np.ndarray, labels: np.ndarray
    ) -> bool:
        """One pass over the frames; whether every one was told right on its way."""
        right = 0
        for index in torch.randperm(len(frames)).split(BATCH):
            targets = torch.from_numpy(labels[index.numpy()])
            optimizer.zero_grad()
            logits = self._module(_tensor(frames[index.numpy()]))
            nn.functional.cross_entropy(logits, targets).backward()
            optimizer.step()
            right += int((logits.argmax(dim=1) == targets).sum())
        return right == len(frames)

    @torch.no_grad()
    def predict(self, frames: np.ndarray) -> np.ndarray:
        batches = (frames[i : i + BATCH] for i in range(0, len(frames), BATCH))
        return np.concatenate([self._module(_tensor(b)).argmax(dim=1).numpy() for b in batches])

    @property
    def bytes(self) -> int:
        return sum(p.numel() * p.element_size() for p in self._module.parameters())


def softmax(shape: tuple[int, ...], classes: int) -> nn.Module:
    """Softmax regression; at first every class is equally likely."""
    linear = nn.Linear(int(np.prod(shape)), classes)
    nn.init.zeros_(linear.weight)
    nn.init.zeros_(linear.bias)
    return nn.Sequential(nn.Flatten(), linear)


def network(shape: tuple[int, ...], classes: int) -> nn.Module:
    """One convolution of 5×5 kernels, max pooling, one linear layer."""
    stride = max(1, min(shape) // FINEST)
    maps = nn.Sequential(
        nn.Conv2d(1, FILTERS, KERNEL, stride, padding=KERNEL // 2),
        nn.MaxPool2d(2, ceil_mode=True),
        nn.ReLU(),
        nn.Flatten(),
    )
    features = maps(torch.zeros(1, 1, *shape)).shape[1]
    return nn.Sequential(nn.Unflatten(1, (1, shape[0])), maps, nn.Linear(features, classes))


METHODS: dict[str, tuple[Callable[[int], Method], str]] = {
    "HDC": (lambda seed: Hyperdimensional(), "prototypes by bitwise majority, Hamming distance"),
    "Ridge": (lambda seed: Linear(RidgeClassifier), "α = 1, exact"),
    "Softmax, dual": (
        lambda seed: Linear(lambda: LogisticRegression(max_iter=10_000)),
        "C = 1, to its optimum",
    ),
    "Softmax": (
        lambda seed: Stepwise(softmax, RATES["softmax"], seed),
        f"Adam, rate {RATES['softmax']:g}, {BATCH} frames a step, from zero",
    ),
    "Small network": (
        lambda seed: Stepwise(network, RATES["network"], seed),
        f"{FILTERS} filters of {KERNEL}×{KERNEL} pixels, max pooling, one linear layer; Adam, "
        f"rate {RATES['network']:g}, {BATCH} frames a step",
    ),
}
"""Name → what makes the method for a seed, and how it is set."""

STEPS = (
    f"The last two are trained until every training frame was told right in {PATIENCE} epochs "
    f"together, or for {EPOCHS} epochs."
)


def _unit(frames: np.ndarray) -> np.ndarray:
    return frames.astype(np.float32) / np.float32(np.iinfo(frames.dtype).max)


def _tensor(frames: np.ndarray) -> Tensor:
    return torch.from_numpy(_unit(frames))


def _blocks(flat: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Columns of frames [N, D] as floats of their own, some at a time."""
    for start in range(0, flat.shape[1], COLUMNS):
        part = slice(start, start + COLUMNS)
        yield part, _unit(flat[:, part])
