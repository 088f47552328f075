"""What the records of a user's controls and decorators claim, to be held against what these do."""

from collections.abc import Iterable, Mapping

from py_trees.behaviour import Behaviour

from sar_compiler.checks.rules.outcome_analysis import PossibleOutcomes
from sar_compiler.compiler import CompiledTree
from sar_compiler.nodes.binding.nesting import trees_in
from sar_compiler.nodes.outcome_sets import ALL, BITS
from sar_compiler.nodes.semantics import Order
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.foreign_nodes import Claim


def claims_of(behaviours: Iterable[Behaviour], compiled: CompiledTree) -> Mapping[Behaviour, Claim]:
    """Return what is claimed of some behaviours; those of which nothing is claimed are left out.

    Args:
        behaviours: The behaviours.
        compiled: Their tree.
    """
    claims: dict[Behaviour, Claim] = {}
    possible: PossibleOutcomes | None = None
    for behaviour in behaviours:
        bound = compiled.origins[behaviour.id].bound
        means, said = bound.spec.semantics, bound.spec.outcomes
        if means.possible is None and not said:
            continue
        possible = possible or PossibleOutcomes(trees_in(compiled.instance.tree))
        outcomes = possible.may_return(bound)
        if said:
            outcomes &= sum(BITS[word] for word in said)
        goes_on = _number(means.goes_on) if means.order is Order.IN_ORDER else 0
        if outcomes != ALL or goes_on:
            claims[behaviour] = Claim(
                sum(1 << WORDS.index(word) for word, bit in BITS.items() if outcomes & bit), goes_on
            )
    return claims


def _number(outcome: int) -> int:
    """Return the number of an outcome that is given as a set."""
    return next((WORDS.index(word) for word, bit in BITS.items() if bit == outcome), 0)
