"""End to end: a small Table I, and a committed number made again."""

import csv
import io
from pathlib import Path

import pytest
from rich.console import Console

from experiments.protocol import runner
from experiments.protocol.measure_run import Training
from experiments.protocol.settings import checked
from experiments.protocol.task import Context
from experiments.records.results import Results
from experiments.reporting.answers import Answers
from experiments.studies.table1 import tables, view
from tests.experiments.composed import composed
from tests.experiments.golden_items import SMALL_CAMERA

GOLDEN = Path(__file__).parent / "golden" / "table1.csv"
SMALL = ["scene=touch", "scene.samples_per_class=12", "scene.contact.depth_spread=0.0",
         "scene.contact.position_spread=0.0", SMALL_CAMERA]  # fmt: skip
SHORT = ["stop.most_steps=40", "stop.least_steps=10", "threads=1", "exclusive=false",
         "cache=false"]  # fmt: skip
COUNTS = [
    *("model", "n_train", "pixels", "seeds", "stop", "status", "n_test", "model_bytes")
]


def test_table_1_of_a_small_scene_is_the_committed_one(
    results, one_thread, monkeypatch
):
    monkeypatch.setattr(tables, "scene", lambda: "small")
    for model in tables.LINES:
        asked = runner.Asked({"scene": "small", "model": model, "stop": "short"})
        for seed in (0, 1) if model in ("hdc", "softmax_dual") else (0,):
            config = composed(*SMALL, *SHORT, f"model={model}", f"seed.run={seed}")
            runner.carry_out(config, asked, Console(quiet=True))
    table = Answers("mine", Results(results), [view.STUDY]).table("table1")
    lines = [{name: line[name] for name in COUNTS} | {
        # Networks after 40 steps are undecided about samples: their last bits would count.
        "right": round(float(line["test_accuracy_final"]) * int(line["n_test"]))
        if line["model"] in ("hdc", "softmax_dual") else ""}
        for line in csv.DictReader(io.StringIO(table.csv()))]  # fmt: skip
    text = io.StringIO()
    writer = csv.DictWriter(text, [*COUNTS, "right"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    assert text.getvalue() == GOLDEN.read_text()


def test_a_committed_number_is_made_again(committed_results, request, one_thread):
    place = "fibre"
    try:
        request.getfixturevalue("measured_data")
    except pytest.skip.Exception:
        place = "touch"  # half a minute of simulated frames
    name = (place, "ridge")
    every = committed_results.runs
    of_ridge = [r for r in every if (r.scene.label, r.model.label) == name]
    run = min(of_ridge, key=lambda run: run.results["total_time_s"])
    known = run.results
    task = checked({**run.config, "beside": {}}, Training)
    *_, again = task.rows(Context("ridge", console=Console(quiet=True)))
    assert again["n_test"] == known["n_test"]
    if again["test_set"] == known["test_set"]:
        assert again["right"] == known["right"]
    else:  # another processor rounds a few grey values otherwise
        assert abs(again["right"] - known["right"]) <= 0.02 * known["n_test"]
        pytest.skip(f"{place}: frames differ on this processor; accuracy agrees")
