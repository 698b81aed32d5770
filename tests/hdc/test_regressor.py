"""Numbers from frames: predicted, adapted, saved, and their intervals."""

import pickle

import numpy as np
import pytest
import torch

from hdc import HDCRegressor
from hdc.readouts import NeighbourValues
from hdc.regressor import _ends


def presses(n, seed, move=0.0):
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
    size = len(pickle.dumps(model))
    assert model.predict(queries, True)[0].shape == (100, 2)
    assert len(pickle.dumps(model)) == size  # without what intervals need
    asked = model.encode(queries)
    np.testing.assert_allclose(model.predict(asked), model.predict(queries))
    model.save(tmp_path / "m")
    loaded = HDCRegressor.load(tmp_path / "m")
    ends = [np.array(some.predict(frames, True)) for some in (model, loaded)]
    np.testing.assert_array_equal(*ends)
    moved, new = presses(100, 2, 3.0), presses(60, 3, 3.0)
    before = loaded.score(*moved)
    assert loaded.recalibrate(*new).score(*moved) > before
    loaded.save(tmp_path / "m")
    assert HDCRegressor.load(tmp_path / "m").score(*moved) == loaded.score(*moved)


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
    lower = np.sort(without - np.abs(residuals), axis=1)
    upper = np.sort(without + np.abs(residuals), axis=1)
    np.testing.assert_array_equal(low, lower[:, k - 1])
    np.testing.assert_array_equal(high, upper[:, n - k])
    few = torch.tensor(without[:, :8]), torch.tensor(residuals[:8])
    assert torch.stack(_ends(*few, 0.1)).isinf().all()  # less than one of 8 + 1


# Refused, or nothing changes ----------------------------------------------------------------------

FRAMES, Z = presses(6, 0)
SHAPE = "targets: expected as many a frame as before, found"
MASKED = np.ma.array(Z[:, 0], mask=np.arange(6) == 2)
NO_VALUE = "targets: expected all to have a value, found masked"


@pytest.mark.parametrize("call", ["fit", "recalibrate", "score"])
@pytest.mark.parametrize(
    ("values", "message"),
    [
        (Z[:5], "targets: expected 6, one a frame, found 5"),
        (None, "targets: expected 6, one a frame, found None"),
        (["a"] * 6, "could not convert string to float"),
        ([np.nan] * 6, "targets: expected finite numbers, found NaN"),
        (np.arange(6).astype("M8[s]"), "targets: expected numbers, found "),
        (MASKED, NO_VALUE),
        (Z[:, None], r"targets: expected shape \[N\] or \[N, T\], found \(6, 1, 2\)"),
        (Z[:, 0], SHAPE),
        (np.zeros((6, 3)), SHAPE),
        (Z, r"frames\[0\]: expected finite pixels"),
    ],
)  # fmt: skip
def test_what_cannot_be_learnt_is_named_and_changes_nothing(call, values, message):
    model = HDCRegressor().fit(FRAMES, Z)
    before = model.predict(FRAMES)
    if call == "fit" and message is SHAPE:
        return
    given = np.full_like(FRAMES, np.nan) if values is Z else FRAMES
    with pytest.raises(ValueError, match=f"^{message}"):
        getattr(model, call)(given, values)
    assert (model.predict(FRAMES) == before).all()


def test_a_share_or_a_score_without_an_answer_is_refused():
    model = HDCRegressor().fit(FRAMES, Z)
    message = r"^alpha: expected a share in \(0, 1\), found 0"
    with pytest.raises(ValueError, match=message):
        model.predict(FRAMES, True, alpha=0)
    with pytest.raises(ValueError, match="frames: expected at least one frame, found"):
        model.score(FRAMES[:0], Z[:0])


@pytest.mark.parametrize("size", [1e-100, 1e100])
def test_targets_of_any_size_are_predicted_alike(size):
    (frames, z), (queries, truth) = presses(40, 0), presses(40, 1)
    for readout in ("ridge", "neighbours"):
        expected = HDCRegressor(readout=readout).fit(frames, z)
        model = HDCRegressor(readout=readout).fit(frames, z * size)
        found = np.array(model.predict(queries, True)) / size  # with its interval
        np.testing.assert_allclose(found, expected.predict(queries, True), rtol=1e-6)
        score = expected.score(queries, truth)
        assert model.score(queries, truth * size) == pytest.approx(score)


def test_equal_targets_are_predicted_exactly_or_score_nothing():
    frames, _ = presses(10, 0)
    model = HDCRegressor().fit(frames, np.full(10, 3.0))
    assert model.score(frames, np.full(10, 3.0)) == 1
    assert model.score(frames, np.full(10, 4.0)) == 0
