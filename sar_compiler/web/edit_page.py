"""The server of the graphical editor. It delivers the page of `studio`, and responds to the page's requests.

All requests except those for the page itself require the access token, because they read and write the user's file.
"""

import asyncio
from collections.abc import Callable
from contextlib import closing, nullcontext
from functools import partial
from importlib.resources import files
from pathlib import Path

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from sar_compiler import style
from sar_compiler.errors import SarError
from sar_compiler.opener import TREE
from sar_compiler.project import CommandLineSettings
from sar_compiler.studio.tree_studio import SIDE_BY_SIDE, Studio
from sar_compiler.views.drawing import drawing_style
from sar_compiler.web.page_server import AppServer, guard, has_token, json_values, refuse, static_response

_MAX_BYTES = 4 * TREE.limit


def edit_app(studio: Studio, token: str) -> ASGIApp:
    """Return the ASGI application that serves the editor.

    Args:
        studio: Responds to the page's requests.
        token: The access token.
    """
    static = {
        path.name: path.read_bytes() for path in files("sar_compiler.studio").joinpath("static").iterdir()
    }
    static |= {"signs.css": style.style().encode(), "drawing.css": drawing_style().encode()}

    async def file(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name not in static:
            raise HTTPException(404)
        return static_response(name, static[name])

    routes = [
        Route("/", file),
        Route("/{name}", file),
        Route("/ask/{question}", partial(_ask, studio, asyncio.Lock(), token), methods=["POST"]),
    ]
    return guard(Starlette(routes=routes, exception_handlers={HTTPException: refuse}))


async def _ask(studio: Studio, one: asyncio.Lock, token: str, request: Request) -> Response:
    """Return the response to a request of the page. Short requests are processed one at a time.

    Raises:
        HTTPException: If the token is wrong, or the values are not a JSON object.
    """
    if not has_token(token, request):
        raise HTTPException(403)
    values = await json_values(request, _MAX_BYTES)
    question = request.path_params["question"]
    try:
        async with nullcontext() if question in SIDE_BY_SIDE else one:
            return JSONResponse(await asyncio.to_thread(studio.answer_question, question, values))
    except TypeError:
        raise HTTPException(400) from None


def serve_editor(
    path: Path,
    additions: CommandLineSettings,
    report: Callable[[str], None],
    port: int | None = None,
    *,
    opens: bool = False,
) -> None:
    """Serve the editor of a file until Ctrl-C.

    Args:
        path: The tree file.
        additions: The user's additions to the configuration of the file's project.
        report: Prints the address of the page.
        port: The port; None for the default port.
        opens: Whether to open the page in a browser.

    Raises:
        UnreadableFileError: If the file cannot be read.
        TreeError: If the file is not text.
        PageError: If the port cannot be used.
        SarError: If the text editor of the page is not installed.
    """
    from sar_compiler.web.run_page import open_page

    studio = Studio(path, additions)
    studio.document.load()
    if not files("sar_compiler.studio").joinpath("static", "codemirror.js").is_file():
        message = "the text editor of the page is not built. Run make editor in the source folder, or install a wheel"
        raise SarError(message)
    with closing(AppServer(partial(edit_app, studio), port)) as server:
        server.start()
        report(f"The editor is at {server.url} (press Ctrl-C to end the editor)")
        if opens:
            open_page(server.url)
        server.wait()
