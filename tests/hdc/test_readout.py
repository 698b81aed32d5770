"""Ridge regression and nearest frames on packed bits, against plain floats and scikit-learn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from hdc.encode import encode
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.linear_model import Ridge as PlainRidge

from hdc import HDCClassifier, HDCRegressor, bits, readout


def plain(x: np.ndarray, y: np.ndarray, penalty: float) -> PlainRidge:
    return PlainRidge(penalty, solver="svd").fit(x, y)


def problem(
    n: int, d: int, t: int, seed: int
) -> tuple[np.ndarray, torch.Tensor, torch.Tensor]:
    """Bits in ±1 [n, d], packed ones, and targets [n, t]."""
    rng = np.random.default_rng(seed)
    x = np.where(rng.random((n, d)) < rng.random(d), 1.0, -1.0)
    return (
        x,
        bits.pack(torch.from_numpy(x > 0)),
        torch.from_numpy(rng.normal(3, 1, (n, t))),
    )


@given(st.integers(3, 30), st.integers(1, 300), st.integers(1, 3), st.integers(0, 99))
@settings(max_examples=40, deadline=None)
def test_ridge_is_that_of_floats_and_its_left_out_errors_are_exact(
    n, d, t, seed
) -> None:
    x, words, y = problem(n, d, t, seed)
    queries, asked, _ = problem(5, d, t, seed + 1)
    model, held = readout.ridge(words, y, d)
    whole = plain(x, y.numpy(), model.penalty)
    weights = np.atleast_2d(whole.coef_)
    rounding = np.abs(weights).max(1) / 254 * d  # half a step of 8 bits, at every pixel
    expected = whole.predict(queries).reshape(5, t)
    assert (np.abs(model.scores(asked).numpy() - expected) <= rounding + 1e-6).all()
    change = held.changes(asked, d).numpy()
    errors = []
    for i in range(n):
        rest = np.arange(n) != i
        without = plain(x[rest], y.numpy()[rest], model.penalty)
        errors.append(y[i].numpy() - without.predict(x[i : i + 1]).reshape(t))
        np.testing.assert_allclose(
            change[:, i], expected - without.predict(queries).reshape(5, t), atol=1e-6
        )
    np.testing.assert_allclose(held.residuals, errors, atol=1e-6)


def test_the_penalty_is_the_one_with_the_least_left_out_error() -> None:
    _, words, y = problem(25, 400, 1, 0)
    model, held = readout.ridge(words, y, 400)
    products = readout.gram(words, words, 400)
    assert torch.equal(products, readout.gram(words, words.clone(), 400))
    centred = products - products.mean(0) - products.mean(1)[:, None] + products.mean()
    unit = float(centred.diagonal().mean())
    others = [
        readout.ridge(words, y, 400, readout.Ridge(
            torch.zeros(1, 8, 7).long(), torch.zeros(1), torch.zeros(1), unit * p, 400
        ))[1].residuals
        for p in readout.PENALTIES
    ]  # fmt: skip
    errors = [float((r**2).sum()) for r in others]
    assert model.penalty == pytest.approx(
        unit * readout.PENALTIES[int(np.argmin(errors))]
    )
    assert float((held.residuals**2).sum()) == pytest.approx(min(errors))


def test_weights_are_those_of_floats_in_any_block(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(readout, "_STEP", 2)  # words that are rounded at once
    x, words, y = problem(30, 300, 2, 0)
    fitted, _ = readout.ridge(words, y, 300)
    whole, expected = fitted.weights(0, 5), plain(x, y.numpy(), fitted.penalty).coef_
    np.testing.assert_allclose(
        whole[:, :300], expected, atol=np.abs(expected).max() / 253
    )
    assert (fitted.weights(2, 4) == whole[:, 128:256]).all()
    assert fitted.planes[:, 7].any()  # 8 bits: the largest weight is ±127 steps
    assert float(
        (whole / fitted.scales[:, None])[:, :300].abs().amax()
    ) == pytest.approx(127)


def test_recalibration_stays_near_the_old_weights() -> None:
    """min Σ (y − b − w·x)² + λ‖w − w₀‖², by fitting what the old weights leave."""
    x, words, y = problem(30, 200, 2, 0)
    new_x, new, new_y = problem(4, 200, 2, 1)
    old, _ = readout.ridge(words, y, 200)
    adapted, _ = readout.ridge(new, new_y, 200, old)
    left = new_y.numpy() - old.scores(new).numpy()
    expected = old.scores(words).numpy() + plain(new_x, left, old.penalty).predict(x)
    np.testing.assert_allclose(adapted.scores(words), expected, atol=0.05)
    assert adapted.penalty == old.penalty


# Classifier ---------------------------------------------------------------------------------------


def hard(n: int, seed: int, drift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Frames in which classes differ little from what all have in common."""
    rng = np.random.default_rng(7)
    common, fields = rng.normal(0, 3, 2000), rng.normal(0, 0.5, (4, 2000))
    moved = drift * rng.normal(0, 3, 2000)
    rng = np.random.default_rng(seed)
    labels = np.arange(n) % 4
    shared = rng.normal(0, 1, (n, 3)) @ np.random.default_rng(8).normal(0, 1, (3, 2000))
    return common + moved + fields[labels] + shared + rng.normal(
        0, 1, (n, 2000)
    ), labels


