"""One more frame in one class: who takes whose frames, by the published rule and by the remedy."""

import numpy as np
import pytest
import torch
from matplotlib import pyplot as plt

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.results import Results
from experiments.studies.unequal import view
from experiments.studies.unequal.measure import unequal
from scenes.frames import Frames

MODELS = {
    n: configs.part("model", n)
    for n in ("hdc", "hdc_random_ties", "hdc_integer", "ridge")
}
MODELS |= {
    "hdc_balanced": configs.part("model", "hdc_balanced"),
    "mean_image": configs.part("model", "mean_image"),
}
SPLIT = {"kind": "random", "test_fraction": 0.5, "group": None}


@pytest.fixture(scope="module")
def scene():
    """Four classes that share much and differ in little: correlations of touched speckle."""
    rng = np.random.default_rng(2)
    labels = np.tile(np.arange(4), 40)
    floor, base = rng.normal(size=6400), rng.normal(size=(4, 6400))
    frames = 0.6 * floor + 0.2 * base[labels] + rng.normal(size=(160, 6400))
    images = np.clip(128 + 35 * frames, 0, 255).astype(np.uint8).reshape(160, 80, 80)
    return Frames(torch.from_numpy(images), labels, tuple("ABCD"), origin="simulated")


@pytest.fixture
def rows(scene, monkeypatch):
    """Rows of two draws."""
    monkeypatch.setattr(Run, "scene", lambda *_: scene)
    made = unequal.rows(
        Run(),
        {},
        SPLIT,
        MODELS,
        seeds=[0],
        n_per_class=[4, 5, 99],
        draws=2,
        most_test=60,
    )
    return list(made)


def by(rows, model, extra):
    """Shares of right answers [draws, n] and of those that name the larger class."""
    chosen = [row for row in rows if (row["model"], row["extra"]) == (model, extra)]
    return (
        np.array([row[key] for row in chosen]) / 60 for key in ("right", "to_larger")
    )


def test_the_larger_class_takes_the_frames_of_others_by_the_published_rule_only(rows):
    equal, _ = by(rows, "hdc", 0)
    one_more, to_larger = by(rows, "hdc", 1)
    balanced, _ = by(rows, "hdc_balanced", 1)
    assert (one_more[:, 0] < equal[:, 0] - 0.2).all()
    assert (to_larger[:, 0] > 0.5).all()
    assert abs(balanced - equal).max() <= 0.1


def test_a_frame_more_than_an_odd_number_changes_little(rows):
    equal, _ = by(rows, "hdc_random_ties", 0)
    one_more, _ = by(rows, "hdc_random_ties", 1)
    loss = equal - one_more
    assert (loss[:, 0] > loss[:, 1] + 0.1).all()  # from 4 to 5, and from 5 to 6


def test_equal_classes_are_as_published_with_the_remedy(rows):
    for published, balanced in zip(
        by(rows, "hdc", 0), by(rows, "hdc_balanced", 0), strict=True
    ):
        assert (published == balanced).all()


def test_sizes_that_a_class_cannot_fill_are_left_out(rows):
    assert {tuple(row["n"]) for row in rows} == {(4, 5)}


@pytest.mark.parametrize(("n", "odd"), [(4, 3), (5, 5), (10, 9)])
def test_the_majority_multiplies_a_small_correlation_by_the_stated_factor(n, odd):
    from math import comb

    from hdc.theory import expected

    tiny = np.full((2, 2), 1e-4)
    gain = expected(tiny, np.array([n, n]), np.full(2, 1e-6))[0, 1] / 1e-4
    assert gain == pytest.approx(
        odd * comb(odd - 1, (odd - 1) // 2) / 2 ** (odd - 1), rel=0.01
    )
    assert gain == pytest.approx((2 * odd / np.pi) ** 0.5, rel=0.1)


def test_table_and_figure_tell_the_loss(scene, monkeypatch, tmp_path):
    monkeypatch.setattr(Run, "scene", lambda *_: scene)
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    unequal(
        name="unequal", scene_name="finger", device="cpu", scene={}, split=SPLIT, models=MODELS,
        seeds=[0, 1], n_per_class=[4, 5], extra=[0, 1], draws=1,
    )  # fmt: skip
    results = Results(tmp_path)
    (table,) = view.STUDY.tables_of(results)
    row = table.data.iloc[0]
    assert (row.recording, row.n, row.extra) == ("finger", 4, 1)
    assert row.hdc < -0.1
    (plot,) = view.STUDY.plots_of(results)
    axes = plot.draw().axes[0]
    equal, published = (line.get_ydata() for line in axes.lines[:2])
    assert published[0] < equal[0] - 10
    plt.close("all")
