"""Speckle against theory (Goodman, Speckle Phenomena in Optics, chapters 3 and 4)."""

import numpy as np
import pytest
import torch
from scipy import stats

from scenes.sensor.camera import CONTINUOUS, Camera, MountedCamera
from scenes.sensor.seeds import stream

CPU = torch.device("cpu")


@pytest.mark.parametrize("modes", [1, 2])
def test_contrast_and_distribution(modes):
    camera = Camera(grid=128, crop=128, pupil=32, polarisations=modes, unevenness=0)
    phases = stream(0, "test").uniform(0, 2 * np.pi, (60, camera.path_count))
    i = MountedCamera(camera, CPU).intensity(torch.from_numpy(phases)).double().numpy()
    assert i.mean() == pytest.approx(1, rel=2e-3)
    assert i.std() == pytest.approx(1 / np.sqrt(modes), rel=0.02)
    apart = i[:, ::8, ::8].ravel()  # several grains apart: nearly independent
    assert stats.kstest(apart, stats.gamma(modes, scale=1 / modes).cdf).statistic < 0.02


def grey_distribution(camera, mean):
    """Exact probabilities of the grey levels: Poisson convolved with the read noise, rounded."""
    scale = camera.grey / camera.photons
    n = np.arange(
        int(stats.poisson.ppf(1e-13, mean)), int(stats.poisson.isf(1e-13, mean)) + 1
    )
    edges = np.arange(-0.5, 255)[:, None]
    below = stats.norm.cdf(
        (edges[1:] - n * scale) / camera.read_noise
    ) @ stats.poisson.pmf(n, mean)
    return np.diff(np.concatenate([[0.0], below, [1.0]]))


@pytest.mark.parametrize("light", [0.0, 0.01, 0.3, 1.0, 4.5])
def test_noise_in_one_draw_has_the_exact_distribution(light):
    """No sampling here: the variate z is pushed through on a grid of quantiles."""
    camera = Camera(grid=512, crop=512, pupil=2)

    class Quantiles:
        def standard_normal(self, dtype, out):
            p = (np.arange(out.size) + 0.5) / out.size
            out[...] = stats.norm.ppf(p).reshape(out.shape).astype(dtype)

    even = torch.full((1, 512, 512), light)
    grey = MountedCamera(camera, CPU).expose(even, [Quantiles()])
    found = np.bincount(grey.numpy().ravel(), minlength=256) / grey.numel()
    exact = grey_distribution(camera, light * camera.photons)
    assert camera.read_noise * camera.photons / camera.grey >= CONTINUOUS
    assert np.abs(found - exact).sum() / 2 < 1e-4


def test_few_photons_are_counted_one_by_one():
    """Below a read noise of some photons: Poisson's variance, the noise's and that of rounding."""
    even = torch.full((4, 256, 256), 1.0)

    def grey(photons, read):
        camera = Camera(grid=256, crop=256, pupil=4, photons=photons, read_noise=read)
        streams = [stream(0, "test", i) for i in range(4)]
        return MountedCamera(camera, CPU).expose(even, streams).double()

    one = grey(1.0, 0.0)
    assert {*one.unique().tolist()} <= {0, 50, 100, 150, 200, 250, 255}
    assert (one == 0).double().mean() == pytest.approx(np.exp(-1), abs=0.005)
    many = grey(100.0, 0.5)
    assert many.mean() == pytest.approx(50, rel=0.01)
    assert many.var() == pytest.approx(50**2 / 100 + 0.5**2 + 1 / 12, rel=0.03)
