"""The server of the graphical editor: the page of `studio`, its questions, and the file on the disk.

Everything but the page itself needs the access token, because it reads and writes the user's file.
"""

import asyncio
import hashlib
import re
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from sar_compiler import style
from sar_compiler.errors import SarError
from sar_compiler.opener import TREE, read_file
from sar_compiler.project import CommandLineSettings
from sar_compiler.studio.tree_studio import Studio
from sar_compiler.tree.content import encode_text
from sar_compiler.tree.diagnostic import Source, TreeError
from sar_compiler.tree.discovery import parse_tree
from sar_compiler.views.drawing import drawing_style
from sar_compiler.web.page_server import AppServer, guard, has_token, json_values, refuse, static_response
from sar_compiler.writing import write_bytes

_LONGEST = 4 * TREE.limit
_CRLF = re.compile(r"\r\n")


class EditedDocument:
    """The file of the page, as it was last read or written.

    Args:
        path: The file.

    Attributes:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._source: Source | None = None
        self._has_crlf = False

    def load(self) -> Mapping[str, object]:
        """Return the text of the file with its version.

        A file whose lines all end with CRLF is edited with LF, and written with CRLF again.

        Raises:
            UnreadableFileError: If it cannot be read.
            TreeError: If it is not text.
        """
        data = read_file(self.path, TREE).data
        self._source = source = _source_of(data, self.path)
        self._has_crlf = "\r\n" in source.text and not re.search(r"(?<!\r)\n|\r(?!\n)", source.text)
        text = _CRLF.sub("\n", source.text) if self._has_crlf else source.text
        return {"text": text, "version": _version(data), "name": self.path.name, "form": source.form.value}

    def save_text(self, text: str, version: str, *, overwrite: bool = False) -> Mapping[str, object]:
        """Write the file.

        Args:
            text: The text.
            version: The version that the page has read or written last.
            overwrite: Whether to write although the file has changed since.

        Returns:
            The new version; or `has_changed`, and nothing is written.

        Raises:
            UnreadableFileError: If it cannot be read.
            WriteError: If it cannot be written.
        """
        if not overwrite and _version(read_file(self.path, TREE).data) != version:
            return {"has_changed": True}
        source = self._source or _source_of(read_file(self.path, TREE).data, self.path)
        data = encode_text(source, text.replace("\n", "\r\n") if self._has_crlf else text)
        write_bytes(self.path, data)
        return {"version": _version(data)}

    def is_changed(self, version: str) -> Mapping[str, object]:
        """Return whether the file on the disk is another version."""
        return {"has_changed": _version(read_file(self.path, TREE).data) != version}


def _source_of(data: bytes, path: Path) -> Source:
    """Return the text of a file, even of one that cannot be parsed.

    Raises:
        TreeError: If it is not text.
    """
    try:
        return parse_tree(data, str(path)).source
    except TreeError as error:
        if error.findings[0].code in ("wrong-encoding", "file-too-large"):
            raise
        return error.findings[0].source


def _version(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def edit_app(document: EditedDocument, studio: Studio, token: str) -> ASGIApp:
    """Return the application of the editor.

    Args:
        document: The file.
        studio: Answers the questions about it.
        token: The access token.
    """
    static = {
        path.name: path.read_bytes() for path in files("sar_compiler.studio").joinpath("static").iterdir()
    }
    static |= {"signs.css": style.style().encode(), "drawing.css": drawing_style().encode()}

    async def page(_: Request) -> Response:
        return static_response("index.html", static["index.html"])

    async def file(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in static:
            raise HTTPException(404)
        return static_response(name, static[name])

    routes = [
        Route("/", page),
        Route("/{name}", file),
        Route("/ask/{question}", partial(_ask, document, studio, asyncio.Lock(), token), methods=["POST"]),
    ]
    return guard(Starlette(routes=routes, exception_handlers={HTTPException: refuse}))


async def _ask(
    document: EditedDocument, studio: Studio, one: asyncio.Lock, token: str, request: Request
) -> Response:
    """Return the answer to a question.

    Raises:
        HTTPException: If the token is wrong, or the values are not a JSON object.
    """
    if not has_token(token, request):
        raise HTTPException(403)
    values = dict(await json_values(request, _LONGEST))
    question = request.path_params["question"]
    of_file = {"open": document.load, "save": document.save_text, "is_changed": document.is_changed}
    function: Any = of_file.get(question) or partial(studio.answer, question, values)
    try:
        async with one:
            answer = await asyncio.to_thread(function, **(values if question in of_file else {}))
    except SarError as error:
        answer = {"error": str(error)}
    except TypeError:
        raise HTTPException(400) from None
    return JSONResponse(answer)


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
        path: The file.
        additions: The user's additions to its project's configuration.
        report: Prints the address of the page.
        port: The port; None for the default one.
        opens: Whether to open the page in a browser.

    Raises:
        UnreadableFileError: If the file cannot be read.
        TreeError: If it is not text.
        PageError: If the port cannot be used.
        SarError: If the text editor of the page is not installed.
    """
    from sar_compiler.web.run_page import open_page

    document, studio = EditedDocument(path), Studio(path, additions)
    document.load()
    if not files("sar_compiler.studio").joinpath("static", "codemirror.js").is_file():
        message = "the text editor of the page is not built. Run make editor in the source folder, or install a wheel"
        raise SarError(message)
    with closing(AppServer(partial(edit_app, document, studio), port)) as server:
        server.start()
        report(f"The editor: {server.url} (Ctrl-C ends it)")
        if opens:
            open_page(server.url)
        server.wait()
