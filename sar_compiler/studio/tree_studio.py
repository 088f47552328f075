"""The questions of the editor's page about a tree file; values and results are JSON values.

Each question comes with the present text, so nothing here is a second document. Offsets in results count UTF-16 units, as
JavaScript does.
"""

import bisect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from sar_compiler.analysis.simulated import simulate_tree
from sar_compiler.analysis.tree_analysis import verify_tree
from sar_compiler.checks.fixing import each_fix
from sar_compiler.editing.names import name_at, renamed
from sar_compiler.editing.operations import edits_of
from sar_compiler.editing.text_edits import EditError, TextEdit
from sar_compiler.errors import SarError
from sar_compiler.missions.tree_check import check_mission
from sar_compiler.nodes.registry import subtree
from sar_compiler.nodes.spec import NodeSpec, Parameter, ParameterRole
from sar_compiler.opener import TREE, read_file
from sar_compiler.project import CommandLineSettings, ProjectTree, Workspace
from sar_compiler.runtime.events import ANSWERED, HALTED, TickRecord
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.content import real_path
from sar_compiler.tree.diagnostic import Diagnostic, TreeError
from sar_compiler.tree.discovery import parse_tree
from sar_compiler.tree.model import Element, TreeFile
from sar_compiler.views.drawing import svg

MOST_STATES = 20_000
"""The most states of a proof on the page."""
_MOST_TICKS = 1000


class Studio:
    """Answers the page about one file.

    Args:
        path: The file.
        additions: The user's additions to its project's configuration.
        max_states: The most states of a proof.
    """

    def __init__(
        self,
        path: Path,
        additions: CommandLineSettings = CommandLineSettings(),  # noqa: B008 - immutable
        max_states: int = MOST_STATES,
    ) -> None:
        self.path = path
        self._max_states = max_states
        self._additions = additions
        self._text = ""
        self._tree: ProjectTree | None = None
        self.questions: Mapping[str, Callable[..., object]] = {
            "look": self.examine,
            "edit": self.edit,
            "rename": self.rename,
            "palette": self.palette,
            "verify": self.verify,
            "play": self.play_ticks,
        }

    def answer(self, question: str, values: Mapping[str, Any]) -> object:
        """Return the answer to a question of the page; `error` in it says why there is none.

        Args:
            question: Its name in `questions`.
            values: Its arguments; `text` is the present text of the file.
        """
        function = self.questions.get(question)
        if function is None:
            return {"error": f"there is no question '{question}'"}
        try:
            return function(**values)
        except SarError as error:
            findings = error.findings if isinstance(error, TreeError) else ()
            return {"error": findings[0].message if findings else str(error)}

    def examine(self, text: str, tree: str | None = None) -> object:
        """Return the findings about the file, its elements, and the drawing of a tree, if it can be parsed.

        Args:
            text: The text.
            tree: The ID of the tree to draw; by default the one that the file executes.
        """
        loaded, offset = self._load(text), _utf16_offsets(text)
        findings = loaded.check()
        parsed = loaded.tree_file if not loaded.is_malformed else None
        told: dict[str, Any] = {"findings": self._findings(loaded, parsed, findings, offset)}
        if parsed is None:
            return told
        ids = [each.attributes.get("ID", "") for each in parsed.trees]
        shown = tree if tree in ids else None
        elements = [*parsed.root.iterate()]
        numbers = {each.place: number for number, each in enumerate(elements)}
        told |= {"trees": ids, "keys": _keys(loaded), "elements": _elements(elements, numbers, offset)}
        try:
            sketch = loaded.sketch(shown)
        except TreeError:
            return told
        bound = [sketch.origins[each.id].bound.element for each in pre_order(sketch.root)]
        nodes = [numbers.get(each.place) if each.source is loaded.source else None for each in bound]
        return {**told, "svg": svg(sketch, is_styled=False), "nodes": nodes, "tree": shown or sketch.name}

    def edit(self, text: str, operation: str, arguments: Mapping[str, Any]) -> object:
        """Return the edits of an operation of `editing.operations`."""
        edits = edits_of(parse_tree(text, str(self.path)), operation, **arguments)
        return {"edits": _edits(text, edits)}

    def rename(self, text: str, offset: int, name: str) -> object:
        """Return the edits that rename the tree or the key at an offset of the text, everywhere in it.

        Raises:
            EditError: If there is no name, or it is also used in other files.
        """
        loaded = self._load(text)
        meant = name_at(loaded, offset)
        if meant is None:
            message = "there is no name of a tree or of a key here"
            raise EditError(message)
        spots = renamed(meant, name)
        other = next((each.source.path for each, _ in spots if each.source is not loaded.source), None)
        if other is not None:
            message = f"'{meant.name}' is also used in {other}. Rename it in an editor with sar-compile lsp"
            raise EditError(message)
        edits = [TextEdit(*each.source.offsets(each.span), new) for each, new in spots]
        return {"edits": _edits(text, edits)}

    def palette(self, text: str) -> object:
        """Return the nodes that can be inserted, with their attributes."""
        registry = self._load(text).context.registry
        specs = [variants[0] for variants in registry.by_tag().values()]
        return {"nodes": [_spec(each) for each in (*specs, subtree())]}

    def verify(self, text: str, tree: str | None = None) -> object:
        """Return the verdicts of a proof, with a counterexample of each violated property."""
        loaded = self._load(text)
        proof = verify_tree(loaded, tree_id=tree, max_states=self._max_states)
        nodes = _paths(loaded, tree)
        verdicts = [
            {
                "question": each.question,
                "verdict": each.outcome.value,
                "reason": each.reason,
                "ticks": _ticks(each.trace.ticks, nodes) if each.trace else [],
                "loop": each.trace.loop if each.trace else 0,
            }
            for each in proof.verdicts
        ]
        return {"states": proof.states, "complete": proof.complete, "verdicts": verdicts}

    def play_ticks(
        self,
        text: str,
        tree: str | None = None,
        ticks: int = 6,
        leaves: Mapping[str, Iterable[str]] | None = None,
    ) -> object:
        """Return the first ticks of a run.

        Args:
            text: The text.
            tree: The tree; by default the one that the file executes.
            ticks: The number of ticks.
            leaves: The outcomes of leaves, one after the other, by the names of the leaves; others have their usual ones.
        """
        loaded = self._load(text)
        chosen = {name: list(each) for name, each in (leaves or {}).items()}
        script = {"leaves": chosen, **({"tree": tree} if tree else {})}
        run = simulate_tree(loaded, script).tick(min(ticks, _MOST_TICKS)).run
        return {"ticks": _ticks(run.ticks, _paths(loaded, tree))}

    def _load(self, text: str) -> ProjectTree:
        """Return the file in its present state; other files are read from the disk."""
        if self._tree is None or text != self._text:
            own = real_path(self.path)

            def read(path: Path) -> TreeFile:
                is_own = real_path(path) == own
                return parse_tree(text if is_own else read_file(path, TREE).data, str(path))

            workspace = Workspace(self._additions, read, further_checks=[check_mission])
            self._tree, self._text = workspace.load_file(self.path), text
        return self._tree

    def _findings(
        self,
        loaded: ProjectTree,
        parsed: TreeFile | None,
        findings: Iterable[Diagnostic],
        offset: Callable[[int], int],
    ) -> list[object]:
        source, told = loaded.source, list(findings)
        fixes = {id(each.finding): each for each in each_fix(source, parsed, told, lambda _finding: True)}
        listed: list[object] = []
        for each in told:
            fix = fixes.get(id(each))
            is_own = each.source.path == source.path and each.source.text == source.text
            start, end = each.source.offsets(each.span) if is_own else (0, 0)
            listed.append(
                {
                    "from": offset(start),
                    "to": offset(end),
                    "line": each.span.line,
                    "column": each.span.column,
                    "file": "" if is_own else each.source.path,
                    "severity": each.severity.value,
                    "code": each.code,
                    "message": each.message,
                    "advice": each.advice,
                    "fix": fix and _edit(TextEdit(fix.start, fix.end, fix.text), offset),
                }
            )
        return listed


