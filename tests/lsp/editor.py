"""An editor for tests: a client of the server that is started as editors start it, by standard input and output."""

import asyncio
import threading

from lsprotocol import types as lsp
from pygls.lsp.client import LanguageClient

from tests.processes import BIN
from tests.waiting import SILENCE_SEC, News


class Editor:
    """An editor with files in it.

    Attributes:
        published: What was published so far, in its order.
        logged: What was logged so far.
        messages: What was shown so far.
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
        """Return the answer to a question."""
        return asyncio.run_coroutine_threadsafe(question, self._loop).result(SILENCE_SEC)

    def say(self, notify, params):
        """Say something that has no answer."""
        self._loop.call_soon_threadsafe(notify, params)

    def close(self):
        """End the session, and the server with it."""
        self.ask(self.client.shutdown_async(None))
        self.say(self.client.exit, None)
        self.ask(self.client.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    def open(self, path, text=None):
        """Open a file, and return what is published when it is checked."""
        written = path.read_text(encoding="utf-8") if text is None else text
        item = lsp.TextDocumentItem(path.as_uri(), "xml", 1, written)
        self.say(self.client.text_document_did_open, lsp.DidOpenTextDocumentParams(item))
        return self.wait_for(path, 1)[0]

    def close_file(self, path):
        """Close a file; nothing is waited for."""
        whose = lsp.TextDocumentIdentifier(path.as_uri())
        self.say(self.client.text_document_did_close, lsp.DidCloseTextDocumentParams(whose))

    def change(self, path, version, *changes):
        """Change a text by pieces, each as what is before, what goes, and what comes; return all that is published for it."""
        pieces = [
            lsp.TextDocumentContentChangePartial(lsp.Range(lsp.Position(*start), lsp.Position(*end)), text)
            for start, end, text in changes
        ]
        whose = lsp.VersionedTextDocumentIdentifier(version=version, uri=path.as_uri())
        self.say(self.client.text_document_did_change, lsp.DidChangeTextDocumentParams(whose, pieces))
        return self.wait_for(path, version, times=2)

    def replace(self, path, version, text):
        """Change the whole text, and return all that is published for it: what moved, and what was found."""
        whose = lsp.VersionedTextDocumentIdentifier(version=version, uri=path.as_uri())
        whole = [lsp.TextDocumentContentChangeWholeDocument(text)]
        self.say(self.client.text_document_did_change, lsp.DidChangeTextDocumentParams(whose, whole))
        return self.wait_for(path, version, times=2)

    def save(self, path):
        """Say that a file is saved."""
        whose = lsp.TextDocumentIdentifier(path.as_uri())
        self.say(self.client.text_document_did_save, lsp.DidSaveTextDocumentParams(whose))

    def wait_for(self, path, version, times=1):
        """Return what is published for a version of a file, when it has been published so often."""

        def found():
            mine = [each for each in self.published if (each.uri, each.version) == (path.as_uri(), version)]
            return mine if len(mine) >= times else None

        complaint = f"nothing is published for {path} in version {version}"
        with self._news:
            return self._news.wait_until(found, lambda: complaint)

    def wait_until(self, wanted, complaint):
        """Wait until something is so of what was published or logged."""
        with self._news:
            return self._news.wait_until(wanted, lambda: complaint)
