"""The pressed fibre: the figures reported for it, and the laws of the frames made from it."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from scenes import fibre
from scenes.fibre import FibreScene
from scenes.frames import Scene
from scenes.split import split


@pytest.fixture(scope="module")
def repository(shared_data) -> Path:
    return shared_data / "mmf_disorder"


def hdc_accuracy(scene: FibreScene, seed: int) -> float:
    """Test accuracy of the paper's HDC: binarise at the median, majority, nearest by Hamming."""
    pixels = scene.frames(np.arange(len(scene))).numpy().reshape(len(scene), -1)
    ties = np.random.default_rng(0).random(pixels.shape[1])  # one fixed order of equal pixels
    ranks = np.argsort(np.argsort(pixels + ties, axis=1), axis=1)
    bits = ranks >= pixels.shape[1] // 2
    train, test = split(scene.labels, n_test=100, seed=seed)
    prototypes = np.stack(
        [bits[train[scene.labels[train] == c]].mean(0) > 0.5 for c in range(len(scene.classes))]
    )
    distances = (bits[test][:, None] != prototypes).sum(-1)
    return float((distances.argmin(1) == scene.labels[test]).mean())


@pytest.mark.parametrize(
    ("perturbation", "reported"), [(0, 0.85), (0.3, 0.79), (0.6, 0.69), (1, 0.49)]
)
def test_accuracy_is_near_what_was_reported(repository, perturbation, reported):
    # Mean of 6 input fields with 100 test samples each; a single field spreads by about 0.05, and
    # what was reported is the mean of two of them.
    accuracies = [
        hdc_accuracy(
            FibreScene(repository, perturbation=perturbation, seed=k, sampling_seed=k), seed=k
        )
        for k in range(6)
    ]
    assert np.mean(accuracies) == pytest.approx(reported, abs=0.1)


def test_it_is_a_scene_as_described(repository):
    scene = FibreScene(repository, samples_per_class=20)
    assert isinstance(scene, Scene)
    assert scene.origin == "measured"
    assert scene.shape == (41, 82)
    assert len(scene) == 100
    assert np.bincount(scene.labels).tolist() == [20] * 5
    assert scene.classes[:2] == ("≤ 0 µm", "0–20 µm")
    depth = np.round(scene.samples["depth"] * 1e6, 3)
    for c, (low, high) in enumerate([(-1e3, 0), (0, 20), (20, 40), (40, 60), (60, 80)]):
        chosen = depth[scene.labels == c]
        assert ((chosen > low) & (chosen <= high)).all()
        assert len(np.unique(chosen)) > 3  # not a single measured position


def test_a_sample_is_the_same_in_any_batch_order_and_number(repository):
    scene = FibreScene(repository, samples_per_class=8)
    larger = FibreScene(repository, samples_per_class=30)
    together = scene.frames(np.arange(40)).numpy()
    order = np.random.default_rng(0).permutation(40)
    assert np.array_equal(scene.frames(order).numpy(), together[order])
    assert np.array_equal(scene.frames([7]).numpy()[0], together[7])
    assert np.array_equal(larger.frames(np.arange(40)).numpy(), together)
    assert scene.frames([]).shape == (0, 41, 82)


def test_the_frame_is_the_measured_matrix_times_the_field(repository):
    """Without noise and perturbation: the published formula, written out from the files."""
    scene = FibreScene(repository, samples_per_class=2, perturbation=0, photons=0, seed=3)
    data = repository / "Data"
    modes = np.load(data / "modes_out_after_correction.npy", allow_pickle=False)
    normal = np.random.default_rng(3).standard_normal((110, 2))
    field = normal[:, 0] + 1j * normal[:, 1]
    for i in range(len(scene)):
        position = f"{5.04 + scene.samples['depth'][i] * 1e3:.4f}".rstrip("0").rstrip(".")
        name = position if "." in position else position + ".0"
        with np.load(data / f"TM_modes_{name}.npz", allow_pickle=False) as file:
            out = file["TM_corr_modes"] @ field
        halves = [modes.T @ out[55 * p : 55 * p + 55] for p in (0, 1)]
        expected = np.hstack([np.abs(half.reshape(41, 41)) ** 2 for half in halves])
        frame = scene.frames([i]).numpy()[0].astype(float)
        clear = (frame > 20) & (frame < 255)
        ratio = frame[clear] / expected[clear]
        assert ratio.std() / ratio.mean() < 0.02  # rounding to whole greys
        assert (
            np.corrcoef(np.minimum(expected, expected[frame == 255].min()).ravel(), frame.ravel())[
                0, 1
            ]
            > 0.999
        )


def test_the_exposure_is_fixed_and_photons_are_counted(repository):
    clean = FibreScene(repository, samples_per_class=40, photons=0, saturation=60)
    noisy = FibreScene(repository, samples_per_class=40, photons=50, saturation=60)
    index = np.arange(200)
    a, b = (s.frames(index).numpy().astype(float) for s in (clean, noisy))
    assert a.mean() == pytest.approx(255 / 60, rel=0.05)
    # One grey is 60/255 · 50 photons; the variance of the difference is Poisson's plus rounding's.
    photons = 60 / 255 * 50
    bright = (a > 5) & (a < 255)
    assert np.var((b - a)[bright]) == pytest.approx((a[bright] / photons).mean() + 1 / 6, rel=0.1)
    means = a.mean((1, 2))
    assert means.std() > 1e-3 * means.mean()  # frames are not normalised one by one


