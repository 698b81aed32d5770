"""The page escapes what it is given, and links to the files beside it."""

from html.parser import HTMLParser

from experiments.reporting import page
from experiments.reporting.compare import compare, differing
from experiments.reporting.page import Part, Section
from experiments.reporting.study import Figure
from experiments.reporting.table import Table, frame

HOSTILE = (
    '</script><script>alert("1")</script>&<img src=x onerror=alert(2)>\\ `|` \x1b[31m'
)


class Page(HTMLParser):
    """Elements with their attributes, cells of tables, all text."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.cells, self.text = [], [""], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_data(self, data):
        self.text += data
        self.cells[-1] += data

    def all(self, key):
        return [attrs[key] for _, attrs in self.elements if key in attrs]


def a_table(name="some", value=0.5, text="Read it."):
    data = frame([{"model": text, "x": value, "x_low": value, "x_high": value}])
    told = {"title": text, "note": text, "commands": [text], "key": ["model"]}
    return Table(name, lambda lines: lines, of="runs", data=data, **told)


def built(*tables, figure="a_figure", text="f", known=None, folder="mine"):
    """The page of one part with these tables and a figure."""
    own = a_table(text=text)
    shown = Figure(figure, own, lambda *_: None, caption=text, commands=[text])
    made = Section("question", text, text, tables or [own], [shown], failures=[text])
    part = Part("mine", text, text, f"../{folder}", [made])
    numbers = differing(compare(own, known or own))
    return Page(page.render([part], numbers, [text]))


def test_the_reference_stands_in_a_cell_that_differs_and_in_no_other():
    for known, beside in ((0.75, 1), (0.5, 0)):
        found = built(known=a_table(value=known, text="f"))
        told = [cell for cell in found.cells[1:] if "reference: 0.750 to 0.750" in cell]
        assert len(told) == beside


def test_what_comes_from_outside_is_escaped():
    found = built(a_table(HOSTILE, text=HOSTILE), figure='x" onload="a()', text=HOSTILE)
    assert [tag for tag, _ in found.elements] == [tag for tag, _ in built().elements]
    attributes = [key for _, attrs in found.elements for key in attrs]
    assert not [key for key in attributes if key.startswith("on")]
    # Shown as it is, escaped once: "<" reads "<".
    assert found.text.count(HOSTILE) >= 6
    assert "&lt;" not in found.text
