"""Who may open the page: this computer alone, or whoever has the token."""

from __future__ import annotations

import secrets
from http.cookies import SimpleCookie
from typing import Any
from urllib.parse import parse_qs

COOKIE = "hdc_live"


class Guard:
    """ASGI middleware that refuses (403) every request and socket without the token.

    The token comes in the address once, ``/?token=…``, and in a cookie from then on.
    """

    def __init__(self, app: Any, token: str) -> None:
        self._app, self._token = app, token.encode()

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {key.decode("latin-1"): value for key, value in scope["headers"]}
        try:
            cookies = SimpleCookie(headers.get("cookie", b"").decode("latin-1"))
        except Exception:  # whatever else is in that header
            cookies = SimpleCookie()
        query = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if self._is_token(query):

            async def with_cookie(message: Any) -> None:
                if message["type"] == "http.response.start":
                    cookie = f"{COOKIE}={query}; HttpOnly; SameSite=Strict; Path=/"
                    message["headers"] = [
                        *message.get("headers", []),
                        (b"set-cookie", cookie.encode()),
                    ]
                await send(message)

            await self._app(scope, receive, with_cookie)
        elif COOKIE in cookies and self._is_token(cookies[COOKIE].value):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            text = "Open this page with the address that was printed where it was started."
            headers_sent = [(b"content-type", b"text/plain; charset=utf-8")]
            await send({"type": "http.response.start", "status": 403, "headers": headers_sent})
            await send({"type": "http.response.body", "body": text.encode()})

    def _is_token(self, found: str) -> bool:
        return secrets.compare_digest(found.encode(), self._token)