def _utf16_offsets(text: str) -> Callable[[int], int]:
    """Return the function from offsets in Python to those in JavaScript."""
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
        child.place: (number, index)
        for number, each in enumerate(elements)
        for index, child in enumerate(each.children)
    }
    listed: list[object] = []
    for each in elements:
        start, end = each.source.spans.tag(each)
        parent, index = parents.get(each.place, (None, 0))
        listed.append(
            {
                "from": offset(start),
                "to": offset(end),
                "tag": each.tag,
                "attributes": dict(each.attributes),
                "parent": parent,
                "index": index,
                "children": [numbers[child.place] for child in each.children],
            }
        )
    return listed


def _keys(loaded: ProjectTree) -> list[str]:
    return sorted({key for each in loaded.context.key_accesses.values() for key in each.keys})


def _spec(spec: NodeSpec) -> object:
    low, high = spec.child_count
    return {
        "tag": spec.tag,
        "kind": spec.kind.value,
        "doc": spec.doc,
        "least": low,
        "most": high,
        "attributes": [_parameter(each) for each in spec.attributes],
    }


def _parameter(parameter: Parameter) -> object:
    return {
        "name": parameter.name,
        "doc": parameter.help,
        "required": parameter.required,
        "choices": list(parameter.value_type.choices),
        "takes_key": parameter.direction is not None,
        "is_reference": parameter.role is ParameterRole.REFERENCE,
    }


def _paths(loaded: ProjectTree, tree: str | None) -> dict[str, list[int]]:
    """Return the nodes of the drawing from the root to each node, by its path; wrappers of a node are in no path."""
    compiled = loaded.preview(tree)
    bound = {each.id: compiled.origins[each.id].bound for each in pre_order(compiled.root)}
    ways: dict[object, list[int]] = {None: []}
    paths: dict[object, list[str]] = {None: []}
    for number, each in enumerate(pre_order(compiled.root)):
        above = None if each is compiled.root or each.parent is None else each.parent.id
        is_wrapper = any(bound[child.id] is bound[each.id] for child in each.children)
        ways[each.id] = [*ways[above], number]
        paths[each.id] = paths[above] + ([] if is_wrapper else [each.name])
    return {"/".join(paths[each]): ways[each] for each in bound}


def _ticks(ticks: Iterable[TickRecord], nodes: Mapping[str, list[int]]) -> list[object]:
    """Return the events of each tick, with the nodes of the drawing that they concern."""
    return [
        {
            "root": tick.root,
            "events": [
                {
                    "leaf": event.leaf,
                    "does": event.deed,
                    "status": "halted" if event.what == HALTED else (event.status or "").lower(),
                    "way": nodes.get("/".join(event.path), []),
                }
                for event in tick.events
                if event.what in (ANSWERED, HALTED)
            ],
        }
        for tick in ticks
    ]
