"""The hyperdimensional classifier against plain references, and its laws."""

from __future__ import annotations

import json
import struct
import subprocess
import sys

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from hdc import HDCClassifier, bits, classifier, planes
from hdc import encode as encoding
from hdc.encode import encode
from hdc.prototypes import Counters, recalibrate

DIMENSIONS = (1, 63, 64, 65, 127, 1000, 250_000)


def random_bits(n: int, d: int, seed: int = 0) -> Tensor:
    return torch.from_numpy(np.random.default_rng(seed).random((n, d)) < 0.5)


def touches(n: int = 60, classes: int = 3, side: int = 12) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    labels = np.arange(n) % classes
    base = rng.integers(0, 200, (classes, side, side))
    return (base[labels] + rng.integers(0, 56, (n, side, side))).astype(np.uint8), labels


@pytest.mark.parametrize("d", DIMENSIONS)
def test_pack_is_inverted_by_unpack_and_leaves_no_tail(d: int) -> None:
    mask = random_bits(3, d)
    words = bits.pack(mask)
    assert words.shape == (3, bits.words_for(d))
    assert torch.equal(bits.unpack(words, d), mask)
    assert torch.equal(bits.count_ones(words), mask.sum(1))
    assert torch.equal(bits.popcount(words).sum(1, dtype=torch.int64), mask.sum(1))


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize("n_prototypes", [1, 2, 5, 51])
def test_hamming_routes_agree_with_unpacked_bits(d: int, n_prototypes: int) -> None:
    queries, prototypes = random_bits(4, d), random_bits(n_prototypes, d, 1)
    expected = torch.stack([(queries ^ p).sum(1) for p in prototypes], 1)
    q, p = bits.pack(queries), bits.pack(prototypes)
    routes = [bits.hamming, bits.hamming_numpy, bits.hamming_torch]
    try:
        import numkong  # noqa: F401

        routes.append(bits.hamming_numkong)
    except ImportError:
        pass
    for route in routes:
        assert torch.equal(route(q, p), expected), route.__name__


def test_hamming_agrees_with_torchhd() -> None:
    torchhd = pytest.importorskip("torchhd")
    bsc = torchhd.tensors.bsc.BSCTensor
    queries, prototypes = random_bits(6, 1000), random_bits(5, 1000, 1)
    theirs = torchhd.hamming_similarity(queries.as_subclass(bsc), prototypes.as_subclass(bsc))
    ours = bits.hamming(bits.pack(queries), bits.pack(prototypes))
    torch.testing.assert_close(1000 - ours.double(), torch.as_tensor(theirs).double())


@pytest.mark.parametrize("n", [1, 2, 3, 80, 255, 256, 65_537])
@pytest.mark.parametrize("ties", bits.TIES)
def test_majority_is_the_count_compared_with_half(n: int, ties: str) -> None:
    d = 65 if n > 1000 else 1000
    vectors, breaker = random_bits(n, d), random_bits(1, d, 9)[0]
    counts = vectors.sum(0)
    tied = {"zero": torch.zeros(d), "one": torch.ones(d), "random": breaker}[ties].bool()
    expected = (2 * counts > n) | ((2 * counts == n) & tied)
    words = bits.pack(vectors)
    assert torch.equal(bits.unpack(bits.majority(words, ties, bits.pack(breaker)), d), expected)
    torch_route = bits.majority_of_counts(
        planes.vertical_sum_torch(words), n, ties, bits.pack(breaker)
    )
    assert torch.equal(bits.unpack(torch_route, d), expected)


def test_majority_agrees_with_torchhd_where_nothing_ties() -> None:
    torchhd = pytest.importorskip("torchhd")
    vectors = random_bits(81, 1000)
    theirs = torchhd.multiset(vectors.as_subclass(torchhd.tensors.bsc.BSCTensor))
    assert torch.equal(bits.unpack(bits.majority(bits.pack(vectors)), 1000), theirs.bool())


def test_random_ties_equal_an_added_random_hypervector() -> None:
    vectors, breaker = random_bits(10, 500), random_bits(1, 500, 3)
    together = bits.majority(bits.pack(torch.cat((vectors, breaker))))
    assert torch.equal(bits.majority(bits.pack(vectors), "random", bits.pack(breaker)[0]), together)


