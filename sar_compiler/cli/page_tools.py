"""What engineers can ask on the page of a run: the blackboard, breakpoints, and what another answer would have led to."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from itertools import takewhile
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from sar_compiler.cli.journal_why import first_that_fits, trees_that_ran
from sar_compiler.cli.run_report import report_page
from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.recorded_events import recorded_events
from sar_compiler.monitoring.groot2_hooks import Groot2Hooks, HookMode, HookPosition
from sar_compiler.monitoring.numbered_tree import NumberedTree, TooManyNodesError
from sar_compiler.runtime.blackboard import Entry, MissingEntryError
from sar_compiler.runtime.events import Event
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.showing import in_one_line, shortened
from sar_compiler.web.page_server import Tool, Tools

if TYPE_CHECKING:
    from sar_compiler.checks.verify.counterfactual import Consequence, Retrospect
    from sar_compiler.ros.engine import Engine

# How long breakpoints hold a tree after the last browser has asked for them, in seconds.
_PATIENCE_SEC = 10.0
# So many entries of a run are kept for questions while it goes on.
_MOST_ENTRIES = 100_000
_NO_TREE = "the tree is not made yet, or is too large to be asked"


class ToolError(SarError):
    """Something that cannot be asked, or not just now."""


class LiveTools:
    """The tools of a run in this process.

    Args:
        tell: Called with what breakpoints do, in words, and where the tree is held by one, empty where it goes on.
        may_hold: Whether the page may hold the tree.
    """

    def __init__(self, tell: Callable[[str, str], object], *, may_hold: bool) -> None:
        self._tell, self._may_hold = tell, may_hold
        self._tree: NumberedTree | None = None
        self._uids: list[int] = []
        self._hooks: Groot2Hooks | None = None
        self._hook: Callable[[Groot2Hooks], object] | None = None
        self._entries: list[JournalEntry] = []
        self._what_if = WhatIf(lambda _robot, _run: self._entries)

    @property
    def tools(self) -> Tools:
        """What can be asked."""
        return {
            "entries": Tool(self._blackboard),
            "breakpoints": Tool(self._breakpoints, is_free=False),
            # It takes the processor from the mission for a moment.
            "otherwise": Tool(self._what_if.ask, is_free=False),
        }

    def begin(self, tree: CompiledTree, engine: "Engine") -> None:
        """Take the tree, and what ticks it."""
        with suppress(TooManyNodesError):
            self._begin(NumberedTree(tree), tree, engine)

    def _begin(self, numbered: NumberedTree, tree: CompiledTree, engine: "Engine") -> None:
        self._tree = numbered
        self._uids = [numbered.uid_of_inner(each) or numbered.uid(each) for each in pre_order(tree.root)]
        hooks = Groot2Hooks(numbered, lambda _: None, self._said, _PATIENCE_SEC, "A breakpoint")
        self._hook = getattr(engine, "hook", None)
        hooks.wake = getattr(engine, "wake", hooks.wake)
        self._hooks = hooks

    def take(self, entry: JournalEntry) -> None:
        """Take an entry of the run."""
        if len(self._entries) < _MOST_ENTRIES and entry.kind in ("run_began", "status"):
            self._entries.append(entry)

    def look(self) -> None:
        """Let a held tree go on where nobody looks any more; called now and then."""
        if self._hooks is not None:
            self._hooks.look()

    def end(self) -> None:
        """Hold the tree no more."""
        if self._hooks is not None:
            self._hooks.remove_all()

    def _said(self, text: str) -> None:
        held = self._hooks.held if self._hooks is not None else None
        place = self._tree.nodes[held.uid - 1].name if held is not None and self._tree is not None else ""
        self._tell(
            text,
            f"The tree is held at a breakpoint before '{place}'. A drive under way goes on." if place else "",
        )

    def _blackboard(self, _: Mapping[str, Any]) -> object:
        if self._tree is None:
            raise ToolError(_NO_TREE)
        return [
            {"scope": path, "entries": [_shown(key, entry) for key, entry in [*scope.entries()]]}
            for path, scope in self._tree.scopes.items()
        ]

    def _breakpoints(self, values: Mapping[str, Any]) -> object:
        """Set a breakpoint at a node (`node`, `is_set`), or go on (`goes_on`); return where they are, and which holds the tree."""
        if self._hooks is None:
            raise ToolError(_NO_TREE)
        self._hooks.heard()
        if "node" in values:
            self._set(self._hooks, values["node"], is_set=bool(values.get("is_set")))
        held = self._hooks.held
        if values.get("goes_on") and held is not None:
            place = {"uid": held.uid, "position": int(held.position)}
            self._hooks.unlock(json.dumps({**place, "desired_status": "", "remove_when_done": False}))
            held = None
        uids = {each["uid"] for each in json.loads(self._hooks.dump())}
        return {
            "nodes": [number for number, uid in enumerate(self._uids) if uid in uids],
            "held": None if held is None else self._uids.index(held.uid),
        }

    def _set(self, hooks: Groot2Hooks, number: object, *, is_set: bool) -> None:
        if not (isinstance(number, int) and 0 <= number < len(self._uids) and self._uids[number]):
            raise ToolError(f"there is no node {number} that can be held")
        place = {"uid": self._uids[number], "position": int(HookPosition.BEFORE)}
        if not is_set:
            hooks.remove(json.dumps(place))
            return
        if not self._may_hold or self._hook is None:
            raise ToolError("what ticks this tree is not held here: leave --groot2-hooks and --engine out")
        self._hook(hooks)
        hook = {**place, "mode": int(HookMode.BREAKPOINT), "once": False, "desired_status": "SKIPPED"}
        hooks.insert(json.dumps({**hook, "enabled": True}))


def _shown(key: str, entry: Entry) -> dict[str, object]:
    try:
        value = entry.read()
    except MissingEntryError:  # never written, or removed by the tick meanwhile
        return {"key": key, "value": None, "type": "", "writes": 0}
    try:
        text = in_one_line(repr(value))
    except Exception as error:  # noqa: BLE001 - a foreign value; it may change meanwhile
        text = f"({error})"
    return {"key": key, "value": shortened(text), "type": type(value).__name__, "writes": entry.stamp}


class WhatIf:
    """What another answer of a leaf would have led to, in a run that was recorded.

    Args:
        entries: Returns the entries of a robot's run.
    """

    def __init__(self, entries: Callable[[int, int], Iterable[JournalEntry]]) -> None:
        self._entries = entries
        self._known: dict[tuple[object, ...], list[Retrospect]] = {}
        self._lock = Lock()

    def ask(self, values: Mapping[str, Any]) -> object:
        """Return what each other answer of a leaf (`node`) in a tick (`tick`) of a run (`run`) of a robot would have led to.

        Raises:
            SarError: If that cannot be said.
        """
        robot, run, node, tick = (int(values.get(name, 0)) for name in ("robot", "run", "node", "tick"))
        with self._lock:
            entries = [*self._entries(robot, run)]
            state = MissionState.of(entries)
            if not (state.runs and 0 <= node < len(state.nodes)):
                raise ToolError("there is no such node in this run")

            def record() -> "Iterator[Event]":
                return takewhile(lambda each: each.tick <= tick, recorded_events(entries))

            found = first_that_fits(self._retrospects(state), lambda each: each.consequences(record(), node))
        names = [each.name for each in state.nodes]
        looks = state.runs[-1].about.get("looks") or []
        return [_consequence_data(each, names, looks) for each in found]

    def _retrospects(self, state: MissionState) -> "list[Retrospect]":
        from sar_compiler.checks.verify.counterfactual import Retrospect
        from sar_compiler.project import Workspace

        about, began = state.runs[-1].about, state.runs[-1].began
        if (key := (about.get("tree_file"), about.get("tree_id"), began)) not in self._known:
            names = [each.name for each in state.nodes]
            trees = trees_that_ran(state, Workspace())
            self._known = {key: [Retrospect(tree, names) for tree in trees]}
        return self._known[key]


def journal_tools(paths: Sequence[Path], reading: AbstractContextManager[object] | None = None) -> Tools:
    """Return the tools of a page of journals.

    Args:
        paths: The journals.
        reading: Is entered while one is read; by default nothing is.
    """
    alone = reading or nullcontext()

    def journal_of(robot: int) -> Path:
        if not 0 <= robot < len(paths):
            raise ToolError("there is no such robot")
        return paths[robot]

    def report(values: Mapping[str, Any]) -> str:
        with alone:
            return report_page(journal_of(values["robot"]))

    def entries(robot: int, run: int) -> Iterable[JournalEntry]:

        with alone, JournalFile.reading(journal_of(robot)) as file:
            return [
                each for each in file.stream() if each.run == run and each.kind in ("run_began", "status")
            ]

    return {"otherwise": Tool(WhatIf(entries).ask), "report": Tool(report)}


def _consequence_data(found: "Consequence", names: Sequence[str], looks: Sequence[Any]) -> dict[str, object]:
    """Return what an answer leads to as JSON values; conditions that say nothing special are left out."""

    def is_told(answer: Event) -> bool:
        look = looks[answer.number] if answer.number < len(looks) else None
        return answer.status != "SUCCESS" or look != ["condition", ""]

    return {
        "instead": {"status": found.instead.status, "label": found.instead.label},
        "then": [f"{names[each.number]} {each.answer}" for each in filter(is_told, found.then)],
        "root": found.root,
    }
