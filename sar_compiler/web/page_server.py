"""The server of a page: on this machine only, in a thread of its own."""

import asyncio
import secrets
import socket
import threading

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from sar_compiler.errors import SarError
from sar_compiler.web.feed import Feed
from sar_compiler.web.page_app import Orders, page_app

PORT = 8043
"""The port, unless another one is asked for."""
_ADDRESS = "127.0.0.1"
# So many connections it has at once, from whomever, and so many that are not accepted yet: each takes a file descriptor of the
# mission's process.
_CONNECTIONS, _BACKLOG = 32, 16
# How long a browser has to read the last news, in seconds.
_LAST_WORDS_SEC = 1.0


# How long a browser may take to say what it wants, in seconds.
_REQUEST_SEC = 10.0


class PageError(SarError):
    """A page cannot be served; nothing has moved."""


class _Protocol(H11Protocol):
    """Lets go of whoever comes when there are too many already, or does not come to the end of the head of a request."""

    _deadline: asyncio.TimerHandle | None = None
    _answered: object = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin with a connection."""
        super().connection_made(transport)
        if len(self.connections) > _CONNECTIONS:
            transport.abort()
        self._watch()

    def data_received(self, data: bytes) -> None:
        """Take what has come."""
        super().data_received(data)
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """End with a connection."""
        super().connection_lost(exc)
        self._forget()

    def _watch(self) -> None:
        """Give the head of a request its time from its first byte on, however slowly the others come."""
        if self.cycle is not self._answered:  # the head is whole, and is being answered
            self._answered = self.cycle
            self._forget()
        elif self._deadline is None and (self.cycle is None or self.cycle.response_complete):
            self._deadline = self.loop.call_later(_REQUEST_SEC, self.transport.abort)

    def _forget(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None


class PageServer:
    """Serves a page, from `start` to `close`.

    Args:
        feed: What the page is told.
        port: The port; None for the usual one, or any that is free if that is taken; 0 for any that is free.
        orders: Who carries out the operator's orders; None if nobody does.

    Attributes:
        port: The port that it has.
        token: What whoever gives orders must know; a part of the address.

    Raises:
        PageError: If there is no such port to have.
    """

    def __init__(self, feed: Feed, port: int | None = None, orders: Orders | None = None) -> None:
        self.token = secrets.token_urlsafe(16)
        self._feed = feed
        self._socket = _bound(port)
        self.port: int = self._socket.getsockname()[1]
        config = uvicorn.Config(
            page_app(feed, self.token, orders),
            loop="asyncio",
            http=_Protocol,
            backlog=_BACKLOG,
            ws="none",
            lifespan="off",
            log_config=None,
            log_level="critical",
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._has_orders = orders is not None
        self._told = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="page", daemon=True)

    @property
    def url(self) -> str:
        """The address to open. What follows the # never leaves the browser but with an order."""
        return f"http://{_ADDRESS}:{self.port}/{f'#{self.token}' if self._has_orders else ''}"

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def wait(self, timeout_sec: float | None = None) -> bool:
        """Wait for its end, so many seconds at most; return whether it has ended."""
        self._thread.join(timeout_sec)
        return not self._thread.is_alive()

    def close(self) -> None:
        """Tell browsers what there is still to tell, and end."""
        self._feed.end()
        if self._thread.is_alive():
            self._told.wait(_LAST_WORDS_SEC)
            self._server.should_exit = True
            self._thread.join(2 * _LAST_WORDS_SEC)
        self._socket.close()

    def _serve(self) -> None:
        asyncio.run(self._both())

    async def _both(self) -> None:
        telling = asyncio.create_task(self._feed.run())
        serving = asyncio.create_task(self._server.serve(sockets=[self._socket]))
        await telling
        self._told.set()
        await serving


def _bound(port: int | None) -> socket.socket:
    """Return a socket at a port.

    Raises:
        PageError: If it cannot be had.
    """
    if port is None:
        try:
            return _bound(PORT)
        except PageError:
            return _bound(0)
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    # A page whose run has just ended has the port for some time still.
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((_ADDRESS, port))
        made.listen(_BACKLOG)
    except OSError as error:
        made.close()
        message = f"port {port} cannot be had for the page ({error.strerror}): choose another one, --web-port, or 0 for any"
        raise PageError(message) from error
    return made
