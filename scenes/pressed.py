"""A sensor that is pressed: the page of the simulated sensor, an extension of :mod:`hdc.live`.

Classes are touches at places, which the page draws from above and returns to. The model is tested
on fresh touches, and the sensor drifts when a button is pressed.
"""

from __future__ import annotations

import html
import math
import time
from collections import deque
from functools import partial

from nicegui import events, ui

from hdc.live.page import (
    RECALIBRATION,
    SAMPLES,
    Page,
    button,
    colour,
    div,
    small,
)
from hdc.live.session import Sample, Session, View
from scenes.sensor.contact import Touch
from scenes.simulated import SIXTEEN_DAYS, SimulatedSensor

RECENT = 20
"""Tests behind the accuracy that is shown."""
TEST_EVERY = 0.25
"""Seconds between two fresh touches that test the model."""
NEAR = 2e-3
"""m; a press so near a taught place goes to it."""
DEPTH = 1.8e-3
"""m, of a touch."""
_PLACE = """<g transform="translate({:.2f} {:.2f})" stroke="{c}" fill="{c}">
<circle r="2" fill="none" stroke-width=".6"/>
<text y="-2.8" text-anchor="middle" font-size="3" stroke="none">{name}</text></g>"""
_TOUCH = '<circle cx="{:.2f}" cy="{:.2f}" r="{:.2f}" fill="#222" fill-opacity=".55"/>'


class PressedSession(Session):
    """A session of a sensor that is pressed.

    Attributes:
        places: touch of each class.
        tests: whether the latest tests were right.
    """

    source: SimulatedSensor

    def __init__(self, source: SimulatedSensor) -> None:
        super().__init__(source)
        self.places: dict[str, Touch | None] = {}
        self.tests: deque[bool] = deque(maxlen=RECENT)
        self._tested = 0
        self._latest = -TEST_EVERY

    def look(self) -> View:
        now = time.monotonic()
        if now - self._latest > TEST_EVERY:
            self._latest = now
            self.test()
        return super().look()

    def test(self) -> None:
        """Test the model on one new touch of a taught class."""
        taught = [name for name in self.counts if name in self.places]
        if len(taught) > 1:
            name = taught[self._tested % len(taught)]
            (frame,) = self.source.touched(1, self.places[name])
            answer = self.ask(frame)
            if answer is not None:
                self.tests.append(answer.label == name)
            self._tested += 1

    def learn(self, name: str, n: int, new: bool = False) -> None:
        super().learn(name, n, new)
        self.places = self.places | {name.strip(): self.source.touch}

    def recalibrate_all(self, n: int) -> None:
        """Recalibrate all classes, each touched where it was taught."""
        lesson = self.next_lesson()
        samples: list[Sample] = []
        for name in self.counts:
            frames = self.source.touched(n, self.places[name])
            samples += [Sample(frame, name, lesson) for frame in frames]
        self.train(self.samples + samples)

    def train(self, samples: list[Sample]) -> None:
        super().train(samples)
        self.tests.clear()

    def forget(self, name: str) -> None:
        super().forget(name)
        self.places = {c: touch for c, touch in self.places.items() if c != name}

    def drift(self, kelvin: float) -> None:
        """Set the drift of the sensor."""
        self.source.offset = kelvin
        self.tests.clear()


class PressedPage(Page):
    """The page with a drawing of the surface in millimetres, and the controls to press it."""

    act = "Press somewhere"
    session: PressedSession
    source: SimulatedSensor

    def controls(self) -> None:
        size = self.source.length * 1e3, self.source.width * 1e3
        self._drawing = ui.interactive_image(
            size=size, on_mouse=self._pressed, events=["mousedown"], sanitize=False
        ).classes("pad")
        small(
            f"The silicone from above, {size[0]:.0f} × {size[1]:.0f} mm: press it. Near the ring "
            "of a class the robot returns to where it was taught."
        )
        button("Lift off", partial(self._press, None))
        self._accuracy = ui.label()
        small(
            f"Accuracy on the latest {RECENT} new touches; “none of these” counts as wrong."
        )

    def adapting(self) -> None:
        ui.label("3. Let it drift, and recalibrate").classes("heading")
        small(
            "Silicone ages; simulated as a change of temperature, which changes speckle."
        )
        with div("row"):
            button("Let 16 days pass", self._drift(SIXTEEN_DAYS))
            button("Back to the first day", self._drift(0.0))
        small(RECALIBRATION)
        button("Recalibrate all classes where they were taught", self._all)

    def refresh(self) -> None:
        super().refresh()
        right, n = sum(self.session.tests), len(self.session.tests)
        share = f"{right} of the latest {n} right ({right / n:.0%})" if n else ""
        self._accuracy.set_text(share or "not tested yet")
        names = list(self.session.counts)
        drawn = []
        for name, place in self.session.places.items():
            if place is not None:
                look, title = colour(names, name), html.escape(name)
                x, y = self._on_drawing(place)
                drawn.append(_PLACE.format(x, y, c=look, name=title))
        touch = self.source.touch
        if touch is not None:
            x, y = self._on_drawing(touch)
            drawn.append(_TOUCH.format(x, y, 1 + 900 * touch.depth))
        self._drawing.content = "".join(drawn)

    def _on_drawing(self, touch: Touch) -> tuple[float, float]:
        """Place of a touch on the drawing in mm."""
        return touch.x * 1e3, (self.source.width / 2 - touch.y) * 1e3

    def _drift(self, kelvin: float) -> partial:
        return partial(self.do, lambda _: self.session.drift(kelvin))

    async def _all(self) -> None:
        await self.do(lambda _: self.session.recalibrate_all(SAMPLES))

    async def _pressed(self, event: events.MouseEventArguments) -> None:
        x = event.image_x * 1e-3
        y = self.source.width / 2 - event.image_y * 1e-3
        near = Touch(DEPTH, x, y)
        least = NEAR
        for place in filter(None, self.session.places.values()):
            distance = math.hypot(place.x - x, place.y - y)
            if distance < least:
                near, least = place, distance
        await self._press(near)

    async def _press(self, touch: Touch | None) -> None:
        await self.do(lambda _: self.source.press(touch))
