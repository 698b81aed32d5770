"""The page itself: its layout, and the job of each button."""

from __future__ import annotations

import asyncio
import contextlib
import html
import logging
import math
import os
import secrets
import socket
from collections.abc import AsyncIterator, Callable
from typing import Any
from urllib.parse import urlencode

from nicegui import app, ui
from nicegui.server import Server
from starlette.responses import Response, StreamingResponse

from hdc.live.guard import Guard
from hdc.live.pad import Pad, colour
from hdc.live.session import ALPHA, MOST_LETTERS, READOUTS, RECENT, Answer, Session, within
from hdc.live.sources import Pressable, Recorded, Source
from hdc.live.worker import Job, Worker

HERE = "127.0.0.1"
REFRESH = 0.2
"""Seconds between updates of words and bars; pictures come as fast as they are made."""
LARGEST_FILE = 2**26
SAMPLES = 10
"""Learned at a press of a button."""
_BOUNDARY = b"--frame\r\n"
_STYLE = """
body { background: #f5f5f2; color: #222; }
.nicegui-content { padding: 0; }
.live { max-width: 1400px; margin: 0 auto; padding: 12px; width: 100%; display: grid; gap: 12px;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 400px), 1fr)); align-items: start; }
.card { background: white; border: 1px solid #ddd; border-radius: 8px; padding: 12px;
  display: flex; flex-direction: column; gap: 8px; min-width: 0; }
.card h2 { font-size: 1.05rem; font-weight: 600; line-height: 1.3; margin: 0; }
.live h1 { font-size: 1.5rem; font-weight: 700; line-height: 1.2; margin: 0; }
.stack { display: flex; flex-direction: column; gap: 12px; min-width: 0; }
.wide { grid-column: 1 / -1; }
.small { font-size: .82rem; color: #555; line-height: 1.35; }
.badge { background: #b35900; color: white; border-radius: 4px; padding: 2px 8px; font-weight: 600;
  font-size: .85rem; white-space: nowrap; }
.picture { width: 100%; aspect-ratio: var(--ratio); display: block; background: #000; }
.halves { display: grid; grid-template-columns: 1fr 1fr; gap: 8px; }
.pad { width: 100%; touch-action: none; cursor: crosshair; user-select: none; }
.pad svg { width: 100%; display: block; }
.answer { font-size: 1.7rem; font-weight: 700; line-height: 1.2; overflow-wrap: anywhere; }
.class { display: grid; grid-template-columns: 44px minmax(0, 1fr) auto; gap: 2px 8px;
  align-items: center; border-top: 1px solid #eee; padding-top: 6px; }
.class img { width: 44px; height: 44px; image-rendering: pixelated; grid-row: span 2;
  align-self: start; }
.name { font-weight: 600; overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }
.bar { height: 14px; background: #eee; border-radius: 3px; overflow: hidden; grid-column: 2 / 4; }
.fill { height: 100%; }
.numbers { font-variant-numeric: tabular-nums; }
.row { display: flex; flex-wrap: wrap; gap: 8px; align-items: center; }
"""


def serve(source: Source, host: str | None = None, port: int = 8080) -> None:
    """Show the page until it is interrupted; its address, with a token, is printed.

    Args:
        source: of the frames.
        host: address to listen at; default: this computer alone.
        port: of the server.

    Raises:
        OSError: the port is taken, or the address is not of this computer.
    """
    host = host or HERE
    _check_free(host, port)
    worker, token = Worker(Session(source)), secrets.token_urlsafe(16)
    app.add_middleware(Guard, token=token, cookie=f"hdc_live_{port}")
    app.on_startup(worker.start)
    app.on_startup(lambda: _announce(f"http://{host}:{port}/?token={token}"))
    app.on_shutdown(worker.stop)
    app.get("/stream")(lambda: _stream(worker))
    app.get("/prototype")(lambda name: _prototype(worker, name))
    with contextlib.suppress(KeyboardInterrupt):
        ui.run(
            lambda: Page(worker), host=host, port=port, title=source.title, reload=False,
            show=False, show_welcome_message=False, timeout_graceful_shutdown=1,
            gzip_middleware_factory=None,  # would hold back the pictures
        )  # fmt: skip


async def _announce(address: str) -> None:
    while not Server.instance.started:
        await asyncio.sleep(0.02)
    print(f"open {address} (Ctrl+C ends it)", flush=True)


def _check_free(host: str, port: int) -> None:
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as tried:
        tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            tried.bind((host, port))
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno else error
            raise OSError(
                f"{host}:{port}: expected an address to listen at, found: {reason}"
            ) from None


def _stream(worker: Worker) -> Response:
    kind = "multipart/x-mixed-replace; boundary=frame"
    return StreamingResponse(_pictures(worker), media_type=kind)


