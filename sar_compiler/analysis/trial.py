"""Searches the possible runs of a tree file for ticks that raise errors."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.nodes.binding.attributes import CONDITIONS
from sar_compiler.nodes.registry import Registry
from sar_compiler.project.project_tree import ProjectTree
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError
from sar_compiler.tree.model import Element

if TYPE_CHECKING:
    from sar_compiler.analysis.bounded_search import SearchBudget
from sar_compiler.checks.rules.entry_accesses import key_accesses_of
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.outcome_sets import S
from sar_compiler.nodes.semantics import Order
from sar_compiler.runtime.expressions import Assignment, ComparisonChain, Literal, Name


class TrialOutcome(NamedTuple):
    """The result of exploring the runs of a tree file within limits.

    Attributes:
        findings: The findings about ticks that raise errors.
        spent: The amount of work.
        is_limited: Whether the work or the time was not enough for the whole search.
        is_cut: Whether `is_spent` has stopped the search.
    """

    findings: Sequence[Diagnostic] = ()
    spent: int = 0
    is_limited: bool = False
    is_cut: bool = False


def try_runs_within(
    tree: ProjectTree, work: int | None, seconds: float | None, is_spent: Callable[[], bool]
) -> TrialOutcome:
    """Search the runs of a tree file for ticks that raise errors.

    Args:
        tree: The tree file.
        work: The maximum amount of work; None for no limit.
        seconds: The maximum processor time, in seconds; None for no limit.
        is_spent: Returns whether the search must stop for another reason.
    """
    budgets: list[SearchBudget] = []

    def budget() -> "SearchBudget":
        from sar_compiler.analysis.bounded_search import SearchBudget

        budgets.append(SearchBudget(work, seconds, is_spent))
        return budgets[0]

    found = try_tree(tree, budget)
    if not budgets:
        return TrialOutcome(found)
    return TrialOutcome(found, budgets[0].spent, budgets[0].is_limited, budgets[0].is_cut)


def try_tree(tree: ProjectTree, budget: "Callable[[], SearchBudget]") -> list[Diagnostic]:
    """Search for ticks that raise errors, within a budget, and return findings.

    Skip files with other errors.

    A tree without keys and scripts cannot raise errors, and is not compiled.

    Args:
        tree: The tree file.
        budget: Returns the budget; only called if runs must be searched.
    """
    if tree.is_malformed or any(each.severity is Severity.ERROR for each in tree.tree_findings):
        return []
    forest, registry = tree.forest, tree.project.registry
    executable = forest.executable
    if not executable or not any(_may_raise(each, registry) for each in forest.iterate()):
        return []
    bound = {id(each.element): each for each in tree.context.bound_forest.trees}
    if not tree.palettes and all(id(each) in bound and is_plain(bound[id(each)]) for each in executable):
        return []
    from shlex import quote

    from sar_compiler.analysis.proofs import try_runs

    limit, is_chosen = budget(), forest.main_tree() is None
    # Findings at the same location, from a rule or from a run of another tree, are about the same error.
    known = {(each.source.path, each.span) for each in tree.findings if each.severity is not Severity.INFO}
    raised = []
    for number, element in enumerate(executable):
        limit.allot(len(executable) - number)
        tree_id = element.attributes.get("ID") if is_chosen else None
        chosen = "" if tree_id is None else f" --tree {quote(tree_id)}"
        try:
            binding = tree.binding(tree_id)
        except TreeError:
            continue
        for finding in try_runs(tree, binding, limit, f"sar-compile verify{chosen}"):
            place = finding.source.path, finding.span
            raised += [finding] if place not in known else []
            known.add(place)
    return tree.project.configuration.decide(raised)


def _may_raise(tree: Element, registry: Registry) -> bool:
    """Return whether ticks of a tree may raise errors. This requires that the tree has keys or scripts."""
    return any(
        "{" in text or name in CONDITIONS or _is_script(element.tag, name, registry)
        for element in tree.iterate()
        for name, text in element.attributes.items()
    )


def _is_script(tag: str, name: str, registry: Registry) -> bool:
    parameters = (spec.parameters.get(name) for spec in registry.variants(tag))
    return any(each is not None and each.value_type.python is Script for each in parameters)


_EQUALITY = {"==", "!="}
_MAX_EXACT = 10**15
"""The limit below which numbers are compared exactly."""


def is_plain(tree: BoundTree) -> bool:
    """Return whether a tree's scripts are simple enough that they can never raise errors.

    In most trees with scripts, one script assigns a number or a string to a variable, and another script, which is
    ticked only afterwards, compares it. For such trees the slow import of the search (0.3 s) is avoided.
    """
    if (
        tree.root is None
        or tree.uses
        or any(each.conditions or each.keys or each.oneshot for each in tree.nodes)
    ):
        return False
    accesses = key_accesses_of(tree)
    is_of_scripts = all(_script_of(access.bound) is not None for access in accesses.accesses)
    return (
        is_of_scripts
        and not accesses.is_open
        and _PlainScriptCheck().visit(tree.root, frozenset()) is not None
    )


def _script_of(bound: BoundNode) -> Script | None:
    """Return the script of a leaf with exactly one script, or None for any other node."""
    scripts = [each for each in bound.values.values() if isinstance(each, Script)]
    return scripts[0] if len(scripts) == 1 and not bound.children else None


class _PlainScriptCheck:
    """Checks the scripts of a tree, in the order in which the nodes are first ticked."""

    def __init__(self) -> None:
        self._types: dict[str, type] = {}

    def visit(self, bound: BoundNode, known: frozenset[str]) -> frozenset[str] | None:
        """Return the variables that have a value once a node has succeeded; None if a script may fail.

        Args:
            bound: The node.
            known: The variables that certainly have values when the node is ticked.
        """
        if not bound.children:
            return self._variables_after_leaf(bound, known)
        semantics = bound.spec.semantics
        if semantics.repeats:  # it may repeat forever within a tick
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
        # Enumeration names begin with a capital letter, and names with `@` refer to the root blackboard.
        is_plain_name = name.isidentifier() and name[0].islower() and name not in ("true", "false")
        is_made = statement.operator == ":=" or name in known
        if kind is None or not (is_plain_name and is_made) or self._types.setdefault(name, kind) is not kind:
            return None
        return known | {name} if bound.spec.statuses == {"SUCCESS"} else known

    def _type_of(self, value: object, known: frozenset[str]) -> type | None:
        """Return the type of a value (`int`, `float` or `str`), or None if the type is uncertain."""
        if isinstance(value, Name):
            return self._types.get(value.name) if value.name in known else None
        if not isinstance(value, Literal):
            return None
        if isinstance(value.value, str):
            return str
        return type(value.value) if abs(value.value) < _MAX_EXACT else None
