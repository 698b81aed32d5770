"""The page itself: its layout, and the job of each button."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from nicegui import app, ui
from nicegui.server import Server
from starlette.responses import Response

from hdc.live.guard import Guard
from hdc.live.session import REPLACED, Session
from hdc.live.worker import FASTEST, Worker

REFRESH = 0.2
"""Seconds between updates of words and bars."""
SAMPLES = 10
"""Learned at a press of a button."""
RECALIBRATION = (
    f"Recalibrating takes {SAMPLES} new samples of a class, and {100 * REPLACED:.0f} % of the bits "
    "of the new prototype."
)
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


def serve(
    session: Session,
    host: str | None = None,
    port: int = 8080,
    page: Callable[[Worker], object] | None = None,
) -> None:
    """Show the page until it is interrupted; its address, with a token, is printed.

    Without a host it listens to this computer alone. A `page` of one's own is made for each
    browser, in place of :class:`Page`.
    """
    host = host or "127.0.0.1"
    worker = Worker(session)
    token = secrets.token_urlsafe(16)
    app.add_middleware(Guard, token=token, cookie=f"hdc_live_{port}")
    app.on_startup(worker.start)
    app.on_startup(lambda: _announce(f"http://{host}:{port}/?token={token}"))
    app.on_shutdown(lambda: asyncio.to_thread(worker.stop))
    app.get("/frame")(lambda: Response(worker.picture(), media_type="image/jpeg"))
    with contextlib.suppress(KeyboardInterrupt):
        ui.run(
            lambda: (page or Page)(worker),
            host=host,
            port=port,
            title=session.source.title,
            reload=False,
            show=False,
            show_welcome_message=False,
            timeout_graceful_shutdown=1,
        )


async def _announce(address: str) -> None:
    while not Server.instance.started:
        await asyncio.sleep(0.02)
    print(f"open {address} (Ctrl+C ends it)", flush=True)


def colour(names: Sequence[str], name: str | None) -> str:
    """The colour of a class among others."""
    if name not in names:
        return "#222222"
    return _COLOURS[names.index(name) % len(_COLOURS)]


class Page:
    """The page in one browser.

    Attributes:
        act: what to do to show a class.
    """

    act = "Show it something"

    def __init__(self, worker: Worker) -> None:
        self.worker = worker
        self.session = worker.session
        self.source = worker.session.source
        self._rows: dict[str, tuple[ui.label, ui.linear_progress]] = {}
        self._shown: dict[str, int] = {}
        ui.add_css(Path(__file__).with_suffix(".css"))
        ui.colors(primary=colour("0", "0"))
        with div("live"):
            with div("row col-span-full"):
                ui.label("Teach a sensor to feel").classes("text-2xl font-bold")
                badge = ui.badge(self.source.title, color="#b35900")
                badge.classes("text-sm font-bold")
                ui.label("All who open this page share this sensor and its model.")
            cards = [self._see, self._classified]
            if self.session.is_taught:
                cards.append(self.adapting)
            for fill in cards:
                with div("card"):
                    fill()
        ui.timer(REFRESH, self.refresh)

    # Layout --------------------------------------------------------------------------------------

    def _see(self) -> None:
        ui.label("1. Frames of the camera").classes("heading")
        picture = ui.interactive_image("/frame").classes("picture w-full")
        ui.timer(1 / FASTEST, picture.force_reload)
        small(
            "The frame, and beside it its hypervector: the share of the bits of each pixel that "
            "are one."
        )
        self.controls()
        ui.label("The model says").classes("heading")
        self._answer = ui.label().classes("answer")

    def controls(self) -> None:
        """Controls of the source, of which these have none."""

    def _classified(self) -> None:
        """The classes, taught here or before."""
        model = self.session.model
        if self.session.is_taught:
            self._teach()
        else:
            ui.label("2. Frames of the training").classes("heading")
        self._classes = div("flex flex-col gap-3")
        if model is None or hasattr(model, "distances"):
            small("Bars: 1 − 2 × Hamming distance to each prototype; 0 is chance.")
        if self.session.is_taught:
            button("Save the model", self._save)

    def _teach(self) -> None:
        ui.label("2. Teach it").classes("heading")
        small(f"{self.act}, name it and learn {SAMPLES} samples; then the next.")
        with div("row"):
            self._name = ui.input("name of a new class")
            self._name.classes("grow").props("dense outlined maxlength=24")
            self._name.on("keydown.enter", self._new_class)
            button("New class", self._new_class)

    def adapting(self) -> None:
        ui.label("3. Recalibrate").classes("heading")
        small(RECALIBRATION)
        small("Show it a class again and press “recalibrate” in its row.")

    # Jobs ----------------------------------------------------------------------------------------

    async def do(self, job: Callable[[Session], Any]) -> Any:
        """Have the worker do a job; its error is shown on this page alone."""
        try:
            return await asyncio.to_thread(self.worker.do, job)
        except ValueError as error:
            ui.notify(
                str(error), position="top", multi_line=True, timeout=6000, color="dark"
            )
            return None

    def doing(self, job: Callable[[Session], Any]) -> Callable[[], Any]:
        return lambda: self.do(job)

    async def _new_class(self) -> None:
        name = self._name.value
        self._name.set_value("")
        await self.do(lambda s: s.learn(name, SAMPLES, new=True))

    async def _save(self) -> None:
        content = await self.do(Session.saved)
        if content is not None:
            ui.download.content(content, "touch.safetensors")

    # Updates -------------------------------------------------------------------------------------

    def refresh(self) -> None:
        view, counts = self.worker.view, self.session.counts
        if counts != self._shown:
            self._shown = counts
            self._show_classes()
        text, label = "nothing yet: teach it two classes", None
        if view.answer is not None:
            label = view.answer.label
            text = "none of these" if label is None else label
            for name, distance in view.answer.distances.items():
                self._show_distance(name, distance)
        self._answer.set_text(view.error or text)
        self._answer.style(f"color: {colour(list(counts), label)}")

    def _show_distance(self, name: str, distance: float) -> None:
        if name in self._rows:
            label, bar = self._rows[name]
            label.set_text(f"· distance {min(distance, 1):.3f}")
            bar.set_value(max(0.0, 1 - 2 * distance))

    def _show_classes(self) -> None:
        """A row for each class: samples, distance, buttons and a bar."""
        self._classes.clear()
        self._rows = {}
        for name, count in self._shown.items():
            look = colour(list(self._shown), name)
            with self._classes, div("class"):
                with div("row").style("min-width: 0"):
                    title = ui.label(name).classes("name font-bold truncate")
                    title.style(f"color: {look}")
                    small(f"{count} samples")
                    distance = small()
                with div("row").style("gap: 2px; flex-wrap: nowrap"):
                    if self.session.is_taught:
                        self._show_buttons(name)
                bar = ui.linear_progress(0, show_value=False, size="14px", color=look)
                bar.style("grid-column: 1 / 3")
            self._rows[name] = distance, bar

    def _show_buttons(self, name: str) -> None:
        more = self.doing(lambda s: s.learn(name, SAMPLES))
        _icon("add", f"learn {SAMPLES} more samples", more)
        again = self.doing(lambda s: s.recalibrate(name, SAMPLES))
        _icon("sync", "recalibrate", again)
        _icon("delete_outline", "forget", self.doing(lambda s: s.forget(name)))


def div(classes: str) -> ui.element:
    return ui.element("div").classes(classes)


def small(text: str = "") -> ui.label:
    return ui.label(text).classes("small")


def button(text: str, act: Callable[[], Any]) -> None:
    ui.button(text, on_click=act).props("no-caps outline dense padding='4px 10px'")


def _icon(icon: str, tip: str, act: Callable[[], Any]) -> None:
    button = ui.button(icon=icon, on_click=act).props("flat dense size=sm")
    button.props(f'aria-label="{tip}"').tooltip(tip)
