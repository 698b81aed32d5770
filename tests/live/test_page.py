"""The page in a real browser and over HTTP."""

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

from hdc.command import main

pytest.importorskip(
    "nicegui", reason="the page needs nicegui: pip install 'speckle-hdc[live]'"
)

from hdc.live.guard import Guard

CHECKOUT = Path(__file__).resolve().parents[2]


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
