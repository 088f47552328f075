"""How soon an editor is answered after a keystroke, in files of a thousand and of ten thousand nodes.

The language server runs as an editor starts it, and the client is that of pygls. A digit is typed into a value and taken back, again and
again; a mistake elsewhere stays in the file. The first answer is what was found so far, moved with the text; the second one what
was found in the text as it is. Between two keystrokes there is time for both.
"""

import asyncio
import statistics
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.figures import Effort, Missing, Result, plain
from benchmarks.trees import balanced, document, in_turn

SIZES = (1_000, 10_000)
_NODES = in_turn(
    '<AlwaysSuccess name="n{0}"/>',
    '<Sleep msec="{0}"/>',
    '<Script code="k{0} := 1"/>',
    '<ScriptCondition code="k{0} == 1"/>',
)
_RIGHT, _MISTAKE, _TYPED_AT = '<Sleep msec="0"/>', '<Sleep msec="0 x"/>', '<Sleep msec="1"/>'
_KEYSTROKES = 5
_PATIENCE_SEC = 60.0


def first(size: int) -> str:
    """Return what the first answer is called."""
    return f"a keystroke in {size:,} nodes, time to the first answer"


def checked(size: int) -> str:
    """Return what the answer is called that was found in the text as it is."""
    return f"a keystroke in {size:,} nodes, time until all is checked"


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the median of the keystrokes for each size."""
    try:
        import pygls  # noqa: F401
    except ImportError:
        yield from (
            Missing(name(size), "", "pygls is not installed") for size in SIZES for name in (first, checked)
        )
        return
    for size in SIZES:
        answers = asyncio.run(_typed(effort.size(size), effort.rounds * _KEYSTROKES))
        yield plain(first(size), statistics.median(each[0] for each in answers), "s")
        yield plain(checked(size), statistics.median(each[1] for each in answers), "s")


async def _typed(nodes: int, keystrokes: int) -> list[tuple[float, float]]:
    """Return the seconds to both answers of each keystroke."""
    from lsprotocol import types as lsp
    from pygls.lsp.client import LanguageClient

    client, answers = LanguageClient("benchmark", "1"), asyncio.Queue[float]()
    uri = (Path.cwd() / "typed.xml").as_uri()

    def published(_params: lsp.PublishDiagnosticsParams) -> None:
        answers.put_nowait(time.perf_counter())

    client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)(published)
    await client.start_io(str(Path(sys.executable).with_name("sar-compile")), "lsp")
    await client.initialize_async(lsp.InitializeParams(lsp.ClientCapabilities()))
    client.initialized(lsp.InitializedParams())
    text = document(balanced(_NODES(nodes))).replace(_RIGHT, _MISTAKE, 1)
    item = lsp.TextDocumentItem(uri, "xml", 1, text)
    client.text_document_did_open(lsp.DidOpenTextDocumentParams(item))
    await asyncio.wait_for(answers.get(), _PATIENCE_SEC)
    line, column = text[: text.index(_TYPED_AT)].count("\n"), len('<Sleep msec="')
    taken = []
    for number in range(keystrokes):
        end = lsp.Position(line, column + number % 2)
        place = lsp.Range(lsp.Position(line, column), end)
        change = lsp.TextDocumentContentChangePartial(place, "" if number % 2 else "1")
        whose = lsp.VersionedTextDocumentIdentifier(version=number + 2, uri=uri)
        began = time.perf_counter()
        client.text_document_did_change(lsp.DidChangeTextDocumentParams(whose, [change]))
        both = [await asyncio.wait_for(answers.get(), _PATIENCE_SEC) for _ in range(2)]
        taken.append((both[0] - began, both[1] - began))
    await client.shutdown_async(None)
    client.exit(None)
    await client.stop()  # type: ignore[no-untyped-call]
    return taken