async def _pictures(worker: Worker) -> AsyncIterator[bytes]:
    """Motion JPEG until the browser leaves or the server is to end."""
    worker.watch(+1)
    try:
        yield _BOUNDARY
        number = 0
        while not Server.instance.should_exit:
            if worker.view.number == number:
                await asyncio.sleep(0.005)
                continue
            view = worker.view
            number = view.number
            head = b"Content-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(view.picture)
            # The boundary after a picture lets the browser show it before the next one comes.
            yield head + view.picture + b"\r\n" + _BOUNDARY
    finally:
        worker.watch(-1)


def _prototype(worker: Worker, name: str) -> Response:
    content = worker.view.prototypes.get(name)
    if content is None:
        return Response(status_code=404)
    return Response(content, media_type="image/jpeg", headers={"Cache-Control": "no-store"})


class Page:
    """The page in one browser."""

    def __init__(self, worker: Worker) -> None:
        self._worker, self._session, self._source = worker, worker.session, worker.session.source
        self._rows: dict[str, _Row] = {}
        self._version = -1
        self._pressable = isinstance(self._source, Pressable)
        ui.add_css(_STYLE)
        ui.colors(primary=colour("0", "0"))
        with ui.element("div").classes("live"):
            with ui.element("div").classes("wide row"):
                _heading("h1", "Teach a sensor to feel")
                _heading("span", self._source.title).classes("badge")
                ui.label(
                    f"{self._source.note} All who open this page share this sensor and its model."
                ).style("flex-basis: 100%")
            with ui.element("div").classes("card"):
                self._see()
            with ui.element("div").classes("card"):
                self._teach()
            with ui.element("div").classes("stack"):
                with ui.element("div").classes("card"):
                    self._adapt()
                with ui.element("div").classes("card"):
                    self._judge()
        ui.timer(REFRESH, self._refresh)

    # Layout --------------------------------------------------------------------------------------

    def _see(self) -> None:
        source = self._source
        height, width = source.shape
        _heading("h2", "1. What the camera sees")
        picture = ui.element("img").props('src="/stream" alt="live picture"').classes("picture")
        picture.style(f"--ratio: {2 * width} / {height}")
        with ui.element("div").classes("halves small"):
            ui.label("the frame")
            ui.label(f"its hypervector: {height * width:,} bits, brighter than the median or not")
        if isinstance(source, Pressable):
            self._pad = Pad(self._do, self._session, source)
        if isinstance(source, Recorded):
            self._play(source)
        self._label = ui.label().classes("small")
        _heading("h2", "The model says")
        self._answer = ui.label().classes("answer").mark("answer")
        self._beside = ui.label().classes("small")

    def _play(self, source: Recorded) -> None:
        def play(session: Session) -> None:
            source.playing = not source.playing

        with ui.element("div").classes("row"):
            for icon, tip, job in (
                ("skip_previous", "one frame back", lambda session: source.step(-1)),
                ("play_arrow", "play or pause", play),
                ("skip_next", "one frame ahead", lambda session: source.step(+1)),
            ):
                self._icon(icon, tip, job)
            self._go = ui.select(list(source.classes), label="go to class").classes("grow")
            self._go.props("dense outlined")
            self._go.on_value_change(lambda e: self._do(lambda session: source.go(e.value)))

    def _teach(self) -> None:
        _heading("h2", "2. Teach it")
        what = "Press somewhere" if self._pressable else "Show it something"
        again = "press elsewhere" if self._pressable else "show something else"
        ui.label(
            f"{what}, name it, and learn {SAMPLES} samples; then {again}. A bit of a class's "
            "prototype is 1 if most of its samples have it."
        ).classes("small")
        with ui.element("div").classes("row"):
            self._name = ui.input("name of a new class").classes("grow")
            self._name.props(f"dense outlined maxlength={MOST_LETTERS}")
            self._name.on("keydown.enter", self._new_class)
            ui.button("New class", on_click=self._new_class).props("no-caps")
        self._classes = ui.element("div").classes("stack")
        self._axis = ui.label().classes("small")
        if len(READOUTS) > 1:
            with ui.element("div").classes("row"):
                ui.label("read-out").classes("small")
                self._readout = ui.toggle(list(READOUTS), value=self._session.readout)
                self._readout.props("no-caps dense").on_value_change(self._use)
        with ui.element("div").classes("row"):
            self._button("Forget everything", lambda session: session.forget(None))
            ui.button("Save the model", on_click=self._save).props("no-caps outline dense")
            upload = ui.upload(
                auto_upload=True, on_upload=self._load, max_file_size=LARGEST_FILE,
                on_rejected=lambda: _tell("This file is too large for a model."),
            ).classes("hidden")  # fmt: skip
            load = ui.button("Load a model", on_click=lambda: upload.run_method("pickFiles"))
            load.props("no-caps outline dense")

    def _adapt(self) -> None:
        source = self._source
        _heading("h2", "3. Let it drift, and recalibrate" if self._pressable else "3. Recalibrate")
        if isinstance(source, Pressable):
            ui.label(
                "Silicone ages and rooms warm up: the same touch then makes another speckle, and "
                "the model begins to fail (simulated as a change of temperature)."
            ).classes("small")
            with ui.element("div").classes("row").style("flex-wrap: nowrap"):
                self._drift = ui.slider(min=0, max=source.most, step=0.01, value=source.offset)
                self._drift.props('aria-label="drift in kelvin"')
                self._drift.on("update:model-value", self._drifted, throttle=0.1)
                self._kelvin = ui.label().classes("numbers").style("white-space: nowrap")
            with ui.element("div").classes("row"):
                self._button("Let 16 days pass", lambda s: s.drift(source.sixteen_days))
                self._button("Back to the first day", lambda s: s.drift(0.0))
        ui.label(
            f"Recalibrating takes {SAMPLES} new samples of a class. “Replace” takes each bit of "
            "the new prototype with probability p, as published; “merge” counts the votes of old "
            "and new samples, the new ones with the share p."
        ).classes("small")
        with ui.element("div").classes("row"):
            self._method = ui.toggle(["replace", "merge"], value="replace").props("no-caps dense")
            with ui.element("div").classes("row grow").style("flex-wrap: nowrap"):
                self._p = ui.slider(min=0, max=1, step=0.05, value=0.5).props('aria-label="p"')
                text = ui.label().classes("numbers").style("white-space: nowrap")
                text.bind_text_from(self._p, "value", lambda p: f"p = {p:.2f}")
        if self._pressable:
            again = ui.button("Recalibrate all classes where they were taught")
            again.props("no-caps outline dense").on_click(lambda: self.recalibrate(None))
        else:
            ui.label("Show it a class again and press “recalibrate” in its row.").classes("small")

    def _judge(self) -> None:
        _heading("h2", "4. How good is it?")
        self._accuracy = ui.label().mark("accuracy")
        tested = "new touches" if self._pressable else "samples, each predicted before it is learnt"
        ui.label(
            f"Accuracy on the latest {RECENT} {tested}; “none of these” counts as wrong. Drift, "
            "recalibration and another read-out start the count anew."
        ).classes("small")

    def _button(self, text: str, job: Job) -> None:
        ui.button(text, on_click=lambda: self._do(job)).props("no-caps outline dense")

    def _icon(self, icon: str, tip: str, job: Job) -> None:
        button = ui.button(icon=icon, on_click=lambda: self._do(job)).props("flat dense size=sm")
        button.props(f'aria-label="{tip}"').tooltip(tip)

    # Jobs ----------------------------------------------------------------------------------------

    async def _do(self, job: Job) -> Any:
        """Have the worker do a job; its error is shown on this page alone."""
        try:
            return await asyncio.wrap_future(self._worker.do(job))
        except ValueError as error:
            _tell(str(error))
        except Exception as error:
            logging.getLogger(__name__).exception("job")
            _tell(f"This went wrong: {type(error).__name__}: {error}")
        return None

    @property
    def _touches(self) -> tuple[Any, ...]:
        """The present touches; read in the worker, after earlier presses."""
        return self._source.touches if isinstance(self._source, Pressable) else ()

    async def _new_class(self) -> None:
        name = self._name.value or self._worker.view.label or ""
        self._name.set_value("")
        await self._do(lambda session: session.new_class(name, SAMPLES, self._touches))

    async def add(self, name: str) -> None:
        await self._do(lambda session: session.add(name, SAMPLES, self._touches))

    async def recalibrate(self, name: str | None) -> None:
        """A class by what is pressed or seen now, or (None) all where they were taught."""
        p, method = within(self._p.value, 0.0, 1.0), str(self._method.value)

        def recalibrate(session: Session) -> None:
            names = list(session.counts) if name is None else [name]
            touches = None if name is None else self._touches
            session.recalibrate(names, SAMPLES, p, method, touches)

        await self._do(recalibrate)

    async def forget(self, name: str) -> None:
        await self._do(lambda session: session.forget(name))

    async def _use(self, event: Any) -> None:
        await self._do(lambda session: session.use(event.value))

    async def _drifted(self) -> None:
        kelvin = self._drift.value
        await self._do(lambda session: session.drift(kelvin))

    async def _save(self) -> None:
        content = await self._do(lambda session: session.saved())
        if content is not None:
            ui.download.content(content, "touch.safetensors")

    async def _load(self, event: Any) -> None:
        event.sender.reset()
        content = await event.file.read()
        await self._do(lambda session: session.load(content))

    # Updates -------------------------------------------------------------------------------------

    def _refresh(self) -> None:
        view, session, source = self._worker.view, self._session, self._source
        answer, counts = view.answer, session.counts
        if view.version != self._version:
            self._version = view.version
            if list(self._rows) != list(counts):
                self._classes.clear()
                with self._classes:
                    self._rows = {name: _Row(self, name, list(counts)) for name in counts}
            for name, row in self._rows.items():
                row.update(counts.get(name, 0), self._version)
            if len(READOUTS) > 1:
                self._readout.set_value(session.readout)
        text, beside = _in_words(answer, session.unit)
        if view.error or self._worker.busy or answer is None:
            wanted = "one more class" if counts else "two classes"
            text = view.error or (
                "learning …" if self._worker.busy else f"nothing yet: teach it {wanted}"
            )
        _say(self._answer, text)
        self._answer.style(f"color: {colour(list(counts), answer.label) if answer else '#777'}")
        _say(self._beside, beside)
        _say(
            self._axis,
            "Bars: 1 − 2 × Hamming distance to each prototype; 0 is chance." if answer else "",
        )
        for name, distance in answer.distances.items() if answer else ():
            if name in self._rows:
                self._rows[name].show(distance)
        right, n = session.tests
        _say(
            self._accuracy,
            f"{right} of the latest {n} right ({right / n:.0%})" if n else "not tested yet",
        )
        if isinstance(source, Pressable):
            self._pad.show(answer.values if answer else ())
            _say(self._kelvin, f"+ {source.offset:.2f} K")
            if abs(self._drift.value - source.offset) > 0.005 and not self._worker.busy:
                self._drift.set_value(source.offset)
        elif view.label:
            _say(self._label, f"recorded as “{view.label}”")


