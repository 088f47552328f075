"""A stage with scripted leaves, a blackboard, and a record of the calls of the leaves."""

from collections.abc import Mapping
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.nodes.values import value_type_of
from sar_compiler.runtime.blackboard import Board, Entry, Scope
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.runtime.variables import Enums
from tests.conformance.leaves import Events, Scripted

_LETTERS = {Status.SUCCESS: "S", Status.FAILURE: "F", Status.RUNNING: "R", Status.INVALID: "-"}


class Stage:
    """The leaves, the blackboard and the wake callback of one test."""

    def __init__(self, **entries: object) -> None:
        self.events = Events()
        self.scope = Scope(Board("stage"))
        self.enums = Enums({"RED": 1, "BLUE": 2})
        self.woken = 0
        for key, value in entries.items():
            self.entry(key).write(value)

    def leaf(self, name: str, outcomes: str = "S") -> Scripted:
        """Create a leaf that returns S, F, R, K (skipped) or X (raises), one for each tick, and repeats the last one."""
        return Scripted(name, Input(name), self.events, Input(outcomes))

    def leaves(self, **outcomes: str) -> list[Behaviour]:
        return [self.leaf(name, answers) for name, answers in outcomes.items()]

    def entry(self, key: str) -> Entry:
        return self.scope.resolve(key)

    def port(self, key: str) -> Input[Any]:
        return Input(self.entry(key), name="port")

    def code(self, text: str) -> Input[Script]:
        return Input(parse(text))

    def code_in(self, key: str) -> Input[Script]:
        script = value_type_of(Script)
        assert script is not None
        return Input(self.entry(key), script.fit, "code")

    @property
    def values(self) -> Mapping[str, object]:
        board = self.scope.board
        return {name.removeprefix(board.prefix + "/"): board.get(name) for name in board.names()}

    def ready(self, root: Behaviour) -> Behaviour:
        """Set up a tree with a wake callback that counts its calls."""
        for node in root.iterate():
            node.setup(wake=self._wake)
        return root

    def tick(self, root: Behaviour) -> str:
        """Tick once, and return the outcome and the events of the leaves: `R: a=S b=R halt c`."""
        root.tick_once()
        outcome = "K" if was_skipped(root) else _LETTERS[root.status]
        return f"{outcome}: {self.new_events()}".rstrip()

    def ticks(self, root: Behaviour, count: int) -> list[str]:
        return [self.tick(root) for _ in range(count)]

    def new_events(self) -> str:
        """Return the events of the leaves since the last call."""
        return " ".join(_event_text(event) for event in self.events.take())

    def _wake(self) -> None:
        self.woken += 1


def _event_text(event: list[str]) -> str:
    if event[0] == "tick":
        return f"{event[1]}={'K' if event[2] == 'SKIPPED' else event[2][0]}"
    return " ".join(event)
