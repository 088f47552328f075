"""The latency of the language server after a keystroke in a file of ten thousand nodes.

The language server runs as an editor starts it, with pygls' client. The client repeatedly types a digit into a value and deletes it, while
an error elsewhere stays in the file. The first answer has the previous findings, moved with the text; the second has the findings in
the current text. The client waits for both before the next keystroke.
"""

import asyncio
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.figures import Effort, UnmeasurableError, medians
from benchmarks.rows import Benchmark, Limit, Measured, Row
from benchmarks.trees import balanced, document, in_turn

_SIZE = 10_000
_NODES = in_turn(
    '<AlwaysSuccess name="n{0}"/>',
    '<Sleep msec="{0}"/>',
    '<Script code="k{0} := 1"/>',
    '<ScriptCondition code="k{0} == 1"/>',
)
_RIGHT, _MISTAKE, _TYPED_AT = '<Sleep msec="0"/>', '<Sleep msec="0 x"/>', '<Sleep msec="1"/>'
_KEYSTROKES = 5
_PATIENCE_SEC = 60.0


@contextmanager
def set_up(_effort: Effort) -> Iterator[None]:
    """Check that the client is installed.

    Raises:
        UnmeasurableError: It is not.
    """
    try:
        import pygls  # noqa: F401
    except ImportError as error:
        raise UnmeasurableError("pygls is not installed") from error
    yield


def _keystroke(_stage: None, effort: Effort) -> Measured:
    answers = asyncio.run(_typed(effort.size(_SIZE), effort.rounds * _KEYSTROKES))
    # The first two keystrokes warm up the server.
    later = iter(answers[2:])
    return Measured(medians(lambda: next(later), (len(answers) - 2) // 4))


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


BENCHMARK = Benchmark(
    (
        Row(
            f"a keystroke in an editor, {_SIZE:,} nodes",
            (
                Limit(0.1, "s passing", what="to the first answer"),
                Limit(0.45, "s passing", what="until all is checked"),
            ),
            "`sar-compile lsp` and pygls' client",
            _keystroke,
        ),
    ),
    set_up,
)
