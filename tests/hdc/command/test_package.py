"""What is installed: the package hdc and its command, and nothing of the harness."""

import re
import shutil
import subprocess
import sys
from importlib.metadata import PathDistribution
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The folder of a real installation, built from a copy, as building leaves files behind."""
    pytest.importorskip("setuptools", minversion="77")
    source, target = map(tmp_path_factory.mktemp, ("source", "target"))
    leave = shutil.ignore_patterns(
        "__pycache__", "tests", "results", "build", "*.egg-info", ".*"
    )
    shutil.copytree(CHECKOUT, source, ignore=leave, dirs_exist_ok=True)
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target"]
    pip = [sys.executable, "-m", "pip", "install", *options, target, source]
    subprocess.run(pip, check=True)
    return target


def test_only_hdc_is_installed(installed):
    (info,) = installed.glob("*.dist-info")
    assert {path.name for path in installed.iterdir()} == {"bin", "hdc", info.name}
    modules = {p.relative_to(CHECKOUT) for p in (CHECKOUT / "hdc").rglob("*.py")}
    assert {
        p.relative_to(installed) for p in (installed / "hdc").rglob("*.py")
    } == modules
    assert (installed / "hdc" / "py.typed").is_file()
    found = PathDistribution(info)
    assert found.metadata["Name"] == "speckle-hdc"
    assert found.metadata["License-Expression"] == "MIT"
    core = {
        re.split("[<>=]", text)[0]
        for text in found.requires or ()
        if "extra ==" not in text
    }
    assert core == {"torch", "numpy", "safetensors", "jinja2"}


def test_the_sample_is_installed_and_small(installed):
    images = list((installed / "hdc" / "command" / "recording").rglob("*.png"))
    assert len(images) == 30 + 15 + 24
    assert sum(image.stat().st_size for image in images) < 300_000


def test_the_installed_command_runs(installed, tmp_path):
    done = subprocess.run(
        [sys.executable, installed / "bin" / "hdc", "train", "nowhere", "-o", "m"],
        env={"PYTHONPATH": str(installed)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    said = "error: path: expected a folder or a file of frames, found nothing: nowhere"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", f"{said}\n")
    assert list(tmp_path.iterdir()) == []
