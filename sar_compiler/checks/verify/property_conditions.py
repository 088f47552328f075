"""Conditions of properties: scripts over facts, keys of the tree, and how the last tick ended."""

from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.errors import SarError, UndecidableError
from sar_compiler.runtime.blackboard import Entry
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.expressions import Script, name_uses
from sar_compiler.runtime.stub_leaf import FactVariables
from sar_compiler.runtime.variables import ScriptValue

ROOT = "root"
"""The root's status after the last tick."""
IDLE = "idle"
"""Whether every tick from now on leaves the tree as it is."""
AFTER_A_TICK = (ROOT, IDLE)
"""The names that are known only when a tick is over."""


class ConditionError(UndecidableError):
    """A condition of a property cannot be evaluated in a state that a run reaches."""


class IdleUnknownError(SarError):
    """A condition asks whether the tree idles, which is not known yet."""


class Surroundings(FactVariables):
    """The variables of conditions: facts, keys of the tree, and the end of the last tick.

    Args:
        simulated: The tree, on numbered boards.

    Attributes:
        board: One of these.
    """

    def __init__(self, simulated: SimulatedTree) -> None:
        super().__init__(simulated.facts, simulated.compiled.instance.scope, Enums())
        self.board = simulated.facts.board
        self._ended: dict[str, ScriptValue | None] = {}

    def end_tick(self, root: str, *, idle: bool | None) -> None:
        """Set the result of the last tick.

        Args:
            root: The root's status.
            idle: Whether every tick from now on leaves the tree as it is; None if that is not known yet.
        """
        self._ended[ROOT] = root
        self._ended[IDLE] = None if idle is None else float(idle)

    def read(self, name: str) -> ScriptValue:
        """Return the value of a fact, of a key, or of what is known of the last tick.

        Raises:
            IdleUnknownError: If that is whether the tree idles, and it is not known.
        """
        ended = self._ended.get(name)
        if ended is None and name in self._ended:
            raise IdleUnknownError(name)
        return super().read(name) if ended is None else ended


class Condition:
    """A condition that can be evaluated.

    Args:
        script: What it says.
        surroundings: What it reads.
        owner: The name of its property, for messages.
    """

    def __init__(self, script: Script, surroundings: Surroundings, owner: str) -> None:
        self._program = Program(script)
        self._surroundings = surroundings
        self._owner = owner
        self._memo = surroundings.board.memo(self.entries)

    @property
    def entries(self) -> list[Entry]:
        """The entries that it reads."""
        names = {use.name for use in name_uses(self._program.script)}.difference(AFTER_A_TICK)
        return [self._surroundings.entry(name) for name in names]

    def holds(self) -> bool:
        """Return whether it holds now, in a tick.

        Raises:
            ConditionError: If it cannot be evaluated, because a key has no value yet or one that does not fit.
        """
        held: bool = self._memo.call(self._holds)
        return held

    def after_tick(self, root: str, idle: bool | None) -> bool:
        """Return whether it holds when a tick is over; see `Surroundings.end_tick`.

        Raises:
            ConditionError: As `holds`.
            IdleUnknownError: If it asks whether the tree idles, and that is not known.
        """
        self._surroundings.end_tick(root, idle=idle)
        return self._holds()

    def _holds(self) -> bool:
        try:
            return self._program.holds(self._surroundings)
        except EvaluationError as error:
            hint = f"; {error.hint}" if error.hint else ""
            message = f"{self._owner}: '{self._program.script.text}' cannot be evaluated in every state: {error}{hint}"
            raise ConditionError(message) from error
