"""Trying the runs of a tree, shortest first, until a tick raises or there were enough ticks."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

from sar_compiler.checks.rules.key_accesses import key_accesses_of
from sar_compiler.checks.verify.properties import without_properties
from sar_compiler.checks.verify.state import Prepared
from sar_compiler.checks.verify.stepping import TreeStepper
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.nodes.binding.bound import Binding, BoundNode
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.runtime.blackboard import ROOT_SIGN, MissingEntryError
from sar_compiler.runtime.kernel.tick_steps import TickSteps
from sar_compiler.runtime.ports import PortError
from sar_compiler.runtime.scripting import NodeScriptError
from sar_compiler.runtime.stub_leaf import Event
from sar_compiler.runtime.variables import UnknownVariableError
from sar_compiler.tree.diagnostic import Diagnostic, Severity
from sar_compiler.tree.source import Span

_MOST_TOLD = 4
"""The most ticks of a run that are told."""


class TrialBudget:
    """How much may be tried: a number of ticks, which is the same on every machine, or a time.

    Args:
        ticks: The number of ticks; None for any number.
        seconds: The processor time; None for any.

    Attributes:
        spent: The ticks so far.
    """

    def __init__(self, ticks: int | None, seconds: float | None = None) -> None:
        self.spent = 0
        self._ticks = ticks
        self._end = None if seconds is None else time.process_time() + seconds

    def take(self) -> bool:
        """Take one tick; return False if there is none left."""
        self.spent += 1
        if self._ticks is not None and self.spent > self._ticks:
            return False
        return self._end is None or time.process_time() < self._end


class NameInTree(str):
    """The name of a node, by which what it raises is found in the file."""

    __slots__ = ("bound",)
    bound: BoundNode


def mark(binding: Binding) -> None:
    """Have errors of a bound tree's nodes name the nodes themselves."""
    for bound in binding.nodes():
        name = NameInTree(bound.name)
        name.bound = bound
        bound.name = name


class _Raised(NamedTuple):
    """What a tick raises, and the ticks up to that one, each as the state before it and its choices."""

    error: Exception
    ticks: list[tuple[bytes, Callable[[TickSteps], bool]]]


def finding_of_runs(simulated: SimulatedTree, binding: Binding, budget: TrialBudget) -> list[Diagnostic]:
    """Return the finding about a shortest run in which a tick raises; nothing if none was found in time.

    Args:
        simulated: The tree with stub leaves; it is used up.
        binding: The same tree, whose nodes are marked.
        budget: How much may be tried.

    Raises:
        UndecidableError: If the ticks of the tree cannot be gone through.
    """
    stepper = TreeStepper(Prepared.of(simulated), without_properties().rules)
    raised = _search(stepper.steps, budget, _Doubts(simulated, binding).is_doubtful)
    if raised is None:
        return []
    ticks = [_played(stepper, state, wanted) for state, wanted in raised.ticks]
    described = {bound.name for bound in binding.nodes() if bound.spec.is_only_described}
    is_sure = not any(event.leaf.name in described for events in ticks for event in events)
    place = _place(raised.error, binding)
    told = f"{simulated.told(raised.error)} ({_told(ticks)})"
    severity = Severity.ERROR if is_sure else Severity.WARNING
    hint = "sar-compile verify shows the run tick by tick"
    source = place.element.source
    return [
        Diagnostic("failing-tick", told, source, _span(raised.error, place), hint=hint, severity=severity)
    ]


def _search(
    steps: TickSteps, budget: TrialBudget, is_doubtful: Callable[[Exception], bool]
) -> _Raised | None:
    """Return the first tick that raises, breadth first; a run that has come to its end is not followed beyond it."""
    start = steps.start()
    origins: dict[bytes, bytes | None] = {start: None}
    waiting = deque([start])
    while waiting:
        state = waiting.popleft()
        if steps.judge(state, None).ends:
            continue
        steps.enter(state)
        while steps.step():
            if not budget.take():
                return None
            if steps.state is None and steps.error is not None and not is_doubtful(steps.error):
                return _Raised(steps.error, [*_way(origins, state), (state, _has_path(steps.path))])
            if steps.state is not None and steps.state not in origins:
                origins[steps.state] = state
                waiting.append(steps.state)
    return None


