"""An editor for tests: a client that starts the language server and talks to it over standard input and output."""

import asyncio
import threading

from lsprotocol import types as lsp
from pygls.lsp.client import LanguageClient

from tests.processes import BIN
from tests.waiting import SILENCE_SEC, News


class Editor:
    """An editor with open files.

    Attributes:
        published: The diagnostics that the server has published, in order.
        logged: The log messages so far.
        messages: The shown messages so far.
    """

    def __init__(self, *options, folder=None):
        self.published: list[lsp.PublishDiagnosticsParams] = []
        self.logged: list[lsp.LogMessageParams] = []
        self.messages: list[lsp.ShowMessageParams] = []
        self._news = News()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self.client = LanguageClient("tests", "1")
        self.client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)(self._keep(self.published))
        self.client.feature(lsp.WINDOW_LOG_MESSAGE)(self._keep(self.logged))
        self.client.feature(lsp.WINDOW_SHOW_MESSAGE)(self._keep(self.messages))
        self.ask(self._start(options, folder))

    async def _start(self, options, folder):
        await self.client.start_io(str(BIN / "sar-compile"), "lsp", *options)
        capabilities = lsp.ClientCapabilities()
        folders = [lsp.WorkspaceFolder(folder.as_uri(), folder.name)] if folder else None
        await self.client.initialize_async(lsp.InitializeParams(capabilities, workspace_folders=folders))
        self.client.initialized(lsp.InitializedParams())

    def _keep(self, kept):
        def keep(params):
            with self._news:
                kept.append(params)
                self._news.tell()

        return keep

    def ask(self, question):
        """Return the response to a request."""
        return asyncio.run_coroutine_threadsafe(question, self._loop).result(SILENCE_SEC)

    def say(self, notify, params):
        """Send a notification."""
        self._loop.call_soon_threadsafe(notify, params)

    def close(self):
        """End the session and the server."""
        self.ask(self.client.shutdown_async(None))
        self.say(self.client.exit, None)
        self.ask(self.client.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    def open(self, path, text=None):
        """Open a file, and return what the server publishes after the check."""
        written = path.read_text(encoding="utf-8") if text is None else text
        item = lsp.TextDocumentItem(path.as_uri(), "xml", 1, written)
        self.say(self.client.text_document_did_open, lsp.DidOpenTextDocumentParams(item))
        return self.wait_for(path, 1)[0]

    def close_file(self, path):
        """Close a file without waiting."""
        whose = lsp.TextDocumentIdentifier(path.as_uri())
        self.say(self.client.text_document_did_close, lsp.DidCloseTextDocumentParams(whose))

    def change(self, path, version, *changes):
        """Change parts of a text, each given as start, end and new text; return all that the server publishes."""
        pieces = [
            lsp.TextDocumentContentChangePartial(lsp.Range(lsp.Position(*start), lsp.Position(*end)), text)
            for start, end, text in changes
        ]
        whose = lsp.VersionedTextDocumentIdentifier(version=version, uri=path.as_uri())
        self.say(self.client.text_document_did_change, lsp.DidChangeTextDocumentParams(whose, pieces))
        return self.wait_for(path, version, times=2)

    def replace(self, path, version, text):
        """Replace the whole text; return what the server publishes: the moved findings, then those of the check."""
        whose = lsp.VersionedTextDocumentIdentifier(version=version, uri=path.as_uri())
        whole = [lsp.TextDocumentContentChangeWholeDocument(text)]
        self.say(self.client.text_document_did_change, lsp.DidChangeTextDocumentParams(whose, whole))
        return self.wait_for(path, version, times=2)

    def save(self, path):
        """Report that a file was saved."""
        whose = lsp.TextDocumentIdentifier(path.as_uri())
        self.say(self.client.text_document_did_save, lsp.DidSaveTextDocumentParams(whose))

    def wait_for(self, path, version, times=1):
        """Wait until the server has published so many results for a version of a file; return them."""

        def found():
            mine = [each for each in self.published if (each.uri, each.version) == (path.as_uri(), version)]
            return mine if len(mine) >= times else None

        complaint = f"nothing is published for {path} in version {version}"
        with self._news:
            return self._news.wait_until(found, lambda: complaint)

    def wait_until(self, wanted, complaint):
        """Wait until a condition on the received messages holds."""
        with self._news:
            return self._news.wait_until(wanted, lambda: complaint)
