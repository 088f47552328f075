"""Detection of trees whose scripts cannot raise in any run, by their text alone: their runs need no search.

Importing the search takes a third of a second, and most trees with scripts are of this kind: a script assigns a
number or a string to a variable, and another one, which is ticked only after that, compares it. All other trees are
searched.
"""

from sar_compiler.checks.rules.entry_accesses import key_accesses_of
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.outcome_sets import S
from sar_compiler.nodes.semantics import Order
from sar_compiler.runtime.expressions import Assignment, ComparisonChain, Literal, Name, Script

_EQUALITY = {"==", "!="}
_MOST = 10**15
"""The largest number that is compared exactly."""


def is_plain(tree: BoundTree) -> bool:
    """Return whether the scripts of a tree raise nothing in any run; False if unknown."""
    if (
        tree.root is None
        or tree.uses
        or any(each.conditions or each.keys or each.oneshot for each in tree.nodes)
    ):
        return False
    accesses = key_accesses_of(tree)
    is_of_scripts = all(_script_of(access.bound) is not None for access in accesses.accesses)
    return is_of_scripts and not accesses.is_open and _ScriptWalk().visit(tree.root, frozenset()) is not None


def _script_of(bound: BoundNode) -> Script | None:
    """Return the only script of a leaf; None for any other node."""
    scripts = [each for each in bound.values.values() if isinstance(each, Script)]
    return scripts[0] if len(scripts) == 1 and not bound.children else None


class _ScriptWalk:
    """A walk through a tree in the order in which its nodes are ticked for the first time."""

    def __init__(self) -> None:
        self._types: dict[str, type] = {}

    def visit(self, bound: BoundNode, known: frozenset[str]) -> frozenset[str] | None:
        """Return the variables that certainly have values after a node has succeeded; None if a script in it may raise.

        Args:
            bound: The node.
            known: The variables that certainly have values when it is ticked.
        """
        if not bound.children:
            return self._variables_after_leaf(bound, known)
        semantics = bound.spec.semantics
        if semantics.repeats:  # a script may determine the duration, and a tick may never end
            return None
        # A node with another order of ticks may tick none of its children.
        is_sequence = semantics.order is Order.IN_ORDER and semantics.goes_on == S
        then = known
        for child in bound.children:
            reached = self.visit(child, then if is_sequence else known)
            if reached is None:
                return None
            then = reached if is_sequence else known
        return then

    def _variables_after_leaf(self, bound: BoundNode, known: frozenset[str]) -> frozenset[str] | None:
        script = _script_of(bound)
        if script is None:
            return known if not any(isinstance(each, Script) for each in bound.values.values()) else None
        if script.plain_form is None:
            return None
        (statement,) = script.statements
        if isinstance(statement, Assignment):
            return self._variables_after_assignment(bound, statement, known)
        assert isinstance(statement, ComparisonChain)  # noqa: S101 - a plain form
        operators = {step.operator for step in statement.steps}
        types = {
            self._type_of(each, known)
            for each in (statement.first, *(step.operand for step in statement.steps))
        }
        is_right = types <= {int, float} or (types == {str} and operators <= _EQUALITY)
        return known if is_right else None

    def _variables_after_assignment(
        self, bound: BoundNode, statement: Assignment, known: frozenset[str]
    ) -> frozenset[str] | None:
        name, kind = statement.target.name, self._type_of(statement.value, known)
        # Names of enumerations begin with a capital, and `@` leads out of the tree.
        is_plain_name = name.isidentifier() and name[0].islower() and name not in ("true", "false")
        is_made = statement.operator == ":=" or name in known
        if kind is None or not (is_plain_name and is_made) or self._types.setdefault(name, kind) is not kind:
            return None
        return known | {name} if bound.spec.outcomes == {"SUCCESS"} else known

    def _type_of(self, value: object, known: frozenset[str]) -> type | None:
        """Return the certain type of a value, an integer, a real number or a string; None if unknown."""
        if isinstance(value, Name):
            return self._types.get(value.name) if value.name in known else None
        if not isinstance(value, Literal):
            return None
        if isinstance(value.value, str):
            return str
        return type(value.value) if abs(value.value) < _MOST else None
