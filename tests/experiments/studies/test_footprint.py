"""The footprint: what is loaded is what the scene needs, in a process of its own."""

import os

from experiments.protocol.task import Context
from experiments.studies.footprint import measure
from tests.experiments import composed

NEEDED = composed.task("footprint")["needed"]


def row_of(scene, model):
    (row,) = measure.Footprint([scene], [model], 3, 1, NEEDED).rows(Context())
    return row


def test_a_process_says_what_it_imports_and_what_that_costs():
    """Adam would bring sympy, by which PyTorch compiles."""
    row = row_of("touch", "softmax")
    assert row["status"] == "ok"
    assert 1e8 < row["peak_bytes"] < 1e9
    columns = (row[name] for name in ("package", "modules", "package_s"))
    of = {name: rest for name, *rest in zip(*columns, strict=True)}
    assert {"python", "torch", "numpy", "hdc", "scenes"} <= set(of)
    assert sum(seconds for _, seconds in of.values()) < row["first_prediction_s"]
    torch, hdc = of["torch"], of["hdc"]
    assert torch[0] > hdc[0] > 10
    assert torch[1] > 0.1


def test_a_module_that_the_library_does_not_need_fails(tmp_path, monkeypatch):
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'hdc': import pandas\n"
        "sys.meta_path.insert(0, Finder())\n"
    )
    path = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{path}")
    status = row_of("touch", "hdc")["status"]
    assert status.startswith("fails: loads ")
    assert "pandas" in status
