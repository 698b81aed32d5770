"""The page escapes what it is given, once."""

from types import SimpleNamespace

from markupsafe import escape

from experiments.reporting import page
from experiments.reporting.study import Figure, Study
from experiments.reporting.table import Table, frame

HOSTILE = '</script><script>alert("1")</script>&<img src=x onerror=alert(2)>\\ `|`'
IN_ATTRIBUTE = 'x" onload="a()'


def test_what_comes_from_outside_is_escaped():
    text, data = HOSTILE, frame([{"model": HOSTILE, "x": 0.5}])
    told = {"title": text, "note": text, "commands": [text]}
    table = Table(text, lambda _: None, of="runs", data=data, **told)
    figure = Figure(IN_ATTRIBUTE, table, lambda *_: None, caption=text)
    answers = SimpleNamespace(
        name="mine",
        every_study=[Study("question", text, text, 0)],
        tables=lambda _: [table],
        figures=lambda _: [figure],
        failures=[("question", text)],
    )
    differing = [{"table": text, "sentence": text}]
    html = page.render([answers], [(text, text, "../mine")], differing, [text])
    for raw in (HOSTILE, IN_ATTRIBUTE, "<script>alert"):
        assert raw not in html
    assert html.count(str(escape(HOSTILE))) >= 10
