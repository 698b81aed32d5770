"""The page itself: what is where, and what each button asks of the worker."""

from __future__ import annotations

import asyncio
import contextlib
import html
import math
import os
import secrets
import time
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any
from urllib.parse import urlencode

from fastapi import Response
from fastapi.responses import StreamingResponse
from nicegui import app, ui
from nicegui.server import Server
from starlette.middleware.trustedhost import TrustedHostMiddleware

from hdc.live import colours
from hdc.live.guard import Guard
from hdc.live.pad import Pad
from hdc.live.session import MOST_LETTERS, RECENT, STEPS, Session, checked_name, within
from hdc.live.sources import Pressable, Source
from hdc.live.worker import Worker

HERE = "127.0.0.1"
REFRESH = 0.2
"""Seconds between updates of words and bars; the picture comes as fast as it is made."""
LARGEST_FILE = 2**26
SAMPLES = 10
"""That a press of a button learns."""
_BOUNDARY = b"--frame\r\n"
_STYLE = """
body { background: #f5f5f2; color: #222; }
.nicegui-content { padding: 0; }
.live { max-width: 1400px; margin: 0 auto; padding: 12px; width: 100%; display: grid; gap: 12px;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 400px), 1fr)); align-items: start; }
.card { background: white; border: 1px solid #ddd; border-radius: 8px; padding: 12px;
  display: flex; flex-direction: column; gap: 8px; min-width: 0; }
.card h2 { font-size: 1.05rem; font-weight: 600; line-height: 1.3; margin: 0; }
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
.bar { position: relative; height: 14px; background: #eee; border-radius: 3px; overflow: hidden;
  grid-column: 2 / 4; }
.fill { position: absolute; inset: 0 auto 0 0; }
.line { position: absolute; top: 0; bottom: 0; width: 3px; background: #222; }
.numbers { font-variant-numeric: tabular-nums; }
.row { display: flex; flex-wrap: wrap; gap: 8px; align-items: center; }
.steps { display: grid; grid-template-columns: repeat(auto-fit, minmax(56px, 1fr)); gap: 6px; }
"""


def serve(source: Source, host: str | None = None, port: int = 8080) -> None:
    """Show the page until it is interrupted.

    Args:
        source: where frames come from.
        host: address to listen at; None: this computer alone. Otherwise a token is made, printed
            with the address, and asked of everybody.
        port: of the server.

    Raises:
        OSError: the port is taken, or the address is not of this computer.
    """
    _check_free(host or HERE, port)
    worker = Worker(Session(source))
    app.on_startup(worker.start)
    app.on_shutdown(worker.stop)
    _pictures(worker)
    address = f"http://{host or HERE}:{port}/"
    if host is None:
        # A page of elsewhere that makes its name point here is refused.
        app.add_middleware(TrustedHostMiddleware, allowed_hosts=[HERE, "localhost"])
    else:
        token = secrets.token_urlsafe(16)
        app.add_middleware(Guard, token=token)
        address += f"?token={token}"
    app.on_startup(lambda: _announce(address))
    with contextlib.suppress(KeyboardInterrupt):
        ui.run(
            lambda: Page(worker),
            host=host or HERE,
            port=port,
            title=source.title,
            reload=False,
            show=False,
            show_welcome_message=False,
            gzip_middleware_factory=None,  # pictures are compressed, and would wait for each other
            timeout_graceful_shutdown=1,
        )


async def _announce(address: str) -> None:
    while not Server.instance.started:
        await asyncio.sleep(0.02)
    print(f"open {address} (Ctrl+C ends it)", flush=True)


def _check_free(host: str, port: int) -> None:
    import socket

    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as tried:
        tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            tried.bind((host, port))
        except OSError as error:
            said = os.strerror(error.errno) if error.errno else error
            raise OSError(
                f"{host}:{port}: expected an address to listen at, found: {said}"
            ) from None


