"""The variables of the scripts of a scenario: the run, the facts, and the keys of the main tree."""

from collections.abc import Mapping

from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.nodes.values import nearest
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.stub_leaf import FactVariables
from sar_compiler.runtime.variables import ScriptValue, UnknownVariableError, VariableError

OWN = ("root", "tick", "time")
"""The names of values of the run itself."""


class RunVariables:
    """The variables of a scenario's conditions, which only read.

    Attributes:
        now: What the names of the run itself stand for.
    """

    def __init__(self, simulated: SimulatedTree) -> None:
        self.now: Mapping[str, ScriptValue] = {}
        self._simulated = simulated
        self._others = FactVariables(simulated.facts, simulated.compiled.instance.scope, Enums())

    def read(self, name: str) -> ScriptValue:
        """Return a value; raises as `Variables` says, with the name that was probably meant."""
        if name in self.now:
            return self.now[name]
        try:
            return self._others.read(name)
        except UnknownVariableError as error:
            near = nearest(name, [*OWN, *self._simulated.fact_values()])
            advice = f"; did you mean '{near}'?" if near else ""
            message = f"{error}{advice}"
            raise VariableError(message) from error

    def create(self, name: str, value: ScriptValue) -> ScriptValue:
        """Refuse to write."""
        return self.assign(name, value)

    def assign(self, name: str, value: ScriptValue) -> ScriptValue:  # noqa: ARG002 - as the protocol has it
        """Refuse to write."""
        message = (
            f"a condition of a scenario changes nothing, and this gives '{name}' a value; write == to compare"
        )
        raise VariableError(message)
