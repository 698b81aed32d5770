"""How the page is started, and who is refused."""

import asyncio
import socket

import pytest

import scenes.live
from hdc.command import main
from scenes.live import SimulatedSensor

pytest.importorskip("nicegui", reason="the page needs nicegui: pip install 'hdc[live]'")

from starlette.middleware.trustedhost import TrustedHostMiddleware

from hdc.live import page
from hdc.live.guard import Guard


def test_a_socket_without_the_token_is_closed():
    sent = []

    async def send(message):
        sent.append(message)

    async def never(*_):
        raise AssertionError

    for query, headers in ((b"token=x", []), (b"", [(b"cookie", b"hdc_live=x; ;=")]), (b"", [])):
        scope = {"type": "websocket", "query_string": query, "headers": headers}
        asyncio.run(Guard(never, token="secret")(scope, never, send))
        assert sent.pop()["type"] == "websocket.close"


def test_here_only_names_of_this_computer_are_answered(monkeypatch):
    """A page of elsewhere whose name is made to point here does not get at the sensor."""
    added, ran = [], []
    monkeypatch.setattr(page.app, "add_middleware", lambda kind, **how: added.append((kind, how)))
    monkeypatch.setattr(page.ui, "run", lambda *_, **how: ran.append(how["host"]))
    page.serve(SimulatedSensor(side=50), port=0)
    assert added == [(TrustedHostMiddleware, {"allowed_hosts": ["127.0.0.1", "localhost"]})]
    assert ran == ["127.0.0.1"]


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--camera", "97"], 2, "expected a camera that can be opened at index 97, found none"),
        ([], 2, "expected one of --camera and --folder"),
        (["--folder", "nowhere"], 1, "found nothing: nowhere"),
    ],
)
def test_what_is_missing_is_one_line(words, code, said, capfd):
    with pytest.raises(SystemExit) as caught:
        main(["live", *words])
    out, err = capfd.readouterr()
    assert (caught.value.code, out) == (code, "")
    assert said in err
    assert len(err.splitlines()) == 1


def test_a_port_that_is_taken_is_one_line():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(SystemExit) as caught:
            scenes.live.main(["--port", str(port)])
    assert str(caught.value.code).startswith(f"error: 127.0.0.1:{port}: expected an address")
