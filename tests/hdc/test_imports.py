"""Each module can be the first that is imported, and none loads what it does not need.

That no module needs itself is a contract of lint-imports (pyproject.toml).
"""

import pkgutil
import subprocess
import sys

import pytest

import hdc

ALONE = """
import importlib, sys, torch, numba, nicegui, sklearn  # once: they take the time
for name in sys.argv[1:]:
    for known in [known for known in sys.modules if known.partition(".")[0] == "hdc"]:
        del sys.modules[known]
    importlib.import_module(name)
"""


def test_every_module_can_be_imported_first():
    """Whichever a user imports first, none needs that another one was imported before."""
    for extra in ("numba", "nicegui", "sklearn"):
        pytest.importorskip(extra)
    found = pkgutil.walk_packages(hdc.__path__, "hdc.")
    names = [module.name for module in found]
    assert len(names) > 80
    command = [sys.executable, "-c", ALONE, "hdc", *names]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


NOT_NEEDED = (
    "cv2",
    "hydra",
    "matplotlib",
    "numba",
    "pandas",
    "safetensors",
    "scipy",
    "sklearn",
    "hdc.encoders.deviation",
    "hdc.encoders.reference",
    "hdc.readouts.kernel",
    "hdc.readouts.lda",
    "hdc.readouts.ridge",
)


def loaded_by(words):
    """Modules that a process has loaded after it made a classifier of these arguments learn."""
    code = f"""
import sys
import numpy as np
from hdc import HDCClassifier

frames = np.random.default_rng(0).integers(0, 256, (6, 8, 8))
HDCClassifier({words}).fit(frames, [0, 1] * 3).predict(frames)
print(*sys.modules)
"""
    return {*subprocess.check_output([sys.executable, "-c", code], text=True).split()}


def test_the_published_form_loads_no_other():
    assert loaded_by("").isdisjoint(NOT_NEEDED)


def test_a_form_loads_its_own():
    found = loaded_by("encoder='reference', readout='lda'")
    assert {"hdc.encoders.reference", "hdc.readouts.lda"} <= found
    assert "hdc.readouts.kernel" not in found


def test_help_does_without_torch():
    code = (
        "import sys; from hdc.command import main\n"
        "try: main(['train', '--help'])\n"
        "except SystemExit: sys.exit('torch' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