@given(st.integers(0, 300), st.integers(0, 2**9))
@settings(max_examples=40, deadline=None)
def test_greater_compares_every_counter(n: int, threshold: int) -> None:
    vectors = random_bits(n, 70, n)
    mask = planes.greater(planes.vertical_sum(bits.pack(vectors)), threshold)
    expected = vectors.sum(0) > threshold
    assert torch.equal(bits.unpack(mask, 70), expected)


def reference_encoding(frame: np.ndarray) -> np.ndarray:
    """The ⌊D/2⌋ largest pixels, equal ones in raster order."""
    flat = frame.reshape(-1).astype(float)
    order = np.lexsort((np.arange(flat.size), -flat))
    expected = np.zeros(flat.size, bool)
    expected[order[: flat.size // 2]] = True
    return expected


levels = st.sampled_from([1, 2, 3, 256])
shapes = st.sampled_from([1, 2, 63, 64, 65, 130, 700])


@given(st.lists(st.tuples(levels, st.integers(0, 255)), min_size=1, max_size=6), shapes)
@settings(max_examples=150, deadline=None)
@pytest.mark.filterwarnings("ignore:.*constant frame")
def test_encoding_is_the_upper_half_whatever_came_before(
    kinds: list[tuple[int, int]], d: int
) -> None:
    """Frames of few levels, of sudden jumps of brightness, constant and saturated."""
    scan = encoding._SCAN
    encoding._SCAN = 64  # so that the cut crosses many stretches
    try:
        rng = np.random.default_rng(d)
        pixels = np.stack([np.clip(o + rng.integers(0, n, d), 0, 255) for n, o in kinds])
        frames = torch.from_numpy(pixels.astype(np.uint8))
        words = encode(frames)
    finally:
        encoding._SCAN = scan
    for frame, word in zip(frames, words, strict=True):
        assert np.array_equal(bits.unpack(word, d).numpy(), reference_encoding(frame.numpy()))
    if d > 1:
        assert torch.equal(bits.pack(bits.unpack(encoding._encode_any(frames)[0], d)), words)


@pytest.mark.parametrize("dtype", [torch.uint16, torch.int16, torch.float32, torch.float16])
def test_other_pixel_types_are_thresholded_alike(dtype: torch.dtype) -> None:
    values = torch.randint(0, 2000, (3, 20, 20), generator=torch.Generator().manual_seed(0))
    frames = values.to(dtype)
    for frame, word in zip(frames, encode(frames), strict=True):
        expected = reference_encoding(frame.to(torch.float64).numpy())
        assert np.array_equal(bits.unpack(word, 400).numpy(), expected)


def test_full_size_frames_have_exactly_half_ones() -> None:
    rng = np.random.default_rng(0)
    frames = np.clip(rng.gamma(2, 25, (4, 500, 500)) * [[[1]], [[0.2]], [[3]], [[1]]], 0, 255)
    words = encode(torch.from_numpy(frames.astype(np.uint8)))
    assert bits.count_ones(words).tolist() == [125_000] * 4


def test_constant_frames_are_named() -> None:
    frames = torch.full((3, 8, 8), 7, dtype=torch.uint8)
    frames[1, 0, 0] = 9
    for batch in (frames, frames.float()):
        with pytest.warns(UserWarning, match="index 0, 2"):
            assert bits.count_ones(encode(batch)).tolist() == [32] * 3


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_pixels_that_are_not_finite_are_named(value: float) -> None:
    frames = torch.zeros(3, 4, 4)
    frames[2, 1, 1] = value
    with pytest.raises(ValueError, match=r"frames\[2\]: expected finite"):
        encode(frames)


def test_counters_do_not_care_about_order_or_shards() -> None:
    vectors, labels = bits.pack(random_bits(300, 200)), torch.arange(300) % 4
    whole = Counters(4, 200)
    whole.add(vectors, labels)
    shuffled, first, second = Counters(4, 200), Counters(4, 200), Counters(4, 200)
    order = torch.randperm(300, generator=torch.Generator().manual_seed(0))
    for part in order.split(37):
        shuffled.add(vectors[part], labels[part])
    first.add(vectors[:5], labels[:5])
    second.add(vectors[5:], labels[5:])
    first.merge(second)
    expected = torch.stack([bits.unpack(vectors[labels == c], 200).sum(0) for c in range(4)])
    for counters in (whole, shuffled, first):
        assert torch.equal(counters.counts(), expected)
        assert torch.equal(counters.majority(), whole.majority())


def test_a_class_without_samples_is_named() -> None:
    counters = Counters(3, 64)
    counters.add(bits.pack(random_bits(2, 64)), torch.tensor([0, 2]))
    with pytest.raises(ValueError, match="class 1: expected at least one sample"):
        counters.majority()


@pytest.mark.parametrize("p", [0.0, 0.25, 1.0])
def test_recalibration_replaces_a_share_p_of_the_bits(p: float) -> None:
    d = 100_000
    stored = bits.pack(torch.zeros(2, d, dtype=torch.bool))
    new = bits.pack(torch.ones(2, d, dtype=torch.bool))
    replaced = bits.unpack(recalibrate(stored, new, d, p, seed=3), d).double().mean().item()
    assert abs(replaced - p) <= 5 * (p * (1 - p) / (2 * d)) ** 0.5
    again = recalibrate(stored, new, d, p, seed=3)
    assert torch.equal(again, recalibrate(stored, new, d, p, seed=3))


def test_distance_between_random_hypervectors_spreads_as_one_over_root_d() -> None:
    spread = {}
    for d in (256, 4096, 65_536):
        words = bits.pack(random_bits(60, d, d))
        distances = bits.hamming(words, words).double() / d
        spread[d] = distances[~torch.eye(60, dtype=torch.bool)].std().item() * d**0.5
    assert all(abs(s - 0.5) < 0.05 for s in spread.values()), spread


def test_scikit_learn_can_use_it() -> None:
    from sklearn.base import clone, is_classifier
    from sklearn.model_selection import cross_val_score, learning_curve

    frames, labels = touches()
    model = HDCClassifier(ties="random", seed=4)
    assert clone(model).get_params() == model.get_params()
    assert is_classifier(model)
    assert cross_val_score(model, frames, labels, cv=3).min() > 0.9
    assert learning_curve(model, frames, labels, cv=3)[2].shape[1] == 3


def test_integer_prototypes_are_the_cosine_of_counts() -> None:
    frames, labels = touches()
    model = HDCClassifier(prototype="integer").fit(frames, labels)
    v = 2 * bits.unpack(encode(torch.from_numpy(frames)), 144).double() - 1
    c = torch.stack([v[torch.from_numpy(labels) == k].sum(0) for k in range(3)])
    cosine = (v @ c.T) / c.norm(dim=1)
    assert np.array_equal(model.predict(frames), cosine.argmax(1).numpy())
    torch.testing.assert_close(model._scores(frames), -cosine)


def test_streaming_gives_the_same_prototypes() -> None:
    frames, labels = touches()
    names = np.array(["left", "right", "none"])[labels]
    whole = HDCClassifier().fit(frames, names)
    parts = HDCClassifier().partial_fit(frames[:7], names[:7])
    parts.partial_fit((frames[i : i + 11], names[i : i + 11]) for i in range(7, 60, 11))
    assert torch.equal(whole.prototypes_, parts.prototypes_)
    assert whole.classes_.tolist() == parts.classes_.tolist() == ["left", "none", "right"]
    assert whole.counts_.tolist() == [20, 20, 20]


class Source:
    """Frames made when asked for; remembers how many were asked for at once."""

    def __init__(self, frames: np.ndarray):
        self.frames, self.shape, self.largest = frames, frames.shape, 0

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: slice) -> Tensor:
        batch = torch.from_numpy(self.frames[index])
        self.largest = max(self.largest, len(batch))
        return batch


def test_frames_are_asked_for_a_chunk_at_a_time() -> None:
    frames, labels = touches(300)
    source = Source(frames)
    model = HDCClassifier().fit(source, labels)
    assert source.largest == classifier.CHUNK < 300
    assert torch.equal(model.prototypes_, HDCClassifier().fit(frames, labels).prototypes_)
    assert [r["samples_seen"] for r in HDCClassifier().train(frames, labels)][-1] == 300


def test_labels_of_any_kind() -> None:
    frames, _ = touches(4, 2)
    labels = [("a", 1), 3, ("a", 1), 3]
    model = HDCClassifier().fit(frames, labels)
    assert model.predict(frames).tolist() == labels


def test_equal_distances_go_to_the_first_class() -> None:
    frames = np.array([[9, 0, 0, 9], [0, 9, 9, 0]], np.uint8)
    model = HDCClassifier().fit(frames, ["b", "a"])
    query = np.array([[9, 9, 0, 0]], np.uint8)
    assert model.distances(query).tolist() == [[2, 2]]
    assert model.predict(query).tolist() == ["a"]


def test_a_bit_flipped_in_the_state_is_flipped_in_the_model() -> None:
    frames, labels = touches()
    model = HDCClassifier().fit(frames, labels)
    before = model.distances(frames)
    model.state_tensors()["prototypes"][0, 0] ^= 1
    assert np.abs(model.distances(frames) - before)[:, 0].tolist() == [1] * 60


def test_recalibration_forgets_in_proportion() -> None:
    frames, labels = touches()
    model = HDCClassifier().fit(frames, labels)
    other = 255 - frames
    old = model.distances(frames).min(1).mean()
    model.recalibrate(other, labels, p=1)
    assert model.score(other, labels) == 1
    assert model.distances(frames).min(1).mean() > old


def bad_inputs() -> dict[str, tuple]:
    frames, labels = touches()
    trained = HDCClassifier().fit(frames, labels)
    return {
        "expected at least one frame": (HDCClassifier().fit, frames[:0], labels[:0]),
        "at least two classes, found only 1": (HDCClassifier().fit, frames[:3], [1, 1, 1]),
        "labels: expected 60, one a frame, found 59": (HDCClassifier().fit, frames, labels[:59]),
        r"frames\[1\]: expected shape \(12, 12\)": (
            HDCClassifier().fit, [frames[0], frames[1][:5]], [0, 1]),
        "expected D = 144 pixels": (trained.predict, frames[:, :5]),
        "p: expected a probability": (trained.recalibrate, frames, labels, 1.5),
        "found 9": (trained.recalibrate, frames[:2], [9, 9], 0.5),
        "ties: expected one of zero, one, random": (HDCClassifier(ties="x").fit, frames, labels),
        "expected a trained model": (HDCClassifier().predict, frames),
        "found NaN": (HDCClassifier().fit, frames[:2], np.array([0.0, np.nan])),
    }  # fmt: skip


@pytest.mark.parametrize("message", bad_inputs())
def test_bad_input_gets_one_clear_error(message: str) -> None:
    call, *arguments = bad_inputs()[message]
    with pytest.raises(ValueError, match=message):
        call(*arguments)


def test_a_saved_model_is_the_same_model(tmp_path) -> None:
    frames, labels = touches()
    model = HDCClassifier(seed=5).fit(frames, [f"class {c}" for c in labels])
    model.recalibrate(255 - frames[:9], [f"class {c}" for c in labels[:9]], p=0.5)
    model.save(tmp_path / "model.safetensors")
    loaded = HDCClassifier.load(tmp_path / "model.safetensors")
    assert loaded.get_params() == model.get_params()
    assert np.array_equal(loaded.distances(frames), model.distances(frames))
    assert np.array_equal(loaded.predict(frames), model.predict(frames))
    assert torch.equal(loaded.counters_.counts(), model.counters_.counts())


def test_damaged_model_files_are_named_and_never_crash(tmp_path) -> None:
    frames, labels = touches()
    path = tmp_path / "model.safetensors"
    HDCClassifier().fit(frames, labels).save(path)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    damaged = [whole[:n] for n in rng.integers(0, len(whole), 100)]
    for _ in range(300):
        content = bytearray(whole)
        content[rng.integers(len(content))] ^= 1 << rng.integers(8)
        damaged.append(bytes(content))
    header = json.dumps({"planes": {"dtype": "I64", "shape": [2**40], "data_offsets": [0, 2**43]}})
    damaged.append(struct.pack("<Q", len(header)) + header.encode())
    refused = 0
    for content in damaged:
        path.write_bytes(content)
        message = ""
        try:
            HDCClassifier.load(path).predict(frames)
        except ValueError as error:
            message = str(error)
            refused += 1
        assert not message or "model.safetensors" in message or "expected D" in message
    assert refused >= 101  # every truncation at least; a flipped prototype bit makes a valid model


def test_importing_loads_neither_images_nor_tables() -> None:
    code = "import sys, hdc; print([m for m in sys.argv[1:] if m in sys.modules])"
    heavy = ["cv2", "sklearn", "pandas", "matplotlib", "hydra", "scipy", "safetensors", "numba"]
    done = subprocess.run(
        [sys.executable, "-c", code, *heavy], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_same_bits_on_an_accelerator() -> None:
    frames, labels = touches()
    here = HDCClassifier().fit(frames, labels)
    there = HDCClassifier(device="cuda").fit(frames, labels)
    assert torch.equal(here.prototypes_, there.prototypes_.cpu())
    assert np.array_equal(here.distances(frames), there.distances(frames))
