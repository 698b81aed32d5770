"""The sensor from above, to be pressed with mouse or fingers."""

from __future__ import annotations

import html
import math
from typing import Any

from nicegui import ui

from hdc.live import colours
from hdc.live.session import Session, within
from hdc.live.sources import Pressable, Touch
from hdc.live.worker import Worker

NEAR = 2e-3
"""m; so near a taught place the robot returns to it, and so near a touch it is that touch."""
MOST_TOUCHES = 4
_POINTER = """(e) => {
  const pad = e.currentTarget, box = pad.getBoundingClientRect();
  if (e.type === 'pointermove' && !e.buttons) return;
  if (e.type === 'pointerdown') pad.setPointerCapture(e.pointerId);
  emit([e.type, (e.clientX - box.left) / box.width, (e.clientY - box.top) / box.height]);
}"""


class Pad:
    """A drawing of the surface in millimetres, and how it is pressed.

    The sensor is one for all pages, and so are the touches on it.
    """

    def __init__(self, worker: Worker, source: Pressable) -> None:
        self._worker, self._source = worker, source
        self._drawn = ""
        self._held = False  # the one touch is held, and moves along
        with ui.element("div").classes("pad").mark("pad") as pad:
            self._drawing = ui.html("", sanitize=False)
        for kind in ("pointerdown", "pointermove", "pointerup", "pointercancel"):
            throttle = 0.05 if kind == "pointermove" else 0.0
            pad.on(kind, self._pointer, throttle=throttle, js_handler=_POINTER)
        ui.label(
            f"The silicone from above, {source.length * 1e3:.0f} × {source.width * 1e3:.0f} mm: "
            "press it. Near the mark of a class the robot returns to where it was taught."
        ).classes("small")
        with ui.element("div").classes("row").style("flex-wrap: nowrap"):
            ui.label("depth").classes("small")
            deepest = source.deepest * 1e3
            self._depth = ui.slider(min=0.1, max=deepest, step=0.1, value=1.8)
            self._depth.props('aria-label="depth in millimetres"')
            self._depth.on("update:model-value", self._deeper, throttle=0.1)
            self._depth_text = ui.label("").classes("small numbers").style("white-space: nowrap")
        with ui.element("div").classes("row"):
            self._stays = ui.switch("stays pressed", value=True)
            self._several = ui.switch("several at once", value=False)
            ui.button("Lift off", on_click=self._lift).props(
                "no-caps outline dense padding='4px 10px'"
            )

    @property
    def touches(self) -> tuple[Touch, ...]:
        """What presses now."""
        return self._source.touches

    def show(self, session: Session) -> None:
        """Draw what there is now."""
        if (text := f"{self._depth.value:.1f} mm") != self._depth_text.text:
            self._depth_text.set_text(text)
        drawing = self._svg(session)
        if drawing != self._drawn:
            self._drawn = drawing
            self._drawing.set_content(drawing)

    # ---------------------------------------------------------------------------------------------

    def _pointer(self, event: Any) -> None:
        kind, across, down = event.args
        if kind == "pointerdown":
            self._down(*self._place(across, down))
        elif kind == "pointermove":
            if self._held and len(self.touches) == 1:
                x, y = self._place(across, down)
                near = self.touches[0]
                if math.hypot(near.x - x, near.y - y) > NEAR:  # a hand shakes
                    self._press([Touch(x, y, self._deep)], moved=True)
        else:
            if not self._stays.value:
                self._lift()
            self._held = False

    def _down(self, x: float, y: float) -> None:
        several, deep = bool(self._several.value), self._deep

        def press(session: Session) -> None:  # in the worker: another finger may have come before
            places = [t for place in session.places.values() for t in place]
            near = min(places, key=lambda t: math.hypot(t.x - x, t.y - y), default=None)
            is_near = near is not None and math.hypot(near.x - x, near.y - y) < NEAR
            touch = Touch(near.x, near.y, deep) if near and is_near else Touch(x, y, deep)
            now = list(self.touches) if several else []
            left = [t for t in now if math.hypot(t.x - touch.x, t.y - touch.y) >= NEAR]
            if len(left) >= MOST_TOUCHES:
                raise ValueError(f"{MOST_TOUCHES} touches at once are the most.")
            added = len(left) == len(now)  # pressed once more, a touch is lifted
            self._source.press([*left, touch] if added else left)

        self._held = not several  # of several, none is moved
        self._worker.do(press)

    def _press(self, touches: list[Touch], moved: bool = False) -> None:
        self._worker.do(lambda session: self._source.press(touches, moved))

    def _lift(self) -> None:
        self._press([])

    def _deeper(self) -> None:
        touches = [Touch(t.x, t.y, self._deep) for t in self.touches]
        if touches:
            self._press(touches, moved=True)

    @property
    def _deep(self) -> float:
        return within(self._depth.value, 0.0, self._source.deepest * 1e3) * 1e-3

    def _place(self, across: Any, down: Any) -> tuple[float, float]:
        """(x, y) in m of a place on the pad, as shares of its width and height."""
        across, down = (within(share, 0.0, 1.0) for share in (across, down))
        return across * self._source.length, (0.5 - down) * self._source.width

    def _svg(self, session: Session) -> str:
        source = self._source
        length, width = source.length * 1e3, source.width * 1e3

        def at(x: float, y: float) -> tuple[str, str]:
            return f"{x * 1e3:.2f}", f"{width / 2 - y * 1e3:.2f}"

        drawn = [
            f'<svg viewBox="0 0 {length:g} {width:g}" role="img" aria-label="the sensor">',
            f'<rect width="{length:g}" height="{width:g}" rx="1.5" fill="#fbe3dc" '
            'stroke="#c99" stroke-width=".4"/>',
        ]
        for name, (x, y) in (("laser light in", source.fibre), ("camera", source.camera)):
            cx, cy = at(x, y)
            drawn.append(
                f'<rect x="{cx}" y="{float(cy) - 1:.2f}" width="3" height="2" fill="#b00020"/>'
                f'<text x="{float(cx) + 4:.2f}" y="{float(cy) + 0.9:.2f}" font-size="2.6" '
                f'fill="#733">{name}</text>'
            )
        names = list(session.counts)
        for name, touches in list(session.places.items()):
            for touch in touches:
                cx, cy = at(touch.x, touch.y)
                colour = colours.of(names, name)
                drawn.append(
                    f'<circle cx="{cx}" cy="{cy}" r="2" fill="none" stroke="{colour}" '
                    f'stroke-width=".6"/><text x="{cx}" y="{float(cy) - 2.8:.2f}" '
                    f'text-anchor="middle" font-size="3" fill="{colour}">{html.escape(name)}'
                    "</text>"
                )
        for touch in source.touches:
            cx, cy = at(touch.x, touch.y)
            radius = 1 + 0.9 * touch.depth * 1e3
            drawn.append(
                f'<circle cx="{cx}" cy="{cy}" r="{radius:.2f}" fill="#222" fill-opacity=".55"/>'
            )
        return "".join([*drawn, "</svg>"])
