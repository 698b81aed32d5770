"""A trained classifier: what it says of frames, by its encoder and its head."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import inputs
from hdc.availability import needs, renamed
from hdc.conformal import RATE
from hdc.head import Head
from hdc.hypervectors import Hypervectors
from hdc.parameters import check_share
from hdc.readouts import Readout
from hdc.saved import Saved


class Answering(Saved):
    """Answers of a classifier; what was learned is a value, `_head`, that nobody changes."""

    _head: Head

    @renamed("reject", "is_known(frames, alpha), which says what is to be rejected")
    def predict(self, frames: Any) -> np.ndarray:
        """Labels [Q] of frames [Q, H, W] or [Q, D], or of a single image [H, W]."""
        scores = self._each(frames, lambda words: self._head.scores(words).argmax(1))
        return self.classes_[torch.cat(scores).numpy(force=True)]

    @needs("held_out")
    def predict_set(self, frames: Any, alpha: float = RATE, mask: bool = False) -> Any:
        """The classes that each of Q frames may be of: Q arrays of labels, or bool [Q, L].

        The set of a frame that scores like none of the classes is empty; any other contains the
        label of :meth:`predict`. :meth:`is_known` has a rule of its own. With majority and counts,
        a set contains the right label with probability 1 − alpha at least (full conformal
        prediction), if the frame is exchangeable with the training frames of its class. This holds
        for each class with 1/alpha − 1 training frames or more, and for smaller classes together.
        Other read-outs compare scores with those of training frames that were left out. That covers
        about 1 − alpha, without a guarantee (:mod:`hdc.conformal`). A class with fewer frames than
        1/alpha − 1 and than 4 is in every set. Nothing is promised after drift, in another session
        for example.

        Args:
            frames: the queries.
            alpha: share of the sets that may lack the right label.
            mask: True for a bool array [Q, L] in place of labels.

        Raises:
            ValueError: for a share outside (0, 1), or a model that has no frames to compare with;
                it says so.
        """
        share = check_share("alpha", alpha, "(0, 1)")
        parts = self._each(frames, lambda words: self._head.possible(words, share))
        possible = np.concatenate(parts)
        if mask:
            return possible
        return [self.classes_[row] for row in possible]

    @renamed("reject", "alpha")
    def is_known(self, frames: Any, alpha: float = RATE) -> np.ndarray:
        """Whether frames are like those of some class: bool [Q].

        A frame is known if its hypervector is near the majority of some class, nearer than all but
        a share `alpha` of training frames that were left out of it (:mod:`hdc.rejection`). About
        this share of new frames of known classes is refused: of another group, where :meth:`fit`
        was given groups; else only of frames that come as the training frames did, and more in
        another session. :attr:`left_out_` says which. An unknown object is refused only if it looks
        less like every class than their own frames do; try it.

        Args:
            frames: the queries.
            alpha: share of frames of known classes that may be refused.

        Raises:
            ValueError: for a share outside (0, 1), or a model that has no distances to compare
                with; it says so.
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

    @needs("held_out")
    def p_values(self, frames: Any, alpha: float = RATE) -> np.ndarray:
        """How unlike the frames of each class Q frames are: p-values float64 [Q, L].

        That of a class is the share of its frames that are as far out (:mod:`hdc.conformal`); a set
        holds the classes with p above `alpha`. 0 of a class without training frames.

        Args:
            frames: the queries.
            alpha: what they are to be compared with: it decides whether a class has frames enough
                of its own, or is compared with those of all classes.

        Raises:
            ValueError: as :meth:`predict_set`.
        """
        share = check_share("alpha", alpha, "(0, 1)")
        parts = self._each(frames, lambda words: self._head.p_values(words, share))
        return np.concatenate(parts)

    def score(self, frames: Any, y: Any) -> float:
        """Fraction of frames whose predicted label is right.

        Raises:
            ValueError: as :meth:`predict`, or for labels of another kind than those of training,
                such as the text "0" beside the number 0.
        """
        predicted = self.predict(frames).tolist()
        labels = inputs.label_array(y, len(predicted)).tolist()
        inputs.check_one_kind([*labels, *self.classes_.tolist()])
        right = [a == b for a, b in zip(predicted, labels, strict=True)]
        return float(np.mean(right))

    def decision_function(self, frames: Any) -> np.ndarray:
        """The scores of the read-out, [Q, L], the largest wins.

        For two classes the difference [Q], positive for the second. Scores in whole numbers are
        divided by D: majority, trained and a single neighbour have minus the distance as a share of
        the bits.
        """
        found = torch.cat(self._each(frames, self._head_scores)).numpy(force=True)
        if found.dtype.kind == "i":
            found = found / self.dimension_
        if found.shape[1] == 2:
            return found[:, 1] - found[:, 0]
        return found

    @needs("held_out")
    def predict_proba(self, frames: Any) -> np.ndarray:
        """Probabilities of the classes, float64 [Q, L]: the softmax of the scores.

        Its temperature is fitted to training frames scored as if each had not been learnt
        (:mod:`hdc.probability`). Closed forms give these scores: of up to 19 frames per class for
        majority, counts and neighbours, of all for ridge, of 400 or all for lda and kernel, with 19
        of each class that has them. Other read-outs need five folds of the training frames, when
        first asked or saved. New frames, by :meth:`partial_fit` or :meth:`recalibrate`, have it
        fitted anew.

        Raises:
            ValueError: for training with one frame of each class, or a model that must be fitted
                anew to have probabilities; it says so.
            AttributeError: for a read-out of one's own that learns batch by batch and has no
                ``held_out``; ``hasattr`` is False.
        """
        parts = self._each(frames, lambda words: self._head.probabilities(words))
        return torch.cat(parts).numpy()

    @needs("distances")
    def distances(self, frames: Any) -> np.ndarray:
        """Hamming distances int64 [Q, L] between queries and prototypes (Eq. 2).

        D + 1, farther than anything, from a class without samples. Of read-outs that count.
        """
        readout: Any = self.readout_
        parts = self._each(frames, lambda words: readout.distances(self.state_, words))
        return torch.cat(parts).numpy(force=True)

    def _head_scores(self, words: Hypervectors) -> Tensor:
        return self._head.scores(words)

    def _each(self, frames: Any, answer: Callable[[Hypervectors], Any]) -> list[Any]:
        """An answer to each chunk of frames, or to hypervectors."""
        self._check_is_trained()
        with self._computing():
            return [answer(words) for words in self._encoded(frames)]

    @property
    def classes_(self) -> np.ndarray:
        return self._trained.labels

    @property
    def readout_(self) -> Readout:
        return self._trained.readout

    @property
    def state_(self) -> Any:
        return self._trained.state

    @property
    def prototypes_(self) -> Tensor:
        found: Tensor = self.state_.prototypes
        return found

    @property
    def counts_(self) -> np.ndarray:
        return self._trained.counts.numpy()

    @property
    def left_out_(self) -> str:
        with self._computing():
            return self._trained.rejection.unit

    @property
    def prediction_bytes_(self) -> int:
        tensors = [*self.encoder_.state().values()]
        tensors += self.readout_.needed(self.state_).values()
        return sum(tensor.nbytes for tensor in tensors)

    @property
    def _trained(self) -> Head:
        if not hasattr(self, "_head"):
            raise AttributeError(
                f"{type(self).__name__}: expected a trained model; call fit first"
            )
        return self._head
