"""No module of the library needs itself, by whatever kind of import."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import hdc

FOLDER = Path(hdc.__file__).parent


def modules() -> dict[str, Path]:
    found = {}
    for path in sorted(FOLDER.rglob("*.py")):
        words = ("hdc", *path.relative_to(FOLDER).with_suffix("").parts)
        found[".".join(words).removesuffix(".__init__")] = path
    return found


MODULES = modules()


def imported(text: str, known: set[str]) -> Iterator[str]:
    """Modules that a source imports at the top, in a function, for types, or by a string."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in known else str(node.module)
        elif isinstance(node, ast.Call) and node.args:
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            first = node.args[0]
            if name == "import_module" and isinstance(first, ast.Constant):
                yield str(first.value)


def graph(sources: dict[str, str]) -> dict[str, set[str]]:
    known = set(sources)
    return {name: known & {*imported(text, known)} for name, text in sources.items()}


def test_no_module_comes_back_to_itself():
    sources = {name: path.read_text("utf-8") for name, path in MODULES.items()}
    needs = graph(sources)
    assert "hdc.compiled" in needs["hdc.backends"]  # by a string
    assert "hdc.bits" in needs["hdc.conformal"]
    TopologicalSorter(needs).prepare()  # raises CycleError, which names the circle


@pytest.mark.parametrize(
    "back",
    [
        "import hdc.a",
        "def f():\n    from hdc import a",
        "import importlib\nimportlib.import_module('hdc.a')",
    ],
)
def test_a_circle_is_found_whatever_hides_it(back):
    needs = graph({"hdc.a": "from hdc.b import f", "hdc.b": back})
    with pytest.raises(CycleError):
        TopologicalSorter(needs).prepare()


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
    command = [sys.executable, "-c", ALONE, *MODULES]
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


def loaded_by(words: str) -> set[str]:
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
