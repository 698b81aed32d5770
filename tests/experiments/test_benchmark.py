"""The benchmark: results are really compared, and nothing is left out in silence."""

import dataclasses
import re

import numpy as np
import pytest

from experiments import benchmark
from experiments.benchmark_cases import Case
from experiments.benchmark_memory import peak_bytes
from experiments.benchmark_results import Row, growth, read, targets, to_csv
from experiments.benchmark_routes import OURS, OURS_COMPILED, READ, ROUTES, Route
from hdc.encode import encode

COMPARED = [r for r in ROUTES if r.name != READ]


def installed(route):
    return pytest.importorskip(route.module)


@pytest.fixture(scope="module")
def case():
    return Case(12, 1000, 3)


@pytest.fixture
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("route", COMPARED, ids=lambda r: f"{r.operation}-{r.name}")
def test_a_result_is_right_and_a_changed_one_is_not(route, case):
    installed(route)
    call, form = route.build(case)
    result = form(call())
    assert case.verdict(route.operation, result) != "no"
    changed = result.copy()
    if changed.dtype == np.uint8:  # one bit on which all methods have to agree
        _, free = getattr(case, f"expected_{route.operation}")
        assert 0 < np.unpackbits(free).mean() < 0.5 or not free.any()
        row, byte = np.argwhere(free == 0)[0]
        changed[row, byte] ^= 1
    else:
        changed.flat[-1] += 1
    assert case.verdict(route.operation, changed) == "no"
    assert case.verdict(route.operation, result[:-1]) == "no"


def test_ours_is_exact_to_the_last_bit(case):
    for route in COMPARED:
        if route.name == OURS and route.operation in ("encode", "bundle", "train", "hamming"):
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


def test_run_writes_every_route_with_its_numbers(results):
    path = benchmark.run(n=[12], d=[1000], l=[3], queries=5, budget_s=0)
    assert path == results / "benchmark.csv"
    rows = read(path)
    assert {(r.operation, r.route) for r in rows if r.operation != "store"} == {
        (r.operation, r.name) for r in ROUTES
    }
    for row in rows:
        assert row.status in ("ok", "not installed")
        if row.operation != "store" and row.status == "ok":
            assert 0 < row.min_s <= row.median_s
            assert row.ratio_to_ours > 0
            assert row.samples >= 1
        assert row.threads >= 1
        assert "torch 2" in row.versions
    table = benchmark.markdown_table(path)
    ours = next(r for r in rows if (r.operation, r.route) == ("bundle", OURS))
    (line,) = (x for x in table.splitlines() if x.startswith(f"| bundle | {OURS} |"))
    assert f"| {ours.median_s * 1e3:.3g} ms | 1 |" in line
    assert len(table.splitlines()) == 4 + len(rows)


@pytest.mark.parametrize("operation", ["encode", "bundle", "hamming", "train", "predict"])
def test_a_broken_route_is_not_timed_and_fails_the_run(operation, results):
    sound = next(r for r in ROUTES if (r.operation, r.name) == (operation, OURS))

    def build(case):
        call, form = sound.build(case)

        def broken(result):
            right = form(result)
            return right ^ right.dtype.type(1)

        return call, broken

    routes = [sound, Route(operation, "broken", build)]
    with pytest.raises(RuntimeError, match=rf"{operation} by broken \(wrong result\)"):
        benchmark.run(n=[12], d=[1000], l=[3], queries=5, budget_s=0, routes=routes)
    rows = {r.route: r for r in read(results / "benchmark.csv") if r.operation == operation}
    assert rows["broken"].median_s is None
    assert rows["broken"].equal_result == "no"
    assert rows[OURS].median_s > 0


def test_what_raises_is_a_row_and_fails_the_run(results):
    def build(case):
        raise MemoryError("too large")

    with pytest.raises(RuntimeError, match="failed: MemoryError: too large"):
        benchmark.run(n=[4], d=[64], l=[2], routes=[Route("encode", "raising", build)])


