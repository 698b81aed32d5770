"""The hyperdimensional classifier: count bits a class, keep their majority, compare."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any, Self

import torch
from torch import Tensor

from hdc import files, inputs, stored
from hdc.prediction import CHUNK
from hdc.prototypes import Counters
from hdc.recalibration import Recalibrator


class HDCClassifier(Recalibrator):
    """Nearest-prototype classifier on packed hypervectors (Kitagawa et al., Opt. Express 32, 3209).

    A frame becomes a hypervector by thresholding at its own median (:func:`hdc.encode.encode`), a
    class prototype is the bitwise majority of its hypervectors (Eq. 1), and a query belongs to the
    class whose prototype is nearest in Hamming distance (Eqs. 2, 3); among equally near ones, to
    the first in ``classes_``. Memory: one chunk of packed hypervectors, a sample of 64 for
    :meth:`is_known`, and the counters, however many frames are given.

    Frames of :meth:`fit` are [N, H, W] or [N, D]; a model of images takes a single one, [H, W], as
    a batch of one, images of no other shape, and flattened ones. A process that is forked
    after torch has used its threads may hang in any call of torch, and so in a model: start
    processes by ``spawn``.

    Args:
        ties: what a prototype bit becomes that as many hypervectors have as have not (even number
            of samples): ``"zero"`` (default: 1 is taken only if the number of ones is larger, as
            published), ``"one"``, or ``"random"``, which is the extra random vector of Schmuck et
            al., ACM JETC 15, 32 (2019).
        prototype: ``"binary"`` as published, or ``"integer"``: the counters themselves, compared
            by the cosine between 2·count − n and the bipolar query.
        seed: seed of the random vectors for ``ties="random"``.
        device: where frames are encoded and prototypes live.
        backend: ``"numpy"``, or ``"compiled"`` for the CPU kernels of :mod:`hdc.compiled`, which
            need numba and give the same model, bit for bit, in less time; ``"auto"`` is one of them
            by :func:`hdc.bits.choose_backend`, by the number of pixels in ``fit`` or in the first
            batch of ``partial_fit``, or, of a loaded model, in each call of ``predict``. A saved
            model does not remember it: it is of the machine.

    Attributes:
        classes_: array [L] of the labels, sorted (labels of mixed types by type and spelling).
        counts_: int64 array [L], training samples a class; votes after a recalibration by votes.
        prototypes_: int64 tensor [L, W], the packed prototypes, made when asked for; zeros for a
            class without samples.
        dimension_, n_features_in_: D, the pixels of a frame.
        frame_shape_: (H, W) or (D,).
        feature_names_in_: columns of the data frame that a model was trained on, if it was one.
        metadata_: what :meth:`save` was given to keep with the model.
        backend_: ``"numpy"`` or ``"compiled"``, with which the model was trained.

    Example:
        >>> frames = np.array([[9, 8, 1, 0], [8, 9, 0, 2], [0, 1, 9, 7], [1, 0, 8, 9]], np.uint8)
        >>> model = HDCClassifier().fit(frames, ["left", "left", "right", "right"])
        >>> model.predict(frames[:1])
        array(['left'], dtype='<U5')
    """

    def __init__(
        self,
        ties: str = "zero",
        prototype: str = "binary",
        seed: int = 0,
        device: str = "cpu",
        backend: str = "auto",
    ):
        self.ties = ties
        self.prototype = prototype
        self.seed = seed
        self.device = device
        self.backend = backend

    # Training ------------------------------------------------------------------------------------

    def fit(self, frames: Any, y: Any) -> Self:
        """Learn prototypes from frames [N, H, W] or [N, D] and N labels y of any hashable type.

        Raises:
            ValueError: for no frames, one class only, lengths that differ, pixels that are not
                finite, or an unknown parameter value.
        """
        for _ in self._train(frames, y):
            pass
        self._majority()
        return self

    def train(self, frames: Any, y: Any) -> Iterator[dict[str, float]]:
        """:meth:`fit`, yielding ``{"samples_seen": n}`` whenever there is a model to predict with.

        `frames` may be anything with ``shape`` and batches ``frames[a:b]``.
        """
        for seen in self._train(frames, y):
            self._majority()  # whoever times training times the making of prototypes
            yield {"samples_seen": seen}

    def _train(self, frames: Any, y: Any) -> Iterator[int]:
        self._check_parameters()
        self._forget()
        frames = inputs.indexable(frames)
        labels = inputs.label_array(y, len(frames))
        if len(labels) == 0:
            raise ValueError("frames: expected at least one frame, found none")
        names = inputs.feature_names(frames)
        self.backend_ = self._backend(frames)
        classes = inputs.classes_of(labels)
        if len(classes) < 2:
            raise inputs.one_class(classes)
        known = inputs.values(classes)
        words: Tensor | None = None
        for start in range(0, len(frames), CHUNK):
            part = inputs.tensor(frames[start : start + CHUNK])
            words = self._encode(part, start, self.backend_, words)
            if start == 0:  # room once for all that will come
                self._start(part.shape[1:], expected=len(frames))
                self._know(known)
                self.counters_.reserve(max(Counter(inputs.values(labels)).values()))
            self._add(words, labels[start : start + CHUNK])
            if self._empty() is None:  # a model that has seen one frame of each class at least
                if names is not None:
                    self.feature_names_in_ = names
                yield min(start + CHUNK, len(frames))

    def partial_fit(self, frames: Any, y: Any = None, classes: Any = None) -> Self:
        """Add frames to the counters; a label not met before becomes a new class.

        Args:
            frames: a batch, or (with no `y`) an iterable of ``(frames, y)`` batches.
            y: labels of the batch.
            classes: all labels that may come. Those without samples are known (``classes_``) and
                never predicted; a label that is not among them is refused.

        Raises:
            ValueError: as :meth:`fit`, or after :meth:`recalibrate`, whose prototypes are not those
                of counted frames. What was counted before a batch that raises stays counted.
        """
        self._check_parameters()
        self._check_counts("partial_fit")
        allowed = (
            None if classes is None else inputs.values(inputs.label_array(classes, len(classes)))
        )
        if y is None and hasattr(frames, "shape"):
            inputs.label_array(y, len(frames))
        for batch, batch_labels in frames if y is None else [(frames, y)]:
            batch = inputs.indexable(batch, getattr(self, "frame_shape_", None))
            labels = inputs.label_array(batch_labels, len(batch))
            if allowed is not None:
                inputs.check_among(labels, allowed)
            self.backend_ = self._backend(batch)
            for start in range(0, len(batch), CHUNK):
                chunk = slice(start, start + CHUNK)
                self._count(batch[chunk], labels[chunk], start)
        if not hasattr(self, "counters_"):
            raise ValueError("frames: expected at least one frame, found none")
        if allowed is not None:
            self._know(allowed)
        return self

    def merge(self, other: HDCClassifier) -> Self:
        """Add what another model was trained on: bit for bit the model of all frames.

        Classes are united; parameters stay those of this model.

        Raises:
            ValueError: for a model of another kind or frame shape, or one of the two that was not
                trained or was recalibrated.
        """
        if type(other) is not type(self):
            raise ValueError(
                f"merge: expected a {type(self).__name__}, found {type(other).__name__}"
            )
        if not hasattr(other, "counters_"):
            raise other._not_trained()
        for model in (self, other):
            model._check_counts("merge")
        if not hasattr(self, "counters_"):
            self._start(other.frame_shape_)
        inputs.check_shape(other.frame_shape_, self.frame_shape_, type(self).__name__)
        labels = inputs.values(other.classes_)
        self._know(labels)
        rows = [self._index[label] for label in labels]
        self.counters_.merge(other.counters_, rows)
        if self._sample is not None and other._sample is not None:
            self._sample.merge(other._sample)
        else:
            self._sample = None
        self._changed(rows)
        return self

    @classmethod
    def from_counters(
        cls,
        counters: Counters,
        classes: Sequence[Hashable],
        frame_shape: tuple[int, ...],
        **parameters: Any,
    ) -> Self:
        """A model of hypervectors that were counted elsewhere.

        Args:
            counters: counts of L classes; the model goes on with them.
            classes: their labels [L].
            frame_shape: shape (H, W) or (D,) of a frame.
            parameters: constructor parameters.

        Raises:
            ValueError: if classes are not L different labels, at least two of them, or the frame
                shape is not of the counters' dimension.
        """
        model = cls(**parameters)
        model._check_parameters()
        labels = inputs.label_array(classes, len(counters.n))
        ordered = inputs.classes_of(labels)
        if len(ordered) < len(labels):
            raise ValueError(f"classes: expected different ones, found {inputs.values(labels)}")
        if len(labels) < 2:
            raise inputs.one_class(labels)
        if prod(frame_shape) != counters.dimension:
            raise ValueError(
                f"frame_shape: expected {counters.dimension} pixels, found {tuple(frame_shape)}"
            )
        counters.planes = counters.planes.to(model.device)
        model._start(tuple(frame_shape), counters)
        known = inputs.values(labels)
        model._arrange(known, inputs.values(ordered))
        model._sample = None
        model._changed(range(len(known)))
        return model

    # Files ---------------------------------------------------------------------------------------

    def save(self, path: str | Path, metadata: Mapping[str, Any] | None = None) -> None:
        """Write the model to a safetensors file, whole or not at all.

        Args:
            path: file name, in a folder that exists.
            metadata: whatever is to be kept with the model, such as how frames are cropped; values
                that JSON has. By default that of the file the model was read from.

        Raises:
            TypeError: for labels or metadata that JSON has not.
            FileNotFoundError: for a folder that does not exist.
        """
        self._check_is_trained()
        metadata = getattr(self, "metadata_", {}) if metadata is None else dict(metadata)
        parameters = self.get_params() | {"seed": int(self.seed), "device": str(self.device)}
        parameters.pop("backend", None)  # of this machine; the model is the same with any
        content = stored.Stored(
            kind=type(self).__name__,
            parameters=parameters,
            classes=self.classes_,
            frame_shape=self.frame_shape_,
            counters=self.counters_,
            prototypes=self._majority(),
            recalibrated=self._recalibrated,
            calibration=self._try_calibration(),
            metadata=metadata,
        )
        try:
            header = content.header()
        except TypeError as error:
            raise TypeError(f"{path}: {error}") from None
        files.write(Path(path), header, content.tensors())
        self.metadata_ = metadata

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a model that :meth:`save` wrote.

        Raises:
            ValueError: if the file is not such a model, of another class, or damaged; it is named.
        """
        try:
            header, tensors = files.read(Path(path))
            return cls._of(stored.checked(cls.__name__, header, tensors))
        except FileNotFoundError:
            raise
        except Exception as error:  # a hostile header reaches numpy and torch in many ways
            raise ValueError(f"{path}: expected a saved {cls.__name__}, found {error}") from error

    @classmethod
    def _of(cls, found: stored.Stored) -> Self:
        model = cls().set_params(**found.parameters)
        if torch.device(model.device).type == "cuda" and not torch.cuda.is_available():
            warnings.warn(
                f"trained on {model.device!r}, which is not here: on the CPU", stacklevel=3
            )
            model.device = "cpu"
        torch.zeros(1, device=model.device).item()  # raises where the device is not to be had
        if not isinstance(model.seed, int):
            raise ValueError(f"seed {model.seed!r}")
        labels = inputs.values(found.classes)
        model = cls.from_counters(found.counters, labels, found.frame_shape, **model.get_params())
        if inputs.values(model.classes_) != labels:
            raise ValueError(f"classes out of order: {labels!r}")
        prototypes = found.prototypes.to(model.device)
        model._recalibrated = found.recalibrated or not torch.equal(model._majority(), prototypes)
        model.prototypes_ = prototypes
        model._made.calibration, model.metadata_ = found.calibration, found.metadata
        return model

    # ---------------------------------------------------------------------------------------------

    def _check_counts(self, action: str) -> None:
        if getattr(self, "_recalibrated", False):
            raise ValueError(
                f"{action}: expected a model of counted frames, found one that was recalibrated; "
                "recalibrate it again, or fit anew"
            )
