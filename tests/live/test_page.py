"""The page in a real browser and over HTTP: taught, drifted, recalibrated, by two at once."""

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from hdc import HDCClassifier
from hdc.command import main

pytest.importorskip(
    "nicegui", reason="the page needs nicegui: pip install 'speckle-hdc[live]'"
)

from hdc.live.guard import Guard

CHECKOUT = Path(__file__).resolve().parents[2]
PLACES = {"left": (28, -8), "middle": (40, 8), "right": (52, -8)}  # mm


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The simulated sensor's page in a process of its own, interrupted at the end."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    environment = os.environ | {"PYTHONPATH": str(CHECKOUT), "OMP_NUM_THREADS": "1"}
    for name in list(environment):
        if name.startswith(("NICEGUI", "PYTEST")):
            del environment[name]
    folder = tmp_path_factory.mktemp("live")
    command = [sys.executable, "-m", "scenes.live", "--port", str(port)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with subprocess.Popen(command, cwd=folder, env=environment, **pipes) as process:
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


def opener(address):
    """A client that has opened the page, and so has the cookie."""
    client = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    assert client.open(address).status == 200
    return client


class Reader:
    """A browser that shows the page."""

    def __init__(self, browser, address, width=1400):
        self.page = browser.new_context(
            viewport={"width": width, "height": 900}
        ).new_page()
        self.page.set_default_timeout(60_000)
        self.errors = []
        self.page.on("pageerror", lambda error: self.errors.append(error))
        self.page.goto(address, wait_until="domcontentloaded")
        self.pad = self.page.locator(".pad img")
        self.pad.wait_for()

    def press(self, name):
        x, y = PLACES[name]
        self.pad.scroll_into_view_if_needed()
        box = self.pad.bounding_box()
        across, down = x / 90, 0.5 - y / 40
        self.page.mouse.click(
            box["x"] + box["width"] * across, box["y"] + box["height"] * down
        )
        # The picture of the touch comes from the server: it was pressed.
        self.until(
            "Math.abs(document.querySelector('.pad circle[fill=\"#222\"]')"
            f"?.getAttribute('cx') - {x}) < 0.5"
        )

    def teach(self, name):
        self.press(name)
        self.page.get_by_label("name of a new class").fill(name)
        self.click("New class")
        self.row(name).get_by_text("10 samples").wait_for()

    def row(self, name):
        return self.page.locator(
            ".class", has=self.page.locator(".name", has_text=name)
        )

    def click(self, button):
        self.page.get_by_role("button", name=button).click()

    def until(self, condition):
        self.page.wait_for_function(condition)

    def predicts(self, label):
        """One of a few touches is recognised; each differs, and some are rightly refused."""
        from playwright.sync_api import (
            TimeoutError as Timeout,
        )  # other tests do without a browser

        answer = self.page.locator(".answer", has_text=re.compile(f"^{label}$"))
        for _ in range(5):
            with contextlib.suppress(Timeout):
                return answer.wait_for(timeout=10_000)
            self.press(label)
        return answer.wait_for()

    def shows(self, text):
        self.page.get_by_text(text).first.wait_for()

    def accuracy(self, condition):
        self.until(
            "(() => { const m = document.body.innerText.match(/(\\d+) of the latest (\\d+) right/);"
            f" return m && +m[2] >= 12 && m[1] / m[2] {condition}; }})()"
        )


@pytest.fixture
def reader(browser, address):
    reader = Reader(browser, address)
    reader.click("Back to the first day")
    reader.click("Forget everything")
    reader.until("document.querySelectorAll('.class').length === 0")
    yield reader
    assert reader.errors == []
    reader.page.context.close()


def test_taught_it_is_right_drifted_it_fails_recalibrated_it_is_right_again(reader):
    for name in PLACES:
        reader.teach(name)
    for name in PLACES:
        reader.press(name)
        reader.row(name).get_by_label("learn 10 more samples").click()
        reader.row(name).get_by_text("20 samples").wait_for()
        reader.predicts(name)
    reader.accuracy(">= 0.8")
    reader.click("Let 16 days pass")
    reader.accuracy("<= 0.7")
    reader.click("Recalibrate all")
    reader.row("left").get_by_text("30 samples").wait_for()
    reader.accuracy(">= 0.75")
    reader.until("document.querySelector('.picture img').naturalWidth === 500")
    reader.until("document.documentElement.scrollWidth <= 1400")


def test_a_model_is_taught_by_two_and_saved(reader, browser, address, tmp_path):
    other = Reader(browser, address, width=400)
    for name in ("left", "right"):
        reader.teach(name)
        other.row(name).get_by_text("10 samples").wait_for()
    with reader.page.expect_download() as download:
        reader.click("Save the model")
    download.value.save_as(tmp_path / "touch.safetensors")
    assert HDCClassifier.load(tmp_path / "touch.safetensors").counts_.tolist() == [
        10,
        10,
    ]
    reader.click("Forget everything")
    reader.until("document.querySelectorAll('.class').length === 0")
    reader.click("Save the model")
    reader.shows("There is nothing to save yet")
    other.until("document.documentElement.scrollWidth <= 400")
    name = "<img src=x>"  # is text
    other.page.get_by_label("name of a new class").fill(name)
    other.click("New class")
    reader.page.locator(".name", has_text=name).wait_for()
    assert other.errors == []
    other.page.context.close()


# Without a browser -------------------------------------------------------------------------------


def test_everything_needs_the_token(address):
    bare = address.split("?")[0]
    for path in (
        "",
        "frame",
        "?token=",
        "?token=wrong",
        "_nicegui_ws/socket.io/?EIO=4",
    ):
        for headers in ({}, {"Cookie": "hdc_live=wrong; ;="}):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(
                    urllib.request.Request(bare + path, headers=headers)
                )
    assert opener(address).open(bare).status == 200


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


def test_a_socket_without_the_token_is_refused():
    """In its address, where a socket has none, it is of no use."""
    for headers in ({}, {"cookie": "c=x"}):
        answer = answered("websocket", "/", b"token=secret", **headers)
        assert answer["status"] == 403


HOST = "127.0.0.1:8080"


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_pages_of_another_address_are_refused(kind):
    """cracks: another port of the same host has the cookie, and was let in."""
    mine = {"host": HOST, "cookie": "c=secret"}
    for origin in (
        "http://127.0.0.1:9000",
        "http://127.0.0.1",
        "https://evil.example",
        "null",
        "",
    ):
        assert answered(kind, origin=origin, **mine)["status"] == 403
    assert answered(kind, origin=f"http://{HOST}", **mine) is None
    assert answered(kind, **mine) is None


def test_the_token_redirects_to_this_page_alone():
    """cracks: GET //evil.example/?token=… redirected there."""
    for path in ("/", "//evil.example/", "/frame", "//evil.example/%2e"):
        answer = answered("http", path, b"token=secret", host=HOST)
        assert dict(answer["headers"])[b"location"] == b"/"


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (
            ["--camera", "97"],
            1,
            "expected a camera that can be opened at index 97, found none",
        ),
        ([], 2, "expected one of --camera, --folder and --video"),
        (["--folder", "nowhere"], 1, "found nothing: nowhere"),
    ],
)
def test_a_wrong_source_is_one_line(words, code, message, capfd):
    with pytest.raises(SystemExit) as caught:
        main(["live", *words])
    out, err = capfd.readouterr()
    assert (caught.value.code, out, len(err.splitlines())) == (code, "", 1)
    assert message in err
