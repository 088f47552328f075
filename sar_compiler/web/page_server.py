"""The HTTP server of a page. It runs in a separate thread, and only this machine can reach it."""

import asyncio
import json
import math
import secrets
import socket
import threading
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import Future
from functools import partial
from hmac import compare_digest
from importlib.resources import files
from typing import Any, NamedTuple, Protocol
from urllib.parse import unquote

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from sar_compiler import style
from sar_compiler.errors import SarError
from sar_compiler.journal.command_objects import parse_seen
from sar_compiler.journal.journal_entries import CommandAuthor
from sar_compiler.web.feed import Feed, ReplayFeed, as_json

# The accepted host names, with any port, because the port may be tunnelled. Other names are rejected, because a foreign site may resolve its
# name to this machine (DNS rebinding).
_NAMES = ("127.0.0.1", "localhost", "[::1]")
_MAX_BODY, _MAX_NAME, _MAX_REASON, _MAX_SEEN = 10_000, 60, 200, 10_000
# The time limit for a command, in seconds. The page waits somewhat longer (`orders.js`).
_COMMAND_SEC = 10.0

_READ_ONLY = "this page is read-only. Open the complete address that the run has printed"

_TYPES = {"html": "text/html", "js": "text/javascript", "css": "text/css", "svg": "image/svg+xml"}
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}

# The content security policy of a report, which contains its styles and needs no other resources.
_REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"


class CommandSender(NamedTuple):
    """The sender of a command, with the robot and the reason.

    Attributes:
        name: The name of the sender; empty if the sender has not entered a name.
        robot: The index of the robot among the robots of the page.
        address: The address of the browser.
        reason: The reason for the command; empty if the sender has not entered a reason.
        seen: The objects of the command as the sender saw them.
    """

    name: str = ""
    robot: int = 0
    address: str = ""
    reason: str = ""
    seen: Mapping[str, str] = {}

    def author(self, page: str) -> CommandAuthor:
        """Return the author of the command: the sender's name with a description of the page, and the reason."""
        return CommandAuthor(f"{self.name or 'an operator'} ({page})", self.reason)


class CommandHandler(Protocol):
    """Carries out the operator's commands."""

    def send(self, verb: str, values: Mapping[str, Any], giver: CommandSender) -> "Future[tuple[bool, str]]":
        """Send a command, from any thread.

        Args:
            verb: The name of the command.
            values: The values of its fields.
            giver: The sender of the command, with the robot.

        Returns:
            Whether the command was accepted, and the response. If the future is cancelled, the command is not carried out.

        Raises:
            SarError: If the command does not exist, or a value is invalid.
        """


class PageQuery(NamedTuple):
    """A query about a run for engineers on the page.

    Attributes:
        ask: Called in a separate thread; returns the result as JSON values, or raises a `SarError` for an impossible query.
        is_free: Whether the query needs no token, because it has no side effects.
    """

    ask: Callable[[Mapping[str, Any]], object]
    is_free: bool = True


Tools = Mapping[str, PageQuery]
"""The queries of a page, by name. The result of `report` is a complete page."""


