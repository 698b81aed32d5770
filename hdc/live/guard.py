"""Access to the page: only for browsers that have its token."""

from __future__ import annotations

import secrets
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs


class Guard:
    """ASGI middleware that refuses (403) every request and socket without the token.

    The token comes in the address once, ``/?token=…``, and in a cookie from then on. Neither a page
    of another site nor another user of this computer has it.

    Args:
        app: the application behind it.
        token: the secret.
        cookie: name of the cookie; browsers share cookies between the ports of a host.
    """

    def __init__(self, app: Any, token: str, cookie: str) -> None:
        self._app, self._token, self._cookie = app, token, cookie

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
        elif self._is_token(
            parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        ):

            async def send_with_cookie(message: Any) -> None:
                if message["type"] == "http.response.start":
                    cookie = f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"
                    header = (b"set-cookie", cookie.encode())
                    message["headers"] = [*message.get("headers", []), header]
                await send(message)

            await self._app(scope, receive, send_with_cookie)
        elif self._is_token(self._from_cookie(dict(scope["headers"]).get(b"cookie", b""))):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            text = b"Open this page with the address that was printed where it was started."
            headers = [(b"content-type", b"text/plain; charset=utf-8")]
            await send({"type": "http.response.start", "status": 403, "headers": headers})
            await send({"type": "http.response.body", "body": text})

    def _from_cookie(self, header: bytes) -> str:
        try:
            cookies = SimpleCookie(header.decode("latin-1"))
        except CookieError:
            return ""
        return cookies[self._cookie].value if self._cookie in cookies else ""

    def _is_token(self, text: str) -> bool:
        return secrets.compare_digest(text.encode(), self._token.encode())
