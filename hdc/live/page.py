"""The page itself: its layout, and the job of each button."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import app, ui
from nicegui.server import Server
from starlette.responses import Response

from hdc import HDCClassifier, HDCRegressor
from hdc.live.guard import Guard
from hdc.live.pad import Pad, colour, slider
from hdc.live.session import ALPHA, READOUTS, RECENT, Answer, Session
from hdc.live.sources import Pressable, Recorded, Source
from hdc.live.worker import FASTEST, View, Worker

REFRESH = 0.2
"""Seconds between updates of words and bars."""
SAMPLES = 10
"""Learned at a press of a button."""


def serve(
    source: Source,
    host: str | None = None,
    port: int = 8080,
    trained: HDCClassifier | HDCRegressor | None = None,
) -> None:
    """Show the page until it is interrupted; its address, with a token, is printed.

    Without a host it listens to this computer alone. A model that was trained before is shown as it
    is; without one, the page teaches its own.
    """
    host = host or "127.0.0.1"
    worker = Worker(Session(source, trained))
    token = secrets.token_urlsafe(16)
    app.add_middleware(Guard, token=token, cookie=f"hdc_live_{port}")
    app.on_startup(worker.start)
    app.on_startup(lambda: _announce(f"http://{host}:{port}/?token={token}"))
    app.on_shutdown(lambda: asyncio.to_thread(worker.stop))
    app.get("/frame")(lambda: Response(worker.picture(), media_type="image/jpeg"))
    with contextlib.suppress(KeyboardInterrupt):
        ui.run(
            lambda: Page(worker),
            host=host,
            port=port,
            title=source.title,
            reload=False,
            show=False,
            show_welcome_message=False,
            timeout_graceful_shutdown=1,
        )


async def _announce(address: str) -> None:
    while not Server.instance.started:
        await asyncio.sleep(0.02)
    print(f"open {address} (Ctrl+C ends it)", flush=True)


class Page:
    """The page in one browser."""

    def __init__(self, worker: Worker) -> None:
        self._worker = worker
        self._session = worker.session
        self._source = worker.session.source
        self._rows: dict[str, tuple[ui.label, ui.linear_progress]] = {}
        self._shown: dict[str, int] = {}
        self._pressable = isinstance(self._source, Pressable)
        ui.add_css(Path(__file__).with_suffix(".css"))
        ui.colors(primary=colour("0", "0"))
        with _div("live"):
            with _div("row col-span-full"):
                ui.label("Teach a sensor to feel").classes("text-2xl font-bold")
                badge = ui.badge(self._source.title, color="#b35900")
                badge.classes("text-sm font-bold")
                ui.label("All who open this page share this sensor and its model.")
            for fill in self._cards():
                with _div("card"):
                    fill()
        ui.timer(REFRESH, self._refresh)

    def _cards(self) -> list[Callable[[], None]]:
        if self._session.is_taught:
            return [self._see, self._teach, self._adapt]
        return [self._see, self._trained]

    # Layout --------------------------------------------------------------------------------------

    def _see(self) -> None:
        source = self._source
        height, width = source.shape
        ui.label("1. What the camera sees").classes("heading")
        picture = ui.interactive_image("/frame").classes("picture w-full")
        ui.timer(1 / FASTEST, picture.force_reload)
        _small(
            "The frame, and beside it its hypervector: "
            f"{height * width:,} bits, brighter than the median or not."
        )
        if isinstance(source, Pressable):
            self._pad = Pad(self._do, self._session, source)
        if isinstance(source, Recorded):
            self._play(source)
        self._label = _small()
        ui.label("The model says").classes("heading")
        self._answer = ui.label().classes("answer")
        self._beside = _small()
        self._numbers = _small()
        self._accuracy = ui.label()
        if self._session.is_taught:
            tested = "samples, each predicted before it is learnt"
            if self._pressable:
                tested = "new touches"
            counted = f"Accuracy on the latest {RECENT} {tested}"
            _small(f"{counted}; “none of these” counts as wrong.")

    def _play(self, source: Recorded) -> None:
        """Buttons that step through a recording."""
        back = self._doing(lambda s: source.step(-1))
        play = self._doing(lambda s: source.play())
        ahead = self._doing(lambda s: source.step(+1))
        with _div("row"):
            _icon("skip_previous", "one frame back", back)
            _icon("play_arrow", "play or pause", play)
            _icon("skip_next", "one frame ahead", ahead)

    def _trained(self) -> None:
        """A model that was trained before: its classes, which are not taught here."""
        ui.label("2. What it was trained on").classes("heading")
        self._classes = _div("flex flex-col gap-3")
        if self._session.counts:
            _small("Bars: 1 − 2 × Hamming distance to each prototype; 0 is chance.")
        else:
            _small("Numbers; each is shown with the interval it is expected in.")

    def _teach(self) -> None:
        ui.label("2. Teach it").classes("heading")
        act = "Show it something"
        if self._pressable:
            act = "Press somewhere"
        _small(f"{act}, name it and learn {SAMPLES} samples; then the next.")
        hint = "name of a new class"
        if isinstance(self._source, Recorded):
            hint += " (empty: as recorded)"
        with _div("row"):
            self._name = ui.input(hint).classes("grow")
            self._name.props("dense outlined maxlength=24")
            self._name.on("keydown.enter", self._new_class)
            ui.button("New class", on_click=self._new_class).props("no-caps")
        self._classes = _div("flex flex-col gap-3")
        _small("Bars: 1 − 2 × Hamming distance to each prototype; 0 is chance.")
        with _div("row"):
            _small("read-out")
            self._readout = ui.toggle(list(READOUTS), value=self._session.readout)
            self._readout.props("no-caps dense padding='4px 10px'")
            self._readout.on(
                "update:model-value",
                lambda: self._doing(Session.use, self._readout.value)(),
            )
        with _div("row"):
            _button("Forget everything", self._doing(Session.forget, None))
            _button("Save the model", self._save)

    def _adapt(self) -> None:
        source = self._source
        if isinstance(source, Pressable):
            ui.label("3. Let it drift, and recalibrate").classes("heading")
            _small(
                "Silicone ages; simulated as a change of temperature, which changes speckle."
            )
            with _div("row"):
                _button(
                    "Let 16 days pass", self._doing(Session.drift, source.sixteen_days)
                )
                _button("Back to the first day", self._doing(Session.drift, 0.0))
        else:
            ui.label("3. Recalibrate").classes("heading")
        _small(
            f"Recalibrating takes {SAMPLES} new samples of a class, and each bit of the new "
            "prototype with probability p."
        )
        self._p = slider("p", 0, 1, 0.05, 0.5)
        if self._pressable:
            _button("Recalibrate all classes where they were taught", self._recalibrate)
        else:
            _small("Show it a class again and press “recalibrate” in its row.")

    # Jobs ----------------------------------------------------------------------------------------

    async def _do(self, job: Callable[[Session], Any]) -> Any:
        """Have the worker do a job; its error is shown on this page alone."""
        try:
            return await asyncio.to_thread(self._worker.do, job)
        except ValueError as error:
            ui.notify(
                str(error), position="top", multi_line=True, timeout=6000, color="dark"
            )
            return None

    def _doing(self, job: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
        return lambda: self._do(lambda session: job(session, *arguments))

    async def _new_class(self) -> None:
        name = self._name.value or self._worker.view.label or ""
        self._name.set_value("")
        await self._doing(Session.learn, name, SAMPLES, True)()

    async def _recalibrate(self, name: str | None = None) -> None:
        await self._doing(Session.recalibrate, name, SAMPLES, self._p.value)()

    async def _save(self) -> None:
        content = await self._do(Session.saved)
        if content is not None:
            ui.download.content(content, "touch.safetensors")

    # Updates -------------------------------------------------------------------------------------

    def _refresh(self) -> None:
        view, session = self._worker.view, self._session
        if session.counts != self._shown:
            self._shown = session.counts
            self._show_classes()
        if session.is_taught:
            self._readout.set_value(session.readout)
            self._accuracy.set_text(_accuracy(list(session.tests)))
        self._show_answer(view)
        if isinstance(self._source, Pressable):
            self._pad.show()
        elif view.label:
            self._label.set_text(self._recorded_as(view.label))

    def _recorded_as(self, label: str) -> str:
        text = f"recorded as “{label}”"
        if isinstance(self._source, Recorded) and not self._source.playing:
            text += ", paused"
        return text

    def _show_answer(self, view: View) -> None:
        answer = view.answer
        if answer is None:
            self._answer.set_text(view.error or "nothing yet: teach it two classes")
            self._answer.style("color: #777")
            self._beside.set_text("")
            self._numbers.set_text("")
            return
        text, beside = _in_words(answer)
        look = colour(list(self._session.counts), answer.label)
        self._answer.set_text(view.error or text)
        self._answer.style(f"color: {look}")
        self._beside.set_text(beside)
        self._numbers.set_text(_in_numbers(answer, view.seconds))
        for name, distance in answer.distances.items():
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
            with self._classes, _div("class"):
                with _div("row").style("min-width: 0"):
                    title = ui.label(name).classes("name font-bold truncate")
                    title.style(f"color: {look}")
                    _small(f"{count} samples")
                    distance = _small()
                with _div("row").style("gap: 2px; flex-wrap: nowrap"):
                    if self._session.is_taught:
                        self._show_buttons(name)
                bar = ui.linear_progress(0, show_value=False, size="14px", color=look)
                bar.style("grid-column: 1 / 3")
            self._rows[name] = distance, bar

    def _show_buttons(self, name: str) -> None:
        more = self._doing(Session.learn, name, SAMPLES)
        _icon("add", f"learn {SAMPLES} more samples", more)
        _icon("sync", "recalibrate", partial(self._recalibrate, name))
        _icon("delete_outline", "forget", self._doing(Session.forget, name))


def _accuracy(tests: Sequence[bool]) -> str:
    if not tests:
        return "not tested yet"
    right, n = sum(tests), len(tests)
    return f"{right} of the latest {n} right ({right / n:.0%})"


def _in_words(answer: Answer) -> tuple[str, str]:
    """The predicted class, or the values, and the rest of the answer."""
    if not answer.distances:
        values = [f"{v:.1f} [{low:.1f}, {high:.1f}]" for v, low, high in answer.values]
        return ", ".join(values), ""
    likely = ", ".join(answer.likely) or "none"
    text = "none of these" if answer.label is None else answer.label
    return text, f"{1 - ALPHA:.0%} prediction set: {likely}."


def _in_numbers(answer: Answer, seconds: float) -> str:
    """The nearest distance, the margin to the next, and the time that the answer took."""
    parts = []
    if answer.distances:
        parts.append(f"distance {min(answer.distances.values()):.3f}")
    if answer.margin is not None:
        parts.append(f"margin {answer.margin:.3f}")
    parts.append(f"{1e3 * seconds:.1f} ms")
    return " · ".join(parts)


def _div(classes: str) -> ui.element:
    return ui.element("div").classes(classes)


def _small(text: str = "") -> ui.label:
    return ui.label(text).classes("small")


def _button(text: str, act: Callable[[], Any]) -> None:
    ui.button(text, on_click=act).props("no-caps outline dense padding='4px 10px'")


def _icon(icon: str, tip: str, act: Callable[[], Any]) -> None:
    button = ui.button(icon=icon, on_click=act).props("flat dense size=sm")
    button.props(f'aria-label="{tip}"').tooltip(tip)