def page_app(
    feed: Feed, token: str, orders: CommandHandler | None = None, tools: Tools | None = None
) -> ASGIApp:
    """Return the ASGI application that serves the page, its events, the commands, and the queries.

    Args:
        feed: The source of the page's events.
        token: The access token for commands.
        orders: Carries out the commands; None if the page has no commands.
        tools: The available queries.
    """
    static = {path.name: path.read_bytes() for path in files(__package__).joinpath("static").iterdir()}
    static |= {"signs.css": style.style().encode(), "signs.js": style.script().encode()}

    def page(name: str) -> Callable[[Request], Awaitable[Response]]:
        async def respond(_: Request) -> Response:
            return static_response(name, static[name])

        return respond

    async def file(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in static:
            raise HTTPException(404)
        return static_response(name, static[name])

    async def events(_: Request) -> Response:
        return StreamingResponse(feed.stream(), media_type="text/event-stream")

    routes = [
        Route("/", page("operator.html")),
        Route("/tree", page("tree.html")),
        Route("/static/{name}", file),
        Route("/events", events),
        Route("/moment", partial(_moment, feed)),
        Route("/orders/{verb}", partial(_command_response, orders, token), methods=["POST"]),
        Route("/report", partial(_report, tools or {})),
        Route("/tools/{tool}", partial(_query_response, tools or {}, token), methods=["POST"]),
    ]
    return guard(Starlette(routes=routes, exception_handlers={HTTPException: refuse}))


def has_token(token: str, request: Request) -> bool:
    """Return whether a request has the access token."""
    given = request.headers.get("authorization", "")
    return compare_digest(given.encode(), f"Bearer {token}".encode())


async def _command_response(orders: CommandHandler | None, token: str, request: Request) -> Response:
    """Carry out a command, and return the response.

    Raises:
        HTTPException: If the page has no commands, or the request is invalid.
    """
    if orders is None:
        raise HTTPException(404)
    if not has_token(token, request):
        return _text_response(403, _READ_ONLY)
    values = await json_values(request)
    robot = _robot(request)
    by, reason = (
        "".join(filter(str.isprintable, unquote(request.headers.get(header, ""))[:longest])).strip()
        for header, longest in (("x-operator", _MAX_NAME), ("x-reason", _MAX_REASON))
    )
    try:
        seen = parse_seen(unquote(request.headers.get("x-seen", "")[:_MAX_SEEN]))
    except ValueError as error:
        return _text_response(
            400,
            f"the header X-Seen is wrong: {error}. Put the objects of the command into this header, as the sender saw them",
        )
    giver = CommandSender(by, robot, request.client.host if request.client else "", reason, seen)
    return await _send_command(orders, request.path_params["verb"], values, giver)


async def _query_response(tools: Tools, token: str, request: Request) -> Response:
    """Return the response to a query.

    Raises:
        HTTPException: If the query does not exist, or its values are not a JSON object.
    """
    tool = tools.get(request.path_params["tool"])
    if tool is None:
        raise HTTPException(404)
    if not (tool.is_free or has_token(token, request)):
        return PlainTextResponse(_READ_ONLY, 403)
    values = await json_values(request)
    try:
        return Response(as_json(await asyncio.to_thread(tool.ask, values)), media_type="application/json")
    except SarError as error:
        return PlainTextResponse(str(error), 409)


async def _report(tools: Tools, request: Request) -> Response:
    """Return the report of a robot's mission.

    Raises:
        HTTPException: If there is no report, or the robot is not a number.
    """
    tool = tools.get("report")
    if tool is None:
        raise HTTPException(404)
    try:
        page = await asyncio.to_thread(tool.ask, {"robot": _robot(request)})
    except SarError as error:
        return PlainTextResponse(f"There is no report: {error}.\n", 409)
    return HTMLResponse(str(page), headers={"Content-Security-Policy": _REPORT_POLICY})


def _robot(request: Request) -> int:
    """Return the index of the robot in a request; raise an `HTTPException` if the index is not a number."""
    try:
        return int(request.query_params.get("robot", 0))
    except ValueError:
        raise HTTPException(400) from None


async def _moment(feed: Feed, request: Request) -> Response:
    """Return the state of a replay at a time.

    Raises:
        HTTPException: If the page is not a replay, or the time is not a number.
    """
    if not isinstance(feed, ReplayFeed):
        raise HTTPException(404)
    try:
        time, since = float(request.query_params["time"]), int(request.query_params.get("since", 0))
    except (KeyError, ValueError):
        raise HTTPException(400) from None
    if not math.isfinite(time):
        raise HTTPException(400)
    try:
        return Response(await feed.moment(time, since), media_type="application/json")
    except SarError as error:
        return PlainTextResponse(f"{error}\n", 500)


def static_response(name: str, content: bytes) -> Response:
    """Return a response with a static file of a page."""
    return Response(content, media_type=_TYPES[name.rpartition(".")[2]])


async def refuse(_: Request, error: Exception) -> Response:
    """Return the response to a refused request."""
    status = error.status_code if isinstance(error, HTTPException) else 500
    return PlainTextResponse("page not found\n" if status == 404 else "invalid request\n", status)  # noqa: PLR2004


def _text_response(status: int, text: str) -> Response:
    return JSONResponse({"accepted": False, "message": text}, status)


async def json_values(request: Request, longest: int = _MAX_BODY) -> Mapping[str, Any]:
    """Parse the body of a request, which must be a JSON object of at most *longest* bytes.

    Raises:
        HTTPException: If the body is too long, or not a JSON object.
    """
    if request.headers.get("content-type", "").partition(";")[0] != "application/json":
        raise HTTPException(415)
    text = b""
    async for part in request.stream():
        text += part
        if len(text) > longest:
            raise HTTPException(413)
    try:
        values = json.loads(text)
    except (ValueError, RecursionError):
        raise HTTPException(400) from None
    if not isinstance(values, dict):
        raise HTTPException(400)
    return values


async def _send_command(
    orders: CommandHandler, verb: str, values: Mapping[str, Any], giver: CommandSender
) -> Response:
    try:
        result = orders.send(verb, values, giver)
        accepted, text = await asyncio.wait_for(asyncio.wrap_future(result), _COMMAND_SEC)
    except SarError as error:
        return _text_response(400, str(error))
    except (TimeoutError, asyncio.TimeoutError):
        if result.cancel():
            return _text_response(503, "the mission is busy. The command was not sent")
        return _text_response(
            504, "the command was sent, but has no response yet. Check the log for the result"
        )
    return JSONResponse({"accepted": accepted, "message": text})


def guard(app: ASGIApp) -> ASGIApp:
    """Wrap an application so that it rejects requests from other origins and adds security headers to responses.

    Args:
        app: The protected application.
    """

    async def guarded_app(scope: Scope, receive: Receive, send: Send) -> None:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        if scope["type"] == "http":
            refusal = PlainTextResponse("requests from other sites are not allowed\n", 403)
            chosen = app if _is_same_origin(Headers(scope=scope)) else refusal
            await chosen(scope, receive, send_with_headers)

    return guarded_app


def _is_same_origin(headers: Headers) -> bool:
    host, origin = headers.get("host", ""), headers.get("origin")
    name, colon, port = host.rpartition(":")
    if not colon or host.endswith("]"):
        name, port = host, "80"
    # A page that was loaded under one of these host names may send requests to all of them.
    names = [host, *(f"{each}:{port}" for each in _NAMES)]
    return name in _NAMES and port.isdecimal() and origin in (None, *(f"http://{each}" for each in names))


PORT = 8043
"""The default port."""
_ADDRESS = "127.0.0.1"
# The limits for all connections, and for connections not accepted yet. Each connection uses a file descriptor of the mission's process.
_CONNECTIONS, _BACKLOG = 32, 16
# The time for a browser to read the last updates, in seconds.
_LAST_UPDATES_SEC = 1.0
# The time limit for a request's head, in seconds.
_REQUEST_SEC = 10.0


class PageError(SarError):
    """A page cannot be served. This error occurs only before the robot has moved."""


class _Protocol(H11Protocol):
    """A protocol that closes excess connections, and connections whose request head arrives too slowly."""

    _deadline: asyncio.TimerHandle | None = None
    _current_cycle: object = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept a connection, or close it if there are too many connections."""
        super().connection_made(transport)
        if len(self.connections) > _CONNECTIONS:
            transport.abort()
        self._update_deadline()

    def data_received(self, data: bytes) -> None:
        """Receive data. The head of a request must be complete within a time limit."""
        super().data_received(data)
        self._update_deadline()

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the time limit of a connection that has ended."""
        super().connection_lost(exc)
        self._cancel_deadline()

    def _update_deadline(self) -> None:
        """Start the time limit for a request's head, and cancel it when the head is complete."""
        if self.cycle is not self._current_cycle:  # the head is complete, and the request is in progress
            self._current_cycle = self.cycle
            self._cancel_deadline()
        elif self._deadline is None and (self.cycle is None or self.cycle.response_complete):
            self._deadline = self.loop.call_later(_REQUEST_SEC, self.transport.abort)

    def _cancel_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None


class AppServer:
    """Serves an application on this machine, from `start` to `close`.

    Args:
        app: Returns the application, given the access token.
        port: The port; None for the default port, or for a free port if the default port is in use; 0 for any free port.

    Attributes:
        port: The port that the server uses.
        token: The access token, which is part of the address.

    Raises:
        PageError: If the port cannot be used.
    """

    def __init__(self, app: Callable[[str], ASGIApp], port: int | None = None) -> None:
        self.token = secrets.token_urlsafe(16)
        self._socket = _bind(port)
        self.port: int = self._socket.getsockname()[1]
        config = uvicorn.Config(
            app(self.token),
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
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), name="page", daemon=True)

    @property
    def url(self) -> str:
        """The address to open. A browser does not send the part after the # to the server."""
        return f"http://{_ADDRESS}:{self.port}/#{self.token}"

    def start(self) -> None:
        """Start the server in its own thread."""
        self._thread.start()

    def wait(self, timeout_sec: float | None = None) -> bool:
        """Wait until the server ends or a time limit in seconds expires; return whether the server has ended."""
        self._thread.join(timeout_sec)
        return not self._thread.is_alive()

    def close(self) -> None:
        """Stop the server, and wait for its thread for a limited time."""
        if self._thread.is_alive():
            self._server.should_exit = True
            self._thread.join(2 * _LAST_UPDATES_SEC)
        self._socket.close()

    async def _serve(self) -> None:
        await self._server.serve(sockets=[self._socket])


