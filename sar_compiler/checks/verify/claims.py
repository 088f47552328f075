"""The claims in the specs of a user's controls and decorators, to be compared with what these do."""

from collections.abc import Callable, Iterable

from py_trees.behaviour import Behaviour

from sar_compiler.checks.rules.outcome_analysis import PossibleOutcomes
from sar_compiler.compiler import CompiledTree
from sar_compiler.nodes.binding.nesting import trees_in
from sar_compiler.nodes.outcome_sets import ALL, BITS
from sar_compiler.nodes.semantics import Order
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.user_nodes import Claim, UserNode


def hold_to_records(
    nodes: Iterable[UserNode], compiled: CompiledTree, deny: Callable[[Behaviour, str], None]
) -> bool:
    """Have nodes see whether they do what their records say; return whether any of these says something.

    Args:
        nodes: The nodes.
        compiled: Their tree.
        deny: Is told of each behaviour that does something else, and what, in words.
    """
    possible: PossibleOutcomes | None = None
    for node in nodes:
        bound = compiled.origins[node.behaviour.id].bound
        means, said = bound.spec.semantics, bound.spec.outcomes
        if means.possible is None and not said:
            continue
        possible = possible or PossibleOutcomes(trees_in(compiled.instance.tree))
        outcomes = possible.may_return(bound)
        if said:
            outcomes &= sum(BITS[word] for word in said)
        goes_on = _number(means.goes_on) if means.order is Order.IN_ORDER else 0
        if outcomes != ALL or goes_on:
            numbers = sum(1 << WORDS.index(word) for word, bit in BITS.items() if outcomes & bit)
            node.claim = Claim(numbers, goes_on, deny)
    return possible is not None


def _number(outcome: int) -> int:
    """Return the number of an outcome that is given as a set."""
    return next((WORDS.index(word) for word, bit in BITS.items() if bit == outcome), 0)
