"""The behaviour of BehaviorTree.CPP in which this project differs on purpose.

A run that differs is replayed again with one of these habits. If it is then the same, the difference comes
from that habit and its consequences, and from nothing else.
"""

import itertools
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any
from unittest import mock

from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Status

from sar_compiler.runtime import (
    entry_types,
    language_nodes,
    operators,
    queues,
    stock,
    variables,
)
from sar_compiler.runtime.blackboard import ROOT_SIGN, Board, Scope
from sar_compiler.runtime.kernel.cells import ENDED, INVALID, RUNNING
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.kernel.ordering import ResumingNode
from sar_compiler.runtime.kernel.tree_nodes import Ticker
from sar_compiler.runtime.kernel.turning import PreconditionNode
from sar_compiler.runtime.language_nodes import Conditions, SetBlackboard
from sar_compiler.runtime.parents import EngineBehaviour
from sar_compiler.runtime.ticking import OwnDecorator, behaviour_class
from sar_compiler.runtime.variables import RefusedValueError, ScriptValue, describe_value

Case = Mapping[str, Any]

_REAL = re.compile(r"-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+\-]?[0-9]+)?|-?(?:inf|nan)")
_WHOLE = re.compile(r"-?[0-9]+")


@dataclass(frozen=True)
class Habit:
    """A behaviour of BehaviorTree.CPP that this project does not have.

    Attributes:
        reason: A description, in a line.
        may_show: Returns whether a case can show it.
        taken_on: Gives this project the habit for as long as the context lasts.
    """

    reason: str
    may_show: Callable[[Case], bool]
    taken_on: Callable[[], AbstractContextManager[None]]


def reset(behaviour: Behaviour) -> None:
    """Return a node to rest: halt it if it is running, otherwise only reset its outcome."""
    if behaviour.status == Status.RUNNING:
        behaviour.stop(Status.INVALID)
    else:
        behaviour.status = Status.INVALID


def halt_tree(root: Behaviour) -> None:
    """Halt the root, and reset every node that this does not reach."""
    root.stop(Status.INVALID)
    for node in root.iterate():
        reset(node)


def habits_of(case: Case) -> Iterator[tuple[Habit, ...]]:
    """Yield the habits that a case can show: each by itself, then each two, and so on."""
    shown = [habit for habit in HABITS if habit.may_show(case)]
    for count in range(1, len(shown) + 1):
        yield from itertools.combinations(shown, count)


@contextmanager
def taken_on(habits: tuple[Habit, ...]) -> Iterator[None]:
    """Give this project some habits of BehaviorTree.CPP."""
    with ExitStack() as stack:
        for habit in habits:
            stack.enter_context(habit.taken_on())
        yield


@contextmanager
def _replaced(owner: object, name: str, replacement: object) -> Iterator[None]:
    with mock.patch.object(owner, name, replacement):
        yield


@contextmanager
def _no_post_on_halt() -> Iterator[None]:
    ours = Conditions.run_after

    def run_after(self: Conditions, outcome: int) -> None:
        if outcome != INVALID:
            ours(self, outcome)
        elif (script := self._after[INVALID]) is not None:
            script.run()

    with _replaced(Conditions, "run_after", run_after):
        yield


@contextmanager
def _on_halted_of_all() -> Iterator[None]:
    ours = halt_tree

    def halt_all(root: Behaviour) -> None:
        was_running = root.status == Status.RUNNING
        ours(root)
        if not was_running:
            _run_on_halted(root)
        for node in _from_above(root):
            _run_on_halted(node)

    with mock.patch(f"{__name__}.halt_tree", halt_all):
        yield


@contextmanager
def _halts_at_rest() -> Iterator[None]:
    ours = halt_tree

    def halt_all(root: Behaviour) -> None:
        ours(root)
        for node in root.iterate():
            if isinstance(node, EngineBehaviour):
                tree, index = node._tree_and_index()
                assert isinstance(tree, LiveTree)
                tree.tree_nodes[index].reset_cells(tree.ticker)

    with mock.patch(f"{__name__}.halt_tree", halt_all):
        yield


@contextmanager
def _skips_counted_on() -> Iterator[None]:
    class CountedOn(ResumingNode):
        def begin(self, ticker: Ticker) -> int:
            if ticker.cells[self.status_cell] & ENDED:
                ticker.cells[self.status_cell] = RUNNING
            return super().begin(ticker)

        def decide(self, ticker: Ticker, outcome: int) -> int:
            skips = ticker.cells[self.skips]
            answer = super().decide(ticker, outcome)
            ticker.cells[self.skips] = skips
            return answer

    with _replaced(stock._OrderedComposite, "node_class", CountedOn):
        yield


