"""The hyperdimensional classifier: count bits a class, keep their majority, compare."""

from __future__ import annotations

import inspect
from collections.abc import Hashable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.encode import encode
from hdc.prototypes import Counters, recalibrate

PROTOTYPES = ("binary", "integer")
CHUNK = 128  # frames encoded at a time: 4 MB of packed bits at D = 250,000


class HDCClassifier:
    """Nearest-prototype classifier on packed hypervectors (Kitagawa et al., Opt. Express 32, 3209).

    A frame becomes a hypervector by thresholding at its own median (:func:`hdc.encode.encode`), a
    class prototype is the bitwise majority of its hypervectors (Eq. 1), and a query belongs to the
    class whose prototype is nearest in Hamming distance (Eqs. 2, 3); among equally near ones, to
    the first in ``classes_``. Memory: one chunk of packed hypervectors and the counters, however
    many frames are given.

    Args:
        ties: what a prototype bit becomes that as many hypervectors have as have not (even number
            of samples): ``"zero"`` (default: 1 is taken only if the number of ones is larger, as
            published), ``"one"``, or ``"random"``, which is the extra random vector of Schmuck et
            al., ACM JETC 15, 32 (2019).
        prototype: ``"binary"`` as published, or ``"integer"``: the counters themselves, compared
            by the cosine between 2·count − n and the bipolar query.
        seed: of the random vectors for ``ties="random"``.
        device: where frames are encoded and prototypes live.
        backend: ``"numpy"``, or ``"compiled"`` for the CPU kernels of :mod:`hdc.compiled`, which
            need numba and give the same model, bit for bit, in less time. A saved model does not
            remember it: it is of the machine, and can be set by ``set_params`` after loading.

    Attributes:
        classes_: array [L] of the labels, sorted (labels of mixed types by type and spelling).
        counts_: int64 array [L], training samples a class.
        prototypes_: int64 tensor [L, W], the packed prototypes.
        dimension_: D, the pixels of a frame.
        frame_shape_: (H, W) or (D,).

    Example:
        >>> frames = np.array([[9, 8, 1, 0], [8, 9, 0, 2], [0, 1, 9, 7], [1, 0, 8, 9]], np.uint8)
        >>> model = HDCClassifier().fit(frames, ["left", "left", "right", "right"])
        >>> model.predict(frames[:1])
        array(['left'], dtype='<U5')
    """

    _estimator_type = "classifier"
    classes_: np.ndarray
    counts_: np.ndarray
    prototypes_: Tensor

    def __init__(
        self,
        ties: str = "zero",
        prototype: str = "binary",
        seed: int = 0,
        device: str = "cpu",
        backend: str = "numpy",
    ):
        self.ties = ties
        self.prototype = prototype
        self.seed = seed
        self.device = device
        self.backend = backend

    # Training ------------------------------------------------------------------------------------

    def fit(self, frames: Any, labels: Any) -> HDCClassifier:
        """Learn prototypes from frames [N, H, W] or [N, D] and N labels of any hashable type.

        Raises:
            ValueError: for no frames, one class only, lengths that differ, pixels that are not
                finite, or an unknown parameter value.
        """
        for _ in self.train(frames, labels):
            pass
        return self

    def train(self, frames: Any, labels: Any) -> Iterator[dict[str, float]]:
        """:meth:`fit`, yielding ``{"samples_seen": n}`` whenever there is a model to predict with.

        `frames` may be anything with ``shape`` and batches ``frames[a:b]``.
        """
        self._check_parameters()
        _forget(self)
        frames = _indexable(frames)
        labels = _label_array(labels, len(frames))
        if len(labels) == 0:
            raise ValueError("frames: expected at least one frame, found none")
        classes = _classes_of(labels)
        if len(classes) < 2:
            raise ValueError(
                f"labels: expected at least two classes, found only {classes.tolist()[0]!r}"
            )
        # Classes come as they are met: an intermediate model knows only what it has seen.
        for start in range(0, len(frames), CHUNK):
            self._count(frames[start : start + CHUNK], labels[start : start + CHUNK], start)
            if len(self.classes_) == len(classes):
                self._finish()
                yield {"samples_seen": min(start + CHUNK, len(frames))}

    def partial_fit(self, frames: Any, labels: Any = None, classes: Any = None) -> HDCClassifier:
        """Add frames to the counters; a label not met before becomes a new class.

        Args:
            frames: a batch, or (with no `labels`) an iterable of ``(frames, labels)`` batches.
            labels: of the batch.
            classes: accepted for scikit-learn's sake; classes may also appear later.

        After :meth:`recalibrate`, counting starts again from what was counted before it. What was
        counted before a batch that raises stays counted.
        """
        self._check_parameters()
        counted = False
        try:
            for batch, batch_labels in frames if labels is None else [(frames, labels)]:
                batch = _indexable(batch)
                batch_labels = _label_array(batch_labels, len(batch))
                for start in range(0, len(batch), CHUNK):
                    chunk = slice(start, start + CHUNK)
                    self._count(batch[chunk], batch_labels[chunk], start)
                    counted = True
        finally:
            if counted:  # classes and prototypes stay in step with the counters
                self._finish()
        if not hasattr(self, "counters_"):
            raise ValueError("frames: expected at least one frame, found none")
        return self

    def recalibrate(self, frames: Any, labels: Any, p: float, seed: int = 0) -> HDCClassifier:
        """Adapt to a changed environment: with probability p, replace a prototype bit by a new one.

        New prototypes are computed from `frames`; each bit of the stored prototype of a class is
        replaced by the new one's with probability p (paper, Section III.B, Fig. 8). Classes without
        new frames keep their prototypes.

        Raises:
            ValueError: if p is outside [0, 1], or a label is not among ``classes_``.
        """
        self._check_is_trained()
        if self.prototype != "binary":
            raise ValueError(f"prototype: recalibration expects 'binary', found {self.prototype!r}")
        new = HDCClassifier(
            ties=self.ties, seed=self.seed, device=self.device, backend=self.backend
        )
        new.partial_fit(frames, labels)
        self._check_dimension(new.dimension_)
        unknown = [c for c in new.classes_.tolist() if c not in self._index]
        if unknown:
            raise ValueError(
                f"labels: expected classes among {list(self._index)}, found {unknown[0]!r}"
            )
        rows = torch.tensor([self._index[c] for c in new.classes_.tolist()])
        stored = self.prototypes_.clone()
        target = stored.clone()
        target[rows] = new.prototypes_
        self.prototypes_ = recalibrate(stored, target, self.dimension_, p, seed)
        return self

    # Prediction ----------------------------------------------------------------------------------

    def predict(self, frames: Any) -> np.ndarray:
        """Labels [Q] of frames [Q, H, W] or [Q, D]."""
        nearest = self._scores(frames).argmin(1)
        return self.classes_[nearest.numpy(force=True)]

    def distances(self, frames: Any) -> np.ndarray:
        """Hamming distances int64 [Q, L] between queries and prototypes (Eq. 2)."""
        self._check_is_trained()
        return torch.cat([bits.hamming(w, self.prototypes_) for w in self._encoded(frames)]).numpy(
            force=True
        )

    def score(self, frames: Any, labels: Any) -> float:
        """Fraction of frames whose predicted label is right."""
        frames = _indexable(frames)
        labels = _label_array(labels, len(frames))
        return float(np.mean([a == b for a, b in zip(self.predict(frames), labels, strict=True)]))

    def state_tensors(self) -> dict[str, Tensor]:
        """What has to be stored to predict; shares memory with the model."""
        self._check_is_trained()
        if self.prototype == "binary":
            return {"prototypes": self.prototypes_}
        return {"counters": self.counters_.planes}

    # Files ---------------------------------------------------------------------------------------

    def save(self, path: str | Path) -> None:
        """Write the model to a safetensors file, whole or not at all."""
        from hdc.files import save

        self._check_is_trained()
        save(self, Path(path))

    @classmethod
    def load(cls, path: str | Path) -> HDCClassifier:
        """Read a model that :meth:`save` wrote.

        Raises:
            ValueError: if the file is not such a model, or damaged; it is named.
        """
        from hdc.files import load

        return load(cls, Path(path))

    # scikit-learn's conventions, without importing it: importing its base class takes as long as
    # importing torch, and 100 MB; this package takes a hundredth of either ------------------------

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Constructor parameters by name."""
        names = inspect.signature(type(self).__init__).parameters
        return {name: getattr(self, name) for name in names if name != "self"}

    def set_params(self, **params: Any) -> HDCClassifier:
        """Set constructor parameters by name."""
        for name, value in params.items():
            if name not in self.get_params():
                raise ValueError(
                    f"set_params: expected one of {', '.join(self.get_params())}, found {name!r}"
                )
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        return f"HDCClassifier({', '.join(f'{k}={v!r}' for k, v in self.get_params().items())})"

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import ClassifierTags, InputTags, Tags, TargetTags

        return Tags(
            estimator_type="classifier",
            target_tags=TargetTags(required=True),
            classifier_tags=ClassifierTags(),
            input_tags=InputTags(two_d_array=True, three_d_array=True),
        )

    # ---------------------------------------------------------------------------------------------

    def _check_parameters(self) -> None:
        for name, value, valid in (
            ("ties", self.ties, bits.TIES),
            ("prototype", self.prototype, PROTOTYPES),
        ):
            if value not in valid:
                raise ValueError(f"{name}: expected one of {', '.join(valid)}, found {value!r}")
        bits.kernels(self.backend, self.device)

    def _check_is_trained(self) -> None:
        if not hasattr(self, "prototypes_"):
            raise ValueError("HDCClassifier: expected a trained model; call fit first")
        if len(self.classes_) < 2:
            raise ValueError(
                f"labels: expected at least two classes, found only {self.classes_.tolist()[0]!r}"
            )

    def _check_dimension(self, dimension: int) -> None:
        if dimension != self.dimension_:
            raise ValueError(
                f"frames: expected D = {self.dimension_} pixels as in training "
                f"(shape {self.frame_shape_}), found {dimension}"
            )

    def _encode(self, frames: Any, first: int) -> Tensor:
        tensor = _tensor(frames).to(self.device)
        if hasattr(self, "dimension_"):
            self._check_dimension(tensor[0].numel() if len(tensor) else self.dimension_)
        return encode(tensor, first, self.backend)

    def _encoded(self, frames: Any) -> Iterator[Tensor]:
        frames = _indexable(frames)
        for start in range(0, max(1, len(frames)), CHUNK):
            yield self._encode(frames[start : start + CHUNK], start)

    def _count(self, frames: Any, labels: np.ndarray, first: int) -> None:
        """Encode one chunk of frames and add it to the counters."""
        frames = _tensor(frames)
        if len(frames) == 0:
            return
        words = self._encode(frames, first)
        if not hasattr(self, "counters_"):
            self.frame_shape_ = tuple(frames.shape[1:])
            self.dimension_ = frames[0].numel()
            self.counters_ = Counters(0, self.dimension_, self.device)
            self._index: dict[Hashable, int] = {}
        met = list(dict.fromkeys(labels.tolist()))
        new = [label for label in met if label not in self._index]
        if new:
            known = list(self._index) + new
            ordered = _classes_of(_object_array(known)).tolist()
            self.counters_.append_classes(len(new))
            if ordered != known:
                self.counters_.reorder([known.index(label) for label in ordered])
            self._index = {label: i for i, label in enumerate(ordered)}
            self.classes_ = _label_array(ordered, len(ordered))
        indices = torch.tensor([self._index[label] for label in labels.tolist()])
        self.counters_.backend = self.backend
        self.counters_.add(words, indices)

    def _finish(self) -> None:
        """Make the learned attributes from the counters."""
        self.counts_ = self.counters_.n.numpy().copy()
        self.prototypes_ = self.counters_.majority(self.ties, self.seed)

    def _scores(self, frames: Any) -> Tensor:
        """Dissimilarity [Q, L], smaller is nearer."""
        self._check_is_trained()
        score = self._cosine_distances if self.prototype == "integer" else self._hamming
        return torch.cat([score(words) for words in self._encoded(frames)])

    def _hamming(self, words: Tensor) -> Tensor:
        return bits.hamming(words, self.prototypes_)

    def _cosine_distances(self, words: Tensor) -> Tensor:
        """Minus √D times the cosine of bipolar queries and 2c − n, from the planes of c alone.

        A query v ∈ {0, 1} has v·c = Σ_p 2^p |v ∧ plane_p| and |v ∧ b| = (|v| + |b| − Ham(v, b))/2.
        """
        planes, n = self.counters_.planes, self.counters_.n.to(words.device)
        n_classes, n_planes, width = planes.shape
        weights = 2 ** torch.arange(n_planes, device=words.device)
        ones = bits.count_ones(words)
        plane_ones = bits.count_ones(planes)
        distances = bits.hamming(words, planes.reshape(-1, width)).view(-1, n_classes, n_planes)
        overlap = (ones[:, None, None] + plane_ones - distances) // 2
        dot = (overlap * weights).sum(2)
        total = (plane_ones * weights).sum(1)
        # (2v − 1)·(2c − n), in integers throughout
        dot = 4 * dot - 2 * total - n * (2 * ones[:, None] - self.dimension_)
        norm = torch.stack([(2 * c - m).double().norm() for c, m in zip(
            self.counters_.counts(), n, strict=True)])  # fmt: skip
        return -dot / norm.clamp(min=1)


def _forget(model: HDCClassifier) -> None:
    for name in [name for name in vars(model) if name.endswith("_") or name == "_index"]:
        delattr(model, name)


def _indexable(frames: Any) -> Any:
    """Frames with a shape: arrays, tensors and lazy sources as they are, lists as arrays.

    Raises:
        ValueError: for frames of different sizes.
    """
    if hasattr(frames, "shape") and hasattr(frames, "__getitem__"):
        return frames
    frames = list(frames)
    shapes = [np.shape(frame) for frame in frames]
    for i, shape in enumerate(shapes):
        if shape != shapes[0]:
            raise ValueError(
                f"frames[{i}]: expected shape {shapes[0]} as of frames[0], found {shape}"
            )
    if frames and isinstance(frames[0], Tensor):
        return torch.stack(frames)
    return np.asarray(frames)


def _tensor(frames: Any) -> Tensor:
    if isinstance(frames, Tensor):
        return frames
    array = np.asarray(frames)
    if array.dtype == object or array.dtype.kind not in "uif":
        raise TypeError(f"frames: expected real or integer pixels, found dtype {array.dtype}")
    if not array.dtype.isnative:
        array = array.astype(array.dtype.newbyteorder("="))
    if not array.flags.writeable or not array.flags.c_contiguous:
        array = array.copy()
    return torch.from_numpy(array)


def _label_array(labels: Any, n: int) -> np.ndarray:
    if isinstance(labels, Tensor):
        labels = labels.numpy(force=True)
    elif not isinstance(labels, np.ndarray):
        labels = list(labels) if isinstance(labels, Iterable) else [labels]
        values = [x.item() if isinstance(x, np.generic | Tensor) else x for x in labels]
        kinds = {type(value) for value in values}
        labels = _object_array(values)
        if len(kinds) == 1 and kinds <= {str, int, float, bool}:
            array = np.array(values)
            # numpy rounds some large integers and drops null characters at the end of a string.
            labels = array if kinds == {float} or array.tolist() == values else labels
    if labels.ndim != 1:
        raise ValueError(f"labels: expected one dimension, found shape {labels.shape}")
    if len(labels) != n:
        raise ValueError(f"labels: expected {n}, one a frame, found {len(labels)}")
    for i, label in enumerate(labels.tolist() if labels.dtype.kind in "fO" else ()):
        if isinstance(label, float) and label != label:
            raise ValueError(f"labels[{i}]: found NaN")
    return labels


def _object_array(values: list[Any]) -> np.ndarray:
    array = np.empty(len(values), object)
    array[:] = values
    return array


def _classes_of(labels: np.ndarray) -> np.ndarray:
    """The distinct labels, sorted; those without a common order by type and spelling."""
    distinct = list(dict.fromkeys(labels.tolist()))
    try:
        distinct.sort()
    except TypeError:
        distinct.sort(key=lambda label: (type(label).__name__, repr(label)))
    return _label_array(distinct, len(distinct))
