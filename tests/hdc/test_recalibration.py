"""Changed environments: bits replaced as published, or votes of old and new frames."""

import warnings

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits, planes
from hdc.encoders import Reference
from hdc.prototypes import Counters, merged
from hdc.readouts import Majority
from tests.hdc.own import fitted


def counters_of(counts, n):
    """Counters of given counts [L, D] of n [L] hypervectors."""
    empty = Counters(len(n), len(counts[0]))
    return empty._of_counts(torch.tensor(counts), torch.tensor(n))


OLD, NEW = [4, 1, 3, 0, 0], [6, 1, 0, 2, 0]
C_OLD = [[4, 1], [1, 0], [3, 2], [0, 0], [0, 0]]
C_NEW = [[6, 2], [0, 1], [0, 0], [2, 1], [0, 0]]


@pytest.mark.parametrize(
    ("p", "weights", "n", "counts"),
    [
        # 4 old and 6 new frames count (1·6 : 3·4) = 1 and 2; 1 and 1 count 1 and 3.
        (0.75, [2, 3, 1, 1, 1], [16, 4, 3, 2, 0],
         [[16, 5], [1, 3], [3, 2], [2, 1], [0, 0]]),
        (0, [0, 0, 1, 1, 1], [4, 1, 3, 2, 0], [*C_OLD[:3], [2, 1], [0, 0]]),
        (1, [1, 1, 1, 1, 1], [6, 1, 3, 2, 0], [*C_NEW[:2], [3, 2], *C_NEW[3:]]),
        # 2·6 : 1·4 and 2 : 1
        (1 / 3, [1, 1, 1, 1, 1], [18, 3, 3, 2, 0],
         [[18, 5], [2, 1], [3, 2], [2, 1], [0, 0]]),
    ],
)  # fmt: skip
def test_votes_are_the_least_whole_numbers_of_their_shares(p, weights, n, counts):
    """Where one side has none, frames count 1; a class without any has no votes."""
    old, new = counters_of(C_OLD, OLD), counters_of(C_NEW, NEW)
    votes, found = merged(old, new, p)
    assert found == weights
    assert votes.n.tolist() == n
    assert votes.counts().tolist() == counts


