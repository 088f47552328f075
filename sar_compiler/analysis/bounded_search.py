"""Searches the runs of a tree for ticks that raise errors, within a budget.

Shorter runs are searched first.
"""

import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.tick_steps import TickSteps
from sar_compiler.analysis.verify.properties import without_properties
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.checks.rules.entry_accesses import key_accesses_of
from sar_compiler.nodes.binding.bound import Binding, BoundNode, BoundTree
from sar_compiler.nodes.binding.nesting import check_size_limits
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.runtime.blackboard import ROOT_SIGN, MissingEntryError
from sar_compiler.runtime.events import Event
from sar_compiler.runtime.ports import PortError
from sar_compiler.runtime.scripting import NodeScriptError
from sar_compiler.runtime.variables import UnknownVariableError, unknown_value_of
from sar_compiler.tree.diagnostic import Diagnostic, Severity, Span

_MAX_LISTED = 4
"""The maximum number of ticks that are listed for a run."""

_MAX_FOUND = 8
"""The maximum number of locations in a tree at which errors are reported."""

_TICK_COST, _NODE_COST = 200, 4000
"""The fixed cost of a tick, and the cost of preparing one node. A tick also costs 1 for each node of the tree."""


class SearchBudget:
    """A limit on the amount of work and on the processor time of a search.

    Work is counted in ticked nodes. A tick also has a fixed cost, and preparing a tree costs as much as many ticks.

    Args:
        work: The maximum amount of work; None for no limit.
        seconds: The maximum processor time, in seconds; None for no limit.
        is_spent: Returns whether the search must stop for another reason.

    Attributes:
        spent: The amount of work so far.
        is_cut: Whether `is_spent` has stopped the search.
        is_limited: Whether the work or the time was not enough for the whole search.
    """

    def __init__(
        self, work: int | None, seconds: float | None = None, is_spent: Callable[[], bool] = lambda: False
    ) -> None:
        self.spent = 0
        self.is_cut = self.is_limited = False
        self._is_spent = is_spent
        self._work = self._share = work
        self._end = None if seconds is None else time.process_time() + seconds
        self._end_of_share = self._end

    def allot(self, trees: int) -> None:
        """Allot a share of the remaining budget to the next tree, given the number of remaining trees."""
        if self._work is not None:
            self._share = self.spent + (self._work - self.spent) // trees
        if self._end is not None:
            now = time.process_time()
            self._end_of_share = now + (self._end - now) / trees

    def charge(self, work: int) -> bool:
        """Charge an amount of work to the budget; return False if the budget is exhausted."""
        if self._share is not None and self.spent + work > self._share:
            self.is_limited = True
            return False
        self.spent += work
        self.is_cut = self.is_cut or self._is_spent()
        if self.is_cut:
            return False
        self.is_limited = self._end_of_share is not None and time.process_time() >= self._end_of_share
        return not self.is_limited


class LocatedName(str):
    """A node name with a reference to its node, so that errors can be located in the tree file."""

    __slots__ = ("bound",)
    bound: BoundNode


def mark(binding: Binding) -> None:
    """Replace the node names of a bound tree by names with references to their nodes."""
    for bound in binding.all_nodes():
        name = LocatedName(bound.name)
        name.bound = bound
        bound.name = name


class _Raised(NamedTuple):
    """An error, and the ticks that lead to it.

    Each tick has its start state and a function that recognises the tick.
    """

    error: Exception
    ticks: list[tuple[bytes, Callable[[TickSteps], bool]]]


def can_prepare(binding: Binding, budget: SearchBudget) -> bool:
    """Charge the cost of preparing a tree to the budget, and return whether the budget was sufficient."""
    nodes = check_size_limits(binding.main, FindingCollector())
    return nodes is not None and budget.charge(nodes * _NODE_COST)