class _Row:
    """One class: its prototype, its samples, its distance, and its buttons."""

    def __init__(self, page: Page, name: str, names: list[str]) -> None:
        self._name = name
        look = colour(names, name)
        with ui.element("div").classes("class").mark(f"class {name}"):
            self._picture = ui.element("img").props('alt="prototype"')
            with ui.element("div").classes("row").style("min-width: 0"):
                ui.label(name).classes("name").style(f"color: {look}")
                self._count = ui.label().classes("small numbers")
                self._distance = ui.label().classes("small numbers")
            with ui.element("div").classes("row").style("gap: 2px; flex-wrap: nowrap"):
                for icon, tip, act in (
                    ("add", f"learn {SAMPLES} more samples", page.add),
                    ("sync", "recalibrate", page.recalibrate),
                    ("delete_outline", "forget", page.forget),
                ):
                    button = ui.button(icon=icon, on_click=lambda act=act: act(name))
                    button.props(f'flat dense size=sm aria-label="{tip}"').tooltip(tip)
            with ui.element("div").classes("bar"):
                self._fill = (
                    ui.element("div").classes("fill").style(f"width: 0; background: {look}")
                )

    def update(self, count: int, version: int) -> None:
        """Show the number of samples and the prototype they make."""
        _say(self._count, f"{count} samples")
        source = f"/prototype?{urlencode({'name': self._name, 'version': version})}"
        self._picture.props["src"] = source
        self._picture.update()

    def show(self, distance: float) -> None:
        """Show a Hamming distance, a share of the bits."""
        self._fill.style(f"width: {100 * max(0.0, 1 - 2 * distance):.1f}%")
        _say(self._distance, f"· distance {min(distance, 1):.3f}")


def _in_words(answer: Answer | None, unit: str) -> tuple[str, str]:
    """The predicted class, and the rest of the answer."""
    if answer is None:
        return "", ""
    lines = []
    if answer.likely is not None:
        likely = ", ".join(answer.likely) or "none"
        lines.append(f"{1 - ALPHA:.0%} prediction set: {likely}.")
    if answer.values:
        each = (f"{value:.1f} {unit} [{low:.1f}, {high:.1f}]" for value, low, high in answer.values)
        lines.append(f"Value: {', '.join(each)}.")
    return "none of these" if answer.label is None else answer.label, " ".join(lines)


def _heading(tag: str, text: str) -> ui.html:
    return ui.html(html.escape(text), sanitize=False, tag=tag)


def _tell(text: str) -> None:
    ui.notify(text, position="top", multi_line=True, timeout=6000, color="dark")


def _say(element: ui.label, text: str) -> None:
    if element.text != text:
        element.set_text(text)
