"""Determines values that no run can distinguish, so that a search can merge states with such values.

A patrol that counts its rounds (`rounds = rounds + 1`) has a state for each number, although no node depends on the
number, or only on whether it is below 3. So before a search, the scripts of the tree, of leaf outcomes and of
properties are analysed:

- If only such keys depend on a key, all its values of the same type are merged.
- If a key is only compared with constants and changed by constants, all values above one number are merged, and all
  values below another number.

Why the merging is exact: two states that differ only in merged values are bisimilar. Every comparison has the same
result in both, every script raises an error in both or in neither, and assignments turn merged values into merged
values. The last point needs care. If `y` is assigned `x - 2`, the merged values of `x` must be 2 above the merged
values of `y`. These inequalities are solved here. A key that is decreased *and* compared from above has no solution,
and is not merged. Errors need more care, because the type of a key's value decides which values can be assigned to the
key. So neither the type of a value nor the presence of a value is ever changed:

- A key whose values flow into other keys is only merged if all these keys contain numbers. Then only its integers are
  merged, unless none of the keys can contain integers.
- A key with any other use is never merged, such as in a port of a control, as a truth value, or in a product.

Integers that are too large raise errors in calculations, but a merged integer never grows so large. So integers are only merged if no step
changes them by more than 1,000. The error is then 10^12 additions away. Numbers above 2^50 are not merged.

Runs are played again without merged values before they are shown (`state_space`).
"""

import math
from collections.abc import Iterator, Mapping
from itertools import count

from sar_compiler.analysis.merging import MergedValues
from sar_compiler.analysis.simulated_tree import SimulatedTree, needs_stub
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.analysis.verify.properties import Properties
from sar_compiler.analysis.verify.script_flows import NUMBERS, FlowValue, Resolve, ScriptFlows
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.checks.rules.entry_accesses import entry_table_of
from sar_compiler.nodes.semantics import AccessKind
from sar_compiler.runtime.blackboard import Board, Scope
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.language_nodes import RunScript
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.variables import UNKNOWN

_LARGEST_LIMIT = 2.0**40
_LARGEST_CHANGE = 1000
_AFTERWARDS = ("_onSuccess", "_onFailure", "_onHalted", "_post")


def merge_values(prepared: PreparedTree, properties: Properties) -> None:
    """Let searches of a tree merge the values of keys and facts that no run can distinguish.

    Nothing is merged if a property asks whether the tree idles, that is, whether all values stay unchanged.

    Args:
        prepared: The tree, before its first tick.
        properties: The properties of the tree.
    """
    if not properties.asks_for_idle:
        prepared.merge(_mergeable(prepared.simulated, properties))


def _mergeable(simulated: SimulatedTree, properties: Properties) -> dict[str, MergedValues]:
    """Return the values that can be merged, by the absolute name of the entry."""
    flows = ScriptFlows(simulated.enums)
    for script, resolve, is_condition in (*_scripts_of_nodes(simulated), *_scripts_of_outcomes(simulated)):
        flows.add_script(script, resolve, is_condition=is_condition)
    for condition in properties.conditions:
        flows.add_script(condition.script, condition.entry_name, is_condition=True)
    if not flows.types or not _add_port_accesses(flows, simulated):
        return {}
    # Absolute names begin with the name of the board.
    board = simulated.compiled.board
    start = {name: _types_at_start(board, name) for name in {*flows.types, *flows.read}}
    return _Solution(flows, start).mergeable_values()


_ReadScript = tuple[Script, Resolve, bool]
"""A script, the function that resolves the names in the script, and whether the value of the script is used."""


def _scripts_of_nodes(simulated: SimulatedTree) -> Iterator[_ReadScript]:
    for instance in simulated.compiled.instance.iterate():

        def resolve(key: str, scope: Scope = instance.scope) -> str:
            return scope.resolve(key).name

        for bound in instance.tree.nodes:
            for attribute, script in bound.conditions.items():
                yield script, resolve, attribute not in _AFTERWARDS
            if not needs_stub(bound.spec):
                scripts = (value for value in bound.values.values() if isinstance(value, Script))
                yield from ((script, resolve, bound.spec.cls is not RunScript) for script in scripts)


def _scripts_of_outcomes(simulated: SimulatedTree) -> Iterator[_ReadScript]:
    for leaf in simulated.leaves:

        def resolve(name: str, leaf: StubLeaf = leaf) -> str | None:
            is_unknown = name == UNKNOWN and not leaf.variables.is_fact(name)
            return None if is_unknown else leaf.variables.entry(name).name

        for outcome in leaf.outcomes:
            written = ((outcome.when, True), (outcome.then, False))
            yield from ((parse(script), resolve, is_used) for script, is_used in written if script)


