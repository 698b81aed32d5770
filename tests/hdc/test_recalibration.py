"""Changed environments: bits replaced as published, or votes of old and new frames."""

from __future__ import annotations

import copy
import warnings

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits, planes
from hdc.encoders import Reference
from hdc.prototypes import Counters, merged
from hdc.readouts import Majority
from hdc.readouts.majority import METHODS
from tests.hdc.own import fitted


def sessions(n: int = 60, classes: int = 3, side: int = 24, seed: int = 1):
    """Frames of two sessions: half of the pixels of a class are others in the second."""
    rng = np.random.default_rng(seed)
    labels = np.arange(n) % classes
    base = rng.integers(0, 200, (classes, side, side))
    changed = np.where(
        rng.random(base.shape) < 0.5, rng.integers(0, 200, base.shape), base
    )
    return [
        (b[labels] + rng.integers(0, 156, (n, side, side)))
        .clip(0, 255)
        .astype(np.uint8)
        for b in (base, changed)
    ], labels


def counters_of(counts: torch.Tensor, n: torch.Tensor) -> Counters:
    """Counters of given counts [L, D] of n [L] hypervectors."""
    counters = Counters(len(n), counts.shape[1])
    for c, n_c in enumerate(n.tolist()):
        rows = torch.arange(n_c)[:, None] < counts[c]
        counters.add(bits.pack(rows), torch.full((n_c,), c))
    return counters


def test_votes_are_the_least_whole_numbers_of_their_shares():
    """By hand, p = 3/4: 4 old and 6 new frames count (1·6 : 3·4) = 1 and 2; 1 and 1 count 1 and 3;
    where one side has none, frames count 1; a class without any has no votes."""
    n_old, n_new = torch.tensor([4, 1, 3, 0, 0]), torch.tensor([6, 1, 0, 2, 0])
    c_old = torch.tensor([[4, 1, 0], [1, 0, 0], [3, 2, 1], [0, 0, 0], [0, 0, 0]])
    c_new = torch.tensor([[6, 2, 1], [0, 1, 0], [0, 0, 0], [2, 1, 0], [0, 0, 0]])
    old, new = counters_of(c_old, n_old), counters_of(c_new, n_new)
    votes, weights = merged(old, new, 0.75)
    assert weights == [2, 3, 1, 1, 1]
    assert votes.n.tolist() == [16, 4, 3, 2, 0]
    expected = [[16, 5, 2], [1, 3, 0], [3, 2, 1], [2, 1, 0], [0, 0, 0]]
    assert votes.counts().tolist() == expected
    assert votes.planes.shape[1] == 5  # 16 needs five bits
    votes, weights = merged(old, new, 0)
    assert votes.counts().tolist() == [*c_old[:3].tolist(), [2, 1, 0], [0, 0, 0]]
    assert weights == [0, 0, 1, 1, 1]
    votes, _ = merged(old, new, 1)
    expected = [[6, 2, 1], [0, 1, 0], [3, 2, 1], [2, 1, 0], [0, 0, 0]]
    assert votes.counts().tolist() == expected
    votes, weights = merged(old, new, 1 / 3)  # 2·6 : 1·4 and 2 : 1
    assert weights[:2] == [1, 1]
    assert votes.n.tolist()[:2] == [18, 3]
    assert votes.counts().tolist()[0] == [18, 5, 1]


