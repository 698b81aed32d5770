"""The page in a real browser, without one, and over HTTP."""

import asyncio
import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor
from hdc.command import main

pytest.importorskip(
    "nicegui", reason="the page needs nicegui: pip install 'speckle-hdc[live]'"
)

from nicegui.testing import user_simulation

from hdc.live import page as pages
from hdc.live.guard import Guard
from hdc.live.session import Answer, Session
from hdc.live.sources import open_source
from hdc.live.worker import Worker
from hdc.readers import Window

CHECKOUT = Path(__file__).resolve().parents[2]
N = 12
LABELS = np.repeat(["left", "right"], N)


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The simulated sensor's page in a process of its own, interrupted at the end."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("NICE", "PYT"))}
    folder = tmp_path_factory.mktemp("live")
    with subprocess.Popen(
        [sys.executable, "-m", "scenes.live", "--port", str(port)],
        cwd=folder,
        env=kept | {"PYTHONPATH": str(CHECKOUT), "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        output = ""
        while not (match := re.search(r"open (http\S+)", output)):
            line = process.stdout.readline()
            assert line, output
            output += line
        yield match[1]
        process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=30)[0]
    assert (process.returncode, output.strip()) == (0, "")
    assert list(folder.iterdir()) == []  # nothing is written


def test_the_page_opens_in_a_browser_without_an_error_of_its_scripts(browser, address):
    """It is pressed and taught, and fits a telephone."""
    page = browser.new_context(viewport={"width": 400, "height": 900}).new_page()
    errors = []
    page.on("pageerror", errors.append)
    page.goto(address, wait_until="domcontentloaded")
    page.locator(".pad img").click()
    name = "<img src=x>"  # is text
    page.get_by_label("name of a new class").fill(name)
    page.get_by_role("button", name="New class").click()
    page.locator(".name", has_text=name).wait_for(timeout=60_000)
    page.wait_for_function(
        "document.querySelector('.picture img').naturalWidth === 500"
    )
    page.wait_for_function("document.documentElement.scrollWidth <= 400")
    assert errors == []
    page.context.close()


# Who may see it ----------------------------------------------------------------------------------


def test_everything_needs_the_token(address):
    bare = address.split("?")[0]
    socket_io = "_nicegui_ws/socket.io/?EIO=4"
    for path in ("", "frame", "?token=", "?token=wrong", socket_io):
        for headers in ({}, {"Cookie": "hdc_live=wrong; ;="}):
            request = urllib.request.Request(bare + path, headers=headers)
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(request)
    client = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    for opened in (address, bare):  # the cookie is kept
        assert client.open(opened).status == 200


def answered(kind, path="/", query=b"", **headers):
    """The head of what a guard answers, or None where it lets the application."""
    messages = []

    async def send(message):
        messages.append(message)

    async def application(scope, receive, send):
        return None

    pairs = [(name.encode(), text.encode()) for name, text in headers.items()]
    scope = {"type": kind, "method": "GET", "path": path, "query_string": query}
    guard = Guard(application, token="secret", cookie="c")
    with contextlib.suppress(StopIteration):
        guard(scope | {"headers": pairs}, None, send).send(None)
    return messages[0] if messages else None


HOST = "127.0.0.1:8080"


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_pages_of_another_address_are_refused(kind):
    """cracks: another port of the same host has the cookie, and was let in."""
    mine = {"host": HOST, "cookie": "c=secret"}
    others = ("127.0.0.1:9000", "127.0.0.1", "evil.example")
    for origin in (*(f"http://{other}" for other in others), "null", ""):
        assert answered(kind, origin=origin, **mine)["status"] == 403
    assert answered(kind, origin=f"http://{HOST}", **mine) is None
    assert answered(kind, **mine) is None


def test_the_token_redirects_to_this_page_alone_and_opens_no_socket():
    """cracks: GET //evil.example/?token=… redirected there."""
    for path in ("/", "//evil.example/", "/frame", "//evil.example/%2e"):
        answer = answered("http", path, b"token=secret", host=HOST)
        assert dict(answer["headers"])[b"location"] == b"/"
    for headers in ({}, {"cookie": "c=x"}):
        answer = answered("websocket", "/", b"token=secret", **headers)
        assert answer["status"] == 403


# What it shows -----------------------------------------------------------------------------------


@pytest.fixture
def frames():
    """uint8 [24, 32, 40]: twelve frames of each of two patterns, which moves along."""
    rng = np.random.default_rng(0)
    base = rng.integers(0, 180, (2, 32, 40))
    noise = rng.integers(0, 70, (2, N, 32, 40))
    return (base[:, None] + noise).astype(np.uint8).reshape(2 * N, 32, 40)


@pytest.fixture
def film(write_film, tmp_path, frames):
    """film(crop) → a source that plays the frames."""
    write_film(tmp_path / "v.mkv", frames)
    return lambda crop=None: open_source(Window(crop), None, tmp_path / "v.mkv", 0, {})


def test_a_video_is_played_over_and_over(film, frames):
    source = film((0, 0, 20, 32))
    assert (source.shape, source.label) == ((32, 20), None)
    seen = [source.frame() for _ in range(48)]
    assert (seen[23] == seen[47]).all()  # the first was looked at for its size
    assert np.abs(seen[0].astype(int) - frames[1][:, :20]).max() <= 5
    assert len(source.samples(30)) == 30


@pytest.mark.parametrize("encoder", ["median", "levels"])
def test_a_trained_model_answers_and_is_not_taught(film, frames, encoder):
    model = HDCClassifier(encoder).fit(frames, LABELS)
    session = Session(film(), model)
    for label in LABELS[1:]:
        view = session.look()
        frame, shares = np.hsplit(view.drawn, 2)
        assert view.answer.label in (label, None)
        # The bits of this model: those of the median were shown for any.
        rank = np.argsort(np.argsort(frame, axis=None, kind="stable"))
        steps = 8 if encoder == "levels" else 2
        expected = (rank * steps // frame.size).reshape(frame.shape) / (steps - 1)
        assert np.abs(shares / 255 - expected).mean() < 0.02
    for job in (
        lambda: session.learn("left", 1),
        lambda: session.forget(None),
        lambda: session.recalibrate("left", 1, 0.5),
    ):
        with pytest.raises(ValueError, match="trained before and is shown as it is"):
            job()
    assert session.counts == {"left": N, "right": N}
    model.predict_set = lambda frames, alpha: [np.array([])]
    answer = session.ask(session.source.frame())
    assert (answer.label, answer.likely) == (None, ())  # no label beside an empty set


def test_values_are_shown_with_intervals_unless_they_go_round(film, frames):
    values = np.repeat([1.0, 3.0], N) + np.tile([0, 0.1], N)
    answer = Session(film(), HDCRegressor().fit(frames, values)).look().answer
    ((value, low, high),) = answer.values
    assert low <= value <= high
    assert value == pytest.approx(1.05, abs=0.3)
    model = HDCRegressor(period=360).fit(frames, np.repeat([10.0, 200.0], N))
    ((angle,),) = Session(film(), model).look().answer.values
    assert pages._in_words(Answer(values=((angle,),)), 0)[0] == f"{angle:.1f}"


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (HDCClassifier, ["training", "12 samples", "distance 0."]),
        (HDCRegressor, ["Numbers and their", "["]),
    ],
)
def test_a_page_of_a_model_is_made_without_a_browser(film, frames, kind, words):
    truth = LABELS if kind is HDCClassifier else np.arange(2.0 * N)
    session = Session(film(), kind().fit(frames, truth))

    async def look():
        worker = Worker(session)
        worker.start()
        async with user_simulation(lambda: pages.Page(worker)) as user:
            await user.open("/")
            for word in words:
                worker.picture()  # as the browser asks for it
                await user.should_see(word, retries=100)
        worker.stop()

    # playwright has an event loop of its own in this thread
    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, look()).result()


