"""The times of ranks: a row each, a table of the slowest."""

from __future__ import annotations

import torch

from experiments.records import configs, measurement
from experiments.records.results import Results
from experiments.studies.ranks import measure as ranks
from experiments.studies.ranks.view import STUDY

SHAPE = [5, 13]  # 65 pixels: one word and a bit


def in_turn(function, arguments, nprocs):
    """Ranks as forked processes, in the place of spawned ones that import everything anew."""
    started = [
        torch.multiprocessing.get_context("fork").Process(target=function, args=(r, *arguments))
        for r in range(nprocs)
    ]
    for process in started:
        process.start()
    for process in started:
        process.join(60)
    assert [process.exitcode for process in started] == [0] * nprocs


def test_rows_of_the_measurement_and_their_table(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    monkeypatch.setattr(ranks.multiprocessing, "spawn", in_turn)
    task = {key: value for key, value in configs.task("distributed").items() if key != "_target_"}
    task |= {"ranks": [1, 3], "n": 10, "shape": SHAPE, "classes": 4, "repeats": 3}
    rows = measurement.read(ranks.run(**task)).rows
    assert [(row["ranks"], row["rank"], row["frames"]) for row in rows] == [
        ("1", "0", "10"),
        ("3", "0", "3"),
        ("3", "1", "3"),
        ("3", "2", "4"),
    ]
    assert {row["bytes"] for row in rows} == {str(4 * SHAPE[0] * SHAPE[1])}
    assert len({row["prototypes_sha256"] for row in rows}) == 1
    for row in rows:
        low, median, high = (float(row[f"count_{q}_s"]) for q in ("q25", "median", "q75"))
        assert 0 < low <= median <= high
        assert float(row["seconds"]) > max(median / 2, float(row["add_q25_s"]))
    (table,) = STUDY.tables(Results(tmp_path))
    one, three = table.cells()
    assert (one[:2], three[:2]) == (["1", "10"], ["3", "4"])
    assert one[5] == "1.00"
    seconds = max(float(row["seconds"]) for row in rows[1:])
    assert table.data["speedup"][1] == float(rows[0]["seconds"]) / seconds
    assert "N = 10 frames of noise, 5 × 13 pixels" in table.title
    assert "the same bit for bit" in table.note


def test_other_prototypes_are_said_to_be_so(tmp_path, write_measurement):
    times = {f"{what}_{q}_s": 1 for what in ("count", "add") for q in ("q25", "median", "q75")}
    row = {"ranks": 1, "rank": 0, "frames": 2, **times, "seconds": 2, "bytes": 8}
    config = {"n": 2, "shape": [1, 2], "classes": 2, "repeats": 1}
    digests = ({**row, "prototypes_sha256": text} for text in ("a", "b"))
    write_measurement("distributed", list(digests), config=config)
    (table,) = STUDY.tables(Results(tmp_path))
    assert "NOT the same" in table.note
