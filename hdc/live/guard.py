"""Access to the page: only for browsers that have its token."""

from __future__ import annotations

import secrets
from typing import Any

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse


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
        answer: Any = self._app
        if scope["type"] in ("http", "websocket"):
            request = HTTPConnection(scope)
            if self._is_token(request.query_params.get("token")) and scope["type"] == "http":
                answer = RedirectResponse(request.url.path)
                answer.set_cookie(self._cookie, self._token, httponly=True, samesite="lax")
            elif not self._is_token(request.cookies.get(self._cookie)):
                answer = PlainTextResponse("Open this page with the address that was printed.", 403)
        await answer(scope, receive, send)

    def _is_token(self, text: str | None) -> bool:
        return secrets.compare_digest((text or "").encode(), self._token.encode())
