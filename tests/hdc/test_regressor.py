"""Numbers from frames: predicted, adapted, saved, and their intervals."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from hdc import HDCRegressor
from hdc.readouts import NeighbourValues
from hdc.regressor import _ends


def presses(n: int, seed: int, move: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Frames that depend smoothly on two numbers."""
    basis = np.random.default_rng(5).normal(0, 1, (4, 500))
    rng = np.random.default_rng(seed)
    z = rng.uniform(-1, 1, (n, 2))
    field = basis[0] + z @ basis[1:3] + move * basis[3]
    return np.tanh(field) + 0.5 * rng.normal(0, 1, (n, 500)), z


@pytest.mark.parametrize(
    "model", [HDCRegressor(), HDCRegressor(readout=NeighbourValues(3))], ids=repr
)
def test_numbers_are_predicted_adapted_and_saved(tmp_path, model):
    (frames, z), (queries, truth) = presses(60, 0), presses(100, 1)
    model.fit(frames, z)
    assert model.score(queries, truth) > 0.85
    assert model.predict(queries, True)[0].shape == (100, 2)
    parts = HDCRegressor(readout=model.readout).partial_fit(frames[:20], z[:20])
    parts.partial_fit(frames[20:], z[20:])
    np.testing.assert_allclose(parts.predict(queries), model.predict(queries))
    model.save(tmp_path / "m", {"unit": "mm"})
    loaded = HDCRegressor.load(tmp_path / "m")
    assert loaded.metadata_ == {"unit": "mm"}
    for some in (model, loaded):
        some.partial_fit(queries[:9], truth[:9])
    ends = [np.array(some.predict(frames, True)) for some in (model, loaded)]
    np.testing.assert_array_equal(*ends)
    moved, new = presses(100, 2, 3.0), presses(60, 3, 3.0)
    before = loaded.score(*moved)
    assert loaded.recalibrate(*new).score(*moved) > before
    with pytest.raises(ValueError, match="expected a model that was not recalibrated"):
        loaded.partial_fit(*new)
    loaded.save(tmp_path / "m")
    assert HDCRegressor.load(tmp_path / "m").score(*moved) == loaded.score(*moved)


def test_intervals_cover_as_often_as_stated():
    covered = []
    for seed in range(12):
        queries, truth = presses(60, 100 + seed)
        model = HDCRegressor().fit(*presses(25, seed))
        _, low, high = model.predict(queries, return_interval=True, alpha=0.2)
        covered.append(((low <= truth) & (truth <= high)).mean())
    assert 0.76 < np.mean(covered) < 0.90
    _, low, high = model.predict(queries, return_interval=True, alpha=0.03)
    assert np.isinf([low, high]).all()  # 25 frames tell nothing of 3 %


@pytest.mark.parametrize(
    ("n", "alpha", "k"),
    [(9, 0.1, 1), (20, 0.1, 2), (999, 0.1, 100), (999, 0.25, 250), (999, 0.75, 750)],
)
def test_ends_of_intervals_are_those_of_the_jackknife_plus(n, alpha, k):
    """The ⌊α(n + 1)⌋-th smallest f₋ᵢ − |r_i|, and as many from above of f₋ᵢ + |r_i|.

    Barber et al., Ann. Statist. 49, 486 (2021): of n frames, with n + 1, not n.
    """
    rng = np.random.default_rng(1)
    without, residuals = rng.normal(size=(3, n, 2)), rng.normal(size=(n, 2))
    low, high = _ends(torch.tensor(without), torch.tensor(residuals), alpha)
    assert low.shape == high.shape == (3, 2)
    for q in range(3):
        for t in range(2):
            pairs = list(
                zip(without[q, :, t].tolist(), residuals[:, t].tolist(), strict=True)
            )
            assert low[q, t].item() == sorted(f - abs(r) for f, r in pairs)[k - 1]
            assert high[q, t].item() == sorted(f + abs(r) for f, r in pairs)[n - k]


def test_targets_that_cannot_be_learnt_are_named():
    frames, z = presses(6, 0)
    model = HDCRegressor().fit(frames, z)
    before = model.predict(frames)
    for values, message in (
        (z[:5], "targets: expected 6, one a frame, found 5"),
        (["a"] * 6, "could not convert string to float"),
        ([np.nan] * 6, "targets: expected finite numbers, found NaN"),
        (None, "targets: expected 6, one a frame, found None"),
    ):
        with pytest.raises(ValueError, match=message):
            model.fit(frames, values)
    with pytest.raises(ValueError, match="targets: expected as many a frame as before"):
        model.partial_fit(frames, z[:, 0])
    assert (model.predict(frames) == before).all()
    with pytest.raises(
        ValueError, match=r"alpha: expected a share in \(0, 1\), found 0"
    ):
        model.predict(frames, True, alpha=0)


# Failures half way --------------------------------------------------------------------------------


@pytest.mark.parametrize("call", ["fit", "partial_fit", "recalibrate"])
def test_a_call_that_is_interrupted_leaves_the_model_of_before(
    call, tmp_path, monkeypatch
):
    frames, z = presses(20, 0)
    model = HDCRegressor().fit(frames, z)
    before = model.predict(frames, return_interval=True)

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("hdc.readouts.least_squares.quantised", interrupted)
        with pytest.raises(KeyboardInterrupt):
            getattr(model, call)(*presses(8, 1))
    model.save(tmp_path / "m")
    loaded = HDCRegressor.load(tmp_path / "m")
    for some in (model, loaded):
        for found, expected in zip(some.predict(frames, True), before, strict=True):
            np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("size", [1e-200, 1e-165, 1e155, 1e290])
def test_targets_of_any_size_are_predicted_alike(size, tmp_path):
    (frames, z), (queries, truth) = presses(40, 0), presses(40, 1)
    for readout in ("ridge", "neighbours"):
        expected = HDCRegressor(readout=readout).fit(frames, z)
        model = HDCRegressor(readout=readout).fit(frames, z * size)
        found = np.array(model.predict(queries, True)) / size  # with its interval
        np.testing.assert_allclose(found, expected.predict(queries, True), rtol=1e-6)
        score = expected.score(queries, truth)
        assert model.score(queries, truth * size) == pytest.approx(score)
        model.save(tmp_path / "m")
        HDCRegressor.load(tmp_path / "m")


def test_targets_whose_sums_overflow_are_refused():
    frames, z = presses(6, 0)
    with pytest.raises(
        ValueError, match=r"targets: expected numbers up to 1e300, found 1e\+308"
    ):
        HDCRegressor().fit(frames, np.where(z > 0, 1e308, -1e308))


@pytest.mark.parametrize(
    ("n", "shape", "found"),
    [
        (4, (4, 3), r"targets: expected as many a frame as before, found \(4, 3\)"),
        (0, (0,), "frames: expected at least one frame, found none"),
    ],
)
def test_a_score_without_an_answer_is_refused(n, shape, found):
    frames, z = presses(10, 0)
    with pytest.raises(ValueError, match=f"^{found}"):
        HDCRegressor().fit(frames, z).score(frames[:n], np.zeros(shape))


def test_equal_targets_are_predicted_exactly_or_score_nothing():
    frames, _ = presses(10, 0)
    model = HDCRegressor().fit(frames, np.full(10, 3.0))
    assert model.score(frames, np.full(10, 3.0)) == 1
    assert model.score(frames, np.full(10, 4.0)) == 0
