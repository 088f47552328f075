"""The requests that the editor's page makes about a project's tree files.

Arguments and responses are JSON values.

Each request contains the current text, so the page has the only copy that is edited. Offsets count UTF-16 units, as in
JavaScript. The page sends requests over HTTP (`web.edit_page`), or to Python in a worker of the browser.
"""

import bisect
import re
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any
from uuid import UUID

from sar_compiler.analysis.simulate.scenario_run import ScenarioRun
from sar_compiler.analysis.simulated import simulate_tree
from sar_compiler.analysis.trace_view import leaf_labels
from sar_compiler.analysis.tree_analysis import predict_tree, verify_tree
from sar_compiler.budget import MAX_MEMORY_MB, Budget, Progress, memory_now_mb
from sar_compiler.checks.fixing import each_fix
from sar_compiler.documents.yaml_files import as_yaml
from sar_compiler.editing.names import name_at, rename_edits
from sar_compiler.editing.operations import EditedFile, edits_of
from sar_compiler.editing.text_edits import EditError, TextEdit
from sar_compiler.errors import SarError
from sar_compiler.missions.tree_check import check_mission
from sar_compiler.nodes.registry import subtree
from sar_compiler.nodes.spec import NodeSpec, Parameter, ParameterRole
from sar_compiler.opener import TREE, read_file
from sar_compiler.project import CommandLineSettings, ProjectTree, Workspace
from sar_compiler.runtime.events import HALTED, RETURNED, TickRecord
from sar_compiler.runtime.walking import pre_order
from sar_compiler.studio.edited_document import EditedDocument
from sar_compiler.tree.content import real_path
from sar_compiler.tree.diagnostic import Diagnostic, TreeError
from sar_compiler.tree.discovery import parse_tree
from sar_compiler.tree.model import Element, TreeFile
from sar_compiler.tree.plain import value_as_script
from sar_compiler.views.drawing import svg
from sar_compiler.writing import write_bytes

MOST_STATES = 1_000_000
"""The default maximum number of states that an analysis explores."""
SIDE_BY_SIDE = frozenset({"verify", "predict", "progress", "stop"})
"""The requests that are processed in parallel with other requests."""
_MOST_TICKS = 1000
# Other spellings of true and false, which are not suggested.
_SPELLINGS = ("True", "False", "TRUE", "FALSE", "1", "0")
_ENDED = ("SUCCESS", "FAILURE")


