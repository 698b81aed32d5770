"""Which samples train and which test: what a split keeps apart, and what a user is warned of."""

import numpy as np
import pytest

from experiments.protocol.settings import Split
from experiments.protocol.splits import choose, nested, resample_split
from scenes.frames import Frames


def split(kind="random", n_train=None, test_fraction=0.2):
    return Split(kind, test_fraction, n_train=n_train)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (
            split("sorted"),
            r"split\.kind: expected one of random, ordered, grouped, "
            r"leave_group_out, session, found 'sorted'",
        ),
        (split(n_train=2), r"split\.n_train: expected an integer from 3 .* found 2"),
        (
            split(n_train=19),
            r"split\.n_train: .* of the 3 classes, such as 18 or 21, found 19",
        ),
        (split(n_train=49), r"split\.n_train: expected .* 48, found 49"),
        (
            Split("grouped", 0.2, group="day"),
            r"split\.group: expected one of order, session, found 'day'",
        ),
    ],
)
def test_a_split_that_does_not_fit_names_its_key(wanted, message, make_scene):
    with pytest.raises(ValueError, match=message):
        choose(make_scene(), wanted, 0)


def in_order_of_class(make_scene, origin, sessions):
    """Frames of each class one after another, as a camera records them; each session counts its
    times from 0."""
    scene, n = make_scene(n=120, origin=origin, sessions=sessions), 120 // sessions
    of_one = np.sort(scene.labels[:n])
    labels = np.concatenate([np.roll(of_one, s) for s in range(sessions)])
    samples = scene.samples | {"order": np.tile(np.arange(n), sessions)}
    return Frames(scene.images, labels, scene.classes, samples, origin=origin)


@pytest.mark.parametrize(
    ("origin", "sessions", "kind", "warned"),
    [
        ("recorded", 1, "random", True),
        ("recorded", 3, "random", True),
        ("recorded", 1, "ordered", False),
        ("simulated", 1, "random", False),
        ("measured", 1, "random", False),
    ],
)
def test_only_a_random_split_of_a_recording_warns_of_copies(
    make_scene, recwarn, origin, sessions, kind, warned
):
    scene = in_order_of_class(make_scene, origin, sessions)
    choose(scene, split(kind), 0)
    assert [str(each.message)[:19] for each in recwarn] == [
        "split.kind=random: "
    ] * warned


def test_a_class_that_only_test_frames_have_is_named(make_scene):
    """A split by session trained without one of the classes, and said nothing."""
    scene = make_scene(n=90, sessions=3)  # nobody learns or tests the second one
    labels = scene.labels.copy()
    labels[:30][labels[:30] == 2] = 0
    scene = Frames(
        scene.images, labels, scene.classes, scene.samples, origin="recorded"
    )
    expected = "split.kind=session: no training frame of c: every model has the 10 test"
    with pytest.warns(UserWarning, match=expected):
        choose(scene, split("session"), 0)


def test_a_group_is_on_one_side(make_scene):
    scene = make_scene()
    pairs = np.arange(60) // 6
    samples = scene.samples | {"pair": pairs}
    scene = Frames(scene.images, scene.labels, scene.classes, samples)
    train, test = choose(scene, Split("grouped", 0.2, group="pair"), 0)
    assert len(np.unique(pairs[test])) == 2
    assert set(pairs[train]) == set(range(10)) - set(pairs[test])


def test_a_draw_is_that_of_its_seed_and_its_order_has_a_stream_of_its_own(make_scene):
    """By definition: a split's seed is the first integer of the stream (seed, draw), and the order
    of the samples is of the stream (seed, draw, 1)."""
    scene = make_scene()
    for seed in ((0, 0), (0, 1), (3, 2)):
        pool, test = resample_split(scene, split(n_train=9), seed, most_test=1000)
        drawn = int(np.random.default_rng(seed).integers(2**31))
        expected = choose(scene, split(), drawn)  # n_train is no matter of a draw
        np.testing.assert_array_equal(pool, expected[0])
        np.testing.assert_array_equal(test, expected[1])
        order, sizes = nested(pool, scene.labels, [2, 16, 17], seed)
        shuffled = np.random.default_rng((*seed, 1)).permutation(pool)
        for label, of_class in enumerate(order):
            is_of_class = scene.labels[shuffled] == label
            np.testing.assert_array_equal(of_class, shuffled[is_of_class])
        assert sizes == [2, 16]  # 48 samples of three classes train


def sessions_named(make_scene, names):
    scene = make_scene(sessions=len(names))
    numbers = scene.samples["session"]
    samples = {**scene.samples, "session_name": np.array(names)[numbers]}
    return Frames(scene.images, scene.labels, scene.classes, samples)


@pytest.mark.parametrize(
    ("names", "trains", "tests"),
    [
        (("test", "train"), "train", "test"),
        (("Test", "Training", "val"), "Training", "Test"),
        (("train", "valid"), "train", "valid"),
        (("a", "b", "train"), "a", "train"),  # these names do not say
    ],
)
def test_sessions_named_by_their_use_are_used_so(
    make_scene, recwarn, names, trains, tests
):
    scene = sessions_named(make_scene, names)
    train, test = choose(scene, split("session"), 0)
    assert set(scene.samples["session_name"][train]) == {trains}
    assert set(scene.samples["session_name"][test]) == {tests}
    told = "".join(str(each.message) for each in recwarn)
    assert ("val (20 of 60 frames) is not used" in told) == ("val" in names)


def test_most_frames_are_used(make_scene):
    scene = sessions_named(make_scene, ("test", "train", "x1", "x2", "x3"))
    expected = (
        r"test tests, x1, x2, x3 \(36 of 60 frames\) is not used: expected at most"
    )
    with pytest.raises(ValueError, match=expected):
        choose(scene, split("session"), 0)
