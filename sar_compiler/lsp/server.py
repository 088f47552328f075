"""The language server: its open files, their checks, and its messages to the editor.

Changed files are checked one after the other, in a separate thread and within a budget. After each change, the server
immediately sends the previous findings at their new positions. It sends the new findings after the check. If the
editor cancels a request, the process that the request has started is killed.
"""

import asyncio
import bisect
import contextlib
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from lsprotocol import types as lsp
from pygls.lsp.server import LanguageServer
from pygls.uris import from_fs_path, to_fs_path

from sar_compiler.analysis.bounded_search import SearchBudget
from sar_compiler.budget import WORK, Budget, BudgetSpentError
from sar_compiler.checks import failure_of_file
from sar_compiler.checks.fixing import Fix, each_fix, fixes
from sar_compiler.editing.names import NamedThing, NameLocation, name_at
from sar_compiler.editing.operations import edits_of, refactorings_at
from sar_compiler.editing.text_edits import TextEdit
from sar_compiler.errors import SarError
from sar_compiler.lsp.completions import completions_for, context_at, page_of_tag
from sar_compiler.lsp.open_text import OpenText, PlacedFinding
from sar_compiler.missions.tree_check import check_mission
from sar_compiler.nodes.registry import Registry
from sar_compiler.opener import TREE, FileIdentity, read_file
from sar_compiler.process_end import dependent_environment
from sar_compiler.project import CommandLineSettings, ProjectTree, Workspace
from sar_compiler.tree.content import real_path
from sar_compiler.tree.diagnostic import Diagnostic, Severity, Source, TreeError
from sar_compiler.tree.discovery import parse_tree
from sar_compiler.tree.model import NO_SPANS, TREE_TAG, Element, TreeFile, last_element_before

_SEVERITIES = {
    Severity.ERROR: lsp.DiagnosticSeverity.Error,
    Severity.WARNING: lsp.DiagnosticSeverity.Warning,
    Severity.INFO: lsp.DiagnosticSeverity.Information,
}
_KINDS = {
    "tag": lsp.CompletionItemKind.Class,
    "attribute": lsp.CompletionItemKind.Property,
    "value": lsp.CompletionItemKind.EnumMember,
    "key": lsp.CompletionItemKind.Variable,
    "tree": lsp.CompletionItemKind.Module,
}
COMMANDS = {"verify": "sar.verify", "simulate": "sar.simulate"}
"""The editor's command for each `sar-compile` subcommand that a code lens can run."""
_REFACTORINGS = {"extract": lsp.CodeActionKind.RefactorExtract, "inline": lsp.CodeActionKind.RefactorInline}
_IDLE_SEC = 0.5
"""If the user types nothing for this number of seconds, the server starts to explore runs."""


_OfThread = TypeVar("_OfThread")


class _IdleBudget(SearchBudget):
    """The budget for exploring runs while the user is not typing."""

    def __init__(self, interrupted: threading.Event) -> None:
        super().__init__(WORK)
        self._interrupted = interrupted

    def charge(self, work: int) -> bool:
        """Charge `work` to the budget. Return False if the budget is exhausted or the text has changed."""
        return not self._interrupted.is_set() and super().charge(work)


