"""Rejection where groups are held out: counts and areas by their definition, frame by frame."""

import numpy as np
import pytest
import torch

from experiments.protocol.settings import Split
from experiments.protocol.splits import nested, resample_split
from experiments.protocol.task import Context
from experiments.studies.promises.rejection.measure import Rejection
from hdc import HDCClassifier
from scenes.frames import Frames
from tests.experiments import composed

SPLIT = {"kind": "leave_group_out", "test_fraction": 0.2, "group": "object"}
CLASSES, OBJECTS, OF_OBJECT = tuple("ABCD"), 4, 6
ALPHA, N = 0.2, 8


@pytest.fixture
def scene(monkeypatch):
    """Frames whose 64 grey values differ, of four classes with four objects each."""
    random = np.random.default_rng(5)
    shape = len(CLASSES), OBJECTS, OF_OBJECT
    labels, objects, _ = (part.flatten() for part in np.indices(shape))
    pixels = random.normal(0, 1, (4, 64))[labels]
    pixels += random.normal(0, 0.5, (4, OBJECTS, 64))[labels, objects]
    pixels += random.normal(0, 1.5, pixels.shape)
    ranks = pixels.argsort(1).argsort(1).astype(np.uint8)
    images = torch.from_numpy(ranks.reshape(-1, 8, 8))
    made = Frames(images, labels, CLASSES, {"object": objects}, "measured")
    monkeypatch.setattr(Context, "scene", lambda *_: made)
    return made


def rows_of(*models, split=SPLIT):
    """Rows of two draws, which leave each class out once."""
    named = {name: composed.part("model", name) for name in models}
    numbers = {"n_per_class": N, "draws": 2, "n_left_out": 2, "alpha": ALPHA}
    config = composed.task("rejection") | {"scene": {}, "split": split, **numbers}
    task = composed.made(Rejection, **config | {"models": named})
    return list(task.rows(Context()))


def nearest(bits, prototypes):
    """Distances of bits [Q, D] to the nearest prototype."""
    return np.min([(bits != one).sum(1) for one in prototypes], axis=0)


def area(known, unknown):
    """Share of the pairs in which the unknown frame is farther; equal ones count half."""
    return np.mean([(u > k) + (u == k) / 2 for u in unknown for k in known])


def by_definition(scene, draw, left_out):
    """Counts, the area, and the training and test frames of a draw without a class."""
    pool, test = resample_split(scene, Split(**SPLIT), (0, draw), 200)
    order, _ = nested(pool, scene.labels, [], (0, draw))
    train = np.concatenate([of_class[:N] for of_class in order])
    train = train[scene.labels[train] != left_out]
    objects = OBJECTS * scene.labels + scene.samples["object"]
    bits = scene.images.numpy().reshape(-1, 64) >= 32  # above the median of 0 … 63

    def prototypes(frames):
        of_classes = [bits[frames[scene.labels[frames] == c]] for c in range(4)]
        return [2 * of.sum(0) > len(of) for of in of_classes if len(of)]

    apart = []
    for one in train:
        others = train[objects[train] != objects[one]]
        apart.append(nearest(bits[[one]], prototypes(others))[0])
    farthest = sorted(apart)[-int(ALPHA * (len(apart) + 1))]
    distances = nearest(bits[test], prototypes(train))
    unknown = scene.labels[test] == left_out
    group = np.unique(objects[test[~unknown]])
    of_groups = [distances[objects[test] == one] for one in group]
    counts = {
        "group": group.tolist(),
        "known": [len(of) for of in of_groups],
        "refused": [(of > farthest).sum() for of in of_groups],
        "unknown": unknown.sum(),
        "unknown_refused": (distances[unknown] > farthest).sum(),
    }
    return counts, area(distances[~unknown], distances[unknown]), train, test


def test_counts_and_areas_are_those_of_the_definition(scene):
    rows = rows_of("hdc", "hdc_lda")
    assert [row["left_out"] for row in rows[::2]] == [*CLASSES]
    for hdc, lda in zip(rows[::2], rows[1::2], strict=True):
        left_out = CLASSES.index(hdc["left_out"])
        counts, apart, train, test = by_definition(scene, hdc["draw"], left_out)
        for row in (hdc, lda):  # one rule for all read-outs
            assert {name: row[name] for name in counts} == counts
            assert row["area"] == pytest.approx(apart)
        assert hdc["area_of_scores"] == hdc["area"]
        model = HDCClassifier(readout="lda")
        model.fit(scene.images[train], scene.labels[train])
        best = model.decision_function(scene.images[test]).max(1)
        unknown = scene.labels[test] == left_out
        assert lda["area_of_scores"] == pytest.approx(
            area(-best[~unknown], -best[unknown])
        )
        assert lda["area_of_scores"] != lda["area"]
    known, refused = (
        sum(sum(row[name]) for row in rows) for name in ("known", "refused")
    )
    assert 0 < refused < known


def test_a_split_without_groups_is_refused(scene):
    with pytest.raises(ValueError, match=r"^split\.kind: expected grouped .* 'random'"):
        rows_of("hdc", split={"kind": "random", "test_fraction": 0.2})
