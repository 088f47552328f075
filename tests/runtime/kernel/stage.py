"""Stages on which py_trees and the kernel tick the same tree, to compare them."""

import functools
import random
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from librt.vecs import vec
from mypy_extensions import i32
from py_trees.common import Status

from sar_compiler.analysis.numbered_board import NumberedBoard
from sar_compiler.compiler import CompiledTree, bind_main, compile_tree
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.runtime.blackboard import Board
from sar_compiler.runtime.breakpoints import Breakpoints, tick_with_breakpoints
from sar_compiler.runtime.clock import Clock, ManualClock
from sar_compiler.runtime.frozen import freeze
from sar_compiler.runtime.kernel.cells import SKIPPED, STATUSES
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.kernel.table import flatten
from sar_compiler.runtime.kernel.times import ClockTimes
from sar_compiler.runtime.kernel.tree_nodes import Visit
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.runtime.variables import Enums
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from tests.runtime.kernel import probes
from tests.runtime.kernel.flat import cells_of, stop, tick
from tests.runtime.kernel.probes import Script
from tests.runtime.kernel.random_trees import RandomTree

# In seconds. They are exact in binary, so that the clock can be set back without rounding.
_PAUSES = (0.0, 0.0625, 0.125, 0.25, 0.5)


def entries() -> dict[str, object]:
    """Return the initial contents of the blackboard."""
    queue = {"numbers": [1.5, 2.0], "flags": deque([True, False, True]), "items": [1, [2], None, 3]}
    return {"a": 0, "b": 1, "n": 0, **queue}


@functools.cache
def registry() -> Registry:
    """Return the registry of all installed nodes and the probes."""
    known = Registry(default_registry().specs())
    known.add_module(probes)
    return known


def bound(body: str) -> Binding:
    """Bind a tree with the given XML body."""
    text = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>'
    return bind_main(Forest.from_file(parse_xml(text)), registry())


def random_bindings(count: int, *, skips: bool) -> Iterator[tuple[int, Binding]]:
    """Yield random trees without errors, with their seeds."""
    seed = 0
    while count:
        seed += 1
        try:
            binding = bind_main(Forest.from_file(parse_xml(RandomTree(seed, skips=skips).text())), registry())
        except TreeError:
            continue
        count -= 1
        yield seed, binding


@dataclass(frozen=True)
class Beat:
    """One tick and the events before it.

    Attributes:
        number: The number of the tick, on which the outcomes of the probes depend.
        seconds: The time that passes before the tick.
        halt: Whether the tree is halted before the tick.
    """

    number: int
    seconds: float
    halt: bool


def random_beats(seed: int, count: int) -> list[Beat]:
    """Return random beats for a number of ticks."""
    draw = random.Random(seed)  # noqa: S311 - the same trees in every run
    return [Beat(number, draw.choice(_PAUSES), draw.random() < 0.15) for number in range(count)]


@dataclass(frozen=True)
class Seen:
    """The observable result of a tick."""

    outcome: str
    events: list[probes.Event]
    statuses: list[Status]
    skipped: list[bool]
    messages: list[str]
    tip: str | None
    entries: tuple[tuple[str, object, object, int], ...]
    woken: int


class Stage:
    """A compiled tree with a manual clock, and a wake callback that counts its calls."""

    def __init__(self, binding: Binding, seed: int, *, raises: bool = False) -> None:
        self.clock = ManualClock()
        self.script = Script(seed, raises)
        self.woken = 0
        context = {Clock: self.clock, Enums: Enums(), Script: self.script}
        self.tree: CompiledTree = compile_tree(binding, context, {})
        for key, value in entries().items():
            self.tree.instance.scope.resolve(key).write(value)
        for node in self.tree.root.iterate():
            node.setup(wake=self._wake)

    def _wake(self) -> None:
        self.woken += 1

    def play(self, beat: Beat) -> Seen:
        """Advance the clock, halt the tree if the beat says so, and tick it."""
        self.script.tick = beat.number
        self.clock.advance(beat.seconds)
        try:
            if beat.halt:
                self.stop()
            outcome = self.tick()
        except Exception as error:  # noqa: BLE001 - compared with what the other form raises
            outcome = f"raised {type(error).__name__}: {error}".replace(self.tree.board.prefix, "")
        return self.seen(outcome)

    def seen(self, outcome: str) -> Seen:
        nodes = list(pre_order(self.tree.root))
        tip = self.tree.root.tip()
        board = self.tree.board
        return Seen(
            outcome,
            self.script.pop_events(),
            [node.status for node in nodes],
            [was_skipped(node) for node in nodes if not node.children],
            [node.feedback_message for node in nodes],
            tip.name if tip else None,
            entries_of(board),
            self.woken,
        )

    def tick(self) -> str:
        raise NotImplementedError

    def stop(self) -> None:
        raise NotImplementedError