def test_ridge_recognises_what_prototypes_do_not_and_recalibrates() -> None:
    train, test = hard(80, 0), hard(200, 1)
    ridge = HDCClassifier(readout="ridge").fit(*train)
    assert ridge.score(*test) > HDCClassifier().fit(*train).score(*test) + 0.1
    new, fresh = hard(8, 2, 0.5), hard(200, 3, 0.5)
    before = ridge.score(*fresh)
    ridge.recalibrate(*new)
    assert ridge.score(*fresh) >= before
    fitted = HDCClassifier(readout="ridge").fit(*train)
    with pytest.raises(
        ValueError, match="merge: expected readout 'prototype' or 'neigh"
    ):
        fitted.merge(fitted)
    with pytest.raises(
        ValueError, match="partial_fit: expected readout 'prototype' or 'neigh"
    ):
        HDCClassifier(readout="ridge").partial_fit(*train)


@pytest.mark.parametrize("k", [1, 3, 4])
def test_neighbours_vote_and_ties_go_to_the_nearest(k: int) -> None:
    (frames, labels), (queries, _) = hard(40, 0), hard(60, 1)
    model = HDCClassifier(readout="neighbours", n_neighbours=k).fit(frames, labels)
    distances = bits.hamming(
        *(encode(torch.from_numpy(f)) for f in (queries, frames))
    ).numpy()
    expected = []
    for row in distances:
        voting = labels[np.argsort(row, kind="stable")[:k]]
        votes = np.bincount(voting, minlength=4)
        expected.append(next(c for c in voting if votes[c] == votes.max()))
    nearest = np.stack([distances[:, labels == c].min(1) for c in range(4)], 1)
    clear = (np.sort(nearest, 1)[:, 0] < np.sort(nearest, 1)[:, 1]).nonzero()[0]
    assert (model.predict(queries)[clear] == np.array(expected)[clear]).all()


def test_neighbours_are_added_merged_and_replaced() -> None:
    (frames, labels), (queries, _) = hard(40, 0), hard(60, 1)
    whole = HDCClassifier(readout="neighbours").fit(frames, labels)
    parts = HDCClassifier(readout="neighbours").partial_fit(frames[:20], labels[:20])
    parts.merge(HDCClassifier(readout="neighbours").fit(frames[20:], labels[20:]))
    assert np.array_equal(parts._scores(queries), whole._scores(queries))
    with pytest.raises(
        ValueError, match=r"with readout 'neighbours', found .* 'prototype'"
    ):
        whole.merge(HDCClassifier().fit(frames, labels))
    new = labels[:20] == 2
    whole.recalibrate(queries[:20][new], labels[:20][new])
    assert whole.state_tensors()["frames"].shape[0] == 30 + 5
    assert (whole.predict(queries[:20][new]) == 2).all()