def _pictures(worker: Worker) -> None:
    """The addresses that pictures come from."""

    @app.get("/stream")
    async def stream() -> StreamingResponse:
        return StreamingResponse(
            _frames(worker), media_type="multipart/x-mixed-replace; boundary=frame"
        )

    @app.get("/prototype")
    def prototype(name: str) -> Response:
        content = worker.view.prototypes.get(name)
        if content is None:
            return Response(status_code=404)
        return Response(content, media_type="image/jpeg", headers={"Cache-Control": "no-store"})


async def _frames(worker: Worker) -> AsyncIterator[bytes]:
    """Every picture that there is time for, as Motion JPEG, for as long as somebody takes them."""
    worker.watch(+1)
    try:
        yield _BOUNDARY
        number = 0
        while True:
            while worker.view.number == number:
                await asyncio.sleep(0.005)
            view = worker.view
            number = view.number
            begin = time.perf_counter()
            head = b"Content-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(view.picture)
            # The boundary after a picture lets the browser show it before the next one comes.
            yield head + view.picture + b"\r\n" + _BOUNDARY
            worker.session.took("send", begin)
    finally:
        worker.watch(-1)


class Page:
    """What one browser sees."""

    def __init__(self, worker: Worker) -> None:
        self._worker, self._session = worker, worker.session
        self._source = worker.session.source
        self._rows: dict[str, _Row] = {}
        self._version = -1
        self._message = worker.view.message[0]
        self._points: tuple[Any, ...] = ()
        ui.add_css(_STYLE)
        ui.colors(primary=colours.BLUE)
        with ui.element("div").classes("live"):
            self._head()
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

    # What is where -------------------------------------------------------------------------------

    def _head(self) -> None:
        with ui.element("div").classes("wide row"):
            _html("h1", "Teach a sensor to feel").style(
                "font-size: 1.5rem; font-weight: 700; line-height: 1.2"
            )
            _html("span", self._source.title).classes("badge")
            _text(
                self._source.note + " Everybody who opens this page shares this one sensor and "
                "this one model."
            ).style("flex-basis: 100%")

    def _see(self) -> None:
        source = self._source
        height, width = source.shape
        _html("h2", "1. What the camera sees")
        picture = ui.element("img").props('src="/stream" alt="live picture"').classes("picture")
        picture.style(f"--ratio: {2 * width} / {height}")
        with ui.element("div").classes("halves small"):
            _text(self._kind)
            _text(f"its hypervector: {height * width:,} bits, brighter than the median or not")
        if isinstance(source, Pressable):
            self._pad = Pad(self._worker, source)
        else:
            self._now = _text("").classes("small")
        _html("h2", "The model says")
        self._answer = _text("").classes("answer").mark("answer")
        self._beside = _text("").classes("small")

    @property
    def _kind(self) -> str:
        return "the simulated speckle of laser light" if self._pressable else "the picture"

    def _teach(self) -> None:
        _html("h2", "2. Teach it")
        pressed = "Press somewhere, name it, and learn {} samples; then press elsewhere."
        seen = "Show it something, name it, and learn {} samples; then show something else."
        _text(
            (pressed if self._pressable else seen).format(SAMPLES)
            + " Learning is counting: a bit of "
            "a class's prototype is 1 if most of its samples have it."
        ).classes("small")
        with ui.element("div").classes("row"):
            self._name = ui.input("name of a new class").props(
                f"dense outlined maxlength={MOST_LETTERS}"
            )
            self._name.classes("grow").on("keydown.enter", self._new_class)
            ui.button("New class", on_click=self._new_class).props("no-caps")
        self._classes = ui.element("div").style("display: flex; flex-direction: column; gap: 6px")
        self._axis = _text("").classes("small")
        with ui.element("div").classes("row"):
            self._button("Forget everything", lambda: self._do(lambda s: s.forget(None)))
            self._button("Save the model", self._save)
            self._upload = ui.upload(
                label="Load a model", auto_upload=True, on_upload=self._load,
                max_file_size=LARGEST_FILE,
                on_rejected=lambda: self._worker.say("This file is too large for a model."),
            )  # fmt: skip
            self._upload.classes("hidden")
            self._button("Load a model", lambda: self._upload.run_method("pickFiles"))

    def _adapt(self) -> None:
        source = self._source
        if isinstance(source, Pressable):
            _html("h2", "3. Let it drift, and recalibrate")
            _text(
                "Silicone ages and rooms warm up: the same touch then makes another speckle, and "
                "the model begins to fail (simulated as a change of temperature)."
            ).classes("small")
            with ui.element("div").classes("row").style("flex-wrap: nowrap"):
                self._drift = ui.slider(
                    min=0, max=source.most, step=0.01, value=source.offset
                ).props('label aria-label="drift in kelvin"')
                self._drift.on("update:model-value", self._drifted, throttle=0.1)
                self._kelvin = _text("").classes("numbers").style("white-space: nowrap")
            with ui.element("div").classes("row"):
                self._button("Let 16 days pass", lambda: self._set_drift(source.sixteen_days))
                self._button("Back to the first day", lambda: self._set_drift(0.0))
        else:
            _html("h2", "3. Recalibrate")
        _text(
            f"Recalibrating takes {SAMPLES} new samples of a class. “Replace” takes each bit of "
            "the new prototype with probability p, as published; “merge” counts the votes of old "
            "and new samples, the new ones with the share p."
        ).classes("small")
        with ui.element("div").classes("row"):
            self._method = ui.toggle(["replace", "merge"], value="replace").props("no-caps dense")
            with ui.element("div").classes("row grow").style("flex-wrap: nowrap"):
                self._p = ui.slider(min=0, max=1, step=0.05, value=0.5).props('aria-label="p"')
                self._share = _text("").classes("numbers").style("white-space: nowrap")
        if self._pressable:
            self._button("Recalibrate all classes where they were taught", self._recalibrate_all)
        else:
            _text("Show it a class again and press “recalibrate” in its row.").classes("small")

    def _judge(self) -> None:
        _html("h2", "4. How good is it?")
        self._accuracy = _text("").mark("accuracy")
        self._chart = ui.echart(_chart([], False)).style("height: 220px")
        _text(
            f"Share of right answers among the latest {RECENT} {self._session.tested_by}; “none "
            "of these” is a wrong answer. "
            + ("A new class, drift" if self._pressable else "Forgetting")
            + " and recalibration begin the count anew."
        ).classes("small")
        self._ridge = _text("").classes("small")
        _text("Time that each step of a frame takes (frame: until there is one):").classes("small")
        with ui.element("div").classes("steps"):
            self._steps = {}
            for step in STEPS:
                with ui.element("div"):
                    self._steps[step] = _text("–").classes("numbers").style("font-weight: 600")
                    _text(step).classes("small")
        self._rate = _text("").classes("small").mark("rate")

    def _button(self, text: str, act: Callable[[], Any]) -> ui.button:
        return ui.button(text, on_click=act).props("no-caps outline dense padding='4px 10px'")

    @property
    def _pressable(self) -> bool:
        return isinstance(self._source, Pressable)

    # What buttons do -----------------------------------------------------------------------------

    def _do(self, job: Callable[[Session], Any]) -> None:
        self._worker.do(job)

    def _touches(self) -> tuple[Any, ...]:
        """What is pressed now; asked in the worker, after what was pressed before."""
        return self._pad.touches if self._pressable else ()

    def _new_class(self) -> None:
        try:
            name = checked_name(self._name.value)
        except ValueError as error:
            self._worker.say(str(error))
            return
        self._do(lambda session: session.new_class(name, SAMPLES, self._touches()))
        self._name.set_value("")

    def add(self, name: str) -> None:
        self._do(lambda session: session.add(name, SAMPLES, self._touches()))

    def recalibrate(self, names: list[str] | None) -> None:
        """Some classes by what is pressed now, or (None) all where they were taught."""
        p, method = within(self._p.value, 0.0, 1.0), str(self._method.value)

        def recalibrate(session: Session) -> Iterator[None]:
            touches = None if names is None else self._touches()
            chosen = list(session.counts) if names is None else names
            return session.recalibrate(chosen, SAMPLES, p, method, touches)

        self._do(recalibrate)

    def _recalibrate_all(self) -> None:
        self.recalibrate(None)

    def forget(self, name: str) -> None:
        self._do(lambda session: session.forget(name))

    def _drifted(self) -> None:
        self._set_drift(within(self._drift.value, 0.0, math.inf))

    def _set_drift(self, kelvin: float) -> None:
        self._drift.set_value(kelvin)
        self._do(lambda session: session.drift(kelvin))

    async def _save(self) -> None:
        done: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        loop = asyncio.get_running_loop()

        def save(session: Session) -> None:
            try:
                content = session.saved()
            except BaseException:
                loop.call_soon_threadsafe(done.cancel)
                raise
            loop.call_soon_threadsafe(done.set_result, content)

        self._do(save)
        try:
            ui.download.content(await asyncio.wait_for(done, 30), "touch.safetensors")
        except (asyncio.CancelledError, TimeoutError):
            return  # said by the worker

    async def _load(self, event: Any) -> None:
        self._upload.reset()
        if event.file.size() > LARGEST_FILE:
            self._worker.say("This file is too large for a model.")
            return
        content = await event.file.read()
        self._do(lambda session: session.load(content))

    # What is new ---------------------------------------------------------------------------------

    def _refresh(self) -> None:
        view, session = self._worker.view, self._session
        number, message = view.message
        if number != self._message:
            self._message = number
            ui.notify(message, position="top", multi_line=True, timeout=6000, color="dark")
        if view.version != self._version:
            self._version = view.version
            self._update_classes(session.counts)
        answer = view.answer
        counts = session.counts
        if view.busy:
            said, colour = "learning …", "#222"
        elif answer is None:
            said, colour = (
                f"nothing yet: teach it {'two classes' if not counts else 'one more'}",
                "",
            )
        elif answer.label is None:
            said, colour = "none of these", "#222"
        else:
            said, colour = answer.label, colours.of(list(counts), answer.label)
        _say(self._answer, said)
        self._answer.style(f"color: {colour or '#777'}")
        _say(
            self._beside,
            f"Ridge regression says: {answer.ridge}" if answer and answer.ridge else "",
        )
        if answer is not None:
            low = _axis_from(answer)
            _say(
                self._axis,
                f"Bars: Hamming distance to each prototype, from {low:.2f} to 0.50 of the bits "
                "(0.50 is chance). Black line: from there on it is “none of these”"
                + ("." if answer.limits is not None else ", not known yet."),
            )
            for i, name in enumerate(answer.names):
                if name in self._rows:
                    limit = None if answer.limits is None else float(answer.limits[i])
                    self._rows[name].show(float(answer.distances[i]), limit, low)
        self._update_source()
        right, n = session.tests
        _say(
            self._accuracy,
            f"{right} of the latest {n} right ({right / n:.0%})" if n else "not tested yet",
        )
        points = list(session.points)
        if (latest := (len(points), points[-1:])) != self._points:
            self._points = latest
            self._chart.options.clear()
            self._chart.options.update(_chart(points, self._pressable))
            self._chart.update()
        _say(
            self._ridge,
            f"Ridge regression on the same samples, for comparison: {session.ridge.state}.",
        )
        for step, element in self._steps.items():
            took = session.milliseconds.get(step)
            _say(element, "–" if took is None else f"{took:.1f} ms")
        _say(self._rate, f"{view.rate:.0f} frames a second · {session.shown} samples shown")
        _say(self._share, f"p = {self._p.value:.2f}")

    def _update_source(self) -> None:
        source = self._source
        if isinstance(source, Pressable):
            self._pad.show(self._session)
            _say(self._kelvin, f"+ {source.offset:.2f} K")
            if abs(self._drift.value - source.offset) > 0.005 and not self._worker.waiting:
                self._drift.set_value(source.offset)
        else:
            label = source.label
            _say(self._now, f"recorded as “{label}”" if label else "")

    def _update_classes(self, counts: dict[str, int]) -> None:
        if list(self._rows) != list(counts):
            self._classes.clear()
            with self._classes:
                self._rows = {name: _Row(self, name, list(counts)) for name in counts}
        for name, row in self._rows.items():
            row.update(counts[name], self._version)


