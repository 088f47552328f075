"""Determines the values that a leaf may have written in a recorded run.

A log of BehaviorTree.CPP contains no blackboard. If a condition depends on a key that a leaf writes, the run is compared with the runs in
which the leaf writes one of the values that the scripts of the tree distinguish. If the run fits one of them, it is possible, because a
leaf may write any value. If it fits none, nothing is decided.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import suppress

from sar_compiler.analysis.conformance import Conformance
from sar_compiler.analysis.simulated_tree import Assumptions
from sar_compiler.errors import UndecidableError
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.runtime.variables import unknown_value_of

_LITERAL = re.compile(r"'[^']*'|(?<![\w.])\d+(?:\.\d+)?")
_CASE = re.compile(r"case_\d+")
_SCRIPTS = ("code", "if")
_MOST = 24


def distinguished_values(binding: Binding) -> tuple[str, ...]:
    """Return script literals for the values that a tree's scripts and cases distinguish, if they are few."""
    found: dict[str, None] = {}
    for text in _texts(binding):
        for literal in _LITERAL.findall(text):
            found[literal] = None
            with suppress(ValueError):
                found.update(dict.fromkeys(_neighbours(float(literal))))
    return tuple(found) if len(found) <= _MOST else ()


def _neighbours(number: float) -> tuple[str, ...]:
    return tuple(f"{each:g}" for each in (number - 1, number, number + 1))


def _texts(binding: Binding) -> Iterator[str]:
    for bound in binding.all_nodes():
        for name, text in bound.element.attributes.items():
            if name.startswith("_") or name in _SCRIPTS:
                yield text
            elif _CASE.fullmatch(name):
                yield f"'{text}'"


def compare_with_written_values(
    binding: Binding, compare: Callable[[Assumptions | None], Conformance]
) -> Conformance:
    """Compare a run with the possible runs of its tree. If needed, assume the values that leaves write.

    Args:
        binding: The tree.
        compare: Compares the run under the given assumptions.

    Raises:
        UndecidableError: If the run depends on an unknown value and fits none of the tried values; as for *compare*.
    """
    values = distinguished_values(binding)
    written: dict[tuple[str, str], tuple[str, ...]] = {}
    undecided: UndecidableError | None = None
    while True:
        try:
            found = compare(Assumptions(written=written) if written else None)
        except UndecidableError as error:
            undecided = undecided or error
            unknown = unknown_value_of(error)
            if not values or unknown is None or (unknown.leaf, unknown.key) in written:
                raise undecided from error
            written[unknown.leaf, unknown.key] = values
            continue
        if undecided is not None and (found.misfit is not None or found.properties):
            raise undecided
        assumed = (f"{leaf} writes a suitable value to '{key}'" for leaf, key in written)
        return found._replace(assumed=(*found.assumed, *assumed))