class Studio:
    """The back end of the editor's page for a file and for the other files of the file's project.

    Args:
        path: The file that is opened first.
        additions: The user's additions to the configuration of the file's project.
        max_states: The maximum number of states of an analysis.
        on_progress: Called repeatedly with the number of states that an analysis has found.

    Attributes:
        document: The file.
    """

    def __init__(
        self,
        path: Path,
        additions: CommandLineSettings = CommandLineSettings(),  # noqa: B008 - immutable
        max_states: int = MOST_STATES,
        on_progress: Callable[[int], object] = lambda _states: None,
    ) -> None:
        self.document = EditedDocument(path)
        self._path = path
        self._options = (additions, max_states, on_progress)
        self._text = ""
        self._tree: ProjectTree | None = None
        self._others: dict[str, Studio] = {}
        self._stamps: dict[Path, tuple[int, int]] = {}
        self._budget = Budget()
        self._states = 0
        self._scenario: Mapping[str, object] = {}
        self._requests: Mapping[str, Callable[..., object]] = {
            "open": self.document.load,
            "save": self.document.save_text,
            "compare": self.compare,
            "look": self.examine,
            "edit": self.edit,
            "rename": self.rename,
            "palette": self.palette,
            "export": self.export,
            "verify": self.verify,
            "predict": self.predict,
            "play": self.play_ticks,
            "record": self.record_scenario,
            "progress": lambda: {"states": self._states},
            "stop": lambda: self._budget.spend("stopped"),
        }

    def answer_question(self, request: str, values: Mapping[str, Any]) -> object:
        """Return the response to a request of the page. If the request fails, `error` contains the reason.

        Args:
            request: The name of the request.
            values: The arguments. `text` is the current text of the file. `file` is the name of the file, unless it is
                the file that was opened first.
        """
        if values.get("file"):
            if other := self._others.get(values["file"]):
                return other.answer_question(request, {**values, "file": ""})
            return {"error": f"the project has no file '{values['file']}'"}
        function = self._requests.get(request)
        if function is None:
            return {"error": f"unknown request '{request}' (known: {', '.join(self._requests)})"}
        try:
            return function(**{name: value for name, value in values.items() if name != "file"})
        except SarError as error:
            findings = error.findings if isinstance(error, TreeError) else ()
            return {"error": findings[0].message if findings else str(error)}

    def examine(self, text: str, tree: str | None = None, folded: Collection[int] = ()) -> object:
        """Return the findings about a file, and the elements and a drawing if the file can be parsed.

        Args:
            text: The text.
            tree: The ID of the tree to draw; by default the main tree.
            folded: The offsets of the elements that are drawn without their children.
        """
        loaded, offset = self._load(text), _utf16_offsets(text)
        findings = loaded.check()
        parsed = loaded.tree_file if not loaded.is_malformed else None
        result: dict[str, Any] = {"findings": self._findings(loaded, parsed, findings, offset)}
        if parsed is None:
            return result
        ids = [each.attributes.get("ID", "") for each in parsed.trees]
        is_named_elsewhere = parsed.main_tree_name not in (None, *ids)
        shown = tree if tree in ids else next(filter(None, ids), None) if is_named_elsewhere else None
        try:
            sketch = loaded.sketch(shown)
        except TreeError as error:
            # A file that contains only node models is valid, but has no tree to draw.
            reasons = [each for each in error.findings if each not in findings]
            result["findings"] += self._findings(loaded, parsed, reasons, offset)
            return result
        elements = [*parsed.root.iterate()]
        numbers = {each.position: number for number, each in enumerate(elements)}
        result |= {"trees": ids, "keys": _keys(loaded, numbers), "files": self._register_files(loaded)}
        result["elements"] = _elements(elements, numbers, offset)
        own, starts = loaded.source, {*folded}
        folds = {number for number, each in enumerate(elements) if offset(each.offset) in starts}
        nodes: list[int | None] = []
        hidden: set[UUID] = set()
        for each in pre_order(sketch.root):
            bound = sketch.origins[each.id].bound
            nodes.append(numbers.get(bound.element.position) if bound.element.source is own else None)
            is_wrapper = any(sketch.origins[child.id].bound is bound for child in each.children)
            if nodes[-1] in folds and not is_wrapper:
                hidden |= {below.id for below in islice(pre_order(each), 1, None)}
        places = [place for place, each in enumerate(pre_order(sketch.root)) if each.id not in hidden]
        drawn = {"svg": svg(sketch, hidden=hidden, is_styled=False), "tree": shown or sketch.name}
        return {**result, **drawn, "nodes": [nodes[place] for place in places], "places": places}

    def export(self, text: str, tree: str | None = None) -> object:
        """Return the name and content of an SVG file with the drawing of a tree."""
        sketch = self._load(text).sketch(tree)
        return {"name": f"{sketch.name}.svg", "text": svg(sketch)}

    def compare(self, version: str) -> object:
        """Return whether the file has changed on the disk, and whether other files of its project have changed."""
        stamps = {path: _stamp(path) for path in self._stamps}
        others_have_changed = stamps != self._stamps
        if others_have_changed:
            self._tree = None
        return {"has_changed": self.document.is_changed(version), "others_have_changed": others_have_changed}

    def edit(self, text: str, operation: str, arguments: Mapping[str, Any]) -> object:
        """Return the edits of an operation, given its name in `editing.operations` and its arguments."""
        edits = edits_of(parse_tree(text, str(self._path)), operation, **arguments)
        return {"edits": _edits(text, edits)}

    def rename(self, text: str, element: int, name: str) -> object:
        """Return the edits that rename the tree in the attribute `ID` of an element wherever its name occurs in the text.

        Raises:
            EditError: If the element does not name a tree, or another file also contains the name.
        """
        loaded = self._load(text)
        span = EditedFile(loaded.forest.main).element(element).value_span("ID")
        named = name_at(loaded, loaded.source.offsets(span)[0])
        if named is None:
            message = "this element does not name a tree"
            raise EditError(message)
        spots = rename_edits(named, name)
        other = next((each.source.path for each, _ in spots if each.source is not loaded.source), None)
        if other is not None:
            message = (
                f"{other} also contains '{named.name}'. Rename it in an editor that uses sar-compile lsp"
            )
            raise EditError(message)
        edits = [TextEdit(*each.source.offsets(each.span), new) for each, new in spots]
        return {"edits": _edits(text, edits if name != named.name else [])}

    def palette(self, text: str) -> object:
        """Return the specs of the nodes that can be inserted, with their attributes."""
        registry = self._load(text).context.registry
        specs = [variants[0] for variants in registry.by_tag().values()]
        tree = {"name": "ID", "doc": "The tree.", "required": True, "choices": []}
        call: Any = _spec(subtree())
        return {"nodes": [*map(_spec, specs), {**call, "attributes": [tree, *call["attributes"]]}]}

    def verify(self, text: str, tree: str | None = None) -> object:
        """Verify a tree; return the verdicts, with a counterexample for each violated property."""
        loaded, max_states, budget = self._read(text), self._options[1], self._begin_analysis()
        proof = verify_tree(loaded, tree_id=tree, max_states=max_states, budget=budget)
        nodes = _paths(loaded, tree)
        verdicts = []
        for each in proof.verdicts:
            run, loop = (_run(each.trace.ticks, nodes), each.trace.loop) if each.trace else (None, 0)
            verdict = {"question": each.question, "verdict": each.outcome.value, "reason": each.reason}
            verdicts.append({**verdict, "run": run, "loop": loop})
        search = {"states": proof.states, "complete": proof.complete, "stopped": budget.reason}
        return {**search, "verdicts": verdicts}

    def predict(self, text: str, tree: str | None = None) -> object:
        """Return the probabilities of success and of each property, as text.

        Raises:
            EditError: If NumPy or SciPy is not installed.
        """
        try:
            from sar_compiler.analysis.prediction_view import prediction_as_text
        except ImportError:
            message = "NumPy and SciPy are not installed here. Install the package sar_compiler, and run sar-compile predict"
            raise EditError(message) from None
        begun, budget = time.monotonic(), self._begin_analysis()
        found = predict_tree(self._read(text), tree_id=tree, max_states=self._options[1], budget=budget)
        return {"text": prediction_as_text(found, time.monotonic() - begun), "stopped": budget.reason}

    def play_ticks(
        self,
        text: str,
        tree: str | None = None,
        ticks: int = 6,
        leaves: Mapping[str, Iterable[str]] | None = None,
    ) -> object:
        """Return the first ticks of a simulated run in which the named leaves return the given outcomes in order."""
        chosen = {name: list(each) for name, each in (leaves or {}).items()}
        script = {"leaves": chosen, **({"tree": tree} if tree else {})}
        loaded = self._load(text)
        run = simulate_tree(loaded, script).tick(min(ticks, _MOST_TICKS)).run
        self._scenario = _scenario(run, tree)
        return _run(run.ticks, _paths(loaded, tree), run.simulated.fact_values())

    def record_scenario(self, name: str) -> object:
        """Write the last simulated run as a scenario with expectations.

        The scenario is a new file in the folder of the tree file.

        Raises:
            EditError: If the name does not end with `.yaml` or `.yml`, or the file already exists.
            WriteError: If the file cannot be written.
        """
        path = self._path.with_name(Path(name).name)
        if path.suffix not in (".yaml", ".yml"):
            message = f"'{name}' does not end with .yaml"
            raise EditError(message)
        if path.exists():
            message = f"'{name}' already exists. Choose another name"
            raise EditError(message)
        scenario = as_yaml(self._scenario)
        write_bytes(path, scenario.encode())
        return {"name": path.name, "text": scenario}

    def _begin_analysis(self) -> Budget:
        """Stop the analysis that is running, and return the budget of a new one."""
        on_progress = self._options[2]

        def report(progress: Progress) -> None:
            self._states = progress.states
            on_progress(progress.states)

        self._budget.spend("stopped")
        self._states = 0
        self._budget = Budget(max_memory_mb=MAX_MEMORY_MB, on_progress=report, memory=memory_now_mb)
        return self._budget

    def _register_files(self, loaded: ProjectTree) -> list[str]:
        """Return the names of the project's files, starting with the edited file.

        The other files are registered for later requests.
        """
        own, folder = loaded.source.path, real_path(self._path).parent
        paths = [real_path(Path(each.source.path)) for each in loaded.forest.files if each.source.path != own]
        self._stamps = {path: _stamp(path) for path in paths}
        for path in paths:
            name = str(path.relative_to(folder) if path.is_relative_to(folder) else path)
            self._others.setdefault(name, Studio(path, *self._options))
        return [self._path.name, *self._others]

    def _load(self, text: str) -> ProjectTree:
        """Return the tree file with the current text, which is parsed only if it has changed."""
        if self._tree is None or text != self._text:
            self._tree, self._text = self._read(text), text
        return self._tree

    def _read(self, text: str) -> ProjectTree:
        """Parse the tree file with the current text, and read other files from the disk."""
        own = real_path(self._path)

        def read(path: Path) -> TreeFile:
            is_own = real_path(path) == own
            return parse_tree(text if is_own else read_file(path, TREE).data, str(path))

        return Workspace(self._options[0], read, further_checks=[check_mission]).load_file(self._path)

    def _findings(
        self,
        loaded: ProjectTree,
        parsed: TreeFile | None,
        findings: Iterable[Diagnostic],
        offset: Callable[[int], int],
    ) -> list[object]:
        source, findings = loaded.source, list(findings)
        fixes = {id(each.finding): each for each in each_fix(source, parsed, findings, lambda _finding: True)}
        listed: list[object] = []
        for each in findings:
            fix = fixes.get(id(each))
            is_own = each.source.path == source.path and each.source.text == source.text
            start, end = each.source.offsets(each.span) if is_own else (0, 0)
            path = "" if is_own else each.source.path
            place = {"from": offset(start), "to": offset(end), "line": each.span.line, "file": path}
            told = {"severity": each.severity.value, "code": each.code, "message": each.message}
            edit = fix and _edit(TextEdit(fix.start, fix.end, fix.text), offset)
            listed.append({**place, **told, "advice": each.advice, "fix": edit})
        return listed


