"""Answers of a trained classifier: labels, sets, probabilities, and whether a frame is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
from hdc.accuracy import accuracy
from hdc.availability import needs
from hdc.conformal import RATE
from hdc.estimator import of_training
from hdc.head import Head
from hdc.hypervectors import Hypervectors
from hdc.parameters import check_share
from hdc.saved import Saved


class Answering(Saved):
    """Methods that ask a trained classifier; its immutable `_head` holds what it has learned."""

    _head: Head

    classes_ = of_training("_head.labels")
    readout_ = of_training("_head.readout")
    state_ = of_training("_head.state")
    prototypes_ = of_training("_head.state.prototypes")

    def predict(self, frames: Any) -> np.ndarray:
        """Labels [Q] of frames [Q, H, W] or [Q, D], or of a single image [H, W].

        Raises:
            ValueError: as :meth:`encode`.
        """
        best = self._scores(frames).argmax(1)
        found: np.ndarray = self.classes_[best.numpy(force=True)]
        return found

    @needs("readout", "held_out", "a read-out with a method held_out")
    def predict_set(self, frames: Any, alpha: float = RATE, mask: bool = False) -> Any:
        """Prediction sets of Q frames: Q arrays of labels, or a mask bool [Q, L].

        The set of a frame whose scores fit no class is empty; every other set contains the label of
        :meth:`predict`. :meth:`is_known` uses another rule.

        For majority and counts, a set contains the right label with probability at least 1 − alpha
        (full conformal prediction), if the frame is exchangeable with the training frames of its
        class. This holds for each class with at least 1/alpha − 1 training frames, and on average
        over the smaller classes. Other read-outs compare the scores of the frame and of training
        frames that were left out, which covers about 1 − alpha without a guarantee
        (:mod:`hdc.conformal`). A class with fewer than 4 frames, and fewer than 1/alpha − 1, is in
        every set. Nothing is guaranteed after drift, such as in another session.

        Args:
            frames: the queries.
            alpha: share of the sets that may lack the right label.
            mask: True for a bool array [Q, L] instead of labels.

        Raises:
            ValueError: for a share outside (0, 1), or a model that keeps nothing to compare with.
        """
        share = check_share("alpha", alpha, "(0, 1)")
        parts = self._each(
            frames,
            lambda words: self._head.conformal.possible(
                words.packed, self._head.scores(words), share
            ),
        )
        possible = np.concatenate(parts)
        if mask:
            return possible
        return [self.classes_[row] for row in possible]

    def is_known(self, frames: Any, alpha: float = RATE) -> np.ndarray:
        """Whether each frame resembles the training frames of some class: bool [Q].

        A frame is unknown if its hypervector is farther from the majority of every class than all
        but a share `alpha` of left-out training frames are (:mod:`hdc.rejection`). About this share
        of new frames of known classes is refused. If :meth:`fit` was given groups, this holds for
        frames of another group; otherwise it holds only for frames recorded under the training
        conditions, and more are refused in another session. :attr:`left_out_` tells which of the
        two applies. An unknown object is refused only if it resembles every class less than the
        frames of that class do, so try it.

        Args:
            frames: the queries.
            alpha: share of frames of known classes that may be refused.

        Raises:
            ValueError: for a share outside (0, 1), or a model that keeps no distances.
        """
        share = check_share("alpha", alpha, "(0, 1)")
        self._check_is_trained()
        with self._computing():
            rejection = self._head.rejection
        farthest = rejection.threshold(share)
        near = self._each(
            frames, lambda words: rejection.nearest(words.packed) <= farthest
        )
        return torch.cat(near).numpy(force=True)

    @needs("readout", "held_out", "a read-out with a method held_out")
    def p_values(self, frames: Any, alpha: float = RATE) -> np.ndarray:
        """Conformal p-values of Q frames for each class, float64 [Q, L].

        The p-value for a class is the share of its training frames that are at least as far out as
        the frame (:mod:`hdc.conformal`), and 0 for a class without training frames. A set holds the
        classes with p above `alpha`.

        Args:
            frames: the queries.
            alpha: the level that the p-values will be compared with. A class with fewer than
                1/alpha − 1 training frames is pooled with the other classes.

        Raises:
            ValueError: as :meth:`predict_set`.
        """
        share = check_share("alpha", alpha, "(0, 1)")
        parts = self._each(
            frames,
            lambda words: self._head.conformal.p_values(
                words.packed, self._head.scores(words), share
            ),
        )
        return np.concatenate(parts)

    def score(self, frames: Any, y: Any) -> float:
        """Fraction of frames whose predicted label is right.

        Raises:
            ValueError: as :meth:`predict`; for no frames; or for labels of another kind than in
                training, such as the text "0" instead of the number 0.
        """
        predicted = self.predict(frames)
        inputs.check_any(predicted)
        labels = inputs.label_array(y, len(predicted))
        inputs.check_one_kind([*labels.tolist(), *self.classes_.tolist()])
        return accuracy(predicted, labels)

    def decision_function(self, frames: Any) -> np.ndarray:
        """Scores of the classes [Q, L], of which the largest wins.

        For two classes it is their difference [Q], positive for the second. Integer scores are
        divided by D: majority, trained and neighbours with one neighbour give minus the share of
        bits that differ.
        """
        found = self._scores(frames).numpy(force=True)
        if found.dtype.kind == "i":
            found = found / self.dimension_
        if found.shape[1] == 2:
            return found[:, 1] - found[:, 0]
        return found

    @needs("readout", "held_out", "a read-out with a method held_out")
    def predict_proba(self, frames: Any) -> np.ndarray:
        """Probabilities of the classes, float64 [Q, L]: the softmax of the scores.

        The temperature is fitted to the scores that training frames get when each is left out
        (:mod:`hdc.probability`). These scores have a closed form: for up to 19 frames per class
        with majority, counts and neighbours, for all frames with ridge, and for about 400 frames,
        at least 19 per class, with lda and kernel. Other read-outs are trained on five folds, when
        probabilities are first asked for or the model is saved. :meth:`partial_fit` and
        :meth:`recalibrate` fit the temperature again.

        Raises:
            ValueError: if every class has a single training frame, or the model has to be fitted
                anew to have probabilities.
            AttributeError: for a read-out of your own that learns batch by batch and has no
                ``held_out``; ``hasattr`` is then False.
        """
        parts = self._each(frames, lambda words: self._head.probabilities(words))
        return torch.cat(parts).numpy()

    @needs("readout", "distances", "a read-out that counts, such as 'majority'")
    def distances(self, frames: Any) -> np.ndarray:
        """Hamming distances int64 [Q, L] between queries and prototypes (Eq. 2).

        Only the read-outs majority and counts have prototypes. The distance to a class without
        training frames is D + 1.
        """
        readout: Any = self.readout_
        parts = self._each(frames, lambda words: readout.distances(self.state_, words))
        return torch.cat(parts).numpy(force=True)

    def _scores(self, frames: Any) -> Tensor:
        """Scores [Q, L] of the read-out."""
        return torch.cat(self._each(frames, lambda words: self._head.scores(words)))

    def _each(self, frames: Any, answer: Callable[[Hypervectors], Any]) -> list[Any]:
        """The answer to each chunk of frames."""
        self._check_is_trained()
        with self._computing():
            return [answer(words) for words in self._encoded(frames)]

    @property
    def counts_(self) -> np.ndarray:
        return self._head.counts.numpy()

    @property
    def left_out_(self) -> str:
        with self._computing():
            return self._head.rejection.unit

    @property
    def prediction_bytes_(self) -> int:
        tensors = [*self.encoder_.state().values()]
        tensors += self.readout_.needed(self.state_).values()
        return sum(tensor.nbytes for tensor in tensors)
