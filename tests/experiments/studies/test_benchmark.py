"""The benchmark: results are really compared, routes run in turns, goals are judged."""

import numpy as np
import pytest

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.results import Results
from experiments.studies.benchmark import measure as benchmark
from experiments.studies.benchmark import names
from experiments.studies.benchmark.cases import Case
from experiments.studies.benchmark.names import (
    COPY,
    NO_RESULT,
    NUMKONG,
    ORDINARY_ROUTES,
    OURS,
    OURS_COMPILED,
    OURS_GPU,
    READ,
    TORCHHD_BUNDLE,
)
from experiments.studies.benchmark.routes import OPERATIONS, Route, common_form
from experiments.studies.benchmark.view import STUDY
from hdc.encoders import Median


def compared(case):
    """The routes of a case that are installed and have a result."""
    for route in OPERATIONS[case.operation](case):
        status = benchmark.check(route, case)["status"]
        assert status in ("ok", "not installed"), (route.name, status)
        if status == "ok" and route.name not in NO_RESULT:
            yield route


def test_every_operation_has_routes_in_the_order_of_their_table():
    assert tuple(OPERATIONS) == names.OPERATIONS


@pytest.mark.parametrize("operation", OPERATIONS)
def test_a_result_is_right_and_a_changed_one_is_not(operation):
    # The processor by another name: it takes the routes of a GPU beside its own.
    case = Case(operation, 12, 1024, 3, device="cpu:0")
    for route in compared(case):
        result = common_form(case, route.call)
        assert case.verdict(result) != "no"
        assert case.verdict(result[:-1]) == "no"
        changed = result.copy()
        if changed.dtype == np.uint8:  # one bit on which all methods have to agree
            free = case.expected[1]
            assert np.unpackbits(free).mean() < 0.5
            changed[tuple(np.argwhere(free == 0)[0])] ^= 1
        else:
            changed.flat[-1] += 1
        assert case.verdict(changed) == "no"
        if route.name in (OURS, OURS_COMPILED, OURS_GPU):
            # exact to the last bit
            assert case.verdict(result) in ("yes", "same labels")


def tie_key(j):
    """Place of pixel 64·w + b among equal ones, by the definition of ``spread``."""
    w, b = divmod(j, 64)
    return (b + (w * 0x9E3779B1 % 2**32 >> 26)) % 64, w


def test_the_reference_splits_ties_as_defined():
    case = Case("encode", 12, 1000, 3)
    expected, ties = case.expected
    for pixels, packed, free in zip(case.pixels.numpy(), expected, ties, strict=True):
        ones = np.unpackbits(packed, count=1000, bitorder="little")
        order = sorted(range(1000), key=lambda j, x=pixels: (-int(x[j]), tie_key(j)))
        assert set(np.flatnonzero(ones)) == set(order[:500])
        tied = np.flatnonzero(np.unpackbits(free, count=1000, bitorder="little"))
        assert set(pixels[tied]) == {np.sort(pixels)[500]}


def rows_of(monkeypatch, *routes):
    """Rows of these routes and ours of encode."""
    case = Case("encode", 6, 640, 3)
    ours = next(route for route in OPERATIONS["encode"](case) if route.name == OURS)
    monkeypatch.setitem(benchmark.OPERATIONS, "encode", lambda _: iter([ours, *routes]))
    return {row["route"]: row for row in benchmark.measure(case, 0.0)}


def test_a_route_without_a_right_result_is_not_timed(monkeypatch):
    wrong = Median().encode(Case("encode", 6, 640, 3).pixels) ^ 1
    rows = rows_of(
        monkeypatch,
        Route("wrong", "torch", lambda: wrong),
        Route("absent", "no_such_module", lambda: None),
    )
    assert rows["wrong"]["status"] == "wrong result"
    assert rows["wrong"]["equal_result"] == "no"
    assert rows["absent"]["status"] == "not installed"
    assert [name for name, row in rows.items() if "median_s" in row] == [OURS]


