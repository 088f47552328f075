"""Queries for engineers on the page of a run: the blackboard, breakpoints, and the effect of other leaf outcomes."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from itertools import takewhile
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour

from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import RUN_BEGAN, STATUS, JournalEntry
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.recorded_events import recorded_events
from sar_compiler.reports.explanation import answer_for_matching_tree, candidate_trees
from sar_compiler.reports.report_files import report_page
from sar_compiler.runtime.blackboard import Entry, MissingEntryError
from sar_compiler.runtime.breakpoints import Breakpoints
from sar_compiler.runtime.events import Event
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.display_text import escape_to_one_line, shorten
from sar_compiler.views.numbered_tree import NumberedTree, TooManyNodesError
from sar_compiler.web.page_server import PageQuery, Tools

if TYPE_CHECKING:
    from sar_compiler.analysis.verify.counterfactual import WhatIfResult, WhatIfSearch
    from sar_compiler.ros.engine import Engine

# Breakpoints can pause a tree for this time after the last query of a browser, in seconds.
_PATIENCE_SEC = 10.0
# The maximum number of a run's entries that are stored for queries during the run.
_MAX_ENTRIES = 100_000
_NO_TREE = "the tree is not built yet, or the tree is too large for queries"


class ToolError(SarError):
    """A query is invalid, or it cannot be processed at the moment."""


class LiveTools:
    """The queries about a run in this process.

    Args:
        log: Called with a message about breakpoints, and with the reason for which the tree is paused; the reason is empty when the tree
            continues.
    """

    def __init__(self, log: Callable[[str, str], object]) -> None:
        self._log = log
        self._tree: NumberedTree | None = None
        self._behaviours: list[Behaviour] = []
        self._breakpoints = Breakpoints(self._log_breakpoint, _PATIENCE_SEC)
        self._use_breakpoints: Callable[[Breakpoints], object] | None = None
        self._entries: list[JournalEntry] = []
        self._what_if = WhatIf(lambda _robot, _run: self._entries)

    @property
    def tools(self) -> Tools:
        """The available queries."""
        return {
            "entries": PageQuery(self._blackboard),
            "breakpoints": PageQuery(self._change_breakpoints, is_free=False),
            # This query briefly takes processor time from the mission.
            "otherwise": PageQuery(self._what_if.query, is_free=False),
        }

    def begin(self, tree: CompiledTree, engine: "Engine") -> None:
        """Set the tree of the run, and the engine that ticks the tree."""
        with suppress(TooManyNodesError):
            self._begin(NumberedTree(tree), tree, engine)

    def _begin(self, numbered: NumberedTree, tree: CompiledTree, engine: "Engine") -> None:
        self._tree = numbered
        self._behaviours = [*pre_order(tree.root)]
        self._use_breakpoints = getattr(engine, "use_breakpoints", None)
        self._breakpoints.wake = getattr(engine, "wake", self._breakpoints.wake)

    def add_entry(self, entry: JournalEntry) -> None:
        """Store an entry of the run if queries need it."""
        if len(self._entries) < _MAX_ENTRIES and entry.kind in (RUN_BEGAN, STATUS):
            self._entries.append(entry)

    def release_abandoned(self) -> None:
        """Resume a paused tree if no browser has sent queries recently. Must be called regularly."""
        self._breakpoints.release_if_abandoned()

    def stop_pausing(self) -> None:
        """Remove all breakpoints, and resume the tree if it is paused."""
        self._breakpoints.clear()

    def _log_breakpoint(self, text: str) -> None:
        held = self._breakpoints.held_at
        where = (
            ""
            if held is None
            else f"The tree is paused at a breakpoint before '{held.name}'. If the robot is driving, it drives on."
        )
        self._log(text, where)

    def _blackboard(self, _: Mapping[str, Any]) -> object:
        if self._tree is None:
            raise ToolError(_NO_TREE)
        return [
            {"scope": path, "entries": [_entry_data(key, entry) for key, entry in [*scope.entries()]]}
            for path, scope in self._tree.scopes.items()
        ]

    def _change_breakpoints(self, values: Mapping[str, Any]) -> object:
        """Set or remove a breakpoint (`node`, `is_set`), or resume the tree (`goes_on`); return all breakpoints."""
        if self._tree is None:
            raise ToolError(_NO_TREE)
        self._breakpoints.keep_alive()
        if "node" in values:
            self._set(values["node"], is_set=bool(values.get("is_set")))
        held = self._breakpoints.held_at
        if values.get("goes_on") and held is not None:
            self._breakpoints.resume()
            held = None
        return {
            "nodes": [number for number, each in enumerate(self._behaviours) if each in self._breakpoints],
            "held": None if held is None else self._behaviours.index(held),
        }

    def _set(self, number: object, *, is_set: bool) -> None:
        if not (isinstance(number, int) and 0 <= number < len(self._behaviours)):
            raise ToolError(f"the tree has no node with the number {number}")
        if not is_set:
            self._breakpoints.remove(self._behaviours[number])
            return
        if self._use_breakpoints is None:
            raise ToolError("this engine cannot pause a tree within a tick. Omit --engine")
        self._use_breakpoints(self._breakpoints)
        self._breakpoints.add(self._behaviours[number])


def _entry_data(key: str, entry: Entry) -> dict[str, object]:
    try:
        value = entry.read()
    except MissingEntryError:  # the entry was never written, or a tick has removed it meanwhile
        return {"key": key, "value": None, "type": "", "writes": 0}
    try:
        text = escape_to_one_line(repr(value))
    except Exception as error:  # noqa: BLE001 - the value of a user's class, which may change meanwhile
        text = f"({error})"
    return {"key": key, "value": shorten(text), "type": type(value).__name__, "writes": entry.stamp}


class WhatIf:
    """Counterfactual queries about a recorded run: the effect of another outcome of a leaf.

    Args:
        entries: Returns the entries of a robot's run.
    """

    def __init__(self, entries: Callable[[int, int], Iterable[JournalEntry]]) -> None:
        self._entries = entries
        self._known: dict[tuple[object, ...], list[WhatIfSearch]] = {}
        self._lock = Lock()

    def query(self, values: Mapping[str, Any]) -> object:
        """Return the effect of every other outcome of a leaf, given the fields `robot`, `run`, `tick` and `node`.

        Raises:
            SarError: If the effects cannot be determined.
        """
        robot, run, node, tick = (int(values.get(name, 0)) for name in ("robot", "run", "node", "tick"))
        with self._lock:
            entries = [*self._entries(robot, run)]
            state = MissionState.from_stream(entries)
            if not (state.runs and 0 <= node < len(state.nodes)):
                raise ToolError("the tree of this run has no such node")

            def record() -> "Iterator[Event]":
                return takewhile(lambda each: each.tick <= tick, recorded_events(entries))

            found = answer_for_matching_tree(
                self._searches(state), lambda each: each.consequences(record(), node)
            )
        names = [each.name for each in state.nodes]
        looks = state.runs[-1].about.get("looks") or []
        return [_consequence_data(each, names, looks) for each in found]

    def _searches(self, state: MissionState) -> "list[WhatIfSearch]":
        from sar_compiler.analysis.verify.counterfactual import WhatIfSearch
        from sar_compiler.project import Workspace

        about, began = state.runs[-1].about, state.runs[-1].began
        if (key := (about.get("tree_file"), about.get("tree_id"), began)) not in self._known:
            names = [each.name for each in state.nodes]
            trees = candidate_trees(state, Workspace())
            self._known = {key: [WhatIfSearch(tree, names) for tree in trees]}
        return self._known[key]


def journal_tools(paths: Sequence[Path], reading: AbstractContextManager[object] | None = None) -> Tools:
    """Return the queries for a page of journals.

    Args:
        paths: The journals, one for each robot.
        reading: A context manager that is entered while a journal is read; None if it is not necessary.
    """
    exclusive = reading or nullcontext()

    def journal_of(robot: int) -> Path:
        if not 0 <= robot < len(paths):
            raise ToolError("this page has no such robot")
        return paths[robot]

    def report_values(values: Mapping[str, Any]) -> str:
        with exclusive:
            return report_page(journal_of(values["robot"]))

    def entries(robot: int, run: int) -> Iterable[JournalEntry]:
        with exclusive, JournalFile.open_snapshot(journal_of(robot)) as file:
            return [each for each in file.stream() if each.run == run and each.kind in (RUN_BEGAN, STATUS)]

    return {"otherwise": PageQuery(WhatIf(entries).query), "report": PageQuery(report_values)}


def _consequence_data(found: "WhatIfResult", names: Sequence[str], looks: Sequence[Any]) -> dict[str, object]:
    """Convert the effect of an outcome to JSON values, leaving out conditions that succeed."""

    def is_reported(event: Event) -> bool:
        look = looks[event.number] if event.number < len(looks) else None
        return event.status != "SUCCESS" or look != ["condition", ""]

    return {
        "instead": {"status": found.instead.status, "label": found.instead.label},
        "then": [f"{names[each.number]} {each.outcome}" for each in filter(is_reported, found.then)],
        "root": found.root,
    }
