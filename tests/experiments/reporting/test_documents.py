"""Parts of the docs that are made of studies and configs."""

import math

import pandas as pd

from experiments.records import configs
from experiments.reporting import documents
from experiments.reporting.answers import Answers
from experiments.reporting.study import Figure, Study
from experiments.reporting.table import Table, frame
from experiments.studies.recordings.figures import is_on_front
from experiments.studies.recordings.tables import COSTS


def test_marked_blocks_are_filled_and_all_else_stays():
    blocks = [f"<!-- begin {n} -->\nold {n}\n<!-- end {n} -->" for n in ("one", "two")]
    page = "a\n" + "\nb\n".join(blocks)
    made = documents.fill(page, {"one": lambda: "new\nlines"})
    assert made == page.replace("old one", "new\nlines")
    assert documents.fill(made, {"one": lambda: "new\nlines"}) == made


def test_the_table_of_costs_has_the_forms_and_softmax_after_most_frames():
    names = ["recording", "n", "model", "bytes", "error", "fit_best_s"]
    names += ["predict_frame_best_s"]
    rows = [
        (recording, n, model, 1500, 0.01 * n, 0.13, 0.002)
        for recording in documents.COSTS
        for n in (5, 50)
        for model in ("softmax_dual_standardised", "hdc", "ridge")
    ]
    alone = ("gelsight", 50, "thumbnail", 1, 1, 1, math.nan)
    made = Table(
        "costs", COSTS.make, of="", data=pd.DataFrame([*rows, alone], None, names)
    )
    lines = documents.costs(made).splitlines()
    assert lines[0].startswith("| Model | Error, GelSight (%) | Error, Fibre 1")
    assert lines[2] == "| HDC as published | 50 | 50 | 0.13 | 2.0 | 1.5 |"
    assert len(lines) == 4  # a form without the second recording is left out
    assert documents.costs(None) == documents.NOT_MEASURED


def test_the_opening_counts_data_sets_on_which_models_are_fast_and_right():
    def of(recording, *models):
        names = ["hdc", "hdc_lda", "a", "b", "c"]
        return [
            (recording, n, name, *numbers)
            for n in (5, 50)
            for name, numbers in zip(names, models, strict=False)
        ]

    rows = [
        *of("on the front", (1, 0.5), (2, 0.2), (3, 0.1), (4, 0.4)),
        # As fast and wrong as another; LDA is no faster than a, which errs as much.
        *of("behind it", (1, 0.5), (3, 0.4), (3, 0.4), (1, 0.6), (0.5, 0.9)),
    ]
    columns = ["recording", "n", "model", "fit_best_s", "error"]
    made = Table("costs", COSTS.make, of="", data=pd.DataFrame(rows, None, columns))
    text = documents.opening(made)
    assert "each of 3 to 4 other models on 1 of 2 public data sets" in text
    assert "On 1 of them, most of these models err less." in text
    assert text.endswith("on 1.")
    assert documents.opening(None) == documents.NOT_MEASURED


def test_the_opening_agrees_with_the_fronts_of_the_figure(committed):
    costs = committed.table("recording_costs")
    fronts = 0
    for _, rows in costs.data.dropna(subset="error").groupby("recording"):
        most = rows[rows.n == rows.n.max()]
        on_front = is_on_front(most.fit_best_s, most.error)
        fronts += "hdc_lda" in set(most.model[on_front])
    assert documents.opening(costs).endswith(f"on {fronts}.")


def test_table_1_has_five_rows_seeds_and_the_published_numbers(committed):
    head, _, *rows = documents.table1(committed.table("table1")).splitlines()
    assert head.startswith("| Model | Seeds |")
    assert len(rows) == 5
    assert rows[1].startswith("| Softmax | 7 |")
    assert rows[1].endswith("| ×137, 90 |")
    assert documents.table1(None) == documents.NOT_MEASURED


def test_the_page_of_results_has_every_figure_and_each_experiment_once(
    committed_results,
):
    def of(name, *words):
        run = "python -m experiments.run"
        commands = [f"{run} {word}" for word in words]
        return Table(name, lambda _: frame([{"x": 1}]), of="drift", commands=commands)

    shown = of("a_table", "experiment=drift scene=a", "-m experiment=drift 'x=[1, 2]'")
    drawn = of("drawn", "experiment=footprint", "experiment=gone")  # of older code
    figure = Figure("a_figure", drawn, lambda *_: None, caption="What it *shows*.")
    some = Study("some", "A title", "A question?", 1, tables=[shown], figures=[figure])
    empty = Study("empty", "Nothing", "No figure?", 2)
    answers = Answers("reference", committed_results, [some, empty])
    text = documents.results_page(answers, {"empty": "Nothing."})
    assert "\n\nA question?\n\n" in text
    text = documents.results_page(answers, {"some": "An answer."})
    assert text.splitlines()[2] == "An answer."
    assert "A question?" not in text
    assert text.splitlines()[0] == "## A title"
    assert "![a_figure](../results/reference/figures/a_figure.svg)" in text
    assert "What it \\*shows\\*." in text
    run = "    python -m experiments.run experiment="
    commands = [line for line in text.splitlines() if line.startswith("    ")]
    assert commands == [f"{run}footprint", f"{run}drift"]
    assert "[a_table](../results/reference/tables/a_table.csv)" in text
    assert "Nothing" not in text


def test_every_scene_is_listed_once_and_every_source_with_its_licence(
    committed_results,
):
    text = documents.scene_list(committed_results)
    names = {path.stem for path in (configs.CONFIGS / "scene").glob("*.yaml")}
    assert {name for name in names if f"`scene={name}`" in text} == names - {"recorded"}
    sources = [line for line in text.splitlines() if "licence:" in line]
    assert len(sources) == len(set(sources)) > 5
    simulated = text.partition("### Simulated")[2]
    assert "Cite:" not in simulated
    assert simulated.count("`scene=") == 5
    assert "500 frames of 41 × 82 pixels; 5 classes." in text
    assert "Test: the last 50 % of each class in time." in text
