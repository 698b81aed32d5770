"""Parts of the docs that are made of studies and configs."""

import math

import pandas as pd

from experiments import studies
from experiments.records import configs
from experiments.records.files import REFERENCE, ROOT
from experiments.reporting import documents
from experiments.reporting.study import Plot, Study
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import Table, frame


def test_marked_blocks_are_filled_and_all_else_stays():
    blocks = [f"<!-- begin {n} -->\nold {n}\n<!-- end {n} -->" for n in ("one", "two")]
    page = "a\n" + "\nb\n".join(blocks)
    made = documents.fill(page, {"one": lambda: "new\nlines"})
    assert made == page.replace("old one", "new\nlines")
    assert documents.fill(made, {"one": lambda: "new\nlines"}) == made


def test_a_claim_stands_once_with_its_names():
    rows = [
        "| Claim | Command |",
        "| --- | --- |",
        "| Fast | run --claim times |",
        "| Fast | run --claim times |",
    ]
    shown = ["| Claim | Name |", "| --- | --- |", "| Fast | `times` |"]
    shown.append("| | `times` |")
    assert documents.named("\n".join(rows)).splitlines() == shown
    assert documents.named(documents.NOT_MEASURED) == documents.NOT_MEASURED


def test_the_table_of_costs_has_the_forms_and_softmax_after_most_frames():
    columns = ["recording", "n", "model", "bytes", "error"]
    columns += [
        "fit_s",
        "predict_frame_s",
        "fit_compiled_s",
        "predict_frame_compiled_s",
    ]
    nan = math.nan
    rows = [
        (recording, n, model, 1500, 0.01 * n, 0.25, 0.002, compiled, 0.003)
        for recording in documents.COSTS
        for n in (5, 50)
        for model, compiled in (("softmax_dual", nan), ("hdc", 0.13), ("ridge", nan))
    ]
    alone = ("gelsight", 50, "bits_chosen", 1, 1, 1, 1, nan, nan)
    table = pd.DataFrame([*rows, alone], columns=columns)
    lines = documents.costs(table).splitlines()
    assert lines[0].startswith("| Model | Error, GelSight (%) | Error, Fibre 1")
    assert lines[2] == "| HDC | 50 | 50 | 0.13 | 2.0 | 1.5 |"  # the faster of each
    assert lines[3].endswith("| 0.25 | 2.0 | 1.5 |")
    assert len(lines) == 4  # a form without the second recording is left out
    assert documents.costs(None) == documents.NOT_MEASURED


def test_the_page_of_results_has_every_figure_and_each_experiment_once():
    study = Study("some", "A title", "A question?", 1)
    empty = Study("empty", "Nothing", "No figure?", 2)
    commands = ["python -m run experiment=drift scene=a", "make it"]
    commands.append("python -m run -m experiment=drift scene=b,c 'x=[1, 2]'")
    commands.append("python -m run experiment=gone")  # of an older commit
    plot = Plot(
        "a_figure",
        lambda *_: None,
        of="runs",
        caption="What it *shows*.",
        commands=commands,
    )
    table = Table("a_table", title="Of what", data=frame([{"x": 1}]))
    text = documents.results_page(
        [study, empty], {"some": [table]}, {"some": [plot, plot]}
    )
    assert text.splitlines()[0] == "## A title"
    assert "(../results/reference/figures/a_figure.svg)" in text
    shown = [line for line in text.splitlines() if line.startswith("    ")]
    assert shown == ["    python -m run experiment=drift", "    make it"]
    assert "[a_table](../results/reference/tables/a_table.csv)" in text
    assert "Nothing" not in text


def test_every_scene_is_listed_once_and_every_source_with_its_licence(
    committed_results,
):
    text = documents.scene_list(committed_results)
    names = [path.stem for path in (configs.CONFIGS / "scene").glob("*.yaml")]
    listed = [name for name in names if f"`scene={name}`" in text]
    assert sorted(listed) == sorted(set(names) - {"recorded"})
    sources = [line for line in text.splitlines() if "licence:" in line]
    assert len(sources) == len(set(sources)) > 5
    simulated = text.partition("### Simulated")[2]
    assert "Cite:" not in simulated
    assert simulated.count("`scene=") == 5
    assert "500 frames of 41 × 82 pixels; 5 classes." in text
    assert "Test: the last 50 % of each class in time." in text


def test_links_of_the_committed_results_lead_to_files():
    text = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    shown = {study.title for study in studies_of(studies)}
    headings = {line[3:] for line in text.splitlines() if line.startswith("## ")}
    assert headings <= shown
    for part in text.split("(../results/reference/")[1:]:
        name = part.partition(")")[0]
        assert (REFERENCE / name).is_file(), name
