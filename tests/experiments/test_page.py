"""The page stands alone, escapes what it is given, and has the numbers of the files."""

import base64
import csv
import io
import json
import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser

import pytest
from PIL import Image

from experiments import comparison, page, page_chart, page_figures, page_tables, table_text
from experiments.selection import Records

HOSTILE = '</script><script>alert("1")</script>&<img src=x onerror=alert(2)>'


class Page(HTMLParser):
    """Elements with their attributes, tables by the id of what they stand in, scripts by type."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.tables, self.scripts, self.text = [], {}, {}, ""
        self._item = self._cell = self._script = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.elements.append((tag, attrs))
        if attrs.get("class") == "item":
            self._item = attrs.get("id")
        elif tag == "tr":
            self.tables.setdefault(self._item, []).append([])
        elif tag in ("td", "th"):
            self._cell = ""
            self._exact = attrs.get("data-exact")
        elif tag == "script":
            self._script = attrs.get("type")

    def handle_endtag(self, tag):
        if tag in ("td", "th"):
            self.tables[self._item][-1].append(self._exact or self._cell.strip())
            self._cell = None
        elif tag == "script":
            self._script = None

    def handle_data(self, data):
        if self._script:
            self.scripts.setdefault(self._script, []).append(data)
        elif self._cell is not None:
            self._cell += data
        else:
            self.text += data


@pytest.fixture
def built(a_full_set, write_page):
    """built() → the page of a results folder with made-up records, its rows and Table I."""

    def build():
        path, compared, rows = write_page()
        return Page(path.read_text(encoding="utf-8")), compared, rows

    return build


def test_numbers_are_those_of_the_files(built, write_measurement):
    rows = [{"name": "cancelling", "error": "1.23456789e-7", "verdict": "ours is better"}] * 3
    write_measurement("stability", rows)
    found, compared, table1 = built()
    exact = list(csv.DictReader(comparison.to_csv(compared).splitlines()))
    for cells, line in zip(found.tables["comparison"][1:], exact, strict=True):
        assert cells[0].startswith(f"{line['experiment']}: ".replace("_", " "))
        assert [cells[k] for k in (1, 4, 8)] == [line[k] for k in ("verdict", "unit", "made_by")]
        for cell, names in ((cells[2], ("published", "published_low", "published_high")),
                            (cells[3], ("measured", "ci_low", "ci_high"))):  # fmt: skip
            wanted = [float(line[name]) for name in names if line[name]]
            assert [float(n) for n in re.findall(r"[\d.]+", cell)] == pytest.approx(wanted, 5e-4)
    assert found.tables["stability"][1:] == [list(row.values()) for row in rows]
    columns = table_text.TABLE1_COLUMNS
    cells = [[" ".join(cell(row).split()) for _, cell in columns] for row in table1]
    assert found.tables["table1"] == [[head for head, _ in columns], *cells]


def test_it_needs_no_network_and_every_picture_is_whole(built, tmp_path):
    figures = tmp_path / "figures"
    figures.mkdir()
    (figures / "a figure.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    Image.effect_noise((900, 900), 90).convert("RGB").save(figures / "large.png")
    Image.new("RGB", (3, 2)).save(figures / "small.png")
    found, _, _ = built()
    sources = [value for _, attrs in found.elements for key, value in attrs.items()
               if key in ("src", "href", "srcset", "action", "data", "poster")]  # fmt: skip
    assert {value.partition(":")[0] for value in sources if not value.startswith("#")} == {"data"}
    style = page.TEMPLATES / "report.css"
    assert not re.search(r"url\(|@import", style.read_text())
    pictures = [attrs for tag, attrs in found.elements if tag == "img"]
    assert [attrs["alt"] for attrs in pictures][:3] == ["a figure.", "large.", "small."]
    assert "missing: fig4_images" in found.text
    for attrs in pictures:
        kind, data = re.fullmatch(r"data:image/([\w+]+);base64,(.*)", attrs["src"]).groups()
        data = base64.b64decode(data, validate=True)
        if kind == "svg+xml":
            assert ET.fromstring(data).tag.endswith("svg")
        else:
            assert max(Image.open(io.BytesIO(data)).size) <= 4000
            assert len(data) < (figures / "large.png").stat().st_size
    anchors = {attrs["id"] for _, attrs in found.elements if "id" in attrs}
    links = {value[1:] for value in sources if value.startswith("#")}
    assert links
    assert links <= anchors


def test_what_comes_from_outside_is_escaped(built, tmp_path, write_run, write_measurement):
    write_run("cnn3", seed=9, status="failed", error=f"ValueError: {HOSTILE}")
    write_measurement("stability", [{"name": HOSTILE, HOSTILE: "1"}], command=HOSTILE)
    (tmp_path / "figures").mkdir()
    name = 'x" onload="alert(3)'
    (tmp_path / "figures" / f"{name}.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    (tmp_path / "runs" / "<b>broken<b>").mkdir()
    (tmp_path / "runs" / "<b>broken<b>" / "record.json").write_text("{")
    found, _, _ = built()
    names = {tag for tag, _ in found.elements}
    assert "b" not in names
    assert len([tag for tag, _ in found.elements if tag == "script"]) == 3
    assert next(attrs["alt"] for tag, attrs in found.elements if tag == "img") == f"{name}."
    assert not [key for _, attrs in found.elements for key in attrs if key.startswith("on")]
    assert found.tables["stability"] == [["name", HOSTILE], [HOSTILE, "1"]]
    assert HOSTILE in found.text
    assert "<b>broken<b>" in found.text


def test_the_chart_is_drawn_from_the_curves(built, tmp_path):
    import vl_convert

    found, _, _ = built()
    (grammar,) = map(json.loads, found.scripts["application/json"])
    runs = [
        run for model in page_chart.MODELS for run in Records(tmp_path).group("touch", model).runs
    ]
    points = {(p["seconds"], p["test accuracy"]) for p in grammar["datasets"]["measured"]}
    assert points == {(r["training_s"], r["test_accuracy"]) for run in runs for r in run.curve}
    assert sum(p["reached"] for p in grammar["datasets"]["measured"]) == 4  # softmax and cnn1
    assert len(grammar["datasets"]["published"]) == 4
    grammar["width"] = 400
    drawn = ET.fromstring(vl_convert.vegalite_to_svg(grammar))
    labels = {e.get("aria-label") or "" for e in drawn.iter()}
    assert sum("published, Table I" in label for label in labels) == 4
    library = found.scripts["module"][0]
    assert "vegaEmbed" in library
    assert len(library) > 500_000


def test_without_records_everything_is_said_to_be_missing(write_page):
    path, _, _ = write_page()
    found = Page(path.read_text(encoding="utf-8"))
    for name in page._MEASURED:
        assert f"missing: measured/{name} has not been made" in found.text
    assert "missing: no records" in found.text
    assert "Quick reproduction" not in found.text


@pytest.mark.parametrize(("modes", "quick"), [(["quick"], True), (["quick", "full"], False)])
def test_a_quick_reproduction_is_called_one(built, tmp_path, modes, quick):
    (tmp_path / "tables").mkdir()
    lines = ["step,mode,seconds", *(f"hdc,{mode},3.5" for mode in modes)]
    (tmp_path / "tables" / "reproduce.csv").write_text("\n".join(lines))
    found, _, _ = built()
    assert ("Quick reproduction" in found.text) == quick
    assert len(found.tables["reproduce"]) == 1 + len(modes)


def test_long_curves_are_thinned_and_keep_where_90_percent_was_reached(tmp_path, write_run):
    curve = [{"training_s": k + 1.0, "loss": 1.0, "train_accuracy": 0.95 if k > 776 else 0.1}
             for k in range(1000)]  # fmt: skip
    write_run("softmax", curve=curve)
    grammar = page_chart.error_vs_time(Records(tmp_path), "touch")
    points = grammar["datasets"]["measured"]
    assert len(points) <= 202
    assert [p["seconds"] for p in points if p["reached"]] == [778]
    assert [points[k]["seconds"] for k in (0, -1)] == [1, 1000]


@pytest.mark.parametrize(
    ("text", "shown", "exact"),
    [("0.123456", "0.1235", "0.123456"), ("5", "5", ""), ("1e-9", "1e-9", ""), ("nan", "nan", ""),
     ("a 5", "a 5", ""), ("123456", "123456", ""), ("-0.000123456", "-0.0001235", "-0.000123456")],
)  # fmt: skip
def test_numbers_are_rounded_beside_their_exact_value(text, shown, exact):
    cell = page_tables.rounded(text)
    assert (cell.text, cell.exact) == (shown, exact)


def test_a_table_too_long_for_a_page_says_so(tmp_path, write_measurement):
    write_measurement("drift", [{"a": "1"}] * 201)
    (table,) = page_tables.of_measurement(tmp_path, "drift", "Drift", "a command")
    assert not table.rows
    assert "201 rows" in table.instead


def test_tables_of_markdown():
    text = """**Title**

