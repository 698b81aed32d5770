"""The sensor from above, to be pressed with mouse or finger."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Sequence
from typing import Any

from nicegui import events, ui

from hdc.live.session import Session
from hdc.live.sources import Pressable, Touch

NEAR = 2e-3
"""m; a press so near a taught place goes to it."""
# Okabe and Ito's colours, which the colour-blind tell apart, darkened for text.
_COLOURS = (
    "#0060a0",
    "#a83c00",
    "#007a56",
    "#9a4f7e",
    "#7a6a00",
    "#2f7fa8",
    "#555555",
    "#5b3fa0",
)
_PLACE = """<g transform="translate({:.2f} {:.2f})" stroke="{c}" fill="{c}">
<circle r="2" fill="none" stroke-width=".6"/>
<text y="-2.8" text-anchor="middle" font-size="3" stroke="none">{name}</text></g>"""
_TOUCH = '<circle cx="{:.2f}" cy="{:.2f}" r="{:.2f}" fill="#222" fill-opacity=".55"/>'


def colour(names: Sequence[str], name: str | None) -> str:
    """The colour of a class among others."""
    if name not in names:
        return "#222222"
    return _COLOURS[names.index(name) % len(_COLOURS)]


def slider(name: str, low: float, high: float, step: float, value: float) -> ui.slider:
    """A slider that shows its value, beside its name."""
    row = ui.element("div").classes("row w-full pt-6")
    with row.style("flex-wrap: nowrap; gap: 16px"):
        ui.label(name).classes("small").style("white-space: nowrap")
        made = ui.slider(min=low, max=high, step=step, value=value)
    return made.props(f'label-always aria-label="{name}"')


class Pad:
    """A drawing of the surface in millimetres, and the controls to press it.

    Args:
        do: has the worker do a job.
        session: with the taught places.
        source: the sensor; it and its touches are shared by all pages.
    """

    def __init__(
        self, do: Callable[..., Any], session: Session, source: Pressable
    ) -> None:
        self._do = do
        self._session = session
        self._source = source
        size = source.length * 1e3, source.width * 1e3
        self._drawing = ui.interactive_image(
            size=size, on_mouse=self._pressed, events=["mousedown"], sanitize=False
        ).classes("pad")
        ui.label(
            f"The silicone from above, {size[0]:.0f} × {size[1]:.0f} mm: press it. Near the ring "
            "of a class the robot returns to where it was taught."
        ).classes("small")
        self._depth = slider("depth in mm", 0.1, source.deepest * 1e3, 0.1, 1.8)
        lift = ui.button("Lift off", on_click=lambda: self._press())
        lift.props("no-caps outline dense")

    def show(self) -> None:
        """Draw taught places and touches."""
        names = list(self._session.counts)
        drawn = []
        for name, touches in self._session.places.items():
            title = html.escape(name)
            look = colour(names, name)
            for touch in touches:
                x, y = self._at(touch.x, touch.y)
                drawn.append(_PLACE.format(x, y, c=look, name=title))
        for touch in self._source.touches:
            x, y = self._at(touch.x, touch.y)
            radius = 1 + 900 * touch.depth
            drawn.append(_TOUCH.format(x, y, radius))
        self._drawing.content = "".join(drawn)

    def _at(self, x: float, y: float) -> tuple[float, float]:
        """Place of (x, y) in m on the drawing in mm."""
        return x * 1e3, (self._source.width / 2 - y) * 1e3

    async def _pressed(self, event: events.MouseEventArguments) -> None:
        x = event.image_x * 1e-3
        y = self._source.width / 2 - event.image_y * 1e-3
        near = []
        for place in self._session.places.values():
            for touch in place:
                apart = math.hypot(touch.x - x, touch.y - y)
                if apart < NEAR:
                    near.append((apart, touch.x, touch.y))
        _, x, y = min(near, default=(0.0, x, y))
        depth = self._depth.value * 1e-3
        await self._press(Touch(x, y, depth))

    async def _press(self, *touches: Touch) -> None:
        await self._do(lambda session: self._source.press(touches))
