"""The page stands alone, escapes what it is given, and has the numbers of the tables."""

import io
import re
from html.parser import HTMLParser

import pandas as pd
from PIL import Image

from experiments.reporting.page import page
from experiments.reporting.page.page import Picture, Section
from experiments.reporting.study import FigureOf, Plot
from experiments.reporting.table import Table, frame

HOSTILE = (
    '</script><script>alert("1")</script>&<img src=x onerror=alert(2)>\\ `|` \x1b[31m'
)
SVG = (
    b'<svg xmlns="http://www.w3.org/2000/svg" width="30pt" height="15pt">'
    b"<text font=\"'a' &amp; b\">100 % #1</text></svg>"
)


class Page(HTMLParser):
    """Elements with their attributes, tables by the id of what they stand in, all text."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.tables, self.text = [], {}, ""
        self._item = self._cell = None
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

    def handle_endtag(self, tag):
        if tag in ("td", "th"):
            self.tables[self._item][-1].append(self._cell.strip())
            self._cell = None

    def handle_data(self, data):
        if self._cell is not None:
            self._cell += data
        self.text += data

    def all(self, key):
        return [attrs[key] for _, attrs in self.elements if key in attrs]


def a_table(name="some", rows=2, **values):
    data = [
        {"name": "a name", "error": 1.23456789e-7 * k, **values}
        for k in range(1, rows + 1)
    ]
    return Table(
        name, "A title", frame(data), note="How to read it.", commands=["make it"]
    )


def picture(name="a_figure", data=SVG, kind="svg", caption="What it shows."):
    of = FigureOf(name, lambda *_: None, of="runs", caption=caption, kind=kind)
    return Picture(Plot(of, caption, ["draw it"], pd.DataFrame()), data)


def built(tables=(), pictures=(), problems=(), about=None, **section):
    made = Section(
        "question", "A question", "What it asks.", tables, pictures, **section
    )
    about = {"reference": "5 runs"} if about is None else about
    return Page(page.render([made], problems, about))


def webp(colour):
    stream = io.BytesIO()
    Image.new("RGB", (3, 2), colour).save(stream, "webp", lossless=True)
    return stream.getvalue()


def test_it_asks_for_nothing_but_the_figures_beside_it():
    pictures = [picture(), picture("photograph", webp("red"), "webp")]
    found = built([a_table()], pictures)
    sources = [value for key in ("src", "href", "srcset", "action", "data", "poster")
               for value in found.all(key)]  # fmt: skip
    files = {value for value in sources if not value.startswith(("#", "data:"))}
    assert files == {
        "figures/a_figure.svg",
        "figures/photograph.webp",
        "tables/some.csv",
    }
    assert not re.search(r"url\(|@import", (page.TEMPLATES / "report.css").read_text())
    images = [attrs for tag, attrs in found.elements if tag == "img"]
    assert [(a["width"], a["height"]) for a in images] == [("40", "20"), ("3", "2")]
    assert {attrs["alt"] for attrs in images} == {"What it shows."}


def test_anchors_exist_and_none_is_twice():
    found = built([a_table()], [picture()])
    anchors = found.all("id")
    assert len(set(anchors)) == len(anchors)
    links = {value[1:] for value in found.all("href") if value.startswith("#")}
    assert links <= set(anchors)
    assert {"question", "table-some", "figure-a_figure"} <= set(anchors)


def test_a_wide_table_shows_eight_columns_and_names_its_file():
    wide = a_table(**{f"x{k}": k for k in range(10)})
    found = built([wide])
    (rows,) = found.tables.values()
    assert {len(row) for row in rows} == {page.COLUMNS}
    assert "4 more columns: tables/some.csv" in found.text


def test_what_comes_from_outside_is_escaped():
    made = a_table(HOSTILE, error=HOSTILE, verdict=HOSTILE)
    hostile = Table(HOSTILE, HOSTILE, made.data, note=HOSTILE, commands=[HOSTILE])
    shown = picture('x" onload="alert(3)', caption=HOSTILE)
    plain = built([a_table("t", error="e", verdict="v")], [picture()], problems=["p"])
    found = built([hostile], [shown], problems=[HOSTILE], about={HOSTILE: HOSTILE})
    tags = [[tag for tag, _ in one.elements] for one in (found, plain)]
    assert tags[0].count("script") == tags[1].count("script") == 1
    assert set(tags[0]) == set(tags[1])
    assert not [
        key for _, attrs in found.elements for key in attrs if key.startswith("on")
    ]
    (rows,) = found.tables.values()
    assert rows[1][1] == HOSTILE.strip()
    # Shown as it is, escaped once: "<" reads "<".
    assert found.text.count(HOSTILE) >= 7
    assert "&lt;" not in found.text
    (image,) = (attrs for tag, attrs in found.elements if tag == "img")
    assert image["alt"] == HOSTILE
