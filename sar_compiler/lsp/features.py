"""The requests of the Language Server Protocol that the server supports."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcInvalidParams

from sar_compiler.budget import Budget
from sar_compiler.editing.names import check_renaming, rename_edits
from sar_compiler.errors import SarError
from sar_compiler.lsp.server import COMMANDS, TreeServer
from sar_compiler.project import CommandLineSettings, ProjectTree
from sar_compiler.tree.conversion import canonical_bytes
from sar_compiler.tree.diagnostic import TreeError

_TRIGGERS = ["<", " ", '"', "{", ":"]


def tree_server(
    version: str,
    additions: CommandLineSettings,
    command: Sequence[str],
    options: Sequence[str],
    new_budget: Callable[[], Budget],
) -> TreeServer:
    """Create a language server that supports all requests of this module.

    Args:
        version: The version of this project.
        additions: The user's additions to the configurations of all projects.
        command: The command that starts `sar-compile`.
        options: The command-line options that define the additions.
        new_budget: A function that creates the budget of a check.
    """
    server = TreeServer(version, additions, command, options, new_budget)
    _add_texts(server)
    _add_help(server)
    _add_names(server)
    _add_commands(server)
    return server


def _add_texts(server: TreeServer) -> None:
    @server.feature(lsp.INITIALIZED)
    def on_initialized(_params: lsp.InitializedParams) -> None:
        server.open_folders(server.workspace.folders)

    @server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
    def on_opened(params: lsp.DidOpenTextDocumentParams) -> None:
        document = params.text_document
        server.on_opened(document.uri, document.text, document.version)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
    def on_changed(params: lsp.DidChangeTextDocumentParams) -> None:
        document = params.text_document
        text = server.workspace.get_text_document(document.uri).source
        server.on_changed(document.uri, text, document.version)

    @server.feature(lsp.TEXT_DOCUMENT_DID_SAVE)
    def on_saved(params: lsp.DidSaveTextDocumentParams) -> None:
        server.on_saved(params.text_document.uri)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
    def on_closed(params: lsp.DidCloseTextDocumentParams) -> None:
        server.on_closed(params.text_document.uri)

    @server.feature(lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def on_watched_files_changed(_params: lsp.DidChangeWatchedFilesParams) -> None:
        server.renew()


def _add_help(server: TreeServer) -> None:
    @server.feature(lsp.TEXT_DOCUMENT_COMPLETION, lsp.CompletionOptions(trigger_characters=_TRIGGERS))
    def completion(params: lsp.CompletionParams) -> list[lsp.CompletionItem]:
        file = server.open_text(params.text_document.uri)
        return server.completions(file, params.position) if file else []

    @server.feature(lsp.TEXT_DOCUMENT_HOVER)
    async def hover(params: lsp.HoverParams) -> lsp.Hover | None:
        file = await server.wait_for_check(params.text_document.uri)
        return server.hover(file, params.position) if file else None

    kinds = [lsp.CodeActionKind.QuickFix, lsp.CodeActionKind.SourceFixAll, lsp.CodeActionKind.Refactor]

    @server.feature(lsp.TEXT_DOCUMENT_CODE_ACTION, lsp.CodeActionOptions(kinds, resolve_provider=True))
    async def actions(params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
        uri = params.text_document.uri
        file = await server.wait_for_check(uri)
        return server.actions(uri, file, params.range) if file else []

    @server.feature(lsp.CODE_ACTION_RESOLVE)
    async def action(params: lsp.CodeAction) -> lsp.CodeAction:
        data: dict[str, Any] = dict(params.data or {})
        tree = await _tree(server, data.get("uri", ""))
        if tree is not None:
            with _show_refusal():
                params.edit = server.operation_edit(tree, **data)
        return params

    @server.feature(lsp.TEXT_DOCUMENT_FORMATTING)
    async def format_document(params: lsp.DocumentFormattingParams) -> list[lsp.TextEdit] | None:
        tree = await _tree(server, params.text_document.uri)
        return _formatting_edits(server, tree) if tree else None


async def _tree(server: TreeServer, uri: str) -> ProjectTree | None:
    """Return the tree parsed from a file's current text; None while the text cannot be parsed."""
    file = await server.wait_for_check(uri)
    return file.current_tree if file else None


def _formatting_edits(server: TreeServer, tree: ProjectTree) -> list[lsp.TextEdit]:
    """Return the edit that formats a file canonically.

    Raises:
        JsonRpcInvalidParams: If the file cannot be formatted.
    """
    source = tree.source
    try:
        text = canonical_bytes(tree.forest.main).decode(source.encoding).removeprefix(source.bom)
    except TreeError as error:
        raise JsonRpcInvalidParams(error.findings[0].message) from error
    return [lsp.TextEdit(server.range_of(source, 0, len(source.text)), text)] if text != source.text else []


def _add_names(server: TreeServer) -> None:
    @server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
    async def definition(params: lsp.DefinitionParams) -> list[lsp.Location]:
        thing = await server.name_at(params.text_document.uri, params.position)
        return [server.location(each) for each in thing.spots if each.is_origin] if thing else []

    @server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
    async def references(params: lsp.ReferenceParams) -> list[lsp.Location]:
        thing = await server.name_at(params.text_document.uri, params.position)
        is_all = params.context.include_declaration
        return (
            [server.location(each) for each in thing.spots if is_all or not each.is_origin] if thing else []
        )

    @server.feature(lsp.TEXT_DOCUMENT_RENAME)
    async def rename(params: lsp.RenameParams) -> lsp.WorkspaceEdit | None:
        thing = await server.name_at(params.text_document.uri, params.position)
        if thing is None:
            return None
        with _show_refusal():
            chosen = rename_edits(thing, params.new_name)
        changes: dict[str, list[lsp.TextEdit]] = {}
        for spot, text in chosen:
            place = server.location(spot)
            changes.setdefault(place.uri, []).append(lsp.TextEdit(place.range, text))
        return lsp.WorkspaceEdit(changes)

    @server.feature(lsp.TEXT_DOCUMENT_PREPARE_RENAME)
    async def name_to_change(params: lsp.PrepareRenameParams) -> lsp.PrepareRenamePlaceholder | None:
        uri, position = params.text_document.uri, params.position
        thing = await server.name_at(uri, position)
        if thing is None:
            return None
        with _show_refusal():
            check_renaming(thing)
        places = [place.range for place in map(server.location, thing.spots) if place.uri == uri]
        at_cursor = (each for each in places if each.start <= position <= each.end)
        return next((lsp.PrepareRenamePlaceholder(each, thing.name) for each in at_cursor), None)

    @server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
    async def symbols(params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
        tree = await _tree(server, params.text_document.uri)
        return server.symbols(tree) if tree else []


@contextmanager
def _show_refusal() -> Iterator[None]:
    """Show the message of a `SarError` in the editor."""
    try:
        yield
    except SarError as error:
        raise JsonRpcInvalidParams(str(error)) from error


def _add_commands(server: TreeServer) -> None:
    @server.feature(lsp.TEXT_DOCUMENT_CODE_LENS)
    async def lenses(params: lsp.CodeLensParams) -> list[lsp.CodeLens]:
        uri = params.text_document.uri
        tree = await _tree(server, uri)
        return server.lenses(uri, tree) if tree else []

    def add(subcommand: str, name: str) -> None:
        @server.command(name)
        async def run(uri: str, tree_id: str | None = None) -> bool:
            return await server.run_command(subcommand, uri, tree_id)

    for subcommand, name in COMMANDS.items():
        add(subcommand, name)
