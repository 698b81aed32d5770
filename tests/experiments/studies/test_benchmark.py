"""The benchmark: results are really compared, and nothing is left out in silence."""

import dataclasses
import inspect
import itertools
import re
import time

import numpy as np
import pytest

from experiments.protocol import machine
from experiments.records import configs, measurement
from experiments.records.results import Results
from experiments.studies.benchmark import measure as benchmark
from experiments.studies.benchmark.bench import Bench
from experiments.studies.benchmark.cases import FRAMES, Case
from experiments.studies.benchmark.memory import call_bytes
from experiments.studies.benchmark.names import (
    DECODED,
    OPERATIONS,
    ORDINARY_ROUTES,
    OURS,
    OURS_COMPILED,
    READ,
    SHUFFLED,
    SORTED,
)
from experiments.studies.benchmark.route import Route
from experiments.studies.benchmark.routes import ROUTES
from experiments.studies.benchmark.view import STUDY
from hdc.encode import encode

COMPARED = [r for r in ROUTES if r.name not in (READ, DECODED)]


def installed(route):
    return pytest.importorskip(route.module)


@pytest.fixture(scope="module")
def case():
    return Case(12, 1000, 3)


@pytest.mark.parametrize("route", COMPARED, ids=lambda r: f"{r.operation}-{r.name}")
def test_a_result_is_right_and_a_changed_one_is_not(route, case):
    installed(route)
    call, form = route.build(case)
    result = form(call())
    assert case.verdict(route.operation, result) != "no"
    changed = result.copy()
    if changed.dtype == np.uint8:  # one bit on which all methods have to agree
        expected = "train" if route.operation == "folder" else route.operation
        _, free = getattr(case, f"expected_{expected}")
        assert 0 < np.unpackbits(free).mean() < 0.5 or not free.any()
        row, byte = np.argwhere(free == 0)[0]
        changed[row, byte] ^= 1
    else:
        changed.flat[-1] += 1
    assert case.verdict(route.operation, changed) == "no"
    assert case.verdict(route.operation, result[:-1]) == "no"


def test_ours_is_exact_to_the_last_bit(case):
    for route in COMPARED:
        exact = ("encode", "bundle", "train", "hamming", "folder")
        if route.name in (OURS, OURS_COMPILED) and route.operation in exact:
            installed(route)
            call, form = route.build(case)
            assert case.verdict(route.operation, form(call())) == "yes"


def test_the_reference_splits_ties_as_defined(case):
    expected, ties = case.expected_encode
    ones = np.unpackbits(expected, axis=1, count=1000, bitorder="little")
    assert (ones.sum(1) == 500).all()
    for pixels, bits, free in zip(case.frames.numpy(), ones, ties, strict=True):
        order = np.lexsort((np.arange(1000), -pixels.astype(int)))
        assert set(np.flatnonzero(bits)) == set(order[:500])
        tied = np.flatnonzero(np.unpackbits(free, count=1000, bitorder="little"))
        assert set(pixels[tied]) == {np.sort(pixels)[500]}


@pytest.mark.filterwarnings("ignore:.*constant frame")
@pytest.mark.parametrize("kind", FRAMES)
def test_every_kind_of_frames_is_encoded_by_all_that_take_it(kind):
    case, bench = Case(12, 1000, 3, kind=kind), Bench(limit_s=20, limit_bytes=1e9, budget_s=0)
    assert case.frames.numpy().dtype == case.dtype
    for route in COMPARED:
        if route.operation == "encode" and bench.reason_to_skip(route, case) is None:
            call, form = route.build(case)
            found = case.verdict("encode", form(call()))
            assert found in (
                ("yes",) if route.name.startswith(OURS) else ("yes", "yes, ties aside")
            )
    if str(case.dtype) != "uint8":
        reasons = {bench.reason_to_skip(route, case) for route in COMPARED}
        assert f"skipped: takes uint8, {'float32' if kind == 'uint16' else 'uint16'}" in reasons