def findings_of_runs(
    simulated: SimulatedTree,
    binding: Binding,
    budget: SearchBudget,
    how_to_see: str,
    known: Iterable[Diagnostic],
) -> list[Diagnostic]:
    """Return a finding for each location at which a tick raises an error, with the shortest run that leads to the error.

    Args:
        simulated: The tree with stub leaves; not usable afterwards.
        binding: The same tree as a bound tree, processed by `mark`.
        budget: The search budget.
        how_to_see: The command that shows the run of a finding.
        known: The findings of the rules; errors with the same cause are not reported again.

    Raises:
        UndecidableError: If the ticks of the tree cannot be enumerated.
    """
    stepper = TreeStepper(PreparedTree.prepare(simulated), without_properties().rules)
    cost = _TICK_COST + len(stepper.flat.nodes)
    doubts, mistaken = _SimulationDoubts(binding), FaultyAttributes(binding, known)

    def place_of(error: Exception) -> tuple[str, Span] | None:
        if doubts.is_doubtful(error):
            return None
        place = _faulty_node(error, binding)
        if mistaken.explains(place, getattr(error, "attribute", "") or getattr(error, "port", "")):
            return None
        return place.element.source.path, _error_span(error, place)

    described = {bound.name for bound in binding.all_nodes() if bound.spec.is_only_described}
    found = []
    for raised in _search(stepper.steps, lambda: budget.charge(cost), place_of):
        ticks = [
            [event for event in stepper.play(state, wanted).events if event.outcome]
            for state, wanted in raised.ticks
        ]
        is_sure = not simulated.by_semantics and not any(
            event.leaf in described for events in ticks for event in events
        )
        place = _faulty_node(raised.error, binding)
        message = f"{simulated.explain(raised.error)} ({_run_text(ticks)})"
        severity = Severity.ERROR if is_sure else Severity.WARNING
        source, span = place.element.source, _error_span(raised.error, place)
        hint = f"{how_to_see} shows the run tick by tick"
        found.append(Diagnostic("failing-tick", message, source, span, hint=hint, severity=severity))
    return found


def _search(
    steps: TickSteps, charge_tick: Callable[[], bool], place_of: Callable[[Exception], object]
) -> list[_Raised]:
    """Search breadth first, and return for each location the first tick that raises an error there.

    States in which the run is over are not expanded.

    Args:
        steps: The possible ticks of the tree.
        charge_tick: Charges a tick to the budget, and returns whether the search may continue.
        place_of: Returns the location of an error; None if the error is ignored.
    """
    start = steps.start()
    origins: dict[bytes, bytes | None] = {start: None}
    waiting = deque([start])
    found: dict[object, _Raised] = {}
    while waiting and len(found) < _MAX_FOUND:
        state = waiting.popleft()
        if steps.judge(state, None).ends:
            continue
        steps.enter(state, alone=True)
        while steps.step():
            if not charge_tick():
                return [*found.values()]
            if steps.error is not None:
                place = place_of(steps.error)
                if place is not None and place not in found:
                    ticks = [*_path_to_state(origins, state), (state, _has_path(steps.path()))]
                    found[place] = _Raised(steps.error, ticks)
            elif steps.state is not None and steps.state not in origins:
                origins[steps.state] = state
                waiting.append(steps.state)
    return [*found.values()]


def _path_to_state(
    origins: dict[bytes, bytes | None], state: bytes
) -> list[tuple[bytes, Callable[[TickSteps], bool]]]:
    path: list[tuple[bytes, Callable[[TickSteps], bool]]] = []
    before = origins[state]
    while before is not None:
        path.append((before, _leads_to(state)))
        state, before = before, origins[before]
    return path[::-1]


def _leads_to(end: bytes) -> Callable[[TickSteps], bool]:
    return lambda steps: steps.state == end


def _has_path(path: tuple[int, ...]) -> Callable[[TickSteps], bool]:
    return lambda steps: steps.path() == path


def _run_text(ticks: list[list[Event]]) -> str:
    """Describe a run by listing the outcomes of its last ticks."""
    if not any(ticks):
        return f"in tick {len(ticks)}"
    last = list(enumerate(ticks, 1))[-_MAX_LISTED:]
    outcomes = {
        number: ", ".join(f"'{each.leaf}' {each.status}" for each in events) for number, events in last
    }
    if len(ticks) == 1:
        return f"in tick 1: {outcomes[1]}"
    listed = (f"tick {number}: {words}" for number, words in outcomes.items() if words)
    return f"in tick {len(ticks)}: {', '.join(listed)}"


class _SimulationDoubts:
    """Detects errors that real runs might not raise, because values missing in the simulation cause them."""

    def __init__(self, binding: Binding) -> None:
        accesses = [access for tree in binding.used_trees() for access in key_accesses_of(tree).accesses]
        self._all = {access.key for access in accesses}
        writing = (AccessKind.WRITE, AccessKind.BOTH)
        self._written = {access.key for access in accesses if access.kind in writing}

    def is_doubtful(self, error: Exception) -> bool:
        """Return whether real runs might not raise an error."""
        return unknown_value_of(error) is not None or any(
            key not in self._written or f"{ROOT_SIGN}{key}" in self._all for key in _empty_keys(error)
        )


