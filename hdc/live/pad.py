"""The sensor from above, to be pressed with mouse or fingers."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Sequence
from typing import Any

from nicegui import ui

from hdc.live.session import Session, within
from hdc.live.sources import Pressable, Touch

NEAR = 2e-3
"""m; a press so near a taught place goes to it, and a touch follows the finger in such steps."""
# Okabe and Ito's colours, which the colour-blind tell apart, darkened for text.
_COLOURS = (
    "#0060a0", "#a83c00", "#007a56", "#9a4f7e", "#7a6a00", "#2f7fa8", "#555555", "#5b3fa0"
)  # fmt: skip
_POINTER = """(e) => {
  const pad = e.currentTarget, box = pad.getBoundingClientRect();
  if (e.type === 'pointermove' && !e.buttons) return;
  if (e.type === 'pointerdown') pad.setPointerCapture(e.pointerId);
  emit([e.type, (e.clientX - box.left) / box.width, (e.clientY - box.top) / box.height]);
}"""
_SURFACE = """<svg viewBox="0 0 {0:g} {1:g}" role="img" aria-label="the sensor">
<rect width="{0:g}" height="{1:g}" rx="1.5" fill="#fbe3dc" stroke="#c99" stroke-width=".4"/>"""
_OPTICS = """<g transform="translate({:.2f} {:.2f})"><rect y="-1" width="3" height="2"
 fill="#b00020"/><text x="4" y="0.9" font-size="2.6" fill="#733">{}</text></g>"""
_PLACE = """<g transform="translate({:.2f} {:.2f})" stroke="{c}" fill="{c}">
<circle r="2" fill="none" stroke-width=".6"/>
<text y="-2.8" text-anchor="middle" font-size="3" stroke="none">{name}</text></g>"""
_TOUCH = '<circle cx="{:.2f}" cy="{:.2f}" r="{:.2f}" fill="#222" fill-opacity=".55"/>'
_CROSS = """<g class="cross" transform="translate({:.2f} {:.2f})" fill="none" stroke="#000"><path
 d="M-3 0H3M0-3V3" stroke-width=".5"/><ellipse rx="{:.2f}" ry="{:.2f}" stroke-width=".2"/></g>"""


def colour(names: Sequence[str], name: str | None) -> str:
    """The colour of a class among others."""
    return _COLOURS[names.index(name) % len(_COLOURS)] if name in names else "#222222"


def slider(name: str, low: float, high: float, step: float, value: float, text: str) -> ui.slider:
    """A slider between its name and its value."""
    with ui.element("div").classes("row").style("flex-wrap: nowrap; gap: 16px"):
        ui.label(name).classes("small")
        made = ui.slider(min=low, max=high, step=step, value=value).props(f'aria-label="{name}"')
        label = ui.label().classes("small").style("white-space: nowrap")
        label.bind_text_from(made, "value", text.format)
    return made


class Pad:
    """A drawing of the surface in millimetres, and the controls to press it.

    Args:
        do: has the worker do a job.
        session: with the taught places.
        source: the sensor; it and its touches are shared by all pages.
    """

    def __init__(self, do: Callable[..., Any], session: Session, source: Pressable) -> None:
        self._do, self._session, self._source, self._drawn = do, session, source, ""
        with ui.element("div").classes("pad").mark("pad") as pad:
            self._drawing = ui.html("", sanitize=False)
        for kind in ("pointerdown", "pointermove"):
            throttle = 0.05 if kind == "pointermove" else 0.0
            pad.on(kind, self._pointer, throttle=throttle, js_handler=_POINTER)
        ui.label(
            f"The silicone from above, {source.length * 1e3:.0f} × {source.width * 1e3:.0f} mm: "
            "press it. Near the ring of a class the robot returns to where it was taught."
            " Cross: the predicted place, by frames of taught places."
        ).classes("small")
        self._depth = slider("depth", 0.1, source.deepest * 1e3, 0.1, 1.8, "{:.1f} mm")
        ui.button("Lift off", on_click=lambda: self._press()).props(
            "no-caps outline dense padding='4px 10px'"
        ).style("align-self: flex-start")

    def show(self, values: Sequence[tuple[float, float, float]]) -> None:
        """Draw taught places, touches, and the predicted place (x, y) with its interval in mm."""
        source, names = self._source, list(self._session.counts)
        drawn = [_SURFACE.format(source.length * 1e3, source.width * 1e3)]
        for name, (x, y) in (("laser light in", source.fibre), ("camera", source.camera)):
            drawn.append(_OPTICS.format(*self._at(x, y), name))
        for name, touches in self._session.places.items():
            for t in touches:
                look = {"c": colour(names, name), "name": html.escape(name)}
                drawn.append(_PLACE.format(*self._at(t.x, t.y), **look))
        drawn += [_TOUCH.format(*self._at(t.x, t.y), 1 + 900 * t.depth) for t in source.touches]
        if len(values) == 2:
            (x, *of_x), (y, *of_y) = values
            half = (of_x[1] - of_x[0]) / 2, (of_y[1] - of_y[0]) / 2
            drawn.append(_CROSS.format(*self._at(x * 1e-3, y * 1e-3), *half))
        if (drawing := "".join([*drawn, "</svg>"])) != self._drawn:
            self._drawn = drawing
            self._drawing.set_content(drawing)

    def _at(self, x: float, y: float) -> tuple[float, float]:
        """Place of (x, y) in m on the drawing in mm."""
        return x * 1e3, (self._source.width / 2 - y) * 1e3

    async def _pointer(self, event: Any) -> None:
        kind, *shares = event.args
        across, down = (within(share, 0.0, 1.0) for share in shares)
        x, y = across * self._source.length, (0.5 - down) * self._source.width
        if kind == "pointerdown":
            taught = [t for place in self._session.places.values() for t in place]
            near = [t for t in taught if _apart(t, x, y) < NEAR]
            place = min(near, key=lambda t: _apart(t, x, y), default=Touch(x, y, 0.0))
            await self._press(Touch(place.x, place.y, self._deep))
        elif all(_apart(t, x, y) > NEAR for t in self._source.touches):  # a hand shakes
            await self._press(Touch(x, y, self._deep), moved=True)

    async def _press(self, *touches: Touch, moved: bool = False) -> None:
        await self._do(lambda session: self._source.press(touches, moved))

    @property
    def _deep(self) -> float:
        return within(self._depth.value, 0.0, self._source.deepest * 1e3) * 1e-3


def _apart(touch: Touch, x: float, y: float) -> float:
    return math.hypot(touch.x - x, touch.y - y)
