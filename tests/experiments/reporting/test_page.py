"""The page opens with one's own, escapes what it is given, and links to the files beside it."""

from html.parser import HTMLParser
from types import SimpleNamespace

from experiments.reporting import page
from experiments.reporting.against import compare, differing
from experiments.reporting.page import Part, Section
from experiments.reporting.table import Table, frame

HOSTILE = (
    '</script><script>alert("1")</script>&<img src=x onerror=alert(2)>\\ `|` \x1b[31m'
)


class Page(HTMLParser):
    """Elements with their attributes, cells of tables, all text."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.cells, self.text = [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_data(self, data):
        self.text += data
        if self.cells:
            self.cells[-1] += data

    def all(self, key):
        return [attrs[key] for _, attrs in self.elements if key in attrs]


def a_table(name="some", value=0.5, **values):
    row = {"model": "hdc", "x": value, "x_low": value, "x_high": value, **values}
    data = frame([row])
    return Table(
        name,
        title="A title",
        data=data,
        note="Read it.",
        commands=["make it"],
        key=["model"],
    )


def a_plot(name="a_figure", caption="What it shows."):
    return SimpleNamespace(name=name, kind="svg", caption=caption, commands=["draw it"])


def part(name, tables=(), plots=(), **section):
    made = Section("question", "A question", "What it asks.", tables, plots, **section)
    figures = {plot.name: "../a_figure.svg" for plot in plots}
    return Part(name, f"From {name}", "5 runs", f"../{name}", [made], figures=figures)


def built(*parts, cells=(), problems=()):
    return Page(page.render(parts, differing(cells), problems))


def test_it_opens_with_ones_own_and_needs_files_beside_it_only():
    parts = [part("mine", [a_table()], [a_plot()]), part("reference", [a_table("b")])]
    found = built(*parts)
    assert found.text.index("From mine") < found.text.index("From reference")
    names = [value for key in ("src", "href") for value in found.all(key)]
    links = {name for name in names if not name.startswith(("#", "data:,"))}
    assert links == {
        "../mine/figures/a_figure.svg",
        "../mine/tables/some.csv",
        "../reference/tables/b.csv",
        "../a_figure.svg",
    }
    anchors = found.all("id")
    assert len(set(anchors)) == len(anchors)
    inner = {name[1:] for name in names if name.startswith("#")}
    assert inner == {"mine-question", "reference-question"} <= set(anchors)


def test_the_reference_stands_in_a_cell_that_differs_and_in_no_other():
    own, reference = a_table(value=0.5), a_table(value=0.75)
    for known, beside in ((reference, 1), (own, 0)):
        found = built(part("mine", [own]), cells=compare([own], [known]))
        cells = [cell for cell in found.cells if "reference: 0.750 to 0.750" in cell]
        assert len(cells) == beside


def test_what_comes_from_outside_is_escaped():
    hostile = Table(
        HOSTILE,
        title=HOSTILE,
        data=a_table(model=HOSTILE).data,
        note=HOSTILE,
        commands=[HOSTILE],
    )
    shown = a_plot('x" onload="alert(3)', caption=HOSTILE)
    plain = built(part("mine", [a_table()], [a_plot()], failures=["f"]), problems=["p"])
    found = built(
        part("mine", [hostile], [shown], failures=[HOSTILE]), problems=[HOSTILE]
    )
    tags = [[tag for tag, _ in one.elements] for one in (found, plain)]
    assert tags[0] == tags[1]
    attributes = [key for _, attrs in found.elements for key in attrs]
    assert not [key for key in attributes if key.startswith("on")]
    # Shown as it is, escaped once: "<" reads "<".
    assert found.text.count(HOSTILE) >= 6
    assert "&lt;" not in found.text