@pytest.mark.parametrize("name", ["ridge", "neighbours"])
def test_read_outs_come_back_from_files(tmp_path: Path, name: str) -> None:
    (frames, labels), (queries, _) = hard(40, 0), hard(60, 1)
    model = HDCClassifier(readout=name).fit(frames, np.array(list("dcba"))[labels])
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    assert loaded.get_params() == model.get_params()
    assert np.array_equal(
        loaded.decision_function(queries), model.decision_function(queries)
    )
    assert np.array_equal(loaded.is_known(queries), model.is_known(queries))
    model.recalibrate(queries, np.array(list("dcba"))[labels[:1]].repeat(60))
    loaded.recalibrate(queries, np.array(list("dcba"))[labels[:1]].repeat(60))
    assert np.array_equal(
        loaded.decision_function(queries), model.decision_function(queries)
    )


# Regressor ----------------------------------------------------------------------------------------


def presses(n: int, seed: int, move: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Frames that depend smoothly on two numbers."""
    basis = np.random.default_rng(5).normal(0, 1, (4, 500))
    rng = np.random.default_rng(seed)
    z = rng.uniform(-1, 1, (n, 2))
    field = basis[0] + z @ basis[1:3] + move * basis[3]
    return np.tanh(field) + 0.5 * rng.normal(0, 1, (n, 500)), z


@pytest.mark.parametrize(
    "model", [HDCRegressor(), HDCRegressor("neighbours", 3)], ids=repr
)
def test_numbers_are_predicted_adapted_and_saved(
    tmp_path: Path, model: HDCRegressor
) -> None:
    (frames, z), (queries, truth) = presses(60, 0), presses(100, 1)
    model.fit(frames, z)
    assert model.score(queries, truth) > 0.85
    assert model.fit(frames, z[:, 0]).predict(queries).shape == (100,)
    parts = HDCRegressor(**model.get_params()).partial_fit(frames[:20], z[:20])
    parts.partial_fit(frames[20:], z[20:])
    model.fit(frames, z)
    np.testing.assert_allclose(parts.predict(queries), model.predict(queries))
    model.save(tmp_path / "m", {"unit": "mm"})
    loaded = HDCRegressor.load(tmp_path / "m")
    assert loaded.metadata_ == {"unit": "mm"}
    for found, expected in zip(
        loaded.predict(queries, True), model.predict(queries, True), strict=True
    ):
        np.testing.assert_array_equal(found, expected)
    with pytest.raises(
        ValueError, match="found a saved HDCRegressor; load it with HDCRegressor"
    ):
        HDCClassifier.load(tmp_path / "m")
    moved, new = presses(100, 2, 3.0), presses(60, 3, 3.0)
    before = loaded.score(*moved)
    loaded.recalibrate(*new)
    assert loaded.score(*moved) > before
    with pytest.raises(ValueError, match="expected a model that was not recalibrated"):
        loaded.partial_fit(*new)
    loaded.save(tmp_path / "m")
    assert HDCRegressor.load(tmp_path / "m").score(*moved) == loaded.score(*moved)


@pytest.mark.parametrize(
    "model", [HDCRegressor(), HDCRegressor("neighbours", 2)], ids=repr
)
def test_intervals_cover_as_often_as_stated(model: HDCRegressor) -> None:
    covered = []
    for seed in range(12):
        queries, truth = presses(60, 100 + seed)
        model.fit(*presses(25, seed))
        for alpha in (0.1, 0.2):
            _, low, high = model.predict(queries, return_interval=True, alpha=alpha)
            covered.append(((low <= truth) & (truth <= high)).mean())
    wide, narrow = np.mean(np.reshape(covered, (12, 2)), 0)
    assert 0.86 < wide < 0.97
    assert 0.76 < narrow < 0.90
    _, low, high = model.predict(queries, return_interval=True, alpha=0.03)
    assert np.isinf([low, high]).all()  # 25 frames tell nothing of 3 %


def test_targets_that_cannot_be_learnt_are_named() -> None:
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
