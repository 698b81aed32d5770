"""Probabilities from scores, by one temperature that is fitted to left-out training frames.

The probability of class c of a frame with scores s is the softmax

    p_c = exp(β·s_c) / Σ_k exp(β·s_k),      β > 0,

that is, temperature scaling with β = 1/T (Guo et al., On calibration of modern neural networks,
ICML 2017): the most probable class is the predicted one. β maximises the likelihood of m training
frames, each scored by a model that has not learnt it. If all of these were right, β would be
infinite; so the target probability of the right class is (m + 1)/(m + 2) instead of 1, as by Platt
(Advances in Large Margin Classifiers, 1999), and the other classes share the rest.

For frames recorded under other conditions, such as after drift, the probabilities are too high.
"""

from __future__ import annotations

import torch
from torch import Tensor

from hdc.hypervectors import Hypervectors
from hdc.readouts.base import HeldOut, Readout

FOLDS = 5
_HALVINGS = 60
_DOUBLINGS = 60
_FLATTEST = 1e-6
"""Least β, in units of one over the spread of the scores; probabilities are then nearly equal."""


def sharpness(held_out: HeldOut) -> float:
    """β from scores float64 [m, L] of m left-out frames, and their classes [m]."""
    scores, rows = held_out
    m, n_classes = scores.shape
    spread = float(scores.std(dim=1, correction=0).mean())
    if spread == 0 or n_classes == 1:
        return 1.0
    right = (m + 1) / (m + 2)
    aims = torch.full_like(scores, (1 - right) / (n_classes - 1))
    aims[torch.arange(m), rows] = right
    aimed = float((aims * scores).sum())

    def excess(beta: float) -> float:
        """Derivative of minus the log likelihood, which rises with β."""
        shares = torch.softmax(beta * scores, dim=1)
        return float((shares * scores).sum()) - aimed

    low, high = 0.0, 1 / spread
    for _ in range(_DOUBLINGS):
        if excess(high) >= 0:
            break
        low, high = high, 2 * high
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if excess(middle) < 0:
            low = middle
        else:
            high = middle
    return max(high, _FLATTEST / spread)


def cross_validated(
    readout: Readout, words: Hypervectors, rows: Tensor, n_classes: int
) -> HeldOut:
    """Scores of training hypervectors by five-fold cross-validation of a read-out.

    The frames of each class are assigned to the folds in turn, in their order. The only frame of a
    class is always learnt and never scored.
    """
    place = torch.full_like(rows, -1)
    for c in rows.unique().tolist():
        members = (rows == c).nonzero().flatten()
        if len(members) > 1:
            place[members] = torch.arange(len(members)) % FOLDS
    asked = place >= 0
    scores = torch.zeros(len(rows), n_classes, dtype=torch.float64)
    for fold in place[asked].unique().tolist():
        tested = place == fold
        state = readout.fit(words[~tested], rows[~tested], n_classes)
        scores[tested] = readout.scores(state, words[tested]).double().cpu()
    return HeldOut(scores[asked], rows[asked])


def of_several(found: HeldOut, counts: Tensor) -> HeldOut:
    """Left-out frames of classes with at least two frames, scored for the classes with any.

    Args:
        found: scores of left-out frames.
        counts: training frames of each class, int64 [L].

    Raises:
        ValueError: if no class has two frames.
    """
    chosen = counts[found.rows] > 1
    if not chosen.any():
        raise ValueError(
            "predict_proba: expected two training frames or more of a class, found one of each"
        )
    known = counts > 0
    place = known.cumsum(0) - 1
    return HeldOut(found.scores[chosen][:, known], place[found.rows[chosen]])