| a \\| b | c |
| --- | --- |
| 1 \\| 2 | – |
|  | **x** |

Notes.

- of \\_this\\_

**Second**

| made by |
| --- |
| `python -m a` |
"""
    first, second = page_tables.of_markdown("name", "Title", text, "a command", "in 2 s")
    assert first.columns == ["a | b", "c"]
    assert [[cell.text for cell in row] for row in first.rows] == [["1 | 2", "–"], ["", "x"]]
    assert (first.name, first.title, first.intro) == ("name", "Title", "")
    assert (first.notes, first.commands) == ("Notes.\n- of _this_", ())
    assert (second.name, second.title, second.notes) == ("name-2", "Second", "in 2 s")
    assert [[cell.text for cell in row] for row in second.rows] == [["python -m a"]]
    assert second.commands == ["a command"]


def test_a_measurement_is_shown_as_its_markdown_while_there_is_one(tmp_path, write_measurement):
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "drift.md").write_text("| b |\n| --- |\n| 5 |\n")
    (table,) = page_tables.of_measurement(tmp_path, "drift", "Drift", "a command")
    assert "missing" in table.instead
    write_measurement("drift", [{"a": "1"}])
    (table,) = page_tables.of_measurement(tmp_path, "drift", "Drift", "a command")
    assert [cell.text for row in table.rows for cell in row] == ["5"]
    assert table.commands == ["python -m experiments.run experiment=drift"]


def test_known_figures_come_first_and_vector_graphics_win(tmp_path):
    for name in ("zebra.svg", "accuracy_vs_n.svg", "error_vs_time.svg", "zebra.png"):
        (tmp_path / name).write_text("<svg/>")
    found = page_figures.collect(tmp_path)
    names = [figure.name for figure in found if figure.source and not figure.of_sensor]
    assert names == ["error_vs_time", "accuracy_vs_n", "zebra"]
    assert found[-1].source.startswith("data:image/svg")