def test_an_enlarged_field_is_the_same_field(repository):
    """Trigonometric interpolation at three times the pixels passes through the stored ones."""
    small = FibreScene(repository, samples_per_class=2, photons=0)
    large = FibreScene(repository, samples_per_class=2, photons=0, side=123)
    assert large.shape == (123, 246)
    a, b = small.frames(np.arange(10)).numpy(), large.frames(np.arange(10)).numpy()
    centres = b.reshape(10, 123, 2, 123)[:, 1::3, :, 1::3].reshape(10, 41, 82)
    assert np.array_equal(a, centres)
    assert b.mean() == pytest.approx(a.mean(), rel=0.02)


def test_interpolation_is_exact_for_what_the_grid_can_hold():
    x = np.arange(41)
    fine = (np.arange(100) + 0.5) * 41 / 100 - 0.5
    matrix = fibre._dirichlet(100)
    for k in range(-20, 21):
        wave, expected = (np.exp(2j * np.pi * k * t / 41) for t in (x, fine))
        assert np.allclose(matrix @ wave, expected, atol=1e-12)


def test_the_fingerprint_follows_every_setting(repository):
    settings = {
        "samples_per_class": 9,
        "perturbation": 0.4,
        "photons": 20,
        "saturation": 5.0,
        "side": 50,
        "seed": 1,
        "sampling_seed": 1,
        "depth_edges": [0.0, 40e-6, 80e-6],
    }
    base = {"samples_per_class": 8}
    prints = {FibreScene(repository, **{**base, k: v}).fingerprint() for k, v in settings.items()}
    first = FibreScene(repository, **base)
    assert first.fingerprint() == FibreScene(repository, **base).fingerprint()
    assert len(prints | {first.fingerprint()}) == len(settings) + 1


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"samples_per_class": 0}, "scene.samples_per_class: expected an integer ≥ 1, found 0"),
        ({"samples_per_class": 2.5}, "scene.samples_per_class: .* found 2.5"),
        ({"samples_per_class": True}, "scene.samples_per_class: .* found True"),
        ({"perturbation": -0.1}, "scene.perturbation: expected a finite number ≥ 0"),
        ({"perturbation": float("nan")}, "scene.perturbation: .* found nan"),
        ({"photons": "many"}, "scene.photons: .* found 'many'"),
        ({"saturation": 0}, "scene.saturation: expected a finite number > 0"),
        ({"side": 40}, r"scene.side: expected an integer in \[41, 4096\], found 40"),
        ({"seed": -1}, "scene.seed: expected an integer ≥ 0"),
        ({"sampling_seed": None}, "scene.sampling_seed: .* found None"),
        ({"depth_edges": [0.0]}, "scene.depth_edges: expected two or more increasing"),
        ({"depth_edges": [0.0, 0.0]}, "scene.depth_edges: expected two or more increasing"),
        ({"depth_edges": "deep"}, "scene.depth_edges: .* found 'deep'"),
        ({"depth_edges": [0.0, 1e-6]}, r"class 1 \(0–1 µm\) holds none of the 52 measured depths"),
    ],
)
def test_settings_out_of_range_are_named(repository, setting, message):
    with pytest.raises(ValueError, match=message):
        FibreScene(repository, **setting)


def test_a_missing_repository_is_named(tmp_path, monkeypatch):
    with pytest.raises(
        FileNotFoundError, match=r"scene.path: .*wavefrontshaping/article_MMF_disor"
    ):
        FibreScene(tmp_path)
    monkeypatch.delenv("FIBRE_DATA", raising=False)
    monkeypatch.setattr(fibre, "CANDIDATES", (tmp_path / "a", tmp_path / "b"))
    with pytest.raises(FileNotFoundError, match=r"found no folder .*a/Data and .*b/Data"):
        FibreScene()
    (tmp_path / "a" / "Data").mkdir(parents=True)
    with pytest.raises(FileNotFoundError, match=r"a/Data: expected files TM_modes_X.npz"):
        FibreScene()


def savez(name, array):
    return lambda data: np.savez(data / name, TM_corr_modes=array)


MATRIX = "TM_modes_5.06.npz"
GOOD = np.zeros((110, 110), complex)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda d: (d / MATRIX).write_bytes(b""), MATRIX),
        (lambda d: (d / MATRIX).write_bytes((d / MATRIX).read_bytes()[:9000]), MATRIX),
        (savez(MATRIX, GOOD[:, :3]), r"expected a complex array \(110, 110\), found .*\(110, 3\)"),
        (savez(MATRIX, GOOD.real), "found float64"),
        (savez(MATRIX, np.full_like(GOOD, np.nan)), "found NaN or infinity"),
        (savez(MATRIX, np.array([print])), "allow_pickle"),
        (lambda d: np.savez(d / MATRIX, other=GOOD), "TM_corr_modes"),
        (lambda d: (d / "modes_out_after_correction.npy").unlink(), "modes_out_after_correction"),
    ],
)
def test_a_damaged_file_is_named_and_nothing_is_unpickled(repository, tmp_path, damage, message):
    shutil.copytree(repository, tmp_path / "copy", copy_function=shutil.copyfile)
    data = tmp_path / "copy" / "Data"
    data.chmod(0o755)
    damage(data)
    with pytest.raises(ValueError, match=message):
        FibreScene(tmp_path / "copy")
