"""Conditions in files beside a tree: scripts that only look, at facts, at keys of the tree and at the run itself."""

from collections.abc import Collection, Iterator
from typing import NamedTuple

from sar_compiler.checks.rules.entry_accesses import entry_table_of
from sar_compiler.checks.rules.key_accesses import key_accesses_of
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.runtime.blackboard import ROOT_SIGN
from sar_compiler.runtime.expressions import Access, Script, name_uses
from sar_compiler.runtime.script import parse
from sar_compiler.tree.guessing import nearest


class Names(NamedTuple):
    """What conditions can ask of a tree.

    Attributes:
        known: The facts, then the keys of the main tree.
        is_open: Whether there may be more keys, in ways that the file does not show.
    """

    known: tuple[str, ...]
    is_open: bool


class Slip(NamedTuple):
    """What is wrong with a condition.

    Attributes:
        message: What is wrong.
        place: Where it stands in the script, in characters.
        suggestion: What to write instead of an unknown name, if it can be guessed.
        hint: The remedy, if the name is known.
    """

    message: str
    place: tuple[int, int]
    suggestion: str | None = None
    hint: str | None = None


def names_of(simulated: SimulatedTree) -> Names:
    """Return the names that a tree's facts have, and the keys of its main tree."""
    top = simulated.compiled.instance
    trees = dict.fromkeys(instance.tree for instance in top.iterate())
    table = entry_table_of(top, {tree: key_accesses_of(tree) for tree in trees})
    keys = [entry.key for entry in table.entries if entry.scope is top.scope]
    for bound in top.tree.uses:
        keys += bound.remapping.keys.values()
    prefix = f"{top.scope.board.prefix}/"
    effects = (
        entry.name
        for leaf in simulated.leaves
        for entry in leaf.entries(f"{name} := 0" for a in leaf.answers if a.then for name in _made_by(a.then))
    )
    for name in (*top.scope.board.names(), *effects):
        key = name.removeprefix(prefix)
        if name != key and "/" not in key:
            keys.append(key)
    return Names(tuple(dict.fromkeys([*simulated.fact_values(), *keys])), table.is_open)


def _made_by(effect: str) -> Iterator[str]:
    """Yield the names that a script makes, if they are not there."""
    return (use.name for use in name_uses(parse(effect)) if use.access is Access.CREATE)


def unknown_in(script: Script, names: Names, own: Collection[str] = ()) -> Iterator[Slip]:
    """Yield the names in a script that nothing has, but for those that it makes.

    Args:
        script: The script.
        names: What there is in the tree.
        own: Further names.
    """
    known = [*names.known, *own]
    for use in name_uses(script) if not names.is_open else ():
        if use.access is not Access.CREATE and use.name.removeprefix(ROOT_SIGN) not in known:
            message = f"'{use.name}' is neither a fact nor a key of this tree; there is {', '.join(known) or 'none'}"
            yield Slip(message, (use.start, use.end), suggestion=nearest(use.name, known))


def slips(script: Script, names: Names, own: Collection[str], later: Collection[str] = ()) -> Iterator[Slip]:
    """Yield what is wrong with a condition.

    Args:
        script: The condition.
        names: What there is in the tree.
        own: The names of what is known of the run itself.
        later: The names of what will be known when a tick is over.
    """
    usable = True
    for use in name_uses(script):
        place = (use.start, use.end)
        if use.access is not Access.READ:
            message = f"a condition only looks at '{use.name}' and does not change it"
            yield Slip(message, place, hint="write == to compare")
        elif use.name in later:
            message = f"'{use.name}' is known only when a tick is over; an event comes before that"
            yield Slip(message, place, hint="end and at_end can use it")
        else:
            continue
        usable = False
    if usable:
        yield from unknown_in(script, names, own)
