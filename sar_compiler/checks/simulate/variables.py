"""What the scripts of a scenario see: the run, the facts, and the keys of the main tree."""

from collections.abc import Mapping

from sar_compiler.compiler.rehearsal import Rehearsal
from sar_compiler.nodes.values import nearest
from sar_compiler.runtime.answering import FactVariables
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.variables import UnknownVariableError, Value, VariableError

OWN = ("root", "tick", "time")
"""The names that stand for the run itself."""


class RunVariables:
    """The variables of a scenario's conditions, which only read.

    Args:
        rehearsal: The tree.

    Attributes:
        now: What the names of the run itself stand for.
    """

    def __init__(self, rehearsal: Rehearsal) -> None:
        self.now: Mapping[str, Value] = {}
        self._rehearsal = rehearsal
        self._others = FactVariables(rehearsal.facts, rehearsal.compiled.instance.scope, Enums())

    def read(self, name: str) -> Value:
        """Return a value; raises as `Variables` says, with the name that was probably meant."""
        if name in self.now:
            return self.now[name]
        try:
            return self._others.read(name)
        except UnknownVariableError as error:
            near = nearest(name, [*OWN, *self._rehearsal.fact_values()])
            advice = f"; did you mean '{near}'?" if near else ""
            message = f"{error}{advice}"
            raise VariableError(message) from error

    def create(self, name: str, value: Value) -> Value:
        """Refuse to write."""
        return self.assign(name, value)

    def assign(self, name: str, value: Value) -> Value:  # noqa: ARG002 - as the protocol has it
        """Refuse to write."""
        message = (
            f"a condition of a scenario changes nothing, and this gives '{name}' a value; write == to compare"
        )
        raise VariableError(message)