class PageServer(AppServer):
    """Serves the page of a run.

    Args:
        feed: The source of the page's events.
        port: As for `AppServer`.
        orders: Carries out the operator's commands; None if the page has no commands.
        tools: The queries for engineers.
    """

    def __init__(
        self,
        feed: Feed,
        port: int | None = None,
        orders: CommandHandler | None = None,
        tools: Tools | None = None,
    ) -> None:
        super().__init__(lambda token: page_app(feed, token, orders, tools), port)
        self._feed = feed
        self._is_secret = orders is not None or not all(tool.is_free for tool in (tools or {}).values())
        self._is_feed_finished = threading.Event()

    @property
    def url(self) -> str:
        """The address to open. The page sends the part after the # only together with commands."""
        return super().url if self._is_secret else super().url.partition("#")[0]

    def close(self) -> None:
        """Send the queued events to the browsers, and end the server."""
        self._feed.finish()
        if self._thread.is_alive():
            self._is_feed_finished.wait(_LAST_UPDATES_SEC)
        super().close()

    async def _serve(self) -> None:
        feeding = asyncio.create_task(self._feed.run())
        serving = asyncio.create_task(super()._serve())
        await feeding
        self._is_feed_finished.set()
        await serving


def _bind(port: int | None) -> socket.socket:
    """Return a socket that listens at a port of this machine.

    Raises:
        PageError: If the port cannot be used.
    """
    if port is None:
        try:
            return _bind(PORT)
        except PageError:
            return _bind(0)
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    # The connections of a run that has just ended still occupy the port for some time.
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((_ADDRESS, port))
        made.listen(_BACKLOG)
    except OSError as error:
        made.close()
        message = f"port {port} cannot be used for the page ({error.strerror}). Choose another port with --web-port, or a free port with --web-port 0"
        raise PageError(message) from error
    return made