def test_a_ratio_is_the_median_over_turns(monkeypatch):
    words = Median().encode(Case("encode", 6, 640, 3).pixels)
    times = [
        iter([0.5, 0.5, 3.0] * 3),
        iter([1.0, 2.0, 3.0] * 3),
    ]  # of ours, then of the other route
    monkeypatch.setattr(benchmark, "sampler", lambda _: times.pop(0).__next__)
    row = rows_of(monkeypatch, Route("same", "torch", lambda: words))["same"]
    assert (row["median_s"], row["min_s"], row["samples"]) == (2.0, 1.0, 7)
    assert row["ratio_to_ours"] == 2.0  # of 2, 4 and 1


def test_every_step_of_the_config_is_measured(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    monkeypatch.setattr(benchmark, "sampler", lambda call: lambda: 1e-3)
    task = configs.task("benchmark")
    del task["_target_"]
    for step in task["steps"]:
        step |= {
            "n": [min(n, 12) for n in step["n"]],
            "l": [min(c, 3) for c in step["l"]],
        }
        step["d"] = [1024 if d == 10_000 else 2704 for d in step["d"]]
    benchmark.benchmark(**task)
    rows = Results(tmp_path).measurements[0].frame
    assert set(rows["operation"]) == set(OPERATIONS)
    assert set(rows["status"]) <= {"ok", "not installed"}


def test_a_wrong_route_fails_the_experiment_at_its_end(monkeypatch):
    row = {"operation": "encode", "route": "a", "status": "wrong result"}
    monkeypatch.setattr(benchmark, "measure", lambda *_: [row])
    rows = benchmark.benchmark.rows(
        Run(force=True),
        [{"operation": ["encode"], "n": [1, 2], "d": [8], "l": [1]}],
        0.0,
        0,
    )
    assert [next(rows), next(rows)] == [row, row]
    with pytest.raises(RuntimeError, match="encode by a"):
        next(rows)


def row(operation, route, ratio, **other):
    at = {"n": 400, "d": 250_000, "l": 5, "status": "ok"}
    names = {"operation": operation, "route": route, "equal_result": "yes"}
    return names | at | {"median_s": ratio, "ratio_to_ours": ratio} | other


def test_goals_are_judged(tmp_path, write_measurement):
    write_measurement(
        "benchmark",
        [
            row("bundle", OURS_COMPILED, 0.001),
            row("bundle", TORCHHD_BUNDLE, 0.25),
            row("train", OURS_COMPILED, 0.02),
            row("train", ORDINARY_ROUTES[0], 1.5),
            row("train", READ, 0.01),
            row("train", COPY, 0.02),
            row("train", ORDINARY_ROUTES[0], 0.1, n=40),
            row("predict", OURS_COMPILED, 0.0001, n=1),
            row("hamming", OURS_COMPILED, 0.9, n=100),
            row("hamming", NUMKONG, 1.0, n=100),
        ],
    )
    tables = {table.name: table for table in STUDY.tables_of(Results(tmp_path))}
    goals = {cells[0]: cells[1:] for cells in tables["benchmark_goals"].cells()}
    assert goals == {
        "predict one frame: hdc, compiled, ms": ["≤ 0.12", "0.100", "yes"],
        f"bundle: {TORCHHD_BUNDLE}, × {OURS_COMPILED}": ["≥ 200", "250", "yes"],
        f"train: {ORDINARY_ROUTES[0]}, × {OURS_COMPILED}": ["≥ 80", "75.0", "no"],
        f"train: {OURS_COMPILED}, × {READ}": ["≤ 1.15", "2.00", "no"],
        f"train: {OURS_COMPILED}, × {COPY}": ["≤ 1", "1.00", "yes"],
        f"hamming: {OURS_COMPILED}, × {NUMKONG}": ["≤ 1.1", "0.900", "yes"],
    }