def _empty_keys(error: BaseException | None) -> Iterator[str]:
    while error is not None:
        if isinstance(error, UnknownVariableError):
            yield error.name
        elif isinstance(error, MissingEntryError):
            yield error.key
        error = error.__cause__


def _faulty_node(error: Exception, binding: Binding) -> BoundNode:
    for name in (getattr(error, "node", None), *_names_of_raising(error)):
        if isinstance(name, LocatedName):
            return name.bound
    if isinstance(error, PortError):
        reading = [bound for bound in binding.all_nodes() if error.port in bound.keys]
        if reading:
            return next((each for each in reading if each.keys[error.port] == error.source), reading[0])
    assert binding.main.root is not None  # noqa: S101 - a tree without a root has errors
    return binding.main.root


def _names_of_raising(error: Exception) -> list[object]:
    """Return the `name` of each object whose method is in an error's traceback, the innermost first."""
    calls = [frame.f_locals for frame, _ in traceback.walk_tb(error.__traceback__)]
    return [getattr(call.get("self"), "name", None) for call in reversed(calls)]


def _error_span(error: Exception, place: BoundNode) -> Span:
    element = place.element
    if isinstance(error, NodeScriptError) and error.attribute in element.attributes:
        if error.start is None or error.end is None:
            return element.value_span(error.attribute)
        return element.value_part_span(error.attribute, error.start, error.end)
    port = getattr(error, "port", "")
    return element.value_span(port) if port in element.attributes else element.tag_span()


_CODES = frozenset({"assignment-as-condition", "idle-statement", "touching-statements", "key-as-text"})
_WRITING = (AccessKind.WRITE, AccessKind.CHANGE)


class FaultyAttributes:
    """The attributes of a bound tree that have findings, and the keys that receive the values of these attributes.

    Args:
        binding: The bound tree.
        findings: The findings of the rules.
    """

    def __init__(self, binding: Binding, findings: Iterable[Diagnostic]) -> None:
        self._trees = {bound: tree for tree in binding.used_trees() for bound in tree.nodes}
        relevant = [each for each in findings if each.code in _CODES]
        self._attributes = {
            (bound, attribute) for bound in self._trees for attribute in _attributes_of(bound, relevant)
        }
        self._keys = {key for place in self._attributes for key in self._written_attributes(*place)}
        links = [*self._links()]
        before = -1
        while before != len(self._keys):  # keys are passed on to subtrees of subtrees
            before = len(self._keys)
            self._keys |= {inner for outer, inner in links if outer in self._keys}

    def explains(self, bound: BoundNode, attribute: str) -> bool:
        """Return whether a faulty attribute explains an error. An empty *attribute* stands for the whole node."""
        return (bound, attribute) in self._attributes or any(
            (tree, key) in self._keys for tree, key, _ in self._accesses(bound, attribute)
        )

    def _written_attributes(self, bound: BoundNode, attribute: str) -> Iterator[tuple[BoundTree, str]]:
        if bound.subtree is not None and attribute in bound.remapping.constants:
            yield bound.subtree, attribute
        yield from ((tree, key) for tree, key, kind in self._accesses(bound, attribute) if kind in _WRITING)

    def _accesses(self, bound: BoundNode, attribute: str) -> Iterator[tuple[BoundTree, str, AccessKind]]:
        tree = self._trees[bound]
        for each in key_accesses_of(tree).accesses if self._attributes else ():
            if each.bound is bound and attribute in ("", each.attribute):
                yield tree, each.key, each.kind

    def _links(self) -> Iterator[tuple[tuple[BoundTree, str], tuple[BoundTree, str]]]:
        """Yield each key that is passed to a subtree, together with the corresponding key inside the subtree."""
        for tree in dict.fromkeys(self._trees.values()):
            for use in tree.uses:
                if use.subtree is not None:
                    for inner, outer in use.remapping.keys.items():
                        yield (tree, outer), (use.subtree, inner)


def _attributes_of(bound: BoundNode, findings: list[Diagnostic]) -> Iterator[str]:
    element = bound.element
    for finding in findings:
        if finding.source.path == element.source.path and finding.span.line >= element.line:
            for attribute in element.attributes:
                span = element.value_span(attribute)
                if span[:2] <= finding.span[:2] and finding.span[2:] <= span[2:]:
                    yield attribute
