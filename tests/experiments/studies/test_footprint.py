"""The footprint: what is loaded is what the scene needs, in a process of its own."""

import subprocess

import pandas as pd
import pytest

from experiments.protocol.task import Context
from experiments.studies.footprint import measure, view
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


def test_a_process_that_fails_ends_the_experiment():
    with pytest.raises(subprocess.CalledProcessError, match="nowhere"):
        next(rows_of("nowhere"))


def test_medians_and_ranges_over_the_repetitions():
    rows = []
    for repetition, seconds in enumerate((1.0, 5.0, 2.0)):
        for package, size in (("hdc", 1e6), ("torch", 1e8)):
            rows.append(
                {"scene": "touch", "model": "hdc", "n": 3, "status": "ok",
                 "origin": "simulated", "repetition": repetition,
                 "first_prediction_s": seconds, "peak_bytes": 3e8,
                 "package": package, "modules": 9,
                 "package_s": seconds / 10, "package_bytes": size * seconds}
            )  # fmt: skip
    frame = pd.DataFrame(rows)
    (case,) = view.footprint(frame).to_dict("records")
    ends = ("", "_low", "_high")
    assert [case[f"first_prediction_s{end}"] for end in ends] == [2, 1, 5]
    packages = view.packages(frame)
    assert packages.package.tolist() == ["torch", "hdc"]
    assert packages.package_bytes.tolist() == [2e8, 2e6]