def _run_on_halted(node: Behaviour) -> None:
    if isinstance(node, Conditions) and (script := node._after[INVALID]) is not None:
        script.run()


def _from_above(node: Behaviour) -> Iterator[Behaviour]:
    yield node
    for child in node.children:
        yield from _from_above(child)


@contextmanager
def _precondition_asked_once() -> Iterator[None]:
    class AskedOnce(PreconditionNode):
        def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
            answer = super().on_child_outcome(ticker, outcome)
            ticker.cells[self.child_runs] = int(not outcome & ENDED)
            return answer

        def reset_cells(self, ticker: Ticker) -> None:
            pass

    with _replaced(behaviour_class(OwnDecorator, PreconditionNode), "node_class", AskedOnce):
        yield


class _AnyType:
    """The type of an entry that SetBlackboard wrote: no string can be converted to it."""


@contextmanager
def _literals_lost() -> Iterator[None]:
    ours = SetBlackboard.update

    def update(self: SetBlackboard) -> Status:
        key = str(self._output_key.get())
        entry, source = self._scope.resolve(key), self._value.entry
        entry.declare(str if source is None else source.kind)
        if entry.kind not in (None, _AnyType) or (source is not None and not source.exists):
            return ours(self)
        value = self._value.get()
        if entry.kind is _AnyType and isinstance(value, str):
            message = f"{describe_value(value)} cannot become any type"
            raise RefusedValueError(message)
        entry.write(value)
        if isinstance(value, str):
            Blackboard.storage.pop(entry.name)
        if key.startswith(ROOT_SIGN) or entry.name == Scope(entry.board, self._scope.path).resolve(key).name:
            entry.board.kinds[entry.name] = _AnyType
        return Status.SUCCESS

    def names(board: Board) -> Iterator[str]:
        yield from [name for name in board.stamps if board.has(name)]

    with _replaced(SetBlackboard, "update", update), _replaced(Board, "names", names):
        yield


def _front_of(text: str) -> int | float:
    match = _REAL.match(text)
    if match is None:
        message = f"{describe_value(text)} is not a number"
        raise RefusedValueError(message)
    return int(match.group()) if _WHOLE.fullmatch(match.group()) else float(match.group())


@contextmanager
def _front_read() -> Iterator[None]:
    read_as, fit = entry_types.read_as, variables.fit

    def read(text: str, kind: type) -> ScriptValue:
        match = _WHOLE.match(text)
        return int(match.group()) if kind is int and match else read_as(text, kind)

    def item(value: ScriptValue, kind: type) -> ScriptValue:
        return read(value, kind) if isinstance(value, str) and kind is not bool else fit(value, kind)

    with ExitStack() as stack:
        for module in (variables, operators, entry_types):
            stack.enter_context(_replaced(module, "number_of", _front_of))
        for module in (language_nodes, entry_types):
            stack.enter_context(_replaced(module, "read_as", read))
        stack.enter_context(_replaced(queues, "fit", item))
        yield


HABITS = (
    Habit(
        "_post is not run there when a node is halted, against the documentation",
        lambda case: "_post=" in case["xml"],
        _no_post_on_halt,
    ),
    Habit(
        "halting the tree runs _onHalted there of nodes that do not run, and twice of those that do",
        lambda case: "_onHalted=" in case["xml"] and bool(case.get("halt_before")),
        _on_halted_of_all,
    ),
    Habit(
        "Precondition does not check there after its child was halted or skipped",
        lambda case: "<Precondition" in case["xml"],
        _precondition_asked_once,
    ),
    Habit(
        "halting the tree there halts nodes at rest as well, which forget what outlasts their end",
        lambda case: bool(case.get("halt_before")),
        _halts_at_rest,
    ),
    Habit(
        "a Sequence or Fallback that is ticked again after its end, and not reset, counts children there that were skipped before",
        lambda case: "<Sequence" in case["xml"] or "<Fallback" in case["xml"],
        _skips_counted_on,
    ),
    Habit(
        "SetBlackboard loses a text there that it gives to an entry without a type",
        lambda case: "<SetBlackboard" in case["xml"],
        _literals_lost,
    ),
    Habit(
        "of a text that begins with a number, the rest is dropped there",
        lambda _: True,
        _front_read,
    ),
)
