"""The page stands alone, escapes what it is given, and has the numbers of the tables."""

import base64
import gzip
import io
import re
from html.parser import HTMLParser

from PIL import Image

from experiments.reporting.page import page
from experiments.reporting.page.page import Block, Picture, Section
from experiments.reporting.study import Plot
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
    return Picture(Plot(name, caption, lambda: None, ["draw it"], kind), data)


def built(*blocks, problems=(), about=None, **section):
    made = Section("question", "A question", "What it asks.", blocks, **section)
    about = {"reference": "5 runs"} if about is None else about
    return Page(page.render([made], problems, about))


def test_the_interactive_form_of_a_figure_is_built_once():
    built_with = []

    def chart():
        built_with.append("data")
        return {"mark": "point"}

    figure = Picture(Plot("a_figure", "", lambda: None, chart=chart), SVG)
    shown = built(Block(pictures=[figure]))
    assert "chart" in shown.all("class")
    assert built_with == ["data"]


def webp(colour):
    stream = io.BytesIO()
    Image.new("RGB", (3, 2), colour).save(stream, "webp", lossless=True)
    return stream.getvalue()


def test_it_needs_no_network_and_every_picture_is_whole():
    pictures = [picture(), picture("photograph", webp("red"), "webp")]
    found = built(Block("", [a_table()], pictures))
    sources = [value for key in ("src", "href", "srcset", "action", "data", "poster")
               for value in found.all(key)]  # fmt: skip
    assert {
        value.partition(":")[0] for value in sources if not value.startswith("#")
    } == {"data"}
    assert not re.search(r"url\(|@import", (page.TEMPLATES / "report.css").read_text())
    images = [attrs for tag, attrs in found.elements if tag == "img"]
    assert len(images) == 2
    packed = base64.b64decode(images[0]["data-packed"], validate=True)
    assert gzip.decompress(packed) == SVG
    photograph = images[1]["src"].partition(",")[2]
    assert base64.b64decode(photograph, validate=True) == pictures[1].data
    assert [(a["width"], a["height"]) for a in images] == [("40", "20"), ("3", "2")]
    assert {attrs["alt"] for attrs in images} == {"What it shows."}


def test_anchors_exist_and_none_is_twice():
    blocks = [Block(name, [a_table()], [picture()]) for name in ("mine", "reference")]
    found = built(*blocks)
    anchors = found.all("id")
    assert len(set(anchors)) == len(anchors)
    links = {value[1:] for value in found.all("href") if value.startswith("#")}
    assert links <= set(anchors)
    assert {"question", "mine-table-some", "reference-figure-a_figure"} <= set(anchors)


def test_what_comes_from_outside_is_escaped():
    made = a_table(HOSTILE, error=HOSTILE, verdict=HOSTILE)
    hostile = Table(HOSTILE, HOSTILE, made.data, note=HOSTILE, commands=[HOSTILE])
    shown = picture('x" onload="alert(3)', caption=HOSTILE)
    plain = built(
        Block("", [a_table("t", error="e", verdict="v")], [picture()]), problems=["p"]
    )
    found = built(
        Block(HOSTILE, [hostile], [shown]),
        problems=[HOSTILE], about={HOSTILE: HOSTILE},
    )  # fmt: skip
    tags = [[tag for tag, _ in one.elements if tag != "h3"] for one in (found, plain)]
    assert tags[0].count("script") == tags[1].count("script") == 1
    assert set(tags[0]) == set(tags[1])
    assert not [
        key for _, attrs in found.elements for key in attrs if key.startswith("on")
    ]
    (rows,) = found.tables.values()
    assert rows[1][1] == HOSTILE.strip()
    # Shown as it is, escaped once: "<" reads "<".
    assert found.text.count(HOSTILE) >= 8
    assert "&lt;" not in found.text
    (image,) = (attrs for tag, attrs in found.elements if tag == "img")
    assert image["alt"] == HOSTILE