def entries_of(board: Board) -> tuple[tuple[str, object, object, int], ...]:
    """Return the name, type, value and number of writes of each entry that was written or declared."""
    names = board.cells.names if isinstance(board, NumberedBoard) else {*board.names(), *board.kinds}
    return tuple(
        (
            name.removeprefix(board.prefix),
            (board.kind_of(name), board.is_declared(name)),
            freeze(board.get(name)) if board.has(name) else None,
            board.stamp(name),
        )
        for name in sorted(names)
        if board.has(name) or board.is_declared(name)
    )


class PyTreesStage(Stage):
    """Is ticked by py_trees."""

    def tick(self) -> str:
        root = self.tree.root
        root.tick_once()
        return "SKIPPED" if was_skipped(root) else root.status.name

    def stop(self) -> None:
        self.tree.root.stop(Status.INVALID)


class LiveStage(Stage):
    """Is ticked as in a run."""

    def __init__(self, binding: Binding, seed: int, *, raises: bool = False) -> None:
        super().__init__(binding, seed, raises=raises)
        self.live = LiveTree(self.tree.root)

    def tick(self) -> str:
        outcome = self.live.tick()
        return "SKIPPED" if outcome == SKIPPED else STATUSES[outcome].name

    def stop(self) -> None:
        self.live.stop()


class EveryNode(Breakpoints):
    """Breaks a tick before each node for a moment."""

    def wait_at(self, behaviour):
        yield


class HeldStage(LiveStage):
    """Is ticked as in a run that waits at a breakpoint before each node."""

    def tick(self) -> str:
        visits: list[Visit] = []
        for _ in tick_with_breakpoints(self.live, EveryNode(print, 1.0), visits):
            pass
        assert visits[-1].behaviour is self.tree.root
        return "SKIPPED" if visits[-1].outcome == SKIPPED else STATUSES[visits[-1].outcome].name


@dataclass(frozen=True)
class Saved:
    """A state of a tree in flat form, and its time."""

    cells: Any
    entries: Any
    time: float


class FlatStage(Stage):
    """Is ticked in flat form, and can save and restore its state."""

    def __init__(self, binding: Binding, seed: int, *, raises: bool = False) -> None:
        super().__init__(binding, seed, raises=raises)
        self.flat = flatten(self.tree.root)
        self.times = ClockTimes(lambda _: self.clock)
        self.ticker = self.flat.ticker(self.times)
        self.entries: EntryCells | None = None

    def tick(self) -> str:
        outcome = tick(self.flat, self.ticker)
        return "SKIPPED" if outcome == SKIPPED else STATUSES[outcome].name

    def stop(self) -> None:
        stop(self.flat, self.ticker)

    def save(self) -> Saved:
        """Return the state of the tree: its cells, its blackboard and the time."""
        if self.entries is None:
            self.entries = EntryCells()
            NumberedBoard.from_board(self.tree.board, self.entries)
        self.flat.renumber(self.ticker)
        self.entries.update_contents()
        return Saved(cells_of(self.ticker), self.entries.now[:], self.clock.now())

    def restore(self, saved: Saved) -> None:
        """Restore a saved state."""
        assert self.entries is not None, "nothing was saved"
        cells, self.ticker.values[:] = saved.cells
        self.ticker.cells = vec[i32](cells)
        self.entries.restore(saved.entries)
        self.clock.advance(saved.time - self.clock.now())
        self.ticker.times = ClockTimes(lambda _: self.clock)

    def seen(self, outcome: str) -> Seen:
        for node in self.flat.nodes:
            node.write_status(self.ticker.cells)
        return super().seen(outcome)