class _Row:
    """One class: its prototype, how many samples, how far it is, and what can be done with it."""

    def __init__(self, page: Page, name: str, names: list[str]) -> None:
        self._name = name
        with ui.element("div").classes("class").mark(f"class {name}"):
            self._picture = ui.element("img").props('alt="prototype"')
            with ui.element("div").classes("row").style("min-width: 0"):
                _text(name).classes("name").style(f"color: {colours.of(names, name)}")
                self._count = _text("").classes("small numbers")
                self._distance = _text("").classes("small numbers")
            with ui.element("div").classes("row").style("gap: 2px; flex-wrap: nowrap"):
                for icon, tip, act in (
                    ("add", f"learn {SAMPLES} more samples", lambda: page.add(name)),
                    ("sync", "recalibrate", lambda: page.recalibrate([name])),
                    ("delete_outline", "forget", lambda: page.forget(name)),
                ):
                    button = ui.button(icon=icon, on_click=act).props("flat dense size=sm")
                    button.props(f'aria-label="{tip}"').tooltip(tip)
            with ui.element("div").classes("bar"):
                self._fill = ui.element("div").classes("fill")
                self._fill.style(f"width: 0; background: {colours.of(names, name)}")
                self._line = ui.element("div").classes("line").style("display: none")

    def update(self, count: int, version: int) -> None:
        """Samples there are, and the prototype they make."""
        _say(self._count, f"{count} samples")
        source = f"/prototype?{urlencode({'name': self._name, 'version': version})}"
        self._picture.props["src"] = source
        self._picture.update()

    def show(self, distance: float, limit: float | None, low: float) -> None:
        """A distance, and the largest of a known frame, as shares of the pixels."""

        def place(share: float) -> float:
            return round(100 * min(max((share - low) / (0.5 - low), 0.0), 1.0), 1)

        self._fill.style(f"width: {place(distance)}%")
        if limit is None:
            self._line.style("display: none")
        else:
            self._line.style(f"display: block; left: calc({place(limit)}% - 3px)")
        _say(self._distance, f"· distance {min(distance, 1):.3f}")