def test_votes_above_their_bits_are_halved_and_so_are_those_of_a_new_frame():
    """Against Python integers, rounded down."""
    old, new = Counters(1, 2), Counters(1, 2)
    old.n[0] = 2**23 + 1
    old.reserve(2**23 + 1)
    old.planes[0, 23] = 3  # 2²³ of one bit, 2²³ + 1 of the other
    old.planes[0, 0] = 2
    new.add(torch.full((3, 1), 1), torch.zeros(3, dtype=torch.int64))
    votes, weights = merged(old, new, 0.5)  # 3 = 2²³ + 1 (mod 3): old by 1, new by n/3
    assert (2**23 + 1) % 3 == 0
    total = [2**23 + (2**23 + 1), 2**23 + 1]
    assert votes.n.tolist() == [(2**24 + 2) >> 1]
    assert votes.counts().tolist() == [[count >> 1 for count in total]]
    assert weights == [(2**23 + 1) // 3 >> 1]
    assert votes.planes.shape[1] == 24


@pytest.mark.parametrize("ties", planes.TIES)
def test_votes_of_unequal_classes_are_of_as_many_as_the_smallest(ties):
    """Old ones are drawn by the seed of the read-out, new ones by that of the recalibration."""
    rng = np.random.default_rng(0)
    d = 700

    def drawn(numbers):
        rows = torch.from_numpy(np.repeat(np.arange(3), numbers))
        words = bits.pack(torch.from_numpy(rng.random((len(rows), d)) < 0.5))
        counters = Counters(3, d)
        counters.add(words, rows)
        return words, rows, counters

    words, rows, old = drawn([9, 4, 6])
    new_words, new_rows, new = drawn([7, 5, 3])
    readout = fitted(
        Majority(ties, class_weight="balanced", random_state=11), words, rows, 3, d
    )
    readout = readout.adapted(new_words, new_rows, 0.6, 5, "merge")
    votes, _ = merged(old.thinned(4, seed=11), new.thinned(3, seed=5), 0.6)
    assert torch.equal(readout.n, votes.n)
    assert torch.equal(readout.counters().counts(), votes.counts())
    assert torch.equal(readout.prototypes_, votes.majority(ties, 11))
    published = fitted(Majority(ties, random_state=11), words, rows, 3, d)
    published = published.adapted(new_words, new_rows, 0.6, 5, "merge")
    votes, _ = merged(old, new, 0.6)
    assert torch.equal(published.counters().counts(), votes.counts())
    assert torch.equal(published.prototypes_, votes.majority(ties, 11))


def test_votes_of_a_class_without_new_frames_stay_as_they_are():
    """However large those of another class grow."""
    rng = np.random.default_rng(0)
    n_old, n_new = torch.tensor([5, 101]), torch.tensor([0, 127])
    counts = torch.from_numpy(rng.integers(0, n_old[:, None].numpy() + 1, (2, 90)))
    more = torch.from_numpy(rng.integers(0, n_new[:, None].numpy() + 1, (2, 90)))
    votes, new = counters_of(counts, n_old), counters_of(more, n_new)
    for _ in range(4):
        votes, _ = merged(votes, new, 0.333)
    assert 2**23 <= votes.n[1] < 2**24
    assert votes.n[0] == 5
    assert torch.equal(votes.counts([0])[0], counts[0])


@pytest.mark.parametrize("method", METHODS)
def test_a_changed_environment_is_learnt_and_the_old_one_kept(method):
    (old, new), labels = sessions()
    model = HDCClassifier().fit(old, labels)
    before = model.distances(new).min(1).mean()
    few = slice(12)  # four of each class
    model.recalibrate(new[few], labels[few], method=method)
    assert model.distances(new).min(1).mean() < before
    assert model.score(new, labels) == 1
    assert model.score(old, labels) == 1
    # What is known follows: new frames, as new as those.
    assert model.is_known(new, 0.2).mean() > 0.6
    noise = np.random.default_rng(0).integers(0, 256, (40, 24, 24), dtype=np.uint8)
    assert not model.is_known(noise, 0.2).any()  # of 12 frames
    model.recalibrate(new, labels, method=method)
    assert model.is_known(new).mean() > 0.9


def test_integer_prototypes_merge_and_refuse_replacement():
    (old, new), labels = sessions()
    model = HDCClassifier(readout="counts").fit(old, labels)
    with pytest.raises(ValueError, match="method: expected one of merge, found 'repl"):
        model.recalibrate(new, labels, method="replace")
    before = model.decision_function(new).max(1).mean()
    model.recalibrate(new[:9], labels[:9])
    assert model.decision_function(new).max(1).mean() > before
    assert model.score(new, labels) == 1
    assert model.is_known(new).mean() > 0.8


@pytest.mark.parametrize("ties", planes.TIES)
@pytest.mark.parametrize("method", METHODS)
def test_a_model_recalibrated_by_single_frames_comes_back(method, ties, tmp_path):
    """Of a class of one frame, none are left without it: bits beyond D stay zeros."""
    (old, new), labels = sessions()
    old, new = old[:, :7, :11], new[:, :7, :11]
    model = HDCClassifier(readout=Majority(ties)).fit(old[:4], labels[:4])
    model.recalibrate(new[:2], labels[:2], p=0.7, method=method)
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert np.array_equal(loaded.distances(new), model.distances(new))
    assert np.array_equal(loaded.is_known(new, 0.5), model.is_known(new, 0.5))


# Without labels -----------------------------------------------------------------------------------


def drifted(n: int = 90) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frames of two sessions, the second under a strong pattern that all frames have in common."""
    rng = np.random.default_rng(0)
    labels = np.arange(n) % 6
    fields = rng.normal(0, 0.4, (6, 1500))
    pattern = rng.normal(0, 20, 1500)
    old, new = (fields[labels] + rng.normal(0, 1, (n, 1500)) for _ in range(2))
    return 100 + old, 100 + new + pattern, labels


@pytest.mark.parametrize(
    ("base", "readout"),
    [
        *(("median", name) for name in ("majority", "counts", "ridge", "neighbours")),
        *(("levels", name) for name in ("lda", "trained")),
    ],
)
def test_a_reference_is_zeroed_again_without_labels(base, readout):
    old, new, labels = drifted()
    model = HDCClassifier(Reference(base), readout).fit(old, labels)
    before = {k: v.clone() for k, v in model.state_.tensors().items()}
    assert model.score(new, labels) < 0.6
    assert model.rezero(new[::2]) is model
    assert model.score(new[1::2], labels[1::2]) > 0.95
    fresh = Reference().fit(new[::2])
    assert torch.equal(model.encoder_.reference_, fresh.reference_)
    for name, tensor in model.state_.tensors().items():
        assert torch.equal(tensor, before[name])
    assert model.is_known(new[1::2], 0.2).mean() > 0.5


def test_frames_of_one_class_are_warned_of():
    old, new, labels = drifted()
    model = HDCClassifier("reference", "lda").fit(old, labels)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.rezero(new)
    message = "rezero: the 15 frames are put into [12] of 6 classes; they have to show"
    with pytest.warns(UserWarning, match=message):
        model.rezero(np.repeat(new[labels == 2][:1], 15, 0) + np.arange(1500) / 1e6)


def test_hypervectors_are_no_reference():
    old, _, labels = drifted()
    model = HDCClassifier("reference").fit(old, labels)
    with pytest.raises(TypeError, match="rezero: expected frames, found hypervectors"):
        model.rezero(model.encode(old))


def test_a_frame_without_touch_is_zeroed_by_another():
    old, new, labels = drifted()
    rest = np.full((1, 1500), 100.0) + np.random.default_rng(1).normal(
        0, 0.01, (1, 1500)
    )
    pattern = (new - old).mean(0)
    model = HDCClassifier(Reference(frame=rest[0])).fit(old, labels)
    with pytest.warns(UserWarning, match="are put into 1 of 6 classes"):
        model.rezero(rest + pattern)
    expected = Reference().zero(rest + pattern).reference_
    assert torch.equal(model.encoder_.reference_, expected)


def test_other_encoders_cannot_be_zeroed():
    (old, new), labels = sessions()
    with pytest.raises(
        AttributeError, match="rezero: expected an encoder with a reference"
    ):
        HDCClassifier().fit(old, labels).rezero(new)
    model = HDCClassifier("reference").fit(old, labels)
    reference = model.encoder_.reference_.clone()
    for frames, message in (
        (new[:0], "frames: expected at least one frame, found none"),
        (new[:, :5], "expected D = 576 pixels"),
        (np.where(new > 300, 1, np.nan), r"frames\[0\]: expected finite pixels"),
    ):
        with pytest.raises(ValueError, match=message):
            model.rezero(frames)
        assert torch.equal(model.encoder_.reference_, reference)


@pytest.mark.parametrize("readout", ["lda", "kernel"])
def test_discriminants_of_both_sessions_are_mixed(readout, tmp_path):
    """Half of each knows both; a class without new frames stays; single new frames do no harm."""
    (old, new), labels = sessions()
    model = HDCClassifier("levels", readout).fit(old, labels)
    both = copy.deepcopy(model).recalibrate(new[::4], labels[::4])
    both.recalibrate(new[1::4], labels[1::4]).save(tmp_path / "m")
    for found in (both, HDCClassifier.load(tmp_path / "m")):
        assert found.score(new, labels) > 0.85
        assert found.score(old, labels) > 0.85
        assert found.predict_proba(new).sum(1) == pytest.approx(1)
    two = labels < 2
    with pytest.warns(UserWarning, match="no new frames of"):
        some = copy.deepcopy(model).recalibrate(new[two], labels[two])
    assert some.score(new[two], labels[two]) > 0.85
    assert some.score(old, labels) > 0.6
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*nearest mean")
        assert model.recalibrate(new[:3], labels[:3]).score(old, labels) > 0.85


@pytest.mark.parametrize(
    ("method", "labels", "p", "message"),
    [
        ("add", [0, 1], 0.5, "method: expected one of replace, merge, found 'add'"),
        (None, [9, 9], 0.5, r"labels: expected classes among \[0, 1, 2\], found 9"),
        (None, [0, 1], 1.5, r"p: expected .*\[0, 1\]"),
    ],
)
def test_what_cannot_be_recalibrated_is_named(method, labels, p, message):
    (old, new), of_old = sessions()
    model = HDCClassifier().fit(old, of_old)
    with pytest.raises(ValueError, match=message):
        model.recalibrate(new[:2], labels, p=p, method=method)


@pytest.mark.parametrize(
    ("readout", "argument", "default"),
    [
        ("ridge", {"p": 0.75}, "0.5"),
        ("neighbours", {"random_state": 1}, "0"),
        ("ridge", {"method": "merge"}, "None"),
        ("lda", {"method": "replace"}, "None"),
        ("kernel", {"random_state": 3}, "0"),
    ],
)
def test_an_argument_that_a_readout_ignores_is_refused(readout, argument, default):
    (old, new), labels = sessions()
    model = HDCClassifier(readout=readout).fit(old, labels)
    before = model.decision_function(new)
    ((name, value),) = argument.items()
    with pytest.raises(ValueError, match=f"^{name}: expected {default} ") as caught:
        model.recalibrate(new, labels, **argument)
    assert str(caught.value).endswith(f"does not use it, found {value!r}")
    assert (model.decision_function(new) == before).all()
    model.recalibrate(new, labels, p=0.5, random_state=0, method=None)
    assert model.score(new, labels) == 1


def test_each_recalibration_replaces_bits_of_its_own(tmp_path):
    """By p = ½ a quarter of what differs stays after two, an eighth after three; in a file, too."""
    (old, new), labels = sessions()
    model = HDCClassifier().fit(old, labels)
    aim = HDCClassifier().fit(new, labels).prototypes_
    path = tmp_path / "model"
    away = [int(bits.count_ones(model.prototypes_ ^ aim).sum())]
    for _ in range(3):
        model.recalibrate(new, labels).save(path)
        model = HDCClassifier.load(path)
        away.append(int(bits.count_ones(model.prototypes_ ^ aim).sum()))
    shares = np.array(away) / away[0]
    assert shares == pytest.approx([1, 1 / 2, 1 / 4, 1 / 8], abs=0.06)
