"""Conformal sets and rejection: exact distances, and coverage on fresh frames."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits, io, planes
from hdc import sample as sampling
from hdc.conformal import FEWEST, Conformal, Peers
from hdc.encoders import Median
from hdc.export import Plan
from hdc.prototypes import tie_breaker
from hdc.readouts import LDA, Kernel, Majority, Ridge
from hdc.sample import KEPT, Reservoir, Sample
from tests.hdc.own import Nearest, fitted

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


def learned(words: list[torch.Tensor], ties: str = "zero", d: int = 14, seed: int = 0):
    """A majority of each class, and the peers of its frames."""
    rows = torch.cat([torch.full((len(w),), c) for c, w in enumerate(words)])
    part = Majority(ties, random_state=seed)
    model = fitted(part, torch.cat(words), rows, len(words), d)
    deciding = part.deciding(model.state)
    return model, [Peers.of(w, deciding[c]) for c, w in enumerate(words)]


def p_values(peers, prototypes, words: torch.Tensor, alpha: float) -> np.ndarray:
    """Those of hypervectors, whatever their scores."""
    scores = torch.zeros(len(words), len(peers))
    return Conformal(peers, prototypes).p_values(words, scores, alpha)


def junk(seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).integers(0, 256, (50, D))
    return np.concatenate([noise, np.zeros((1, D)), np.full((1, D), 255)]).astype(
        np.uint8
    )


def plain_p(peers, prototypes, words: torch.Tensor, alpha: float) -> np.ndarray:
    """p-values by their definition, frame by frame."""
    p = np.zeros((len(words), len(peers)))
    for c, own in enumerate(peers):
        if own is None:
            continue
        distances = bits.hamming(words, prototypes)[:, c].tolist()
        for q, (d, d_i) in enumerate(zip(distances, own.compared(words), strict=True)):
            m = len(d_i)
            others = [
                e
                for b, x in enumerate(peers)
                if x and b != c and len(x) >= FEWEST
                for e in x.held_out - np.mean(x.held_out)
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
    model, peers = learned(words)
    queries = torch.from_numpy(rng.integers(0, 2**14, (60, 1)))
    none = torch.zeros(1, 1, dtype=torch.int64)
    for known, prototypes in (
        ([None, *peers], torch.cat((none, model.prototypes))),
        (peers[:1], model.prototypes[:1]),
    ):
        np.testing.assert_allclose(
            p_values(known, prototypes, queries, alpha),
            plain_p(known, prototypes, queries, alpha),
        )


def test_too_small_a_share_is_named():
    words = torch.arange(39).reshape(-1, 1)
    model, peers = learned([words])
    peers, prototypes = [None, *peers], model.prototypes.repeat(2, 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        p_values(peers, prototypes, words, 1 / 40)
    text = "alpha=0.0244 needs at least 40 stored frames, found 39; no frame is refused"
    with pytest.warns(UserWarning, match=f"^{text}"):
        p_values(peers, prototypes, words, 0.0244)


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


@pytest.mark.parametrize("ties", planes.TIES)
@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 12])
def test_distances_are_those_of_counting_anew(n, ties):
    """With the new frame in the place of a kept one, and with a kept one left out."""
    rng = np.random.default_rng(n)
    words = bits.pack(torch.from_numpy(rng.random((n + 3, 333)) < rng.random(333)))
    kept, fresh = words[:n], words[n:]
    model, (peers,) = learned([kept], ties, 333, seed=3)
    breaker = tie_breaker(333, 3, 0)
    d_i = peers.compared(fresh)
    majority = bits.majority(kept, ties, breaker)
    assert torch.equal(model.prototypes[0], majority)
    for i in range(n):
        others = torch.cat((kept[:i], kept[i + 1 :]))
        for q, x in enumerate(fresh):
            exchanged = bits.majority(torch.cat((others, x[None])), ties, breaker)
            assert d_i[q, i] == int(bits.hamming(kept[i : i + 1], exchanged[None]))
        if n > 1:
            without = bits.majority(others, ties, breaker)
            expected = int(bits.hamming(kept[i : i + 1], without[None]))
            assert peers.held_out[i] == expected


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
        peers = model._head.conformal.peers[0]
        d_i = peers.compared(Median().encode(torch.from_numpy(x)))
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
        reservoir = Reservoir()
        for start, n in zip(np.cumsum([0, *cuts]), cuts, strict=False):
            reservoir.add(words[start : start + n], labels[start : start + n])
        sample = reservoir.sample()
        samples.append(torch.cat([sample.kept["a"], sample.kept["b"]]))
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


def drawn(numbers: torch.Tensor) -> Sample:
    """A sample of hypervectors of one word, all of class "a"."""
    reservoir = Reservoir()
    reservoir.add(numbers[:, None], ["a"] * len(numbers))
    return reservoir.sample()


@pytest.mark.parametrize("n", [40, 3000])
def test_every_frame_is_kept_with_the_same_chance(n, monkeypatch):
    """No frame after the 108th used to be."""
    kept = []
    for seed in range(600 if n == 40 else 100):
        monkeypatch.setattr(sampling, "_SEED", seed)
        kept += drawn(torch.arange(n)).kept["a"][:, 0].tolist()
    assert chi_square(kept, n, bins=20) < 2
    assert max(kept) > 0.99 * (n - 1)


@pytest.mark.parametrize("sizes", [(300, 300), (30, 400), (5, 40)])
def test_every_frame_of_merged_samples_is_kept_with_the_same_chance(sizes, monkeypatch):
    n = sum(sizes)
    kept = []
    for seed in range(500):
        monkeypatch.setattr(sampling, "_SEED", seed + 10_000)
        other = drawn(torch.arange(sizes[0], n))
        monkeypatch.setattr(sampling, "_SEED", seed)
        mine = drawn(torch.arange(sizes[0]))
        sample, again = mine.merged(other), mine.merged(other)
        assert sample.seen == {"a": n}
        assert torch.equal(again.kept["a"], sample.kept["a"])
        found = sample.kept["a"][:, 0].tolist()
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
    words = model.encode(queries)
    scores = model._head.scores(words)
    left_out = []
    for i in range(40):
        others = np.arange(40) != i
        again = HDCClassifier(readout=readout).fit(frames[others], labels[others])
        one = again.encode(frames[i : i + 1])
        left_out.append(float(again._head.scores(one)[0, labels[i]]))
    found = model.p_values(words, 0.2)
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


@pytest.mark.parametrize("readout", ["ridge", "lda", "kernel"])
def test_a_recalibration_without_frames_of_all_classes_leaves_no_sets(
    readout, tmp_path
):
    """Scores of before and of now are in two units."""
    speckle = Speckle(6)
    frames, labels = speckle.frames(100)
    model = HDCClassifier(readout=readout).fit(frames, labels)
    few = labels < 2
    with pytest.warns(UserWarning, match="no new frames of 2, 3, 4"):
        model.recalibrate(frames[few], labels[few])
    model.predict(frames)
    for ask in (model.predict_set, model.is_known, model.predict_proba):
        with pytest.raises(
            ValueError, match=r"recalibrated, or .* frames of all classes"
        ):
            ask(frames)
    model.recalibrate(frames[::2], labels[::2]).save(tmp_path / "m")
    assert model.is_known(frames, 0.2).mean() > 0.5
    assert model.is_known(junk(), 0.2).mean() < 0.5


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
        header["sharpness"] = model._head.temperature.sharpness
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
