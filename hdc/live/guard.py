"""Who may see the page: whoever has its token, by a page of its own address."""

from __future__ import annotations

import secrets
from typing import Any
from urllib.parse import urlsplit

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse


class Guard:
    """ASGI middleware that refuses (403) every request and socket without the token.

    The token comes in the address once, ``/?token=…``, and in a cookie from then on. Neither a page
    of another site nor another user of this computer has it. The cookie has the port in its name,
    as browsers share cookies between the ports of a host; and what a page of another address asks
    for, be it of another port of this host, is refused by its ``Origin``.
    """

    def __init__(self, app: Any, token: str, cookie: str) -> None:
        self._app, self._token, self._cookie = app, token, cookie

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        answer: Any = self._app
        if scope["type"] in ("http", "websocket"):
            answer = self._checked(scope)
        await answer(scope, receive, send)

    def _checked(self, scope: Any) -> Any:
        """The application, or the answer instead of it."""
        request = HTTPConnection(scope)
        if not _is_of_this_page(request):
            return PlainTextResponse("This is not for pages of another address.", 403)
        if scope["type"] == "http" and self._is_token(
            request.query_params.get("token")
        ):
            # Not to the path that was asked for: //elsewhere is the address of another host.
            answer = RedirectResponse("/")
            answer.set_cookie(self._cookie, self._token, httponly=True, samesite="lax")
            return answer
        if self._is_token(request.cookies.get(self._cookie)):
            return self._app
        text = "Open this page with the address that was printed."
        return PlainTextResponse(text, 403)

    def _is_token(self, text: str | None) -> bool:
        return secrets.compare_digest((text or "").encode(), self._token.encode())


def _is_of_this_page(request: HTTPConnection) -> bool:
    """Whether no page asks, or one that came from the address that is asked."""
    origin = request.headers.get("origin")
    return origin is None or urlsplit(origin).netloc == request.headers.get("host")