class TreeServer(LanguageServer):
    """The language server for tree files.

    Args:
        version: The version of this project.
        additions: The user's additions to the configurations of all projects.
        command: The command that starts `sar-compile`.
        options: The command-line options that define the additions.
        new_budget: A function that creates the budget of a check.
    """

    def __init__(
        self,
        version: str,
        additions: CommandLineSettings,
        command: Sequence[str],
        options: Sequence[str],
        new_budget: Callable[[], Budget],
    ) -> None:
        super().__init__("sar-compile lsp", version)
        self._new_budget = new_budget
        self._command = command
        self._options = options
        self._additions = additions
        self._open: dict[str, OpenText] = {}
        self._texts: Mapping[Path, str] = {}  # the texts of open files during a check
        self._unchanged: dict[Path, tuple[FileIdentity | str | None, TreeFile]] = {}
        self._loader = self._new_loader()
        self._wanted: dict[str, None] = {}
        self._work: asyncio.Task[None] | None = None
        self._awoken = asyncio.Event()
        self._checked = asyncio.Event()
        self._changed = threading.Event()
        self._thread = ThreadPoolExecutor(1, "checks")
        self._published: dict[str, set[str]] = {}
        self._problems: set[str] = set()

    def _new_loader(self) -> Workspace:
        def note(text: str) -> None:
            self._log(lsp.MessageType.Info, text)

        return Workspace(self._additions, self._read, note, [check_mission])

    def open_folders(self, uris: Iterable[str]) -> None:
        """Set the editor's open folders, whose files belong to one set, and check all open files again."""
        folders = [path for uri in uris if (path := to_fs_path(uri)) is not None]
        self._additions = self._additions._replace(folders=tuple(map(Path, folders)))
        self.renew()

    def _report_problem(self, problem: str) -> None:
        """Log why a file cannot be checked, and show the reason once. Called in the thread of the checks."""
        self._log(lsp.MessageType.Error, problem)
        if problem not in self._problems:
            self._problems.add(problem)
            message = lsp.ShowMessageParams(lsp.MessageType.Error, problem)
            self._loop.call_soon_threadsafe(self.window_show_message, message)

    def _log(self, kind: lsp.MessageType, text: str) -> None:
        """Log a message in the editor. Called in the thread of the checks."""
        self._loop.call_soon_threadsafe(self.window_log_message, lsp.LogMessageParams(kind, text))

    def _read(self, path: Path) -> TreeFile:
        """Parse a file as shown in the editor, or from the disk if it is not open. Unchanged files are cached."""
        text = self._texts.get(real_path(path))
        content = read_file(path, TREE) if text is None else None
        version = text if content is None else content.identity
        known, tree_file = self._unchanged.get(path, (None, None))
        if tree_file is None or known != version:
            tree_file = parse_tree(content.data if content is not None else text or "", str(path))
            self._unchanged[path] = version, tree_file
        return tree_file

    # Texts

    def on_opened(self, uri: str, text: str, version: int) -> None:
        """Store the text of a file that was opened, and check it."""
        path = to_fs_path(uri)
        if path is not None:
            self._open[uri] = OpenText(Path(path), text, version)
            self._request_check(uri)

    def on_changed(self, uri: str, text: str, version: int) -> None:
        """Store a changed text, send the previous findings at their new positions, and check the text."""
        if uri in self._open:
            self._open[uri].change(text, version)
            self._publish(uri)
            self._request_check(uri)

    def on_saved(self, uri: str) -> None:
        """Check all open files again, because a file was saved."""
        if uri in self._open:
            self._open[uri].mark_complete()
        self.renew()

    def on_closed(self, uri: str) -> None:
        """Discard the text of a closed file. Also discard its findings, unless an open file includes the file."""
        self._open.pop(uri, None)
        self._wanted.pop(uri, None)
        self._publish(uri, *self._published.pop(uri, ()))
        self.renew()

    def renew(self) -> None:
        """Check all open files again, because other files or settings have changed."""
        self._loader = self._new_loader()
        for uri in self._open:
            self._request_check(uri)

    def open_text(self, uri: str) -> OpenText | None:
        """Return the open file with the given URI, or None if there is no such file."""
        return self._open.get(uri)

    # Checks

    def _request_check(self, uri: str) -> None:
        self._loop = asyncio.get_running_loop()
        self._changed.set()
        self._awoken.set()
        self._wanted[uri] = None
        if self._work is None or self._work.done():
            self._work = asyncio.ensure_future(self._check_wanted())

    async def _check_wanted(self) -> None:
        checked: dict[str, None] = {}
        while self._wanted:
            while self._wanted:
                uri = next(iter(self._wanted))
                del self._wanted[uri]
                checked[uri] = None
                await self._check(uri)
            if await self._is_idle():
                for uri in checked:
                    await self._try_runs(uri)
                checked.clear()

    async def _is_idle(self) -> bool:
        """Wait for a moment. Return True if the user has not typed during this time."""
        self._awoken.clear()
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._awoken.wait(), _IDLE_SEC)
        return not self._awoken.is_set()

    async def _check(self, uri: str) -> None:
        file = self._open.get(uri)
        if file is None:
            return
        loader, path, text = self._loader, file.path, file.text
        self._changed.clear()
        self._texts = {real_path(each.path): each.text for each in self._open.values()}
        found = None
        if not file.is_foreign():
            found = await self._run_in_budget(path, lambda: self._findings(loader, path))
        tree, findings = found or (None, [])
        if self._open.get(uri) is file and file.text == text:
            file.set_findings(tree, findings)
            self._publish(uri)
            for other, each in self._open.items():
                if other != uri and _depends_on(each, path):
                    self._recheck(other, because=uri)
            self._checked.set()
            self._checked = asyncio.Event()

    def _recheck(self, uri: str, because: str) -> None:
        """Request a check of the file *uri*, once for each version of the file *because* on which it depends."""
        stamp = (because, self._open[because].version)
        if self._open[uri].seen.get(because) != stamp[1]:
            self._open[uri].seen[because] = stamp[1]
            self._wanted[uri] = None

    def _findings(self, loader: Workspace, path: Path) -> tuple[ProjectTree | None, list[Diagnostic]]:
        loader.reload_sets()
        tree = None
        try:
            tree = loader.load_file(path)
            findings = tree.check()
        except TreeError as error:
            return tree, [*error.findings]
        except SarError as error:
            self._report_problem(str(error))
            return tree, []
        except Exception as error:  # noqa: BLE001 - any error becomes a finding about the file
            return tree, [failure_of_file(path, error)]
        loader.report_use()
        return tree, findings

    async def _run_in_budget(self, path: Path, function: Callable[[], _OfThread]) -> _OfThread | None:
        """Call a function that checks a file. If the budget is exhausted first, report this and return None."""
        budget = self._new_budget()

        def run_checks() -> _OfThread | None:
            try:
                return budget.run(function)
            except BudgetSpentError:
                self._report_problem(f"{path} was not checked: {budget.reason}")
                # The abandoned check may have left the loader in an inconsistent state.
                self._loader = self._new_loader()
                return None

        return await self._loop.run_in_executor(self._thread, run_checks)

    async def _try_runs(self, uri: str) -> None:
        """While the user is not typing, explore the runs of a file, and send the tick errors as findings."""
        file = self._open.get(uri)
        tree = file.current_tree if file is not None else None
        if file is None or tree is None:
            return
        self._changed.clear()
        found = await self._run_in_budget(file.path, lambda: _try_tree(tree, self._changed))
        if found is not None and file.current_tree is tree and not self._changed.is_set():
            file.set_tick_errors(found)
            self._publish(uri)

    # Messages

    def _publish(self, *uris: str) -> None:
        for uri in uris:
            file = self._open.get(uri)
            others = {_uri_of(each) for each in file.elsewhere} if file else set()
            before = self._published.get(uri, set())
            self._published[uri] = others
            for about in {uri, *before, *others}:
                self._publish_about(about)

    def _publish_about(self, uri: str) -> None:
        """Send all findings about one file, including findings from checks of other files."""
        file = self._open.get(uri)
        unique: dict[object, lsp.Diagnostic] = {}
        if file is not None:
            source = Source(str(file.path), file.text, NO_SPANS)
            for placed in file.shown:
                key = placed.finding.code, placed.finding.message, placed.start
                unique[key] = self._diagnostic(source, placed)
        for other in self._open.values():
            for each in other.elsewhere:
                if _uri_of(each) == uri:
                    placed = PlacedFinding.from_finding(each)
                    key = each.code, each.message, placed.start
                    unique.setdefault(key, self._diagnostic(each.source, placed))
        version = file.version if file else None
        self.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri, [*unique.values()], version))

    def _diagnostic(self, source: Source, placed: PlacedFinding) -> lsp.Diagnostic:
        finding = placed.finding
        advice = f"\n{finding.advice}" if finding.advice else ""
        return lsp.Diagnostic(
            self.range_of(source, placed.start, placed.end),
            f"{finding.message}{advice}",
            _SEVERITIES[finding.severity],
            finding.code,
            source="sar-compile",
        )

    def range_of(self, source: Source, start: int, end: int) -> lsp.Range:
        """Convert two offsets in a text to a range in the editor's units."""
        return lsp.Range(self._position(source, start), self._position(source, end))

    def _position(self, source: Source, offset: int) -> lsp.Position:
        line, column = source.position_of(offset)
        first = source.line_starts[line - 1]
        units = self.workspace.position_codec.client_num_units(source.text[first : first + column - 1])
        return lsp.Position(line - 1, units)

    def offset_of(self, file: OpenText, position: lsp.Position) -> int:
        """Convert a position in the editor's units to an offset in a file's text."""
        source = Source(str(file.path), file.text, NO_SPANS)
        starts, codec = source.line_starts, self.workspace.position_codec
        if position.line >= len(starts):
            return len(file.text)
        first = starts[position.line]
        line = source.line(position.line + 1)
        units = 0
        for column, character in enumerate(line):
            if units >= position.character:
                return first + column
            units += codec.client_num_units(character)
        return first + len(line)

    # Requests

    async def wait_for_check(self, uri: str) -> OpenText | None:
        """Wait until the text of an open file has been checked. Return the file, or None if it is not open."""
        while (file := self._open.get(uri)) is not None and not file.is_checked:
            await self._checked.wait()
        return self._open.get(uri)

    async def name_at(self, uri: str, position: lsp.Position) -> NamedThing | None:
        """Return the tree, node or key whose name is at a position, or None if there is no name."""
        file = await self.wait_for_check(uri)
        tree = file.current_tree if file is not None else None
        if file is None or tree is None:
            return None
        others = [await self.wait_for_check(other) for other in tuple(self._open) if other != uri]
        beside = [each.current_tree for each in others if each is not None and each.current_tree is not None]
        return name_at(tree, self.offset_of(file, position), beside)

    def location(self, spot: NameLocation) -> lsp.Location:
        """Convert the location of a name to the editor's form."""
        uri = from_fs_path(str(real_path(Path(spot.source.path)))) or ""
        return lsp.Location(self._as_opened(uri), self.range_of(spot.source, *spot.source.offsets(spot.span)))

    def _as_opened(self, uri: str) -> str:
        """Return the URI under which the editor opened a file. It may be the URI of a link to the file."""
        path = to_fs_path(uri)
        return next((name for name, each in self._open.items() if str(real_path(each.path)) == path), uri)

    def completions(self, file: OpenText, position: lsp.Position) -> list[lsp.CompletionItem]:
        """Return the completions at a position."""
        form = file.form
        context = None if file.is_foreign() else context_at(file.text, self.offset_of(file, position), form)
        if context is None:
            return []
        completions = completions_for(context, self._vocabulary(file), file.tree, form)
        return [
            lsp.CompletionItem(
                each.text, kind=_KINDS[each.kind], detail=each.doc or None, sort_text=f"{number:05}"
            )
            for number, each in enumerate({each.text: each for each in completions}.values())
        ]

    def _vocabulary(self, file: OpenText) -> Registry:
        """Return the known tags of a file's project; empty if the project cannot be loaded."""
        try:
            if file.tree is not None:
                return file.tree.context.registry
            return self._loader.project_of(file.path).vocabulary
        except SarError:
            return Registry()

    def hover(self, file: OpenText, position: lsp.Position) -> lsp.Hover | None:
        """Return the description of the node at a position, with its attributes and possible outcomes."""
        tree = file.current_tree
        if tree is None:
            return None
        offset = self.offset_of(file, position)
        element = last_element_before([*tree.forest.main.root.iterate()], tree.source.position_of(offset))
        page = element and page_of_tag(element.tag, self._vocabulary(file))
        return (
            lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, f"```text\n{page}\n```")) if page else None
        )

    def actions(self, uri: str, file: OpenText, wanted: lsp.Range) -> list[lsp.CodeAction]:
        """Return the actions in a range of text: the fixes of findings, all safe fixes, and the refactorings."""
        tree = file.current_tree
        if tree is None or tree.tree_file is None:
            return []
        first, last = (self.offset_of(file, each) for each in (wanted.start, wanted.end))
        findings = [each.finding for each in file.shown]
        own = [each for each in findings if each.source is tree.source]
        here = list(each_fix(tree.source, tree.tree_file, own, lambda _finding: True))
        found = [
            lsp.CodeAction(
                f"Replace by {fix.finding.suggestion}" if fix.finding.suggestion else "Delete",
                lsp.CodeActionKind.QuickFix,
                [self._diagnostic(tree.source, PlacedFinding.from_finding(fix.finding))],
                edit=self._edit(uri, tree.source, [fix]),
            )
            for fix in here
            if PlacedFinding.from_finding(fix.finding).start <= last
            and PlacedFinding.from_finding(fix.finding).end >= first
        ]
        safe = fixes(tree.source, tree.tree_file, own)
        if safe:
            edit = self._edit(uri, tree.source, safe)
            found.append(lsp.CodeAction("Apply all safe fixes", lsp.CodeActionKind.SourceFixAll, edit=edit))
        return [*found, *self._refactorings(uri, tree, first)]

    def _refactorings(self, uri: str, tree: ProjectTree, offset: int) -> Iterator[lsp.CodeAction]:
        """Yield the refactorings available at an offset. The editor requests the edits only of the chosen one."""
        elements = [*tree.forest.main.root.iterate()]
        number = (
            bisect.bisect_right(elements, tree.source.position_of(offset), key=lambda each: each.position) - 1
        )
        for each in refactorings_at(tree.forest.main, number) if number > 0 else ():
            kind = _REFACTORINGS.get(each.operation, lsp.CodeActionKind.RefactorRewrite)
            data = {"uri": uri, "operation": each.operation, "arguments": dict(each.arguments)}
            yield lsp.CodeAction(each.title, kind, data=data)

    def operation_edit(
        self, tree: ProjectTree, uri: str, operation: str, arguments: Mapping[str, Any]
    ) -> lsp.WorkspaceEdit:
        """Return the workspace edit that applies an operation to a file.

        Raises:
            EditError: If the operation is impossible.
        """
        return self._edit(uri, tree.source, edits_of(tree.forest.main, operation, **arguments))

    def _edit(self, uri: str, source: Source, chosen: Iterable[Fix | TextEdit]) -> lsp.WorkspaceEdit:
        edits = [lsp.TextEdit(self.range_of(source, each.start, each.end), each.text) for each in chosen]
        return lsp.WorkspaceEdit({uri: edits})

    def symbols(self, tree: ProjectTree) -> list[lsp.DocumentSymbol]:
        """Return the trees of a file with their nodes."""
        return [self._symbol(each) for each in tree.forest.main.trees]

    def _symbol(self, element: Element) -> lsp.DocumentSymbol:
        source, span = element.source, element.tag_span()
        place = self.range_of(source, *source.offsets(span))
        last = element
        while last.children:
            last = last.children[-1]
        end = self.range_of(source, *source.offsets(last.tag_span())).end
        name = element.attributes.get("name") or element.attributes.get("ID") or element.tag
        kind = lsp.SymbolKind.Module if element.tag == TREE_TAG else lsp.SymbolKind.Function
        inner = [self._symbol(each) for each in element.children]
        return lsp.DocumentSymbol(name, kind, lsp.Range(place.start, end), place, element.tag, children=inner)

    def lenses(self, uri: str, tree: ProjectTree) -> list[lsp.CodeLens]:
        """Return the code lenses for the executable trees of a file."""
        own = [each for each in tree.forest.executable if each.source is tree.source]
        found = []
        for element in own:
            place = self.range_of(element.source, *element.source.offsets(element.tag_span()))
            for title, name in COMMANDS.items():
                arguments = [uri, element.attributes.get("ID")]
                found.append(lsp.CodeLens(place, lsp.Command(title, name, arguments=arguments)))
        return found

    async def run_command(self, subcommand: str, uri: str, tree_id: str | None) -> bool:
        """Run a subcommand of `sar-compile` on the current text of a file, and log its output.

        Returns:
            Whether the command has succeeded.
        """
        file = self._open.get(uri)
        if file is None:
            return False
        chosen = [f"--tree={tree_id}"] if tree_id else []
        process = await asyncio.create_subprocess_exec(
            *self._command, subcommand, "-", *chosen, *self._options,
            cwd=file.path.parent, env=dependent_environment(),
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
        )  # fmt: skip
        number = self.protocol.msg_id
        request = None if number is None else self.protocol._request_futures.get(number)  # noqa: SLF001
        if request is not None:
            # When a request is cancelled, pygls cancels only the response, so the process is killed here.
            request.add_done_callback(lambda _: _kill(process))
        output, _ = await process.communicate(file.text.encode())
        text = output.decode("utf-8", "replace").strip().replace("<stdin>", str(file.path))
        has_succeeded = process.returncode == 0
        kind = lsp.MessageType.Info if has_succeeded else lsp.MessageType.Warning
        self.window_log_message(lsp.LogMessageParams(kind, text))
        result = "no problems found" if has_succeeded else "problems found"
        message = f"{subcommand} {file.path.name}: {result}. The server's log contains the output"
        self.window_show_message(lsp.ShowMessageParams(kind, message))
        return has_succeeded


def _kill(process: asyncio.subprocess.Process) -> None:
    with contextlib.suppress(ProcessLookupError):
        process.kill()


def _uri_of(finding: Diagnostic) -> str:
    return from_fs_path(str(real_path(Path(finding.source.path)))) or ""


def _depends_on(file: OpenText, path: Path) -> bool:
    """Return whether the findings about the open *file* depend on the file at *path*."""
    tree = file.tree
    if tree is None:
        return False
    tree_set = (
        tree.forest.tree_set
    )  # not the set of the project, which may have been replaced since the check
    return (tree_set is not None and tree_set.is_read) or any(
        real_path(Path(each.source.path)) == real_path(path) for each in tree.forest.files
    )


def _try_tree(tree: ProjectTree, interrupted: threading.Event) -> list[Diagnostic]:
    from sar_compiler.analysis.trial import try_tree

    try:
        return try_tree(tree, lambda: _IdleBudget(interrupted))
    except (SarError, OSError):
        return []
