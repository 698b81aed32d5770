"""Parts of the docs that are made of studies and configs."""

from experiments import studies
from experiments.records import configs
from experiments.records.files import REFERENCE, ROOT
from experiments.records.results import Results
from experiments.reporting import documents
from experiments.reporting.study import FigureOf, Plot, Study
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import Table, frame


def test_marked_blocks_are_filled_and_all_else_stays():
    blocks = [f"<!-- begin {n} -->\nold {n}\n<!-- end {n} -->" for n in ("one", "two")]
    page = "a\n" + "\nb\n".join(blocks)
    made = documents.fill(page, {"one": lambda: "new\nlines"})
    assert made == page.replace("old one", "new\nlines")
    assert documents.fill(made, {"one": lambda: "new\nlines"}) == made


def test_the_gallery_has_every_figure_with_its_command_and_its_tables():
    study = Study("some", "A title", "A question?", 1)
    empty = Study("empty", "Nothing", "No figure?", 2)
    of = FigureOf("a_figure", lambda *_: None, of="runs", caption="")
    plot = Plot(of, "What it *shows*.", ["make it", "and this"], frame([]))
    table = Table("a_table", "Of what", frame([{"x": 1}]))
    text = documents.gallery([study, empty], {"some": [table]}, {"some": [plot]})
    assert text.splitlines()[0] == "## A title"
    assert "(../results/reference/figures/a_figure.svg)" in text
    assert "    make it\n    and this" in text
    assert "[Of what](../results/reference/tables/a_table.csv)" in text
    assert "Nothing" not in text


def test_every_scene_is_listed_once_with_its_licence():
    text = documents.scene_list(Results(REFERENCE))
    names = [path.stem for path in (configs.CONFIGS / "scene").glob("*.yaml")]
    listed = [name for name in names if f"`scene={name}`" in text]
    assert sorted(listed) == sorted(set(names) - {"recorded"})
    sources = text.count("licence:")
    public = [n for n in listed if configs.scene_display(n)["kind"] != "simulated"]
    assert sources == len(public)
    assert "2,400 frames of 512 × 512 pixels; 4 classes." in text
    assert "the last 50 % of each class in time test" in text


def test_links_of_the_committed_gallery_lead_to_files():
    text = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    shown = {study.title for study in studies_of(studies)}
    headings = {line[3:] for line in text.splitlines() if line.startswith("## ")}
    assert headings <= shown
    for part in text.split("(../results/reference/")[1:]:
        name = part.partition(")")[0]
        assert (REFERENCE / name).is_file(), name
