"""No module of the library needs itself, by whatever kind of import."""

import re
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import hdc


def test_no_module_comes_back_to_itself():
    """By an import at the top, in a function, for types, or by a string."""
    graph = pytest.importorskip("grimp").build_graph("hdc", cache_dir=None)
    needs = {
        name: {*graph.find_modules_directly_imported_by(name)} for name in graph.modules
    }
    for path in Path(hdc.__file__).parent.rglob("*.py"):
        for name in re.findall(r'import_module\("(.*?)"', path.read_text("utf-8")):
            needs[f"hdc.{path.stem}"].add(name)
    assert needs["hdc.backends"] >= {"hdc.compiled"}  # by a string
    TopologicalSorter(needs).prepare()  # raises CycleError, which names the circle


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
    graph = pytest.importorskip("grimp").build_graph("hdc", cache_dir=None)
    command = [sys.executable, "-c", ALONE, *sorted(graph.modules)]
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
