"""Finds limits: facts that bound how often an event can happen. Proofs require such bounds."""

from collections.abc import Collection

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.expressions import Assignment, name_uses
from sar_compiler.runtime.script import parse

# A number so large that subtracting one does not change it.
_WITHOUT_END = 1e18


def remove_limits(simulated: SimulatedTree, known: Collection[str]) -> bool:
    """Remove the limits assumed for leaf outcomes in a recorded run. Return whether there were any.

    Args:
        simulated: The tree with stub leaves.
        known: The facts whose initial values the run has recorded.
    """
    limits = find_limits(simulated, known)
    for name in limits:
        simulated.facts.resolve(name).write(_WITHOUT_END)
    return bool(limits)


def find_limits(simulated: SimulatedTree, known: Collection[str]) -> set[str]:
    """Return the facts that bound how often events can happen, such as operator commands.

    These are the facts that the outcomes of leaves only decrease.

    Args:
        simulated: The tree with stub leaves.
        known: The facts whose initial values a run has recorded.
    """
    scripts = [parse(outcome.then) for leaf in simulated.leaves for outcome in leaf.outcomes if outcome.then]
    changes = [each for script in scripts for each in script.statements if isinstance(each, Assignment)]
    others = {each.target.name for each in changes if each.operator != "-="}.union(known)
    return simulated.fact_values().keys() & {each.target.name for each in changes} - others


def spending_conditions(simulated: SimulatedTree, limits: Collection[str]) -> set[int]:
    """Return the conditions of a tree that decrease limits, by leaf number.

    If such a condition finds the same situation in consecutive ticks, such as a pause, this counts as one event.

    Args:
        simulated: The tree with stub leaves.
        limits: The names of the limits.
    """
    origins = simulated.compiled.origins
    return {
        leaf.number
        for leaf in (simulated.leaves if limits else ())
        if origins[leaf.id].bound.spec.kind is Kind.CONDITION
        and any(
            use.name in limits for each in leaf.outcomes if each.then for use in name_uses(parse(each.then))
        )
    }
