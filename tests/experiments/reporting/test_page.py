"""The page escapes what it is given."""

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
    """Elements with their attributes, and all text."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.text = [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data


def a_table(name, text):
    data = frame([{"model": text, "x": 0.5, "x_low": 0.5, "x_high": 0.5}])
    told = {"title": text, "note": text, "commands": [text], "key": ["model"]}
    return Table(name, lambda lines: lines, of="runs", data=data, **told)


def built(name="some", figure="a_figure", text="f"):
    """The page of one part with a table and a figure."""
    own = a_table(name, text)
    shown = Figure(figure, own, lambda *_: None, caption=text)
    made = Section("question", text, text, [own], [shown], failures=[text])
    part = Part("mine", text, text, "../mine", [made])
    return Page(page.render([part], differing(compare(own, own)), [text]))


def test_what_comes_from_outside_is_escaped():
    found = built(HOSTILE, figure='x" onload="a()', text=HOSTILE)
    assert [tag for tag, _ in found.elements] == [tag for tag, _ in built().elements]
    attributes = [key for _, attrs in found.elements for key in attrs]
    assert not [key for key in attributes if key.startswith("on")]
    # Shown as it is, escaped once: "<" reads "<".
    assert found.text.count(HOSTILE) >= 6
    assert "&lt;" not in found.text