def test_skipped_rows_say_why(results):
    def slow(case):
        import time

        _, form = sound.build(case)
        result = sound.build(case)[0]()

        def call():
            time.sleep(0.02)
            return result

        return call, form

    sound = next(r for r in ROUTES if (r.operation, r.name) == ("bundle", OURS))
    absent = dataclasses.replace(sound, name="absent", module="no_such_module")
    routes = [sound, Route("bundle", "slow", slow), absent]
    path = benchmark.run(n=[4, 400], d=[64], l=[3, 5], limit_s=1, budget_s=0, routes=routes)
    found = {(r.route, r.n, r.l): r.status for r in read(path)}
    assert found["slow", 4, 3] == "ok"
    assert re.fullmatch(r"skipped: about \d+ s expected, limit 1 s", found["slow", 400, 3])
    assert found[OURS, 4, 5] == "skipped: 4 frames for 5 classes"
    assert found["absent", 4, 3] == "not installed"
    assert found[OURS, 400, 5] == "ok"


def test_memory_is_foretold_from_the_same_pixels():
    name = "sklearn RidgeClassifier"
    ridge = next(r for r in ROUTES if (r.operation, r.name) == ("train", name))
    installed(ridge)
    rows = [
        Row("train", ridge.name, 4000, 10_000, 5, peak_bytes=730_000_000),  # with a Gram matrix
        Row("train", ridge.name, 40, 250_000, 5, peak_bytes=147_000_000),
    ]
    bench = benchmark._Bench(limit_s=20, limit_bytes=1.7e9, budget_s=0, rows=rows)
    assert bench._reason_to_skip(ridge, Case(400, 250_000, 5)) is None
    expected = "skipped: about 15.7 GB expected, limit 1.7 GB"  # 14.7 and a gigabyte of frames
    assert bench._reason_to_skip(ridge, Case(4000, 250_000, 5)) == expected
    del rows[1]
    expected = "skipped: about 1.9 GB expected, limit 1.7 GB"
    assert bench._reason_to_skip(ridge, Case(400, 250_000, 5)) == expected


def test_hypervectors_made_frame_by_frame_are_those_of_the_frames(case):
    assert case.words.equal(encode(case.frames))


def test_peak_memory_is_what_a_call_takes():
    route = next(r for r in ROUTES if r.name == "torch.median, compare")
    case = Case(100, 100_000, 5)
    peak = peak_bytes(route, case)
    if peak is None:
        pytest.skip("this system does not tell the peak of a process")
    assert peak > 0.9 * case.n * case.d  # the mask of a byte a pixel


def test_growth_and_targets_from_rows():
    rows = [
        Row("bundle", OURS, n, d, 5, median_s=1e-9 * n * d**1.5, peak_bytes=n * d)
        for n in (40, 400)
        for d in (10_000, 250_000)
    ]
    rows.append(Row("bundle", "torchhd.multiset", 400, 250_000, 5, 1.0, 1.0, 150.0))
    found = {(o, k): (t, m) for o, k, t, m, _ in growth(rows)}
    assert found["bundle", "N"] == pytest.approx((1, 1))
    assert found["bundle", "D"] == pytest.approx((1.5, 1))
    assert ("bundle", "L") not in found
    by_name = {what: reached for what, _, _, reached in targets(rows)}
    assert by_name["bundle: torchhd.multiset over hdc"] is True
    assert "bundle: torchhd.multiset over hdc, compiled" not in by_name
    rows[-1].ratio_to_ours = 80.0
    rows.append(Row("bundle", OURS_COMPILED, 400, 250_000, 5, 1.0, 1.0, 0.5))
    by_name = {what: reached for what, _, _, reached in targets(rows)}
    assert by_name["bundle: torchhd.multiset over hdc"] is False
    assert by_name["bundle: torchhd.multiset over hdc, compiled"] is True  # 160 times
    assert by_name["train: sklearn RidgeClassifier over hdc"] is None


def test_csv_is_read_back_as_written(tmp_path):
    rows = [
        Row("encode", "a, b", 1, 2, 3, 0.5, 0.25, None, 7, "yes, ties aside"),
        Row("x", "y", 1, 1, 1),
    ]
    (tmp_path / "rows.csv").write_text(to_csv(rows))
    assert read(tmp_path / "rows.csv") == rows
