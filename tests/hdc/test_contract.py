"""What every encoder with every read-out promises, over one list of pairs."""

import copy
import pickle

import numpy as np
import pytest
import torch

from hdc import HDCClassifier
from hdc.encoders import (
    ENCODERS,
    Levels,
    Quantile,
    Reference,
    RelativeEncoder,
    make_encoder,
)
from hdc.readouts import (
    READOUTS,
    Counting,
    Counts,
    Majority,
    Updatable,
    make_readout,
)
from tests.hdc.own import Nearest, fitted

PAIRS = [
    *((encoder, readout) for encoder in ENCODERS for readout in READOUTS),
    (Levels(3, lit=0.5), "majority"),
    (Reference("levels"), "lda"),
    (Reference(Quantile("1/3")), "counts"),
    *(("median", kind("one", "balanced", 4)) for kind in (Majority, Counts)),
    ("median", Nearest()),
]


def touches(n, seed=0):
    fields = np.random.default_rng(7).integers(0, 200, (4, 40, 50))
    rng = np.random.default_rng(seed)
    labels = np.arange(n) % 4
    noisy = fields[labels] + rng.normal(0, 60, (n, 40, 50))
    return np.clip(noisy, 0, 255).astype(np.uint8), np.array(list("dbca"))[labels]


FRAMES, LABELS = touches(80)
QUERIES, TRUTH = touches(60, 1)


@pytest.fixture(scope="module", params=PAIRS, ids=repr)
def model(request):
    return HDCClassifier(*request.param).fit(FRAMES, LABELS)


def answers(model, asked=QUERIES):
    mask = model.predict_set(asked, 0.1, mask=True)
    sets = model.predict_set(asked, 0.1)
    assert [found.tolist() for found in sets] == [
        model.classes_[row].tolist() for row in mask
    ]
    return [
        mask.tolist(),
        model.predict(asked).tolist(),
        model.p_values(asked, 0.1).tolist(),
        model.predict_proba(asked).tolist(),
        model.is_known(asked, 0.1).tolist(),
    ]


def test_a_file_a_pickle_and_hypervectors_answer_alike(model, tmp_path):
    assert model.score(QUERIES, TRUTH) > 0.9
    expected = answers(model)  # what is made when asked for is not kept
    first, second = tmp_path / "m", tmp_path / "n"
    model.save(first)
    loaded = HDCClassifier.load(first, trusted="tests.hdc.own.Nearest")
    loaded.save(second)
    assert second.read_bytes() == first.read_bytes()
    size = first.stat().st_size
    assert 0 < model.prediction_bytes_ <= size
    counts = isinstance(make_readout(model.readout), Counting)
    assert hasattr(loaded, "distances") == counts
    for found in (model, loaded):
        pickled = pickle.dumps(found)
        assert len(pickled) < 1.2 * size + 5000
        assert answers(pickle.loads(pickled)) == expected
    words = HDCClassifier(model.encoder, model.readout)
    both = model.encode(np.concatenate([FRAMES, QUERIES]))
    words.fit(both[:80], LABELS)
    assert answers(words, both[80:]) == expected
    assert len(pickle.dumps(words)) < 1.2 * size + 5000  # without the queries


def test_no_frames_have_no_answers(model):
    none = FRAMES[:0]
    assert model.predict(none).shape == model.is_known(none).shape == (0,)
    assert model.predict_proba(none).shape == (0, 4)
    assert model.predict_set(none, 0.1) == []


def test_it_goes_on_learning_or_says_why_not(model):
    """Half of class a and classes b and d first, then the other half and class c."""
    encoder, readout = model.encoder, model.readout
    early = np.isin(LABELS, ["b", "d"]) | ((LABELS == "a") & (np.arange(80) < 40))
    first, second = ((FRAMES[part], LABELS[part]) for part in (early, ~early))
    if not isinstance(make_readout(readout), Updatable):
        message = r"^partial_fit: expected a read-out that learns batch by batch, found"
        with pytest.raises(AttributeError, match=message):
            model.partial_fit  # noqa: B018
        return
    parts = HDCClassifier(encoder, readout).partial_fit(*first).partial_fit(*second)
    assert parts.counts_.tolist() == [20] * 4
    if make_encoder(encoder).learns:  # of the first batch only
        assert parts.score(QUERIES, TRUTH) > 0.9
        return
    expected = model.decision_function(QUERIES)
    assert np.array_equal(parts.decision_function(QUERIES), expected)


def test_it_recalibrates_or_says_why_not(model):
    new = np.roll(QUERIES, 2, axis=1)  # the sensor has moved
    before, moved = answers(model), copy.copy(model)
    if hasattr(moved, "partial_fit"):
        moved.partial_fit(FRAMES[:8], LABELS[:8])
    zeroes = isinstance(make_encoder(model.encoder), RelativeEncoder)
    assert hasattr(moved, "rezero") == zeroes
    if zeroes:
        moved.rezero(new)
        assert not moved._head.recalibrated
    if hasattr(make_readout(model.readout), "adapt"):
        used = moved.readout_.adapts_by
        given = {"p": 0.6, "method": "merge"}
        moved.recalibrate(new, TRUTH, **{k: given[k] for k in given if k in used})
        assert moved.score(new, TRUTH) > 0.8
        assert moved.is_known(new, 0.2).mean() > 0.5
    else:
        message = r"^recalibrate: expected a read-out that adapts, found"
        with pytest.raises(AttributeError, match=message):
            moved.recalibrate  # noqa: B018
    assert answers(model) == before  # of which it is a copy


@pytest.mark.parametrize("readout", ["majority", "counts", "neighbours"])
def test_a_class_without_frames_never_wins(readout):
    """Only a read-out that learns batch by batch may have one."""
    words = torch.from_numpy(np.random.default_rng(0).integers(0, 2**60, (20, 4)))
    rows = 2 * (torch.arange(20) % 2)
    model = fitted(make_readout(readout), words, rows, 4, 256)
    scores = model.scores(torch.cat((words, ~words & (2**60 - 1))))
    assert set(scores.argmax(1).tolist()) <= {0, 2}
    assert not scores.isnan().any()