# The command -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("", 2, "expected one of --camera N, --folder RECORDING and --video FILE"),
        (
            "own --video v.mkv --subsample 2",
            2,
            "no --crop or --subsample with a MODEL that has",
        ),
        (
            "m --video v.mkv --subsample 2",
            1,
            "expected 40 × 32 pixels as in training, found 20",
        ),
        ("--video v.mkv --labels kind", 2, "expected no --labels without --folder"),
        ("--camera 97", 1, "expected a camera that can be opened at index 97, found"),
        ("x --video v.mkv", 1, "expected a saved model, found"),
        ("m --folder r.npz", 1, "r.npz: expected 40 × 32 pixels as in training"),
    ],
)
def test_what_does_not_fit_is_one_line(
    film, frames, tmp_path, monkeypatch, capfd, words, code, message
):
    monkeypatch.chdir(tmp_path)
    HDCClassifier().fit(frames, LABELS).save("m")
    HDCClassifier().fit(frames, LABELS).save("own", {"subsample": 3})
    (tmp_path / "x").write_text("no model")
    np.savez("r.npz", frames=frames[:, :20], labels=LABELS)
    with pytest.raises(SystemExit) as caught:
        main(["live", *words.split()])
    out, err = capfd.readouterr()
    assert (caught.value.code, out, len(err.splitlines())) == (code, "", 1)
    assert message in err


def test_a_model_of_thinned_arrays_is_shown_frames_that_are_thinned(
    film, frames, tmp_path, monkeypatch
):
    """It fitted a video neither with --subsample nor without."""
    monkeypatch.chdir(tmp_path)
    HDCClassifier().fit(frames[:, ::2, ::2], LABELS).save("m")
    shown = []
    monkeypatch.setattr(pages, "serve", lambda session, *_: shown.append(session))
    with pytest.raises(SystemExit):
        main(["live", "m", "--video", "v.mkv", "--subsample", "2"])
    assert shown[0].look().answer is not None
