"""`monitor --serve`: the view in a browser, by textual-serve, on the loopback interface alone.

Every page has a process of its own that runs the terminal program. The address has a token: who
does not know it gets no page and no process. Needs the extra `serve`.
"""

import asyncio
import hmac
import logging
import secrets
import socket
import sys
from pathlib import Path
from typing import Any

from aiohttp import web
from textual_serve.server import Server

from adhesion_can.cli.monitor_viewer import viewer_command
from adhesion_can.errors import InputError
from adhesion_can.printable import say

HOST = "127.0.0.1"
"""Address that is listened on: nobody on another host can connect."""
TOKEN_BYTES = 24
"""Length of the random token, bytes."""
REFUSED = "This view needs the token: open the whole address that 'monitor --serve' printed."
TEMPLATES = Path(__file__).parent / "page"
"""Folder of the page. The one of textual-serve fetches its font from another host."""


class MonitorServer(Server):
    """Serves the view of a monitor to those who know the token.

    Args:
        command: Command line that runs the view of one page, for a shell.
        port: Port, 1..65535.
        token: Token in the address.
        duration_s: Time after which the server ends, s; None: it does not.

    """

    def __init__(self, command: str, port: int, token: str, duration_s: float | None) -> None:
        super().__init__(
            command, HOST, port, title="adhesion-can monitor", templates_path=TEMPLATES
        )
        self._token = token
        self._duration_s = duration_s
        self._cookie = f"adhesion-can-{port}"
        self._pages: set[asyncio.Task[Any]] = set()

    @property
    def address(self) -> str:
        """Address to open, with the token."""
        return f"{self.public_url}/?token={self._token}"

    def initialize_logging(self) -> None:
        """Warnings alone, on stderr: stdout is nobody's, and requests are no news."""
        logging.basicConfig(level=logging.WARNING, stream=sys.stderr, format="%(message)s")
        # A page's process may end after the loop, which is no news on the way out.
        logging.getLogger("asyncio").setLevel(logging.ERROR)

    async def on_startup(self, app: web.Application) -> None:
        """Say where the view is."""
        del app
        say(f"monitor: open {self.address} in a browser on this host; Ctrl-C ends")
        if self._duration_s is not None:
            asyncio.get_running_loop().call_later(self._duration_s, self.request_exit)

    async def on_shutdown(self, app: web.Application) -> None:
        """End every page and its process, without waiting for the browsers."""
        del app
        pages = list(self._pages)
        for page in pages:
            page.cancel()
        await asyncio.gather(*pages, return_exceptions=True)

    async def handle_index(self, request: web.Request) -> web.StreamResponse:
        """The page, for the address with the token."""
        self._require(request.query.get("token", ""))
        self._require_host(request)
        response: web.StreamResponse = await super().handle_index(request)
        # The page's script opens its socket without the token; a page of another port has none.
        response.set_cookie(self._cookie, self._token, httponly=True, samesite="Strict")
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["Cache-Control"] = "no-store"
        return response

    async def handle_websocket(self, request: web.Request) -> web.WebSocketResponse:
        """The terminal of a page, for a page of this server."""
        self._require(request.cookies.get(self._cookie, ""))
        self._require_host(request)
        if request.headers.get("Origin") != self.public_url:
            raise web.HTTPForbidden(text=REFUSED)
        page = asyncio.current_task()
        assert page is not None  # noqa: S101  a handler runs in a task
        self._pages.add(page)
        try:
            return await super().handle_websocket(request)
        finally:
            self._pages.discard(page)

    async def handle_download(self, request: web.Request) -> web.StreamResponse:
        """Nothing is offered for download."""
        del request
        raise web.HTTPNotFound

    def _require(self, token: str) -> None:
        """HTTPForbidden unless the token is right."""
        if not hmac.compare_digest(token.encode(), self._token.encode()):
            raise web.HTTPForbidden(text=REFUSED)

    def _require_host(self, request: web.Request) -> None:
        """HTTPForbidden where a name of another host leads here, as a rebound DNS name does."""
        if f"http://{request.host}" != self.public_url:
            raise web.HTTPForbidden(text=REFUSED)


def serve(command_line: str, port: int, duration_s: float | None) -> int:
    """Serve the view until Ctrl-C, SIGTERM or the end of the duration; exit status.

    Args:
        command_line: Command line of the server.
        port: Port; 0 for one that is free.
        duration_s: Time after which the server ends, s; None: it does not.

    Raises:
        InputError: The port cannot be listened on.

    """
    number = _free_port(port)
    token = secrets.token_urlsafe(TOKEN_BYTES)
    MonitorServer(viewer_command(command_line), number, token, duration_s).serve()
    return 0


def _free_port(port: int) -> int:
    """The port, or one that the system chooses for 0.

    Raises:
        InputError: It cannot be listened on.

    """
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise InputError(
                f"--port {port}",
                f"cannot be listened on ({error.strerror})",
                "give another one, or none for one that is free",
            ) from error
        number: int = probe.getsockname()[1]
        return number
