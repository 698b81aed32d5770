"""The classifier: labels, batches, errors half way, and memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from hdc import HDCClassifier, bits, classifier
from hdc.encode import encode


def touches(n: int = 60, classes: int = 3, side: int = 12) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    labels = np.arange(n) % classes
    base = rng.integers(0, 200, (classes, side, side))
    return (base[labels] + rng.integers(0, 56, (n, side, side))).astype(np.uint8), labels


label = st.one_of(
    st.integers(), st.text(max_size=3), st.booleans(), st.none(), st.floats(allow_nan=False),
    st.tuples(st.integers(0, 2), st.text(max_size=1)), st.frozensets(st.integers(0, 3)),
)  # fmt: skip


@given(st.lists(label, min_size=2, max_size=6, unique=True), st.sampled_from([1, 2, 5, 128]))
@settings(max_examples=100, deadline=None)
def test_labels_of_any_hashable_type_come_back(names: list, batch: int) -> None:
    """Every class once at least, equal in whole and in batches, exactly the labels given."""
    rng = np.random.default_rng(len(names))
    frames = rng.permutation(np.arange(64 * len(names)) % 251).reshape(-1, 64).astype(np.uint8)
    model = HDCClassifier().fit(frames, names)
    assert model.predict(frames).tolist() == names
    assert model.score(frames, names) == 1
    parts = HDCClassifier()
    for start in range(0, len(names), batch):
        parts.partial_fit(frames[start : start + batch], names[start : start + batch])
    assert parts.predict(frames).tolist() == names
    if not any(isinstance(name, frozenset) for name in names):  # sets are ordered in part only
        assert parts.classes_.tolist() == model.classes_.tolist()
        assert torch.equal(parts.prototypes_, model.prototypes_)


@pytest.mark.parametrize("kind", ["array", "tensor", "scalars", "tensors", "series", "objects"])
def test_integer_labels_in_any_container(kind: str) -> None:
    frames, labels = touches()
    if kind == "series":
        given = pytest.importorskip("pandas").Series(labels)
    else:
        given = {
            "array": labels.astype(np.uint8), "tensor": torch.from_numpy(labels),
            "scalars": list(labels), "tensors": list(torch.from_numpy(labels)),
            "objects": labels.astype(object),
        }[kind]  # fmt: skip
    model = HDCClassifier().fit(frames, given)
    assert model.classes_.tolist() == [0, 1, 2]
    assert type(model.classes_.tolist()[0]) is int
    assert model.score(frames, given) == 1


def test_labels_in_a_column_and_hidden_nan_are_refused() -> None:
    frames, labels = touches()
    with pytest.raises(ValueError, match=r"labels: expected one dimension, found shape \(60, 1\)"):
        HDCClassifier().fit(frames, labels[:, None])
    with pytest.raises(ValueError, match=r"labels\[1\]: found NaN"):
        HDCClassifier().fit(frames[:3], ["a", float("nan"), "b"])


@pytest.mark.parametrize("prototype", classifier.PROTOTYPES)
def test_a_bad_batch_leaves_a_model_in_step(prototype: str) -> None:
    """A class that arrives before the error shifts the places of the others."""
    frames, labels = touches()
    model = HDCClassifier(prototype=prototype).fit(frames[labels > 0], labels[labels > 0])
    bad = np.full((1, 12, 12), np.nan)
    with pytest.raises(ValueError, match="expected finite pixels"):
        model.partial_fit([(frames[:3], labels[:3]), (bad, [1])])
    assert model.classes_.tolist() == [0, 1, 2]
    assert model.counts_.tolist() == [1, 21, 21]
    assert len(model.prototypes_) == 3
    assert model.score(frames[labels > 0], labels[labels > 0]) == 1


def test_a_refused_first_batch_changes_nothing() -> None:
    frames, labels = touches()
    model = HDCClassifier().fit(frames, labels).recalibrate(255 - frames, labels, p=0.5)
    before = model.prototypes_.clone()
    with pytest.raises(ValueError, match="expected D = 144 pixels"):
        model.partial_fit(frames[:, :5], labels)
    with pytest.raises(ValueError, match="p: expected"):
        model.recalibrate(frames, labels, p=-1)
    assert torch.equal(model.prototypes_, before)
    model.partial_fit(frames[:3], labels[:3])  # counting starts from before the recalibration
    again = HDCClassifier().fit(frames, labels).partial_fit(frames[:3], labels[:3])
    assert torch.equal(model.prototypes_, again.prototypes_)


def test_errors_and_warnings_number_frames_from_the_first_of_all() -> None:
    frames, labels = touches(300)
    bad = frames.astype(np.float32)
    bad[290, 0, 0] = np.inf
    model = HDCClassifier().fit(frames, labels)
    for call in (model.predict, lambda f: HDCClassifier().fit(f, labels)):
        with pytest.raises(ValueError, match=r"frames\[290\]: expected finite pixels, found inf"):
            call(bad)
    frames[290] = 7
    with pytest.warns(UserWarning, match="at index 290:"):
        model.predict(frames)


def test_arrays_as_files_give_them() -> None:
    """Foreign byte order, read-only, reversed, Fortran order, lists and memory maps."""
    frames, labels = touches()
    wide = frames.astype(np.uint16) * 3
    expected = HDCClassifier().fit(wide, labels).prototypes_
    frozen = wide.copy()
    frozen.flags.writeable = False
    backwards = wide[:, ::-1].copy()[:, ::-1]
    for same in (wide.astype(">u2"), frozen, backwards, np.asfortranarray(wide), list(wide)):
        assert torch.equal(HDCClassifier().fit(same, labels).prototypes_, expected)
    with pytest.raises(TypeError, match="frames: expected real or integer pixels, found dtype"):
        HDCClassifier().fit(np.full((60, 2, 2), "a"), labels)


def test_training_yields_once_all_classes_have_been_seen() -> None:
    frames, labels = touches(700)
    order = np.argsort(labels == 2, kind="stable")  # the third class comes last
    model = HDCClassifier()
    seen = []
    for report in model.train(frames[order], labels[order]):
        seen.append(report["samples_seen"])
        assert model.counts_.sum() == seen[-1]
        assert model.score(frames, labels) > 0.9
    assert seen == [512, 640, 700]


def test_memory_does_not_grow_with_the_number_of_frames() -> None:
    class Made:
        """Frames that exist only while they are counted."""

        def __init__(self, n: int):
            self.shape = (n, 40, 50)

        def __len__(self) -> int:
            return self.shape[0]

        def __getitem__(self, part: slice) -> np.ndarray:
            start, stop, _ = part.indices(len(self))
            rng = np.random.default_rng(start)
            return rng.integers(0, 255, (stop - start, 40, 50), dtype=np.uint8)

    peaks = []
    for n in (256, 256, 4096):  # the first warms up
        tracemalloc.start()
        HDCClassifier().fit(Made(n), np.arange(n) % 2)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[2] < peaks[1] + 4096 * 64 + 200_000, peaks  # labels, and not 7.7 MB of frames


def test_no_frames_to_predict_give_no_labels() -> None:
    frames, labels = touches()
    for prototype in classifier.PROTOTYPES:
        model = HDCClassifier(prototype=prototype).fit(frames, labels)
        assert model.predict(frames[:0]).shape == (0,)
        assert model.distances(frames[:0]).shape == (0, 3)


def test_parameters_as_scikit_learn_sets_them() -> None:
    from sklearn.base import clone
    from sklearn.model_selection import GridSearchCV, learning_curve
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer

    frames, labels = touches()
    model = HDCClassifier().set_params(ties="one", seed=3)
    assert repr(clone(model)) == (
        "HDCClassifier(ties='one', prototype='binary', seed=3, device='cpu', backend='numpy')"
    )
    assert not hasattr(clone(model.fit(frames, labels)), "prototypes_")
    with pytest.raises(ValueError, match=r"set_params: expected one of ties, .*found 'tie'"):
        model.set_params(tie="one")
    grid = GridSearchCV(model, {"ties": list(bits.TIES)}, cv=3).fit(frames, labels)
    assert grid.best_score_ > 0.9
    _, _, scores = learning_curve(
        model, frames, labels, cv=3, train_sizes=[0.5, 1.0], exploit_incremental_learning=True
    )
    assert scores[-1].min() > 0.9
    flat = frames.reshape(60, -1)
    assert make_pipeline(FunctionTransformer(), model).fit(flat, labels).score(flat, labels) == 1


def test_torchhd_measures_alike() -> None:
    """Integer prototypes are torchhd's bundle of bipolar hypervectors."""
    torchhd = pytest.importorskip("torchhd")
    frames, labels = touches(90)
    v = 2 * bits.unpack(encode(torch.from_numpy(frames)), 144).float() - 1
    bipolar = v.as_subclass(torchhd.tensors.map.MAPTensor)
    bundles = torch.stack([torchhd.multiset(bipolar[labels == c]) for c in range(3)])
    theirs = torchhd.cosine_similarity(bipolar, bundles).as_subclass(torch.Tensor)
    model = HDCClassifier(prototype="integer").fit(frames, labels)
    torch.testing.assert_close(-model._scores(frames).float() / 12, theirs)


@given(st.integers(1, 12), st.integers(2, 40), st.integers(0, 99))
@settings(max_examples=40, deadline=None)
def test_integer_prototypes_against_floats(n: int, d: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    frames = np.stack([rng.permutation(d) for _ in range(2 * n)]).astype(np.uint8)
    labels = np.arange(2 * n) % 2
    model = HDCClassifier(prototype="integer").fit(frames, labels)
    v = 2 * bits.unpack(encode(torch.from_numpy(frames)), d).double() - 1
    c = torch.stack([v[torch.from_numpy(labels == k)].sum(0) for k in range(2)])
    expected = -(v @ c.T) / c.norm(dim=1).clamp(min=1)
    torch.testing.assert_close(model._scores(frames), expected)