def _utf16_offsets(text: str) -> Callable[[int], int]:
    """Return a function that converts offsets in a Python string to offsets in JavaScript."""
    wide = [found.start() for found in re.finditer("[\U00010000-\U0010ffff]", text)]
    return (lambda offset: offset + bisect.bisect_left(wide, offset)) if wide else (lambda offset: offset)


def _edit(edit: TextEdit, offset: Callable[[int], int]) -> object:
    return {"from": offset(edit.start), "to": offset(edit.end), "insert": edit.text}


def _edits(text: str, edits: Iterable[TextEdit]) -> list[object]:
    offset = _utf16_offsets(text)
    return [_edit(each, offset) for each in sorted(edits)]


def _elements(
    elements: Sequence[Element], numbers: Mapping[tuple[int, int], int], offset: Callable[[int], int]
) -> list[object]:
    parents = {
        child.position: (number, index)
        for number, each in enumerate(elements)
        for index, child in enumerate(each.children)
    }
    listed: list[object] = []
    for each in elements:
        start, end = each.source.spans.tag(each)
        parent, index = parents.get(each.position, (None, 0))
        own = {"from": offset(start), "to": offset(end), "tag": each.tag, "attributes": dict(each.attributes)}
        children = [numbers[child.position] for child in each.children]
        listed.append({**own, "parent": parent, "index": index, "children": children})
    return listed


