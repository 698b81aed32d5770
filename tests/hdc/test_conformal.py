"""Conformal sets and rejection: exact distances, and coverage on fresh frames."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits, io
from hdc.conformal import FEWEST, Conformal, Peers
from hdc.encoders import Median
from hdc.export import Plan
from hdc.prototypes import Counters
from hdc.readouts import LDA, Kernel, Ridge
from hdc.readouts.majority import EXTRAS, deciding_prototypes
from hdc.sample import KEPT, Sample
from tests.hdc.own import Nearest

D = 2048


class Speckle:
    """Speckle of correlated classes: |field of the class + a share of a fresh field|².

    The fields have 36 % of their intensity in common. The share of the fresh field differs from
    frame to frame, so that the distances of a class spread far more than independent bits would.
    """

    def __init__(self, seed: int, classes: int = 5):
        self.rng, self.classes = np.random.default_rng(seed), classes
        self.common = self.field(1)
        self.fields = self.of_new_classes()

    def field(self, n: int) -> np.ndarray:
        return self.rng.standard_normal((n, D)) + 1j * self.rng.standard_normal((n, D))

    def of_new_classes(self) -> np.ndarray:
        return 0.6 * self.common + 0.8 * self.field(self.classes)

    def frames(
        self, n: int, fields: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        labels = np.arange(n) % self.classes
        share = 0.5 * np.exp(0.2 * self.rng.standard_normal((n, 1)))
        fields = self.fields if fields is None else fields
        intensity = np.abs(fields[labels] + share * self.field(n)) ** 2
        return np.clip(30 * intensity, 0, 255).astype(np.uint8), labels


def p_values(peers, words: torch.Tensor, alpha: float) -> np.ndarray:
    """Those of hypervectors, whatever their scores."""
    scores = torch.zeros(len(words), len(peers))
    return Conformal(peers).p_values(words, scores, alpha)


def junk(seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).integers(0, 256, (50, D))
    return np.concatenate([noise, np.zeros((1, D)), np.full((1, D), 255)]).astype(
        np.uint8
    )


def plain_p(peers: list[Peers | None], words: torch.Tensor, alpha: float) -> np.ndarray:
    """p-values by their definition, frame by frame."""
    p = np.zeros((len(words), len(peers)))
    for c, own in enumerate(peers):
        if own is None:
            continue
        for q, (d, d_i) in enumerate(zip(*own.compare(words), strict=True)):
            m = len(d_i)
            others = [
                e
                for b, x in enumerate(peers)
                if x and b != c and len(x.held_out) >= FEWEST
                for e in x.held_out
            ]
            if (m + 1) * alpha >= 1 or m < FEWEST:
                others = []
            larger = sum(x >= d for x in d_i)
            larger += sum(e >= d - (sum(d_i) + d) / (m + 1) for e in others)
            p[q, c] = (1 + larger) / (1 + m + len(others))
    return p


@pytest.mark.parametrize("alpha", [0.5, 0.2, 0.05, 0.025, 0.01])
@pytest.mark.filterwarnings("ignore:alpha=.* needs at least")
def test_p_values_are_shares_of_kept_frames_as_unlike_as_the_query(alpha):
    """Few bits, so that distances are often equal; classes of 19, 19, 3 and one frame, and none."""
    rng = np.random.default_rng(0)
    words = [torch.from_numpy(rng.integers(0, 2**14, (m, 1))) for m in (19, 19, 3, 1)]
    counters = Counters(4, 14)
    counters.add(
        torch.cat(words),
        torch.arange(4).repeat_interleave(torch.tensor([19, 19, 3, 1])),
    )
    peers = [
        Peers.of(w, deciding_prototypes(counters, c, "zero", 0))
        for c, w in enumerate(words)
    ]
    assert len(peers[3].held_out) == 0
    assert np.isnan(peers[3].mean)
    assert [p.held_out.mean() for p in peers[:3]] == pytest.approx([0, 0, 0])
    queries = torch.from_numpy(rng.integers(0, 2**14, (60, 1)))
    for known in ([None, *peers], peers[:1]):
        np.testing.assert_allclose(
            p_values(known, queries, alpha), plain_p(known, queries, alpha)
        )


def test_too_small_a_share_is_named():
    words = torch.arange(39).reshape(-1, 1)
    counters = Counters(1, 14)
    counters.add(words, torch.zeros(39, dtype=torch.int64))
    peers = [None, Peers.of(words, deciding_prototypes(counters, 0, "zero", 0))]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        p_values(peers, words, 1 / 40)
    text = "alpha=0.0244 needs at least 40 stored frames, found 39; no frame is refused"
    with pytest.warns(UserWarning, match=f"^{text}"):
        p_values(peers, words, 0.0244)


# Coverage -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("per_class", [6, 40])
@pytest.mark.filterwarnings("ignore:.*constant frame")
def test_fresh_frames_are_refused_as_often_as_stated_and_junk_always(per_class):
    refused = []
    for seed in range(8):
        speckle = Speckle(seed)
        model = HDCClassifier().fit(*speckle.frames(5 * per_class))
        frames, _ = speckle.frames(400)
        refused.append(
            [1 - model.is_known(frames, rate).mean() for rate in (0.05, 0.2)]
        )
        assert not model.is_known(junk()).any()
        assert not model.is_known(
            speckle.frames(100, speckle.of_new_classes())[0]
        ).any()
    low, high = np.mean(refused, 0)
    assert 0.02 < low < 0.08, refused
    assert 0.1 < high < 0.26, refused  # 1 in 7 of 6 + 1 frames


@pytest.mark.parametrize("per_class", [1, 2, 3, 4, 5, 10])
@pytest.mark.filterwarnings("ignore:alpha=.* needs at least")
def test_sets_cover_what_is_asked_however_few_frames_there_are(per_class):
    """Fewer than four frames of a class: two of them were covered half as often as asked."""
    asked = np.array([0.8, 0.9, 0.95])
    covered = []
    for seed in range(12):
        speckle = Speckle(seed)
        model = HDCClassifier().fit(*speckle.frames(5 * per_class))
        frames, labels = speckle.frames(100)
        sets = [model.predict_set(frames, 1 - share) for share in asked]
        covered.append([_share_of_right(found, labels) for found in sets])
    # Training sets differ; twelve of them leave three points.
    assert (np.mean(covered, 0) > asked - 0.03).all(), np.mean(covered, 0)


def _share_of_right(sets, labels) -> float:
    return float(np.mean([y in one for y, one in zip(labels, sets, strict=True)]))


def test_too_few_frames_of_a_class_are_named():
    frames, labels = Speckle(0).frames(15)
    model = HDCClassifier().fit(frames, labels)
    text = "alpha=0.1 needs at least 4 stored frames of each class, found 3; no frame"
    with pytest.warns(UserWarning, match=f"^{text}"):
        sets = model.predict_set(frames, 0.1)
    assert {len(found) for found in sets} == {5}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sets = model.predict_set(frames, 0.3)  # more than a quarter: three are enough
    assert min(len(found) for found in sets) < 5


def noisy(seed, noise):
    """draw(labels) → frames [n, 500] of three classes, each of a noise of its own."""
    rng = np.random.default_rng(seed)
    fields = rng.normal(0, 1, (3, 500))

    def draw(labels):
        own = np.array(noise)[labels, None]
        return fields[labels] + own * rng.normal(0, 1, (len(labels), 500))

    return draw


@pytest.mark.parametrize("share", [0.1, 0.2, 0.5])
def test_each_class_is_covered_whatever_its_spread_and_number(share):
    """Classes of unlike noise and number: the guarantee is for each, never exceeded by chance."""
    missed = []
    for seed in range(12):
        draw, labels = noisy(seed, [0.5, 1, 3]), np.repeat([0, 1, 2], [20, 40, 90])
        model = HDCClassifier().fit(draw(labels), labels)
        fresh = np.repeat([0, 1, 2], 60)
        sets = model.predict_set(draw(fresh), share)
        right = [y in found for y, found in zip(fresh, sets, strict=True)]
        missed.append(1 - np.reshape(right, (3, 60)).mean(1))
    assert (np.abs(np.mean(missed, 0) - share) < 0.1).all(), np.mean(missed, 0)


@pytest.mark.filterwarnings("ignore:.*constant frame")
def test_predictions_are_labels_and_what_is_known_is_asked_apart():
    speckle = Speckle(1)
    frames, labels = speckle.frames(100)
    names = np.array(list("edcba"))
    model = HDCClassifier().fit(frames, names[labels])
    new, labels = speckle.frames(200)
    mixed = np.concatenate([new, junk()])
    plain, known = model.predict(mixed), model.is_known(mixed)
    assert known[:200].mean() > 0.8
    assert not known[200:].any()
    assert plain.dtype == np.dtype("<U1")
    assert plain.shape == (252,)
    assert model.is_known(new[:0]).shape == (0,)
    for share in (0, -1.0, 1.0, 7, "x", None):
        with pytest.raises(ValueError, match=r"expected a share in \(0, 1\), found"):
            model.is_known(mixed, share)


# Exact distances ----------------------------------------------------------------------------------


@pytest.mark.parametrize("ties", bits.TIES)
@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 12])
def test_distances_are_those_of_counting_anew(n, ties):
    """With the new frame in the place of a kept one, and with a kept one left out."""
    rng = np.random.default_rng(n)
    words = bits.pack(torch.from_numpy(rng.random((n + 3, 333)) < rng.random(333)))
    kept, fresh = words[:n], words[n:]
    counters = Counters(1, 333)
    counters.add(kept, torch.zeros(n, dtype=torch.int64))
    breaker = counters._tie_breaker(3, 0)
    deciding = torch.stack([counters.prototype(0, ties, 3, extra) for extra in EXTRAS])
    peers = Peers.of(kept, deciding)
    d, d_i = peers.compare(fresh)
    majority = bits.majority(kept, ties, breaker)
    assert d.tolist() == bits.hamming(fresh, majority[None])[:, 0].tolist()
    for i in range(n):
        others = torch.cat((kept[:i], kept[i + 1 :]))
        for q, x in enumerate(fresh):
            exchanged = bits.majority(torch.cat((others, x[None])), ties, breaker)
            assert d_i[q, i] == int(bits.hamming(kept[i : i + 1], exchanged[None]))
        if n > 1:
            without = bits.majority(others, ties, breaker)
            expected = int(bits.hamming(kept[i : i + 1], without[None]))
            assert peers.held_out[i] + peers.mean == pytest.approx(expected)


def test_recalibrated_models_compare_with_the_new_frames():
    """By exchanging frames in the second recalibration and counting anew."""
    speckle = Speckle(3)
    old, labels = speckle.frames(50)
    new, _ = speckle.frames(21, speckle.of_new_classes())
    new, x = new[:20], new[20:]
    for method in ("replace", "merge"):
        model = (
            HDCClassifier()
            .fit(old, labels)
            .recalibrate(new, labels[:20], 0.6, 1, method)
        )
        d, d_i = (
            model._learned.conformal()
            .peers[0]
            .compare(Median().encode(torch.from_numpy(x)))
        )
        assert d.tolist() == model.distances(x)[:, 0].tolist()
        for i, place in enumerate(range(0, 20, 5)):
            exchanged = new.copy()
            exchanged[place] = x[0]
            again = HDCClassifier().fit(old, labels)
            again.recalibrate(exchanged, labels[:20], 0.6, 1, method)
            assert d_i[0, i] == again.distances(new[place : place + 1])[0, 0]


# What is kept -------------------------------------------------------------------------------------


def test_what_is_kept_does_not_depend_on_batches_and_has_a_share_of_each_time():
    words, labels = torch.arange(3000)[:, None], ["a", "b", "a"] * 1000
    samples = []
    for cuts in ([3000], [128] * 24, [1] * 3000):
        sample = Sample()
        for start, n in zip(np.cumsum([0, *cuts]), cuts, strict=False):
            sample.add(words[start : start + n], labels[start : start + n])
        samples.append(torch.cat([sample.of("a"), sample.of("b")]))
        assert sample.seen == {"a": 2000, "b": 1000}
    assert torch.equal(samples[0], samples[1])
    assert torch.equal(samples[0], samples[2])
    assert len(samples[0]) == len(set(samples[0].flatten().tolist())) == 2 * KEPT
    thirds = np.bincount(samples[0].flatten() // 1000, minlength=3)
    assert thirds.min() >= 5  # of 38


def chi_square(kept: list[int], n: int, bins: int) -> float:
    """Of how often frames 0 … n − 1 were kept, in units of what equal chances let expect."""
    counts, _ = np.histogram(kept, bins=bins, range=(0, n))
    expected = len(kept) / bins
    return float(((counts - expected) ** 2 / expected).sum() / (bins - 1))


@pytest.mark.parametrize("n", [40, 3000])
def test_every_frame_is_kept_with_the_same_chance(n):
    """No frame after the 108th used to be."""
    kept = []
    for seed in range(600 if n == 40 else 100):
        sample = Sample(seed)
        sample.add(torch.arange(n)[:, None], ["a"] * n)
        kept += sample.of("a")[:, 0].tolist()
    assert chi_square(kept, n, bins=20) < 2
    assert max(kept) > 0.99 * (n - 1)


@pytest.mark.parametrize("sizes", [(300, 300), (30, 400), (5, 40)])
def test_every_frame_of_merged_samples_is_kept_with_the_same_chance(sizes):
    n = sum(sizes)
    kept = []
    for seed in range(500):
        sample, again, other = Sample(seed), Sample(seed), Sample(seed + 10_000)
        other.add(torch.arange(sizes[0], n)[:, None], ["a"] * sizes[1])
        other.add(torch.tensor([[7], [8]]), ["b"] * 2)
        for some in (sample, again):
            some.add(torch.arange(sizes[0])[:, None], ["a"] * sizes[0])
            some.merge(other)
        assert sample.seen == {"a": n, "b": 2}
        assert sample.of("b")[:, 0].tolist() == [7, 8]
        assert torch.equal(again.of("a"), sample.of("a"))
        found = sample.of("a")[:, 0].tolist()
        assert len(set(found)) == min(KEPT, n)
        kept += found
    assert chi_square(kept, n, bins=15) < 2.2


def test_decisions_are_shares_of_pixels():
    frames, labels = Speckle(0).frames(50)
    model = HDCClassifier().fit(frames, labels)
    expected = -model.distances(frames) / D
    np.testing.assert_allclose(model.decision_function(frames), expected)
    two = labels < 2
    model.fit(frames[two], labels[two])
    distances = model.distances(frames)
    expected = (distances[:, 0] - distances[:, 1]) / D
    np.testing.assert_allclose(model.decision_function(frames), expected)
    assert ((model.decision_function(frames) > 0) == (model.predict(frames) == 1)).all()


# Read-outs that are compared by their own scores --------------------------------------------------


OTHERS = ["ridge", "lda", "kernel", "trained", "neighbours", Nearest()]


@pytest.mark.parametrize("readout", OTHERS, ids=str)
@pytest.mark.parametrize("per_class", [8, 25])
def test_other_read_outs_cover_about_what_is_asked_and_refuse_junk(readout, per_class):
    covered, refused, unknown = [], [], []
    for seed in range(6):
        speckle = Speckle(seed)
        model = HDCClassifier(readout=readout).fit(*speckle.frames(5 * per_class))
        frames, labels = speckle.frames(200)
        covered.append(_share_of_right(model.predict_set(frames, 0.2), labels))
        refused.append(1 - model.is_known(frames, 0.2).mean())
        others, _ = speckle.frames(50, speckle.of_new_classes())
        unknown.append(1 - model.is_known(others, 0.2).mean())
    assert 0.72 < np.mean(covered) < 0.93, covered
    assert np.mean(refused) < 0.28, refused
    assert np.mean(unknown) > 0.5, unknown


@pytest.mark.parametrize("readout", ["majority", "counts", *OTHERS], ids=str)
def test_a_set_that_is_not_empty_has_the_label_of_the_prediction(readout):
    """Of classes of unlike noise 29 of 240 labels lay outside their own set."""
    draw, labels = noisy(0, [1, 3, 9]), np.repeat([0, 1, 2], 25)
    model = HDCClassifier(readout=readout).fit(draw(labels), labels)
    queries = draw(np.repeat([0, 1, 2], 80))
    sets = model.predict_set(queries, 0.2)
    known = model.is_known(queries, 0.2)
    assert 0 < known.sum() < 240
    pairs = zip(model.predict(queries), sets, known, strict=True)
    for label, found, is_known in pairs:
        assert (len(found) > 0) == is_known
        assert not is_known or label in found


def test_p_values_of_scores_are_shares_of_left_out_frames_with_lower_ones():
    """With ridge regression, whose left-out scores are those of models without the frame."""
    speckle = Speckle(2, classes=2)
    frames, labels = speckle.frames(40)
    queries, _ = speckle.frames(30)
    readout = Ridge(1.0)
    model = HDCClassifier(readout=readout).fit(frames, labels)
    scores = model.readout_.scores(model.encoder_.encode(torch.from_numpy(queries)))
    left_out = []
    for i in range(40):
        others = np.arange(40) != i
        again = HDCClassifier(readout=readout).fit(frames[others], labels[others])
        one = again.encoder_.encode(torch.from_numpy(frames[i : i + 1]))
        left_out.append(float(again.readout_.scores(one)[0, labels[i]]))
    words = model.encoder_.encode(torch.from_numpy(queries))
    found = model._learned.conformal().p_values(words, scores, 0.2)
    for c in range(2):
        own = np.array(left_out)[labels == c]
        for q in range(30):
            lower = (own <= float(scores[q, c])).sum()
            assert found[q, c] == pytest.approx((1 + lower) / 21, abs=2.1 / 21)
    assert len(np.unique(found)) > 5


@pytest.mark.parametrize("readout", [LDA(), Kernel([1], [0.1])])
def test_a_rare_class_is_not_in_every_set(readout):
    """Of 400 frames that are scored without themselves, evenly spread, it has two or three."""
    speckle = Speckle(4, classes=2)
    many, labels = speckle.frames(2400)
    rare = np.flatnonzero(labels)[:8]
    rows = np.concatenate([np.flatnonzero(labels == 0), rare])
    model = HDCClassifier(readout=readout).fit(many[rows], labels[rows])
    frames, truth = speckle.frames(100)
    found = model.predict_set(frames, 0.2)
    assert np.mean([1 in one for one in found]) < 0.8
    held = [label in one for label, one in zip(truth, found, strict=True)]
    assert np.mean(held) > 0.7
    assert model.is_known(junk(), 0.2).mean() < 0.5


def test_classes_without_new_frames_keep_their_left_out_scores():
    speckle = Speckle(6)
    frames, labels = speckle.frames(100)
    model = HDCClassifier(readout="ridge").fit(frames, labels)
    few = labels < 2
    with pytest.warns(UserWarning, match="no new frames of 2, 3, 4"):
        model.recalibrate(frames[few], labels[few])
    assert [len(own) for own in model._learned.conformal().peers] == [20] * 5
    assert model.is_known(junk(), 0.2).mean() < 0.5


@pytest.mark.parametrize("p", [0.5, 1])
@pytest.mark.parametrize("readout", ["lda", "kernel"])
def test_left_out_scores_have_the_unit_of_the_scores_beside_them(readout, p):
    """A recalibration changes the unit in which discriminants are given."""
    speckle = Speckle(6)
    frames, labels = speckle.frames(100)
    queries, truth = speckle.frames(200)
    model = HDCClassifier(readout=readout).fit(frames, labels)
    words = model.encoder_.encode(torch.from_numpy(queries))

    def found():
        kept = model._learned.conformal().peers[4].distances
        return [kept, -model.readout_.scores(words)[:, 4].double().numpy()]

    before = found()
    few = labels < 2
    with pytest.warns(UserWarning, match="no new frames of 2, 3, 4"):
        model.recalibrate(frames[few], labels[few], p)
    after = found()
    factors = [new @ old / (old @ old) for new, old in zip(after, before, strict=True)]
    assert factors[0] == pytest.approx(factors[1], rel=0.05, abs=1e-9)
    if p < 1:
        own = model.is_known(queries[truth == 4], 0.2)
        assert 0.6 < own.mean() < 0.97


# One class ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("readout", ["majority", "counts", "neighbours"])
def test_one_class_is_told_from_what_is_unknown(readout, tmp_path):
    speckle = Speckle(0, classes=1)
    frames, labels = speckle.frames(60)
    model = HDCClassifier(readout=readout).fit(frames, ["touch"] * 60)
    fresh, _ = speckle.frames(200)
    others, _ = speckle.frames(200, speckle.of_new_classes())
    model.save(tmp_path / "m")
    for asked in (model, HDCClassifier.load(tmp_path / "m")):
        assert 0.1 < 1 - asked.is_known(fresh, 0.2).mean() < 0.32
        assert asked.is_known(others, 0.2).mean() < 0.1
        assert set(asked.predict(fresh)) == {"touch"}
        assert (asked.predict_proba(fresh) == 1).all()
    first = HDCClassifier(readout=readout).partial_fit(frames[:20], labels[:20])
    assert not first.is_known(others, 0.2).all()
    assert (
        first.partial_fit(others[:20], labels[:20] + 1).score(others, [1] * 200) > 0.9
    )


@pytest.mark.parametrize("readout", ["ridge", "lda", "kernel", "trained"])
def test_a_read_out_that_tells_classes_apart_refuses_one(readout):
    frames, labels = Speckle(0, classes=1).frames(10)
    with pytest.raises(
        ValueError, match=r"^labels: expected at least two classes for "
    ):
        HDCClassifier(readout=readout).fit(frames, labels)


# Words of version 2.0 -----------------------------------------------------------------------------


def test_words_of_version_2_0_name_those_of_today():
    frames, labels = Speckle(0).frames(50)
    model = HDCClassifier("reference").fit(frames, labels)
    for call, message in (
        (lambda: model.predict(frames, reject=True), r"predict: expected is_known\("),
        (lambda: model.is_known(frames, reject=0.1), "is_known: expected alpha, found"),
        (lambda: Plan.of(model, "touch", reject=0.1), "of: expected alpha, found"),
    ):
        with pytest.raises(TypeError, match=f"^{message}") as caught:
            call()
        assert "\n" not in str(caught.value)
    with pytest.raises(ValueError, match=r"^recalibrate: .*labels: rezero\(frames\)$"):
        model.recalibrate(frames)


@pytest.mark.parametrize("readout", ["majority", "neighbours", "ridge", "lda"])
def test_a_file_of_version_2_0_predicts_and_says_where_it_lacks_scores(
    readout, tmp_path
):
    """Such a file has the sharpness of probabilities, and no scores of left-out frames."""
    speckle = Speckle(0)
    model = HDCClassifier(readout=readout).fit(*speckle.frames(50))
    queries, _ = speckle.frames(30)
    model.save(tmp_path / "m")
    header, tensors = io.read_model(tmp_path / "m")
    old = {k: v for k, v in tensors.items() if not k.startswith("held_out.")}
    assert (len(old) < len(tensors)) == (readout in ("ridge", "lda"))
    header["sharpness"] = None
    if len(old) < len(tensors):
        header["sharpness"] = model._learned.temperature().sharpness
    io.write_model(tmp_path / "m", header, old, lambda *_: None)
    loaded = HDCClassifier.load(tmp_path / "m")
    assert np.array_equal(loaded.predict(queries), model.predict(queries))
    assert np.array_equal(loaded.predict_proba(queries), model.predict_proba(queries))
    if len(old) == len(tensors):
        expected = model.is_known(queries, 0.2)
        assert np.array_equal(loaded.is_known(queries, 0.2), expected)
        return
    for call in (loaded.predict_set, loaded.is_known):
        with pytest.raises(ValueError, match=r"saved by version 2\.0, of .*; fit anew"):
            call(queries, 0.2)


@pytest.mark.parametrize("drifts", [False, True])
def test_classes_without_new_frames_are_still_known(drifts: bool) -> None:
    """Their left-out scores were those of the weights of before, and 1 % of them was known."""
    speckle = Speckle(1)
    frames, labels = speckle.frames(200)
    queries, truth = speckle.frames(400)
    new, now = speckle.frames(100, speckle.of_new_classes() if drifts else None)
    model = HDCClassifier(readout="ridge").fit(frames, labels)
    others = truth > 1
    before = model.is_known(queries[others], 0.2).mean()
    with pytest.warns(UserWarning, match="no new frames of 2, 3, 4"):
        model.recalibrate(new[now < 2], now[now < 2])
    assert model.score(queries[others], truth[others]) > 0.9
    assert model.is_known(queries[others], 0.2).mean() > before - 0.1


def test_a_frame_is_known_where_its_set_is_not_empty():
    """By default, too, with as many frames as users have."""
    frames, labels = _noisy(8, 40)
    model = HDCClassifier().fit(frames[::2], labels[::2])
    asked = np.concatenate([frames[1::2], np.flip(frames[1::2], (1, 2))])
    sets = model.predict_set(asked)
    known = model.is_known(asked)
    assert known.tolist() == [len(one) > 0 for one in sets]
    assert 0 < known.sum() < len(known)


def _noisy(classes: int, each: int) -> tuple[np.ndarray, np.ndarray]:
    """Frames [N, 20, 20] of patterns under noise, and their labels."""
    rng = np.random.default_rng(5)
    labels = np.repeat(np.arange(classes), 2 * each)
    light = rng.uniform(0, 200, (classes, 20, 20))[labels]
    noisy = (light + rng.normal(0, 90, light.shape)).clip(0, 255)
    return noisy.astype(np.uint8), labels
