"""The quantile that theory states: its laws, what it reads from frames, and its verdicts."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pandas as pd
import pytest
import torch
from rich.console import Console
from scipy.stats import multivariate_normal, norm

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.results import Results
from experiments.records.rows import pack_labels
from experiments.studies.quantiles import view
from experiments.studies.quantiles.measure import (
    light_of,
    quantile_correlation,
    quantile_theory,
)
from hdc import bits, theory
from hdc.encoders import Quantile
from hdc.theory import Light

pytestmark = pytest.mark.usefixtures("one_thread")
PIXELS = 20_000
QUANTILES = ["1/4", "1/2", "3/4"]


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.8])
@pytest.mark.parametrize("rho", [-0.5, 0.0, 0.3, 0.9])
def test_correlation_of_bits_is_that_of_two_gaussians(rho, share):
    threshold = norm.isf(share)
    covariance = [[1, rho], [rho, 1]]
    # Both above the threshold is both negatives below its negative.
    both = multivariate_normal.cdf([-threshold, -threshold], cov=covariance)
    expected = (both - share**2) / (share * (1 - share))
    assert quantile_correlation(rho, share) == pytest.approx(expected, abs=1e-5)


def test_at_the_median_it_is_the_arcsine_law():
    rho = np.linspace(-0.9, 1, 20)
    expected = 2 / np.pi * np.arcsin(rho)
    np.testing.assert_allclose(quantile_correlation(rho, 0.5), expected, atol=1e-12)
    with pytest.raises(ValueError, match=r"share: expected a number in \(0, 1\)"):
        quantile_correlation(0.5, 1.0)


def speckle(light: Light, rng: np.random.Generator, frames: int) -> np.ndarray:
    """Frames [2, frames, D] of two classes of fully developed speckle, with noise."""

    def field():
        parts = rng.normal(size=(2, PIXELS)) / np.sqrt(2)
        return parts[0] + 1j * parts[1]

    first = field()
    # Half of the mean square difference of two intensities is `change` times their mean.
    second = np.sqrt(1 - light.change) * first + np.sqrt(light.change) * field()
    intensity = np.abs(np.stack([first, second])) ** 2
    intensity[:, : round(light.dark * PIXELS)] = 0
    shape = (2, frames, PIXELS)
    photons = rng.poisson(intensity[:, None] / light.photon, shape)
    noise = np.sqrt(light.read) * rng.normal(size=shape)
    return photons * light.photon + noise


def separation(frames: np.ndarray, at: str) -> float:
    """d′ of the numbers of bits that differ between two classes, and within one."""
    one, other = (bits.unpack(_words(own, at), PIXELS).numpy() for own in frames)
    within = np.mean([(own[:-1] != own[1:]).mean() for own in (one, other)])
    between = (one != other).mean()
    deviation = np.sqrt(within * (1 - within) + between * (1 - between))
    return float((between - within) / deviation)


def _words(frames, at):
    grey = np.clip(np.rint(200 * frames) + 300, 0, 65535).astype(np.int32)
    return Quantile(at).encode(torch.from_numpy(grey))


@pytest.mark.filterwarnings("ignore:.*of the pixels of a frame equal")
@pytest.mark.parametrize(
    "light",
    [
        Light(dark=0.0, photon=0.02, read=0.0, change=0.05),
        Light(dark=0.0, photon=0.02, read=0.05, change=0.05),
        Light(dark=0.4, photon=0.02, read=0.0, change=0.05),
        Light(dark=0.6, photon=0.02, read=0.0, change=0.02),
    ],
)
def test_simulated_speckle_is_told_apart_best_near_the_stated_quantile(light):
    frames = speckle(light, np.random.default_rng(0), 8)
    grid = [f"{k}/10" for k in range(1, 10)]
    found = np.array([separation(frames, at) for at in grid])
    stated = theory.best_quantile(light)
    nearest = int(np.argmin([abs(float(Fraction(at)) - stated) for at in grid]))
    assert found[nearest] > 0.9 * found.max()
    best = float(Fraction(grid[int(found.argmax())]))
    assert abs(best - stated) < 0.125


def test_without_read_noise_the_threshold_is_half_of_the_mean():
    for photon, change in ((0.01, 0.1), (0.2, 0.01)):
        stated = theory.best_quantile(Light(0.0, photon, 0.0, change))
        assert stated == pytest.approx(1 - np.exp(-0.5), abs=0.01)
    of_half = theory.best_quantile(Light(0.5, 0.01, 0.0, 0.1))
    assert of_half == pytest.approx(0.5 + 0.5 * (1 - np.exp(-0.5)), abs=0.01)
    noisy = theory.best_quantile(Light(0.0, 0.01, 0.05, 0.1))
    assert noisy > 0.5


def test_light_is_read_from_frames():
    light = Light(dark=0.4, photon=0.03, read=0.001, change=0.05)
    frames = 40 * speckle(light, np.random.default_rng(1), 20)
    labels = np.repeat([0, 1], 20)
    found = light_of(frames.reshape(40, -1), labels, dark_below=0.1)
    assert found.dark == pytest.approx(light.dark, abs=0.02)
    assert found.photon == pytest.approx(light.photon, rel=0.2)
    assert found.change == pytest.approx(light.change, rel=0.2)
    assert found.read < 0.003


def test_rows_state_before_they_look(recording):
    of = configs.part("scene", "recorded")["scene"] | {"path": str(recording(60, 3))}
    split = {"kind": "random", "test_fraction": 0.5, "group": None}
    model = configs.part("model", "hdc_quantile")
    run = Run(console=Console(quiet=True), force=True)
    given = (of, split, model, QUANTILES, [1, 5], [0, 1])
    rows = list(quantile_theory.rows(run, *given, sample=4))
    kinds = [row["kind"] for row in rows if row["seed"] == 1]
    assert kinds[:4] == ["predicted", "law", "law", "law"]
    assert set(kinds[4:]) == {"accuracy"}
    for row in rows:
        if row["kind"] == "law" and row["at"] == 0.5:
            assert row["expected"] == pytest.approx(row["measured"])
            assert row["error"] == pytest.approx(0, abs=1e-12)
    every = view.curves(pd.DataFrame(rows))
    assert set(every.n) == {1, 5}
    stated = every[every.stated]
    assert len(stated) == 4  # two seeds, two sizes
    assert every.accuracy.between(0, 1).all()


@pytest.mark.parametrize(
    ("behind", "median_behind", "word"),
    [
        (0.02, 0.10, view.PREDICTS),
        (0.03, 0.10, view.PREDICTS),
        (0.04, 0.10, view.FAILS),
        (0.04, 0.00, view.FAILS),
        (-0.01, 0.02, view.NO_NEED),
    ],
)
def test_words_follow_from_the_tolerance(behind, median_behind, word):
    assert view.verdict(behind, median_behind, 0.03) == word


def made_up_rows(stated, right):
    """Rows of one seed: right answers of 100 by quantile, the last at the stated one."""
    rows = [
        {"seed": 0, "kind": "predicted", "dark": 0.5, "at": stated},
        {"seed": 0, "kind": "law", "at": 0.25, "error": 0.1, "error_unchanged": 0.2},
        {"seed": 0, "kind": "law", "at": 0.5, "error": 0.0, "error_unchanged": 0.0},
    ]
    truth = pack_labels(np.zeros(100, int))
    for at, count in right.items():
        said = (np.arange(100) >= count).astype(int)
        row = {"seed": 0, "kind": "accuracy", "at": at, "n_test": 100, "n": [5]}
        rows.append({**row, "predicted": [pack_labels(said)]})
    rows[3]["labels"] = truth
    return rows


@pytest.mark.parametrize(("at_stated", "word"), [(88, "predicts"), (86, "fails")])
def test_the_table_says_whether_the_statement_held(
    tmp_path, write_measurement, drawn, at_stated, word
):
    rows = made_up_rows(0.7, {0.25: 60, 0.5: 70, 0.75: 90, 0.7: at_stated})
    write_measurement("quantiles", rows, scene="fibre_2", config={"tolerance": 0.03})
    (row,) = view.stated_and_found(Results(tmp_path)).to_dict("records")
    assert (row["best"], row["at_best"], row["at_median"]) == (0.75, 0.9, 0.7)
    assert row["at_stated"] == at_stated / 100
    assert row["word"] == word
    assert (row["law_error"], row["unchanged_error"]) == (0.1, 0.2)
    assert "Fibre 2" in drawn(view.STUDY)["quantiles"]


def test_saturated_frames_say_nothing(tmp_path, write_measurement):
    rows = made_up_rows(0.7, {0.5: 100, 0.75: 100, 0.7: 100})
    config = {"tolerance": 0.03, "scene": {"saturated": "nearly copies"}}
    write_measurement("quantiles", rows, scene="spr", config=config)
    (row,) = view.stated_and_found(Results(tmp_path)).to_dict("records")
    assert row["word"] == view.SATURATED