def _add_port_accesses(flows: ScriptFlows, simulated: SimulatedTree) -> bool:
    """Add the reads and writes of ports. Return False if a node may use entries that are not known.

    The ports of stub leaves are ignored: their reads have no effect, and outcome scripts contain their writes.
    """
    table = entry_table_of(simulated.compiled.instance)
    uses = [
        use
        for entry in table.entries
        for use in entry.uses
        if use.access.place is None and not needs_stub(use.node.spec)
    ]
    for use in uses:
        entry = use.instance.scope.resolve(use.access.key).name
        flows.types.setdefault(entry, set()).add(object)
        if use.access.kind is not AccessKind.WRITE:
            flows.fixed.add(entry)
    return not table.is_open


def _types_at_start(board: Board, name: str) -> set[object]:
    """Return a set with the declared type of an entry and the type of its initial value, if they exist."""
    own = {board.kind_of(name)} if board.is_declared(name) else set()
    return {*own, *((type(board.get(name)),) if board.has(name) else ())} - {None}


class _Solution:
    """Solves the inequalities that state which values of entries a search must distinguish.

    Args:
        flows: The effects of scripts.
        start: The initial types of each entry.
    """

    def __init__(self, flows: ScriptFlows, start: Mapping[str, set[object]]) -> None:
        self._flows, self._read = flows, flows.read
        self._types = _types_of_all(flows, start)
        self._real = self._real_entries()
        fixed = self._fixed_entries()
        self._above = dict.fromkeys(self._types, -math.inf) | dict.fromkeys(fixed, math.inf)
        self._below = dict.fromkeys(self._types, math.inf) | dict.fromkeys(fixed, -math.inf)
        for name, constant in flows.tests:
            self._require(name, math.ceil(constant), math.floor(constant))
        self._follow_flows()

    def mergeable_values(self) -> dict[str, MergedValues]:
        """Return the values that can be merged, by the absolute name of the entry."""
        found = {}
        for name in sorted(self._flows.types):
            above, below, is_unread = self._above[name], self._below[name], name not in self._read
            if is_unread or above < math.inf or below > -math.inf:
                label = name.split("/", 2)[2]
                found[name] = MergedValues(label, above, below, is_unread, name in self._real)
        return found

    def _are_numbers(self, name: str) -> bool:
        return self._types[name] <= NUMBERS

    def _real_entries(self) -> set[str]:
        """Return the entries that hold only floats, and whose values flow only to other such entries."""
        real = {name for name, types in self._types.items() if types == {float}}
        while lost := {
            source for target, source, _ in self._flows.flows if source in real and target not in real
        }:
            real -= lost
        return real

    def _fixed_entries(self) -> set[str]:
        """Return the entries whose values must all be distinguished, because of how they are read."""
        flows = self._flows
        fixed = {*flows.fixed, *(name for name in self._read if not self._are_numbers(name))}
        for target, source, offset in flows.flows:
            is_exact = source in self._real or (offset.is_integer() and abs(offset) <= _LARGEST_CHANGE)
            if not is_exact or not self._are_numbers(target):
                fixed.add(source)
        for target, value in flows.results:
            if not self._is_irrelevant(target, value):
                fixed |= value.names
        return fixed

    def _is_irrelevant(self, target: str, value: FlowValue) -> bool:
        """Return whether an assigned value is irrelevant: the entry is never read and never changes its type."""
        types = self._types[target]
        is_taken = len(types) == 1 and types == value.types and types <= {float, str}
        return target not in self._read and value.is_total and is_taken

    def _require(self, name: str, above: float, below: float) -> bool:
        """Require that the values of an entry between two bounds are distinguished.

        Return whether this requirement is new.
        """
        above = above if above <= _LARGEST_LIMIT else math.inf
        below = below if below >= -_LARGEST_LIMIT else -math.inf
        is_new = above > self._above[name] or below < self._below[name]
        self._above[name] = max(above, self._above[name])
        self._below[name] = min(below, self._below[name])
        return is_new

    def _follow_flows(self) -> None:
        """Propagate the required bounds from assigned entries back to the entries that the assignments read.

        The bounds are the lengths of longest paths. A path that still grows after as many steps as there are entries
        contains a cycle.
        """
        for turn in count():
            is_new = False
            for target, source, offset in self._flows.flows:
                above = self._above[target] + _distance(-offset)
                below = self._below[target] - _distance(offset)
                if turn > len(self._types):
                    above = math.inf if above > self._above[source] else above
                    below = -math.inf if below < self._below[source] else below
                is_new = self._require(source, above, below) or is_new
            if not is_new:
                return


def _distance(offset: float) -> float:
    """Return the distance by which adding a constant moves a bound."""
    return max(0.0, offset if offset.is_integer() else math.ceil(offset) + 1.0)


def _types_of_all(flows: ScriptFlows, start: Mapping[str, set[object]]) -> dict[str, set[object]]:
    """Return the possible types of each entry.

    Args:
        flows: The effects of scripts.
        start: The initial types, to which an assigned value may be converted.
    """
    types = {name: start.get(name, set()) | flows.types.get(name, set()) for name in {*start, *flows.types}}
    sizes = -1
    while sizes < (sizes := sum(map(len, types.values()))):
        for found in types.values():
            found.update(*[types[each] for each in found if isinstance(each, str)])
    return {name: {each for each in found if not isinstance(each, str)} for name, found in types.items()}
