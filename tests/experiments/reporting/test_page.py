"""The page escapes what it is given, once."""

from markupsafe import escape

from experiments.reporting import page
from experiments.reporting.compare import compare, differing
from experiments.reporting.page import Part, Section
from experiments.reporting.study import Figure
from experiments.reporting.table import Table, frame

HOSTILE = '</script><script>alert("1")</script>&<img src=x onerror=alert(2)>\\ `|`'
IN_ATTRIBUTE = 'x" onload="a()'


def test_what_comes_from_outside_is_escaped():
    text, data = HOSTILE, [{"model": HOSTILE, "x": 0.5, "x_low": 0.5, "x_high": 0.5}]
    told = {"title": text, "note": text, "commands": [text], "key": ["model"]}
    own = Table(text, lambda _: None, of="runs", data=frame(data), **told)
    shown = Figure(IN_ATTRIBUTE, own, lambda *_: None, caption=text)
    made = Section("question", text, text, [own], [shown], failures=[text])
    part = Part("mine", text, text, "../mine", [made])
    html = page.render([part], differing(compare(own, own)), [text])
    for raw in (HOSTILE, IN_ATTRIBUTE, "<script>alert"):
        assert raw not in html
    assert html.count(str(escape(HOSTILE))) >= 6
