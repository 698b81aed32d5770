"""The page in a real browser, without one, and over HTTP."""

import asyncio
import http.client
import os
import re
import signal
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor
from hdc.command import main

pytest.importorskip(
    "nicegui", reason="the page needs nicegui: pip install 'speckle-hdc[live]'"
)

from nicegui.testing import user_simulation

from hdc.live import page as pages
from hdc.live.session import Session
from hdc.live.sources import open_source
from hdc.live.worker import Worker
from hdc.readers import Window

CHECKOUT = Path(__file__).resolve().parents[2]
N = 12
LABELS = np.array(["left", "right"] * N)


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
        # A job in the background, which these tests may be, ignores an interrupt.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
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

SOCKET = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Version": "13",
}


def ask(host, path, headers):
    """The answer to a single request."""
    connection = http.client.HTTPConnection(host, timeout=30)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    connection.close()
    return answer


def test_who_has_the_token_may_see_the_page_and_no_page_of_another_address(address):
    """cracks: another port of the host was let in, and GET //evil.example/?token=… led there."""
    host, token = urlsplit(address).netloc, urlsplit(address).query
    for path in ("//evil.example/", "//evil.example/%2e", "/frame", "/"):
        answer = ask(host, f"{path}?{token}", {})
        assert (answer.status, answer.getheader("Location")) == (307, "/")
    cookie = answer.getheader("Set-Cookie").partition(";")[0]
    mine, wrong = (
        {"Cookie": cookie},
        {"Cookie": f"{cookie.partition('=')[0]}=wrong; ;="},
    )
    others = (
        "http://127.0.0.1:9",
        "http://127.0.0.1",
        "http://evil.example",
        "null",
        "",
    )
    refused = [{}, wrong, *({**mine, "Origin": origin} for origin in others)]
    for path, kind, status in (
        ("/", {}, 200),
        ("/frame", {}, 200),
        (SOCKET, UPGRADE, 101),
    ):
        for headers in (mine, {**mine, "Origin": f"http://{host}"}):
            assert ask(host, path, headers | kind).status == status
        for headers in refused:
            assert ask(host, path, headers | kind).status == 403
    for path, kind in (
        ("/?token=", {}),
        ("/?token=wrong", {}),
        (f"{SOCKET}&{token}", UPGRADE),
    ):
        assert ask(host, path, kind).status == 403


# What it shows -----------------------------------------------------------------------------------


@pytest.fixture
def frames(frames_and_labels):
    """uint8 [24, 32, 32], of two patterns in turn."""
    return frames_and_labels(2 * N, 2, 32)[0]


@pytest.fixture
def film(write_film, tmp_path, frames):
    """A source that plays the frames."""
    write_film(tmp_path / "v.mkv", frames)
    return open_source(Window(), None, tmp_path / "v.mkv", 0)


@pytest.mark.parametrize("encoder", ["median", "levels"])
def test_a_trained_model_answers_over_and_over_and_is_not_taught(film, frames, encoder):
    model = HDCClassifier(encoder).fit(frames, LABELS)
    session = Session(film, model)
    for label in [*LABELS[1:], *LABELS]:  # the first was looked at for its size
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
        lambda: session.forget("left"),
        lambda: session.recalibrate("left", 1),
    ):
        with pytest.raises(ValueError, match="trained before and is shown as it is"):
            job()
    assert session.counts == {"left": N, "right": N}
    model.is_known = lambda words: np.array([False])
    assert session.ask(film.frame()).label is None


def test_a_page_of_a_model_is_made_without_a_browser(film, frames):
    worker = Worker(Session(film, HDCClassifier().fit(frames, LABELS)))

    async def look():
        worker.start()
        async with user_simulation(lambda: pages.Page(worker)) as user:
            await user.open("/")
            worker.picture()  # as the browser asks for it
            await user.should_see("distance 0.", retries=100)
        worker.stop()

    # playwright has an event loop of its own in this thread
    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, look()).result()


# The command -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("", 2, "expected one of --camera N, --folder RECORDING and --video FILE"),
        ("own --video v.mkv --subsample 2", 2, "no --crop or --subsample with a MODEL that has"),
        ("m --video v.mkv --subsample 2", 1, "expected 32 × 32 pixels as in training, found 16"),
        ("n --video v.mkv", 1, "n: expected a model of classes, found numbers"),
        ("--camera 97", 1, "expected a camera that can be opened at index 97, found"),
        ("m --folder r.npz", 1, "r.npz: expected 32 × 32 pixels as in training"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_line(
    film, frames, tmp_path, monkeypatch, capfd, words, code, message
):
    monkeypatch.chdir(tmp_path)
    HDCClassifier().fit(frames, LABELS).save("m")
    HDCClassifier().fit(frames, LABELS).save("own", {"subsample": 3})
    HDCRegressor().fit(frames, np.arange(2.0 * N)).save("n")
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
