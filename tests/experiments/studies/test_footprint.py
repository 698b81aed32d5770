"""The footprint: what is loaded is what the scene needs, in a process of its own."""

from experiments.protocol.task import Context
from experiments.studies.footprint import measure
from tests.experiments import composed

NEEDED = composed.task("footprint")["needed"]


def rows_of(scene, model="hdc"):
    return measure.Footprint([scene], [model], 3, 1, NEEDED).rows(Context())


def test_a_process_says_what_it_imports_and_what_that_costs():
    """Adam would bring sympy, by which PyTorch compiles."""
    (row,) = rows_of("touch", "softmax")
    assert row["status"] == "ok"
    assert 1e8 < row["peak_bytes"] < 1e9
    columns = (row[name] for name in ("package", "modules", "package_s"))
    of = {name: rest for name, *rest in zip(*columns, strict=True)}
    assert (
        {"python", "torch", "numpy", "hdc", "scipy"}
        <= set(of)
        <= set(NEEDED["all"]) | {"scipy"}
    )
    assert sum(seconds for _, seconds in of.values()) < row["first_prediction_s"]
    torch, hdc = of["torch"], of["hdc"]
    assert torch[0] > hdc[0] > 10
    assert torch[1] > 0.1
