"""The pressed fibre: laws of the frames, on an excerpt of the matrices.

The excerpt (tests/data/mmf_disorder) has 15 of 55 modes on a grid of 21 × 21; the other repository
of matrices is made up.
"""

import shutil
from pathlib import Path

import numpy as np
import pytest

from scenes.fibre import FibreScene
from scenes.frames import Scene

EXCERPT = Path(__file__).parents[1] / "data" / "mmf_disorder"


def excerpt(path=EXCERPT, **settings):
    return FibreScene(path, **{"samples_per_class": 8, **settings})


def test_it_is_a_scene_as_described():
    scene = excerpt(samples_per_class=20)
    assert isinstance(scene, Scene)
    assert (scene.origin, scene.shape, len(scene)) == ("computed", (21, 42), 100)
    assert np.bincount(scene.labels).tolist() == [20] * 5
    assert scene.classes[:2] == ("≤ 0 µm", "0–20 µm")
    assert (scene.value_names, scene.units) == (("depth",), ("µm",))
    assert np.allclose(scene.values[:, 0], scene.samples["depth"] * 1e6)
    depths = np.round(scene.values[:, 0], 3)
    assert np.array_equal(np.ceil(depths / 20).clip(0), scene.labels)
    assert len(np.unique(depths)) == 15


def test_a_sample_is_the_same_in_any_batch_order_and_number():
    scene, larger = excerpt(), excerpt(samples_per_class=30)
    together = scene.frames(np.arange(40)).numpy()
    order = np.random.default_rng(0).permutation(40)
    assert np.array_equal(scene.frames(order).numpy(), together[order])
    assert np.array_equal(larger.frames(np.arange(40)).numpy(), together)
    assert scene.frames([]).shape == (0, 21, 42)
    with pytest.raises(IndexError, match=r"expected values in \[0, 40\)"):
        scene.frames([40])


def assert_is_the_measured_matrix_times_the_field(frame, matrix, seed):
    """Without noise and perturbation: the published formula, written out."""
    modes = np.load(EXCERPT / "Data" / "modes_out_after_correction.npy")
    real, imaginary = (
        np.random.default_rng(seed).standard_normal((matrix.shape[1], 2)).T
    )
    field = real + 1j * imaginary
    halves = [modes.T @ half for half in np.split(matrix @ field, 2)]
    expected = np.hstack([np.abs(half.reshape(21, 21)) ** 2 for half in halves])
    frame = frame.numpy().astype(float)
    scale = (frame * expected).sum() / (expected**2).sum()
    assert np.abs(frame - expected * scale).max() < 1
    assert frame.max() < 255


CLEAR = {"perturbation": 0, "photons": 0, "saturation": 60}


def test_a_frame_is_that_of_the_matrix_of_its_depth():
    scene = excerpt(seed=3, **CLEAR)
    for i, frame in enumerate(scene.frames(range(5))):
        position = f"{5.04 + scene.samples['depth'][i] * 1e3:.4f}".rstrip("0")
        name = position + "0" * position.endswith(".")
        with np.load(EXCERPT / "Data" / f"TM_modes_{name}.npz") as file:
            matrix = file["TM_corr_modes"]
        assert_is_the_measured_matrix_times_the_field(frame, matrix, 3)


def test_the_exposure_is_fixed_and_photons_are_counted():
    clean, noisy = (
        excerpt(samples_per_class=40, photons=n, saturation=60) for n in (0, 50)
    )
    a, b = (s.frames(np.arange(200)).numpy().astype(float) for s in (clean, noisy))
    assert a.mean() == pytest.approx(255 / 60, rel=0.05)
    # One grey is 60/255 · 50 photons; the variance of the difference is Poisson's plus rounding's.
    photons = 60 / 255 * 50
    bright = (a > 5) & (a < 255)
    assert np.var((b - a)[bright]) == pytest.approx(
        (a[bright] / photons).mean() + 1 / 6, rel=0.1
    )
    means = a.mean((1, 2))
    assert means.std() > 1e-3 * means.mean()  # frames are not normalised one by one


def test_the_fingerprint_follows_every_setting():
    changed = [
        {"samples_per_class": 9}, {"perturbation": 0.4}, {"photons": 20},
        {"saturation": 5.0}, {"seed": 1}, {"sampling_seed": 1},
        {"depth_edges": [0.0, 40e-6, 80e-6]},
    ]  # fmt: skip
    prints = {excerpt(**settings).fingerprint() for settings in [{}, {}, *changed]}
    assert len(prints) == len(changed) + 1


def test_matrices_of_another_fibre(tmp_path, monkeypatch):
    """An array of matrices one step apart, of the input modes of one polarisation."""
    real, imaginary = np.random.default_rng(0).standard_normal((2, 6, 30, 15))
    matrices = (real + 1j * imaginary).astype(np.complex64)
    (tmp_path / "bent").mkdir()
    np.save(tmp_path / "bent" / "TMs.npy", matrices)
    monkeypatch.setenv("MEASURED_DATA", str(tmp_path))
    source = {"repository": "somebody/bent", "commit": "abc", "cite": "Somebody, 2023"}
    edges = {"step": 2e-6, "depth_edges": [4e-6, 10e-6]}
    scene = excerpt(source=source, file="TMs.npy", **edges, **CLEAR)
    assert scene.classes == ("≤ 4 µm", "4–10 µm")
    assert set(np.round(scene.values[:, 0], 6)) <= {0, 2, 4, 6, 8, 10}
    matrix = matrices[round(scene.values[0, 0] / 2)]
    assert_is_the_measured_matrix_times_the_field(scene.frames([0])[0], matrix, 0)


def test_a_missing_repository_is_named(tmp_path, monkeypatch):
    with pytest.raises(
        ValueError, match=r"Data/modes_out.*npy: expected .* No such file"
    ):
        FibreScene(tmp_path)
    monkeypatch.delenv("MEASURED_DATA", raising=False)
    with pytest.raises(
        FileNotFoundError, match=r"^MEASURED_DATA: expected a folder with"
    ):
        FibreScene()
    shutil.copytree(EXCERPT, tmp_path / "article_MMF_disorder")
    monkeypatch.setenv("MEASURED_DATA", str(tmp_path))
    assert excerpt(path=None).fingerprint() == excerpt().fingerprint()


def test_a_damaged_file_is_named_and_nothing_is_unpickled(tmp_path):
    shutil.copytree(EXCERPT, tmp_path / "copy")
    file = tmp_path / "copy" / "Data" / "TM_modes_5.06.npz"
    whole = file.read_bytes()
    for content, message in (
        (
            np.zeros((30, 3), complex),
            r"complex array \(30, 30\), found complex128 \(30, 3",
        ),
        (np.array([print]), "allow_pickle"),
    ):
        np.savez(file, TM_corr_modes=content)
        with pytest.raises(ValueError, match=message):
            excerpt(tmp_path / "copy")
    file.write_bytes(whole[:900])
    with pytest.raises(
        ValueError, match=r"TM_modes_5.06.npz: expected a complex array"
    ):
        excerpt(tmp_path / "copy")