def _way(origins: dict[bytes, bytes | None], state: bytes) -> list[tuple[bytes, Callable[[TickSteps], bool]]]:
    way: list[tuple[bytes, Callable[[TickSteps], bool]]] = []
    before = origins[state]
    while before is not None:
        way.append((before, _leads_to(state)))
        state, before = before, origins[before]
    return way[::-1]


def _leads_to(end: bytes) -> Callable[[TickSteps], bool]:
    return lambda steps: steps.state == end


def _has_path(path: tuple[int, ...]) -> Callable[[TickSteps], bool]:
    return lambda steps: steps.path == path


def _played(stepper: TreeStepper, state: bytes, wanted: Callable[[TickSteps], bool]) -> tuple[Event, ...]:
    """Return what the leaves did in a tick."""
    stepper.steps.enter(state)
    while stepper.steps.step() and not wanted(stepper.steps):
        pass
    return tuple(event for event in stepper.played().events if event.answer is not None)


def _told(ticks: list[tuple[Event, ...]]) -> str:
    """Return a run in words: the answers of its last ticks."""
    if not any(ticks):
        return f"in tick {len(ticks)}"
    last = list(enumerate(ticks, 1))[-_MOST_TOLD:]
    answers = {
        number: ", ".join(f"'{each.leaf.name}' {_word(each)}" for each in events) for number, events in last
    }
    if len(ticks) == 1:
        return f"in tick 1; {answers[1]}"
    said = (f"tick {number}: {words}" for number, words in answers.items() if words)
    return f"in tick {len(ticks)}; {'; '.join(said)}"


def _word(event: Event) -> str:
    assert event.answer is not None  # noqa: S101 - others are left out
    return event.answer.status


class _Doubts:
    """Tells errors that only the simulation has: what real leaves and the mission write is not known here."""

    def __init__(self, simulated: SimulatedTree, binding: Binding) -> None:
        self._outputs = simulated.outputs
        accesses = [access for tree in binding.trees() for access in key_accesses_of(tree).accesses]
        self._all = {access.key for access in accesses}
        writing = (AccessKind.WRITE, AccessKind.BOTH)
        self._written = {access.key for access in accesses if access.kind in writing}

    def is_doubtful(self, error: Exception) -> bool:
        """Return whether an error may be none in a real run: a key is empty that something else may have written."""
        return any(
            key in self._outputs or key not in self._written or f"{ROOT_SIGN}{key}" in self._all
            for key in _empty_keys(error)
        )


def _empty_keys(error: BaseException | None) -> Iterator[str]:
    while error is not None:
        if isinstance(error, UnknownVariableError):
            yield error.name
        elif isinstance(error, MissingEntryError):
            yield error.key
        error = error.__cause__


def _place(error: Exception, binding: Binding) -> BoundNode:
    name = getattr(error, "node", None)
    if isinstance(name, NameInTree):
        return name.bound
    if isinstance(error, PortError):
        reading = [bound for bound in binding.nodes() if error.port in bound.keys]
        if reading:
            return next((each for each in reading if each.keys[error.port] == error.source), reading[0])
    assert binding.main.root is not None  # noqa: S101 - a tree without a root has errors
    return binding.main.root


def _span(error: Exception, place: BoundNode) -> Span:
    element = place.element
    if isinstance(error, NodeScriptError) and error.attribute in element.attributes:
        if error.start is None or error.end is None:
            return element.value_span(error.attribute)
        return element.within_value(error.attribute, error.start, error.end)
    port = getattr(error, "port", "")
    return element.value_span(port) if port in element.attributes else element.tag_span()
