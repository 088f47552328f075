"""The variables of the scripts of a scenario: the run, the facts, and the keys of the main tree."""

from collections.abc import Mapping

from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.stub_leaf import FactVariables
from sar_compiler.runtime.variables import ScriptValue, UnknownVariableError, VariableError
from sar_compiler.tree.guessing import did_you_mean, nearest

OWN = ("root", "tick", "time")
"""The names of values of the run itself."""


class RunVariables(FactVariables):
    """The variables of a scenario's conditions, which only read.

    Attributes:
        now: What the names of the run itself stand for.
    """

    def __init__(self, simulated: SimulatedTree) -> None:
        super().__init__(simulated.facts, simulated.compiled.instance.scope, Enums())
        self.now: Mapping[str, ScriptValue] = {}
        self._simulated = simulated

    def read(self, name: str) -> ScriptValue:
        """Return a value; raises as `Variables` says, with the name that was probably meant."""
        if name in self.now:
            return self.now[name]
        try:
            return super().read(name)
        except UnknownVariableError as error:
            near = nearest(name, [*OWN, *self._simulated.fact_values()])
            raise VariableError(f"{error}{did_you_mean(near)}") from error
