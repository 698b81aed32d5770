"""Fixtures that several parts of the tests share."""

import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from scenes.fibre import PRESSED

CHECKOUT = Path(__file__).resolve().parents[1]


@pytest.fixture
def measured_data(monkeypatch, tmp_path_factory):
    """``MEASURED_DATA`` with the matrices of the first fibre: as it is set, else a folder with the
    copy beside the checkout."""
    beside = CHECKOUT.parent / "shared" / "data" / "mmf_disorder"
    if "MEASURED_DATA" not in os.environ and beside.is_dir():
        folder = tmp_path_factory.mktemp("measured")
        (folder / "article_MMF_disorder").symlink_to(beside)
        monkeypatch.setenv("MEASURED_DATA", str(folder))
    if PRESSED.find() is None:
        pytest.skip(
            f"the matrices of {PRESSED.repository} are not here: set MEASURED_DATA"
        )


@pytest.fixture
def full_disk(monkeypatch):
    """full_disk(k, act): act() with a disk that fails at the k-th change of a file, from zero; what
    act raised then, or None if it made fewer changes."""
    steps = [
        (Path, "mkdir"),
        (Path, "open"),
        (os, "fsync"),
        (os, "replace"),
        (Path, "unlink"),
    ]

    def run(failing, act):
        left = iter(range(10_000))

        def counted(call):
            def step(*args, **options):
                if next(left) == failing:
                    raise OSError(28, "No space left on device")
                return call(*args, **options)

            return step

        with monkeypatch.context() as patch:
            for owner, name in steps:
                patch.setattr(owner, name, counted(getattr(owner, name)))
            try:
                act()
            except OSError as error:
                return error
            except SystemExit as ended:  # of a command
                return ended
            return None

    return run


@pytest.fixture(scope="module")
def browser():
    """A headless Chromium, driven by Playwright."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        pytest.skip(f"no browser here: looked for {', '.join(names)}")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(
            executable_path=found,
            args=["--no-sandbox", "--disable-gpu"],
            timeout=120_000,
        )
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def one_thread():
    """Torch computes with one thread: a forked process misses all others."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="session")
def frames_and_labels():
    """frames_and_labels(n, classes, side) → frames uint8 [n, side, side] of classes that differ,
    and their labels."""

    def make(n=50, classes=5, side=16):
        rng = np.random.default_rng(0)
        labels = np.arange(n) % classes
        base = rng.integers(0, 150, (classes, side, side))
        return (base[labels] + rng.integers(0, 90, (n, side, side))).astype(
            np.uint8
        ), labels

    return make


@pytest.fixture
def write_film():
    """write_film(path, frames, code, rate): a video of frames [n, H, W], lossless if not told."""

    def write(path, frames, code="FFV1", rate=10):
        height, width = frames[0].shape
        code = cv2.VideoWriter_fourcc(*code)
        film = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, rate, (width, height))
        for frame in frames:
            film.write(np.dstack([frame] * 3))
        film.release()

    return write