def test_medians_move_where_they_are_said_to():
    def medians(kind):
        return np.median(Case(60, 1000, 3, kind=kind).frames, axis=1)

    assert np.abs(np.diff(medians("speckle"))).mean() < 3
    by_class, shuffled = medians(SORTED), medians(SHUFFLED)
    assert 95 < by_class.max() - by_class.min() < 130
    assert np.abs(np.diff(by_class)).mean() < 10 < 30 < np.abs(np.diff(shuffled)).mean()


def test_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match=r"task\.frames: expected among speckle, .* found 'x'"):
        Case(1, 2, 3, kind="x")


def test_run_writes_every_route_with_its_numbers(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    monkeypatch.setattr("experiments.studies.benchmark.bench.call_bytes", lambda *_: 1)
    task = configs.task("benchmark")
    assert inspect.signature(benchmark.run).parameters.keys() == task.keys() - {"_target_"}
    del task["_target_"]
    task |= {"n": [12], "d": [1024], "l": [3], "many": 9, "large": [2000], "frames": ["uint16"]}
    task |= {"frames_n": 12, "files": 12, "queries": 5, "budget_s": 0}
    folder = benchmark.run(**task)
    assert re.fullmatch(r"benchmark-\w{12}", folder.name)
    rows = measurement.read(folder).rows
    speckle = {
        (r["operation"], r["route"])
        for r in rows
        if (r.get("frames"), r["d"], r.get("l")) == ("speckle", "1024", "3")
    }
    assert speckle == {(r.operation, r.name) for r in ROUTES}
    for row in rows:
        assert row["status"] in ("ok", "not installed", "skipped: takes uint8, float32")
        if row["operation"] != "store" and row["status"] == "ok":
            assert 0 < float(row["min_s"]) <= float(row["median_s"])
            assert float(row["ratio_to_ours"]) > 0
            assert int(row["samples"]) >= 1
            assert re.search(r" \d", row["package"])
    headline, by_kind, by_classes, everything = STUDY.tables(Results(tmp_path))
    assert (headline.name, everything.name) == ("benchmark", "benchmark_all")
    assert "N = 12 frames of D = 1,024 pixels, L = 3 classes" in headline.title
    encoded = next(
        r for r in rows if (r["operation"], r["route"], r["frames"]) == ("encode", OURS, "uint16")
    )
    line = dict(zip(by_kind.heads, by_kind.cells()[2], strict=True))
    assert (line["Frames"], line["D"]) == ("speckle", "2000")
    line = dict(zip(by_kind.heads, by_kind.cells()[1], strict=True))
    assert (line["Frames"], line["N"]) == ("uint16", "12")
    assert float(line[OURS]) == pytest.approx(1e6 / 12 * float(encoded["median_s"]), rel=0.01)
    assert {cells[3] for cells in by_classes.cells()} == {"3", "9"}
    ours = next(r for r in rows if (r["operation"], r["route"]) == ("bundle", OURS))
    (line,) = (cells for cells in headline.cells() if cells[:2] == ["bundle", OURS])
    assert float(line[2]) == pytest.approx(1e3 * float(ours["median_s"]), rel=0.01)
    assert line[3] == "1.00"
    assert len(everything.cells()) == len(rows)
    assert "torch 2." in headline.note


def test_the_headline_is_of_one_size(tmp_path, write_measurement):
    def row(operation, n, d, classes):
        return {
            "operation": operation,
            "route": OURS,
            "n": n,
            "d": d,
            "l": classes,
            "median_s": 1e-3 * n,
            "ratio_to_ours": 1.0,
            "peak_bytes": 10,
            "equal_result": "yes",
            "status": "ok",
        }

    sizes = list(itertools.product((1000, 250_000), (5, 51)))
    rows = [row("bundle", n, *size) for n in (40, 400) for size in sizes]
    rows += [row("predict", 1, *size) for size in sizes]
    rows += [row("encode", n, 250_000, 3) for n in (40, 400)]  # classes are nothing to it
    write_measurement("benchmark", rows)
    headline, everything = (
        table
        for table in STUDY.tables(Results(tmp_path))
        if table.name in ("benchmark", "benchmark_all")
    )
    assert [cells[:3] for cells in headline.cells()] == [
        ["encode", OURS, "400"],
        ["bundle", OURS, "400"],
        ["predict, one frame", OURS, "1.00"],
    ]
    assert len(everything.cells()) == len(rows)


def test_what_was_cut_off_goes_on(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    monkeypatch.setattr("experiments.studies.benchmark.bench.call_bytes", lambda *_: 1)
    task = configs.task("benchmark")
    del task["_target_"]
    task |= {"n": [8], "d": [256], "l": [2], "many": 4, "large": [], "frames": [], "queries": 2}
    task["budget_s"] = 0
    monkeypatch.setattr(benchmark, "ROUTES", [route for route in ROUTES if route.name == OURS])
    asked = []

    def cut_off(bench, routes, case, memory):
        asked.append((routes[0].operation, case.n_classes))
        if len(asked) == 4:
            raise KeyboardInterrupt
        return measure(bench, routes, case, memory)

    measure = Bench.measure
    monkeypatch.setattr(Bench, "measure", cut_off)
    with pytest.raises(KeyboardInterrupt):
        benchmark.run(**task)
    folder = benchmark.run(**task)
    assert asked[3] == asked[4]  # the first three are not measured again
    assert len(set(asked)) == len(asked) - 1
    found = measurement.read(folder)
    assert found.record.status == "finished"
    places = [(r["operation"], r["route"], r.get("l"), r["d"]) for r in found.rows]
    assert len(set(places)) == len(places)
    assert {r["operation"] for r in found.rows} == {*OPERATIONS, "store"}


def test_goals_are_judged_by_one_record(tmp_path, write_measurement):
    def row(operation, route, median_s, **other):
        at = {"frames": "speckle", "n": 400, "d": 250_000, "l": 5, "status": "ok"}
        times = {"median_s": median_s, "ratio_to_ours": median_s}
        return at | {"operation": operation, "route": route} | times | other

    rows = [
        row("bundle", OURS_COMPILED, 0.001),
        row("bundle", "torchhd.multiset", 0.25),
        row("train", OURS_COMPILED, 0.02),
        row("train", ORDINARY_ROUTES[0], 1.5),
        row("train", ORDINARY_ROUTES[1], 1.4),
        row("train", READ, 0.01),
        row("train", ORDINARY_ROUTES[1], 0.1, n=40),
        row("predict", OURS_COMPILED, 0.0001, n=1),
        row("hamming", OURS, 0.9, n=100),
        row("hamming", "numkong.cdist", 1.0, n=100),
        row("encode", OURS, 0.5, n=100, frames=SHUFFLED),
        row("encode", OURS, 0.3, n=100, frames=SORTED),
        row("learn_one", OURS, 0.2, n=1, l=1000),
        row("learn_one", OURS, 0.2, n=1),
        row("folder", OURS, 1.0),
        row("folder", DECODED, 0.85),
    ]
    write_measurement("benchmark", rows)
    results = Results(tmp_path)
    goals = next(table for table in STUDY.tables(results) if table.name == "benchmark_goals")
    assert [(cells[1], cells[2], cells[3]) for cells in goals.cells()] == [
        ("≥ 200", "250.0", "yes"),
        ("≥ 80", "75.00", "no"),
        ("≤ 1.6", "2.000", "no"),
        ("≤ 0.12", "0.1000", "yes"),
        ("≤ 1.1", "0.9000", "yes"),
        ("≤ 1.3", "1.667", "no"),
        ("≤ 1.3", "1.000", "yes"),
        ("≥ 0.9", "0.8500", "no"),
    ]


def measured(routes, n=(12,), d=1000, classes=(3,), limit_s=20):
    """The bench after it has measured these routes, of one operation, at these sizes."""
    bench = Bench(limit_s=limit_s, limit_bytes=1.7e9, budget_s=0)
    for size in classes:
        for count in n:
            bench.measure(routes, Case(count, d, size))
    return bench


@pytest.mark.parametrize("operation", OPERATIONS)
def test_a_broken_route_is_not_timed_and_fails_the_run(operation):
    sound = next(r for r in ROUTES if (r.operation, r.name) == (operation, OURS))
    installed(sound)

    def build(case):
        call, form = sound.build(case)

        def broken(result):
            right = form(result)
            return right ^ right.dtype.type(1)

        return call, broken

    bench = measured([sound, Route(operation, "broken", build)])
    with pytest.raises(RuntimeError, match=rf"{operation} by broken \(wrong result\)"):
        bench.check()
    rows = {row["route"]: row for row in bench.rows}
    assert rows["broken"]["median_s"] is None
    assert rows["broken"]["equal_result"] == "no"
    assert rows[OURS]["median_s"] > 0


def test_what_raises_is_a_row_and_fails_the_run():
    def build(case):
        raise MemoryError("too large")

    bench = measured([Route("encode", "raising", build)])
    with pytest.raises(RuntimeError, match="failed: MemoryError: too large"):
        bench.check()


def test_skipped_rows_say_why():
    def slow(case):
        call, form = sound.build(case)
        result = call()

        def slowly():
            time.sleep(0.02)
            return result

        return slowly, form

    sound = next(r for r in ROUTES if (r.operation, r.name) == ("bundle", OURS))
    absent = dataclasses.replace(sound, name="absent", module="no_such_module")
    routes = [sound, Route("bundle", "slow", slow), absent]
    bench = measured(routes, n=[4, 400], d=64, classes=[3, 5], limit_s=1)
    found = {(row["route"], row["n"], row["l"]): row["status"] for row in bench.rows}
    assert found["slow", 4, 3] == "ok"
    assert re.fullmatch(r"skipped: about \d+ s expected, limit 1 s", found["slow", 400, 3])
    assert found[OURS, 4, 5] == "skipped: 4 frames for 5 classes"
    assert found["absent", 4, 3] == "not installed"
    assert found[OURS, 400, 5] == "ok"


def test_memory_is_foretold_from_the_same_pixels():
    name = "sklearn RidgeClassifier"
    ridge = next(r for r in ROUTES if (r.operation, r.name) == ("train", name))
    installed(ridge)

    def row(n, d, peak_bytes):
        known = {"operation": "train", "route": name, "frames": "speckle", "n": n, "d": d, "l": 5}
        return {**known, "status": "ok", "median_s": None, "peak_bytes": peak_bytes}

    rows = [row(4000, 10_000, 730_000_000), row(40, 250_000, 147_000_000)]  # with a Gram matrix
    bench = Bench(limit_s=20, limit_bytes=1.7e9, budget_s=0, rows=rows)
    assert bench.reason_to_skip(ridge, Case(400, 250_000, 5)) is None
    expected = "skipped: about 15.7 GB expected, limit 1.7 GB"  # 14.7 and a gigabyte of frames
    assert bench.reason_to_skip(ridge, Case(4000, 250_000, 5)) == expected
    del rows[1]
    expected = "skipped: about 1.9 GB expected, limit 1.7 GB"
    assert bench.reason_to_skip(ridge, Case(400, 250_000, 5)) == expected


def test_hypervectors_made_frame_by_frame_are_those_of_the_frames(case):
    assert case.words.equal(encode(case.frames))


def test_peak_memory_is_what_a_call_takes():
    route = next(r for r in ROUTES if r.name == "torch.median, compare")
    case = Case(100, 100_000, 5)
    peak = call_bytes(route, case)
    if peak is None:
        pytest.skip("this system does not tell the peak of a process")
    assert peak > 0.9 * case.n * case.d  # the mask of a byte a pixel


def test_a_process_tells_what_it_holds_and_held():
    before = machine.peak_bytes()
    held = np.ones(before, np.uint8)  # as much again
    assert machine.peak_bytes() > held.nbytes
    if (now := machine.resident_bytes()) is not None:
        assert held.nbytes < now <= machine.peak_bytes()
        del held
        assert machine.resident_bytes() < now