def test_votes_above_their_bits_are_halved_and_so_are_those_of_a_new_frame():
    """Against Python integers, rounded down."""
    old = counters_of([[2**23, 2**23 + 1]], [2**23 + 1])
    new = counters_of([[3, 0]], [3])
    votes, weights = merged(old, new, 0.5)  # 3 = 2²³ + 1 (mod 3): old by 1, new by n/3
    assert (2**23 + 1) % 3 == 0
    total = [2**23 + (2**23 + 1), 2**23 + 1]
    assert votes.n.tolist() == [(2**24 + 2) >> 1]
    assert votes.counts().tolist() == [[count >> 1 for count in total]]
    assert weights == [(2**23 + 1) // 3 >> 1]
    assert votes.planes.shape[1] == 24


@pytest.mark.parametrize("weight", [None, "balanced"])
@pytest.mark.parametrize("ties", planes.TIES)
def test_balanced_votes_are_of_as_many_as_the_smallest_class(ties, weight):
    """New votes are drawn by the seed of the recalibration, all else by that of the read-out."""
    rng = np.random.default_rng(0)
    drawn = []
    for numbers in ([9, 4, 6], [7, 5, 3]):
        rows = torch.from_numpy(np.repeat(np.arange(3), numbers))
        words = bits.pack(torch.from_numpy(rng.random((len(rows), 700)) < 0.5))
        counters = Counters(3, 700)
        counters.add(words, rows)
        drawn.append((words, rows, counters))
    (words, rows, old), (new_words, new_rows, new) = drawn
    model = fitted(Majority(ties, weight, random_state=11), words, rows, 3, 700)
    replaced = model.adapted(new_words, new_rows, 1, 5, "replace")
    bundled = new.thinned(3, seed=11) if weight else new
    assert torch.equal(replaced.prototypes_, bundled.majority(ties))
    model = model.adapted(new_words, new_rows, 0.6, 5, "merge")
    if weight:
        old, new = old.thinned(4, seed=11), new.thinned(3, seed=5)
    votes, _ = merged(old, new, 0.6)
    assert torch.equal(model.counters().counts(), votes.counts())
    assert torch.equal(model.prototypes_, votes.majority(ties))


# Models -------------------------------------------------------------------------------------------


def drifted():
    """Frames of two sessions, the second under a strong pattern that all frames have in common."""
    rng = np.random.default_rng(0)
    labels = np.arange(90) % 6
    fields = rng.normal(0, 0.4, (6, 1500))
    pattern = rng.normal(0, 20, 1500)
    old, new = (fields[labels] + rng.normal(0, 1, (90, 1500)) for _ in range(2))
    return 100 + old, 100 + new + pattern, labels


OLD_FRAMES, NEW_FRAMES, LABELS = drifted()


def trained(*parts: str):
    return HDCClassifier(*parts).fit(OLD_FRAMES, LABELS)


def test_a_reference_is_zeroed_again_without_labels():
    model = trained("reference_levels", "lda")
    state = model.state_
    assert model.score(NEW_FRAMES, LABELS) < 0.6
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # all classes are among them
        assert model.rezero(NEW_FRAMES[::2]) is model
    assert model.score(NEW_FRAMES[1::2], LABELS[1::2]) > 0.95
    fresh = Reference().fit(NEW_FRAMES[::2])
    assert torch.equal(model.encoder_.reference_, fresh.reference_)
    assert model.state_ is state
    assert model.is_known(NEW_FRAMES[1::2], 0.2).mean() > 0.5


def test_what_cannot_be_zeroed_is_named_and_changes_nothing():
    model = trained("reference")
    reference = model.encoder_.reference_.clone()
    broken = NEW_FRAMES.copy()
    broken[17, 3] = np.nan
    for frames, message in (
        (broken, r"frames\[17\]: expected finite pixels"),
        (model.encode(OLD_FRAMES), "rezero: expected frames, found hypervectors"),
    ):
        with pytest.raises((TypeError, ValueError), match=message):
            model.rezero(frames)
        assert torch.equal(model.encoder_.reference_, reference)


UNUSED = "does not use it, found"


@pytest.mark.parametrize(
    ("readout", "given", "message"),
    [
        ("majority", {"method": "add"}, "method: expected one of replace, merge, found 'add'"),
        ("majority", {"p": 1.5}, r"p: expected .*\[0, 1\]"),
        ("majority", {"random_state": 1.5}, "random_state: expected an integer, found 1.5"),
        ("majority", {"y": [9, 9]}, r"labels: expected classes among \[0, .*, found 9"),
        ("counts", {"method": "replace"}, "method: expected one of merge, found 'repl"),
        ("ridge", {"p": 0.75}, f"p: expected 0.5 .*{UNUSED} 0.75"),
        ("neighbours", {"random_state": 1}, f"random_state: expected 0 .*{UNUSED} 1"),
        ("lda", {"method": "replace"}, f"method: expected None .*{UNUSED} 'replace'"),
        ("lda", {"p": 1, "y": [1, 1]}, "p: expected a share below 1 with new fra"),
    ],
)  # fmt: skip
def test_what_a_recalibration_cannot_use_is_named_and_changes_nothing(
    readout, given, message
):
    model = trained("median", readout)
    before = model.decision_function(NEW_FRAMES)
    with pytest.raises(ValueError, match=f"^{message}"):
        model.recalibrate(NEW_FRAMES[:2], **{"y": [0, 1], **given})
    assert (model.decision_function(NEW_FRAMES) == before).all()


def test_frames_of_a_class_without_any_are_not_lost_by_replacing_bits():
    model = HDCClassifier().partial_fit(OLD_FRAMES, LABELS % 5, classes=range(6))
    before = model.distances(NEW_FRAMES)
    with pytest.raises(ValueError, match=r"^recalibrate: expected classes with tr"):
        model.recalibrate(NEW_FRAMES, LABELS)
    assert (model.distances(NEW_FRAMES) == before).all()
    model.recalibrate(NEW_FRAMES, LABELS, method="merge")
    assert (model.predict(NEW_FRAMES[5::6]) == 5).mean() > 0.5


def test_what_was_recalibrated_learns_no_further_frames():
    model = trained().recalibrate(NEW_FRAMES, LABELS)
    with pytest.raises(ValueError, match="not recalibrated"):
        model.partial_fit(OLD_FRAMES, LABELS)


def test_each_recalibration_replaces_bits_of_its_own(tmp_path):
    """By p = ½ a quarter of what differs stays after two, an eighth after three; in a file, too."""
    model = trained()
    aim = HDCClassifier().fit(NEW_FRAMES, LABELS).prototypes_
    path = tmp_path / "model"
    away = [int(bits.count_ones(model.prototypes_ ^ aim).sum())]
    for _ in range(3):
        model.recalibrate(NEW_FRAMES, LABELS).save(path)
        model = HDCClassifier.load(path)
        away.append(int(bits.count_ones(model.prototypes_ ^ aim).sum()))
    shares = np.array(away) / away[0]
    assert shares == pytest.approx([1, 1 / 2, 1 / 4, 1 / 8], abs=0.06)


def test_a_recalibrated_ridge_starts_from_its_weights():
    """The penalty is on their change: few new frames move it less than a fit to them alone."""
    model = HDCClassifier(readout="ridge").fit(OLD_FRAMES, LABELS)
    few = np.unique(LABELS, return_index=True)[1]
    fresh = HDCClassifier(readout="ridge").fit(NEW_FRAMES[few], LABELS[few])
    before = model.decision_function(OLD_FRAMES)
    after = model.recalibrate(NEW_FRAMES[few], LABELS[few])
    changes = [
        np.abs(other.decision_function(OLD_FRAMES) - before).sum()
        for other in (after, fresh)
    ]
    assert 0 < changes[0] < 0.9 * changes[1]