def _keys(loaded: ProjectTree, numbers: Mapping[tuple[int, int], int]) -> Mapping[str, list[object]]:
    """Return, for each key, the file's elements that access the key, and the kinds of access."""
    keys: dict[str, list[object]] = {}
    for accesses in loaded.context.key_accesses.values():
        for each in accesses.accesses:
            element, users = each.bound.element, keys.setdefault(each.key, [])
            if element.source is loaded.source and element.position in numbers:
                users.append([numbers[element.position], each.kind.value])
    return dict(sorted(keys.items()))


def _stamp(path: Path) -> tuple[int, int]:
    """Return a file's modification time and size, which show whether it has changed.

    Both are zero if the file does not exist.
    """
    with suppress(OSError):
        status = path.stat()
        return status.st_mtime_ns, status.st_size
    return 0, 0


def _spec(spec: NodeSpec) -> object:
    meaning = {"tag": spec.tag, "kind": spec.kind.value, "doc": spec.doc, "most": spec.child_count[1]}
    return {**meaning, "attributes": [_parameter(each) for each in spec.attributes]}


def _parameter(parameter: Parameter) -> object:
    meaning = {"name": parameter.name, "doc": parameter.help, "required": parameter.required}
    choices = [each for each in parameter.value_type.choices if each not in _SPELLINGS]
    takes_key = parameter.direction is not None
    is_reference = parameter.role is ParameterRole.REFERENCE
    return {**meaning, "choices": choices, "takes_key": takes_key, "is_reference": is_reference}


