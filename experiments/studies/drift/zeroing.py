"""Re-referencing: updates that need new frames and no labels of them.

Frames are standardised and a reference frame is subtracted from each (:class:`hdc.encoders.
Reference`): of the training, the mean of its frames. After the drift another reference is
subtracted from the queries, and nothing else changes. The ``method`` is one of:

- ``zeroed``: the mean of N_new frames of the second session, with all classes alike, or with a
  ``share`` of them of one class.
- ``untouched``: the mean of N_new frames of the class in which nobody touches; the reference of the
  training is then the mean of such frames of the first session.

Every mean is of standardised frames. HDC does it by the reference of its encoder and its own
``rezero``, a baseline by ``predict_zeroed``: the same frames, alike.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from baselines.bank import Bank, Rows
from experiments.records.rows import Row
from hdc import HDCClassifier
from hdc.encoders import RelativeEncoder, make_encoder


@dataclass(frozen=True)
class Unlabelled:
    """Unlabelled frames by which a model is re-referenced.

    Args:
        sizes: numbers of frames, all classes alike.
        shares: of one class among the frames.
        of_shares: numbers of frames with such a share.
        untouched: numbers of frames in which nobody touches.
        favoured: which class has the share, modulo the number of classes.
    """

    sizes: Sequence[int]
    shares: Sequence[float]
    of_shares: Sequence[int]
    untouched: Sequence[int]
    favoured: int

    def choices(
        self, pool: np.ndarray, labels: np.ndarray, n_classes: int
    ) -> Iterator[tuple[int, float | None, np.ndarray]]:
        """(n, share, frames) for each choice that the pool can fill, its first frames in time.

        Args:
            pool: indices of frames, in order of time.
            labels: classes of all frames, by index.
            n_classes: L.
        """
        for n in self.sizes:
            chosen = first_of_each(pool, labels, _evenly(n, n_classes))
            if chosen is not None:
                yield n, None, chosen
        for n in self.of_shares:
            for share in self.shares:
                counts = self._counts(n, share, n_classes)
                chosen = first_of_each(pool, labels, counts)
                if chosen is not None:
                    yield n, share, chosen

    def _counts(self, n: int, share: float, n_classes: int) -> np.ndarray:
        """Frames of each class [L]: a share of one, the others alike."""
        favoured = self.favoured % n_classes
        of_favoured = round(share * n)
        others = _evenly(n - of_favoured, n_classes - 1)
        return np.insert(others, favoured, of_favoured)


def _evenly(n: int, n_classes: int) -> np.ndarray:
    """n as L numbers, the first of which may be larger by one."""
    counts = np.full(n_classes, n // n_classes)
    counts[: n % n_classes] += 1
    return counts


def first_of_each(
    pool: np.ndarray, labels: np.ndarray, counts: np.ndarray
) -> np.ndarray | None:
    """The first of the pool of each class, as many as counts [L] say; None where there are less."""
    parts = []
    for label, count in enumerate(counts.tolist()):
        of_class = pool[labels[pool] == label]
        if len(of_class) < count:
            return None
        parts.append(of_class[:count])
    return np.concatenate(parts)


def zeroed(
    model: Any,
    bank: Bank,
    old: np.ndarray,
    pool: np.ndarray,
    asked: np.ndarray,
    frames: Unlabelled,
) -> Iterator[tuple[Row, np.ndarray]]:
    """Rows of a stored model and of that model re-referenced by each choice of unlabelled frames;
    and what they predict."""
    choices = list(frames.choices(pool, bank.labels, bank.n_classes))
    afters = [chosen for _, _, chosen in choices]
    stored, *found = rezeroed(model, bank, old, asked, old, [None, *afters])
    yield {"method": "stored", "n_new": 0}, stored
    for (n, share, _), predicted in zip(choices, found, strict=True):
        yield {"method": "zeroed", "n_new": n, "share": share}, predicted


def untouched(
    model: Any,
    bank: Bank,
    old: np.ndarray,
    pool: np.ndarray,
    asked: np.ndarray,
    frames: Unlabelled,
    no_touch: int,
) -> Iterator[tuple[Row, np.ndarray]]:
    """Rows of a model whose references are frames of the class `no_touch`."""
    before = old[bank.labels[old] == no_touch]
    without = pool[bank.labels[pool] == no_touch]
    sizes = [n for n in frames.untouched if n <= len(without)]
    afters = [without[:n] for n in sizes]
    found = rezeroed(model, bank, old, asked, before, afters)
    for n, predicted in zip(sizes, found, strict=True):
        yield {"method": "untouched", "n_new": n}, predicted


def rezeroed(
    model: Any,
    bank: Bank,
    train: np.ndarray,
    asked: np.ndarray,
    before: np.ndarray,
    afters: Sequence[np.ndarray | None],
) -> Iterator[np.ndarray]:
    """Labels of the frames asked, by a model of training frames minus the mean of those `before`;
    from the frames asked the mean of each of `afters` is subtracted, or (None) the same.

    Raises:
        TypeError: for a model that cannot be re-referenced.
    """
    if isinstance(model, HDCClassifier):
        yield from _of_hdc(model, bank, train, asked, before, afters)
        return
    if not hasattr(model, "predict_zeroed"):
        raise TypeError(
            "task.zeroing: expected models with a method predict_zeroed, or HDC with encoder "
            f"'reference', found {type(model).__name__}"
        )
    for after in afters:
        reference = before if after is None else after
        yield model.predict_zeroed(bank, train, asked, before, reference)


def _of_hdc(
    model: HDCClassifier,
    bank: Bank,
    train: np.ndarray,
    asked: np.ndarray,
    before: np.ndarray,
    afters: Sequence[np.ndarray | None],
) -> Iterator[np.ndarray]:
    """The same by HDC itself, whose encoder is a reference."""
    encoder = make_encoder(model.encoder)
    if not isinstance(encoder, RelativeEncoder):
        raise TypeError(
            f"task.zeroing: expected encoder 'reference', found {encoder!r}"
        )
    stored = model.unlearned()
    if not np.array_equal(before, train):
        stored.set_params(encoder__frame=bank.at(before)[:].numpy(force=True))
    stored.fit(bank.at(train), bank.labels[train])
    for after in afters:
        updated = copy.deepcopy(stored)
        if after is not None:
            _zero(updated, bank.at(after))
        yield updated.predict(bank.at(asked))


def _zero(model: HDCClassifier, frames: Rows) -> None:
    with warnings.catch_warnings():
        # What frames of one class do to a model is measured here; a single frame minus
        # itself is constant.
        warnings.filterwarnings("ignore", message="rezero:|.*constant frame")
        model.rezero(frames)