def _axis_from(answer: Any) -> float:
    """Where bars begin: a bit below the nearest distance, in steps of 0.05."""
    return max(0.0, math.floor((float(answer.distances.min()) - 0.03) / 0.05) * 0.05)


def _chart(points: list[Any], pressable: bool) -> dict[str, Any]:
    def line(name: str, colour: str, kind: str, values: list[Any]) -> dict[str, Any]:
        return {
            "name": name, "type": "line", "data": values, "showSymbol": True, "symbolSize": 4,
            "lineStyle": {"color": colour, "type": kind}, "itemStyle": {"color": colour},
        }  # fmt: skip

    return {
        "animation": False,
        "grid": {"left": 44, "right": 12, "top": 28, "bottom": 38},
        "legend": {"top": 0, "data": ["hypervectors", "ridge"]},
        "xAxis": {
            "type": "value", "name": "samples shown to the model", "nameLocation": "middle",
            "nameGap": 24, "minInterval": 1,
        },
        "yAxis": {"type": "value", "min": 0, "max": 100, "name": "%", "nameGap": 8},
        "series": [
            line("hypervectors", colours.BLUE, "solid",
                 [[p.samples, round(100 * p.accuracy, 1)] for p in points]),
            line("ridge", colours.ORANGE, "dashed",
                 [[p.samples, None if p.ridge is None else round(100 * p.ridge, 1)]
                  for p in points]),
        ],
    }  # fmt: skip


def _html(tag: str, text: str) -> ui.html:
    return ui.html(html.escape(text), sanitize=False, tag=tag)


def _text(text: str) -> ui.label:
    return ui.label(text)


def _say(element: ui.label, text: str) -> None:
    if element.text != text:
        element.set_text(text)