def _paths(loaded: ProjectTree, tree: str | None) -> dict[str, list[int]]:
    """Return the numbers of the drawn nodes on each path of node names.

    The paths do not contain the names of wrappers.
    """
    compiled = loaded.preview(tree)
    bound = {each.id: compiled.origins[each.id].bound for each in pre_order(compiled.root)}
    drawn: dict[object, list[int]] = {None: []}
    paths: dict[object, list[str]] = {None: []}
    for number, each in enumerate(pre_order(compiled.root)):
        above = None if each is compiled.root or each.parent is None else each.parent.id
        is_wrapper = any(bound[child.id] is bound[each.id] for child in each.children)
        drawn[each.id] = [*drawn[above], number]
        paths[each.id] = paths[above] + ([] if is_wrapper else [each.name])
    return {"/".join(paths[each]): drawn[each] for each in bound}


def _run(
    ticks: Sequence[TickRecord], nodes: Mapping[str, list[int]], final: Mapping[str, object] | None = None
) -> object:
    """Return each tick's events with their drawn nodes, and the values of facts and keys after the tick.

    Args:
        ticks: The ticks.
        nodes: The result of `_paths`.
        final: The facts after the last tick; None if they are not known.
    """
    changes = [{**tick.facts, **tick.keys} for tick in ticks]
    values = dict(final or {})
    for each in reversed(changes):
        values |= {name: before for name, (before, _) in each.items()}
    listed = []
    for tick, changed in zip(ticks, changes, strict=True):
        values |= {name: after for name, (_, after) in changed.items()}
        events = [
            {
                "leaf": each.leaf,
                "does": each.action,
                "status": status,
                "way": nodes.get("/".join(each.path), []),
            }
            for each in tick.events
            if each.what in (RETURNED, HALTED)
            for status in ["halted" if each.what == HALTED else (each.status or "").lower()]
        ]
        written = {name: value_as_script(value) for name, value in sorted(values.items())}
        listed.append({"root": tick.root, "events": events, "values": written, "changed": [*changed]})
    return {"ticks": listed}


def _scenario(run: ScenarioRun, tree: str | None) -> Mapping[str, object]:
    """Return a scenario that repeats a run up to its end and expects the results of the run."""
    last = next((tick.number for tick in run.ticks if tick.root in _ENDED), len(run.ticks))
    ticks, labels = run.ticks[:last], leaf_labels(run.simulated.leaves)
    facts: dict[str, object] = dict(run.simulated.fact_values())
    for tick in reversed(run.ticks):
        facts |= {
            name: before if tick.number > last else after for name, (before, after) in tick.facts.items()
        }
    returned = [event for tick in ticks for event in tick.events if event.what == RETURNED]
    outcomes: dict[str, list[str]] = {}
    for event in returned:
        outcomes.setdefault(labels[event.number], []).append(event.outcome)
    root = ticks[-1].root
    order = [f"{labels[event.number]} {event.outcome}" for event in returned]
    return {
        "name": f"played: {root} after {len(ticks)} ticks",
        **({"tree": tree} if tree else {}),
        "ticks": len(ticks),
        "leaves": outcomes,
        "expect": {"ends": root in _ENDED, "root": root, "order": order, "facts": facts},
    }
