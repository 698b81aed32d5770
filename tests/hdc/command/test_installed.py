"""A laboratory: a fresh environment, hdc installed from a clone, and a folder of its own."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

pytestmark = pytest.mark.slow
CHECKOUT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """The scripts of a virtual environment with speckle-hdc[compare], installed from a clone."""
    clone, venv = tmp_path_factory.mktemp("clone"), tmp_path_factory.mktemp("venv")
    leave = shutil.ignore_patterns("__pycache__", "results", "build", "site", "*.egg-info", ".*")
    shutil.copytree(CHECKOUT, clone, ignore=leave, dirs_exist_ok=True)
    subprocess.run([sys.executable, "-m", "venv", venv], check=True)
    install = [venv / "bin" / "pip", "install", "--quiet", "-c", "constraints.txt", ".[compare]"]
    subprocess.run(install, cwd=clone, check=True)
    shutil.rmtree(clone)  # nothing may be read from it any more
    return venv


@pytest.fixture
def laboratory(tmp_path):
    """A folder with packages named as the harness has them, which nothing may import."""
    folder = tmp_path / "own work [2]"
    for name in ("configs", "experiments", "scenes", "baselines"):
        (folder / name).mkdir(parents=True)
        (folder / name / "__init__.py").write_text("raise SystemExit('not mine')\n")
    rng = np.random.default_rng(0)
    base = rng.integers(0, 160, (3, 40, 50))
    for day in ("touches", "tomorrow"):
        for name, pattern in zip(("left", "middle", "right"), base, strict=True):
            (folder / day / name).mkdir(parents=True)
            for i in range(10):
                image = (pattern + rng.integers(0, 90, pattern.shape)).astype(np.uint8)
                assert cv2.imwrite(str(folder / day / name / f"{i}.png"), image)
    return folder


def files(*folders):
    """All but compiled modules, which Python itself leaves beside their sources."""
    found = (path for folder in folders for path in folder.rglob("*") if path.is_file())
    return {path: path.stat().st_mtime_ns for path in found if "__pycache__" not in path.parts}


def test_every_command_in_a_folder_of_its_own(environment, laboratory, tmp_path):
    home, scratch = tmp_path / "home", tmp_path / "scratch"
    home.mkdir()
    scratch.mkdir()
    before = files(environment, laboratory)

    def hdc(*words):
        done = subprocess.run(
            [environment / "bin" / "hdc", *words], cwd=laboratory, capture_output=True, text=True,
            env={"HOME": str(home), "TMPDIR": str(scratch), "PATH": os.environ["PATH"]},
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, ""), words
        return done.stdout

    assert "held out at random: accuracy 100.0%" in hdc(
        "train", "touches", "-o", "touch.safetensors", "--crop", "4", "0", "40", "40",
        "--test-fraction", "0.2",
    )  # fmt: skip
    answer = hdc("predict", "touch.safetensors", "tomorrow/left/0.png", "--reject")
    assert answer.splitlines()[1].split("\t")[:2] == ["tomorrow/left/0.png", "left"]
    assert "30 of 30 frames" in hdc("evaluate", "touch.safetensors", "tomorrow")
    assert "30 new frames" in hdc(
        "recalibrate", "touch.safetensors", "tomorrow", "-o", "new.safetensors"
    )
    table = hdc("compare", "touches", "--test", "tomorrow", "-o", "compare.html")
    assert all(name in table for name in ("prototypes", "ridge", "mean image", "Use hdc train"))

    made = {laboratory / name for name in ("touch.safetensors", "new.safetensors", "compare.html")}
    after = files(environment, laboratory, home, scratch)
    assert set(after) - set(before) == made
    assert {path: after[path] for path in before} == before
