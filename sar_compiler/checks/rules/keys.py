"""Blackboard keys that are read but never written, read too early, or written but never read."""

import difflib
import itertools
from collections.abc import Iterator

from sar_compiler.checks.rules.check_context import CheckContext, information, warning
from sar_compiler.checks.rules.entry_accesses import (
    EntryAccess,
    EntryAccesses,
    EntryTable,
    argument_of,
    between,
    comes_first,
    entry_table_of,
    parting,
)
from sar_compiler.checks.rules.key_accesses import AccessTime, KeyAccesses, key_accesses_of
from sar_compiler.checks.rules.outcome_analysis import PossibleOutcomes
from sar_compiler.checks.rules.scripts import is_condition
from sar_compiler.nodes.binding.attributes import closed
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.binding.collector import file_of
from sar_compiler.nodes.outcome_sets import K, S
from sar_compiler.nodes.semantics import WRITES, AccessKind, Order
from sar_compiler.nodes.values import nearest
from sar_compiler.tree.diagnostic import Diagnostic

_LIKE, _CLOSE = 0.7, 0.75
"""The similarity of two keys from which one may be, and from which it must be, a misspelling of the other."""


def check_keys(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about keys whose reads and writes do not fit each other."""
    if not context.sound:
        return  # a mistake elsewhere may be the reason why a key is not written
    main = context.forest.main_tree()
    known: dict[BoundTree, KeyAccesses] = {}
    reported: set[tuple[str, int, int]] = set()
    for top in context.bound.tops:
        board = entry_table_of(top, known)
        model = context.bound.models.subtrees.get(top.tree.name)
        ports = model.ports if model is not None else {}
        for entry in board.entries if ports else ():
            # Users of the tree pass it the keys that its model declares.
            entry.is_parameter = entry.is_parameter or (entry.scope is top.scope and entry.key in ports)
        for finding in _of_board(board, context, is_main=top.tree.element is main):
            place = (finding.source.path, finding.span.line, finding.span.column)
            if place not in reported:
                reported.add(place)
                yield finding


def _of_board(board: EntryTable, context: CheckContext, *, is_main: bool) -> Iterator[Diagnostic]:
    for entry in board.entries:
        if entry.given or entry.is_parameter:
            continue
        if not entry.is_made:
            yield from _unwritten(entry, board, is_main=is_main)
            continue
        if not board.is_foreign:
            yield from _too_early(entry)
        yield from _overwritten(entry, context)
        if not board.is_foreign:
            yield from _side_by_side(entry)
        if is_main and not board.is_open and not board.is_foreign:
            yield from _unread(entry, board)


def _unwritten(entry: EntryAccesses, board: EntryTable, *, is_main: bool) -> Iterator[Diagnostic]:
    readers = entry.of(AccessKind.READ, AccessKind.PEEK, AccessKind.CHANGE)
    if not readers:
        return
    use = readers[0]
    if use.access.kind is AccessKind.CHANGE and is_condition(use.bound, use.access.attribute):
        return  # `check_scripts` asks whether == is meant
    if _is_given_another(use):
        return  # `check_subtrees` finds the attribute that means nothing
    written = [other.key for other in board.entries if other.scope is entry.scope and other.is_made]
    near = _nearest(entry.key, written)
    if near is not None and (board.is_foreign or not is_main) and not _is_slip(entry, near):
        near = None
    is_open = board.is_open and not _is_name_of_key(use)
    if near is None and (is_open or board.is_foreign or not is_main or _may_be_enumeration(use)):
        return
    yield _unwritten_finding(use, entry, near)


def _unwritten_finding(use: EntryAccess, entry: EntryAccesses, near: str | None) -> Diagnostic:
    argument = argument_of(use, entry)
    if argument is not None:
        return _unwritten_argument(*argument, entry, near)
    access, key = use.access, use.access.key
    suggestion, hint = None, _how_to_give(use, key)
    if near is not None and key == entry.key:
        suggestion = near if access.place else f"{{{near}}}" if access.attribute in use.bound.keys else near
    if access.kind is AccessKind.CHANGE:
        message = f"{access.attribute}: nothing makes '{key}', and = and its like need a variable that exists"
        hint = f"write {key} := ... where it is to be made"
    else:
        message = f"{access.attribute}: '{key}' is read here, and nothing ever writes it"
    return warning("unwritten-key", message, use.bound, use.access.span(), suggestion=suggestion, hint=hint)


def _unwritten_argument(
    place: BoundNode, attribute: str, entry: EntryAccesses, near: str | None
) -> Diagnostic:
    """Return the finding about an unwritten key at the `SubTree` that passes it to the reading tree."""
    message = f"{attribute}: '{entry.key}' is read in '{place.name}', and nothing ever writes it"
    suggestion = f"{{{near}}}" if near is not None else None
    hint = f"let a node before it write it; a parameter of the mission is {{@{entry.key}}}"
    return warning("unwritten-key", message, place, place.element.value_span(attribute), suggestion, hint)


def _how_to_give(use: EntryAccess, key: str) -> str:
    if _is_name_of_key(use):
        return f'{use.access.attribute} takes the name itself: write {use.access.attribute}="{key}"'
    if use.instance.around is not None:
        return f'give it to the subtree, <SubTree ID="{use.instance.tree.name}" {key}="..."/>, or let a node write it'
    shown = f"@{key}" if use.access.place else f"{{@{key}}}"
    return f"let a node before it write it; a parameter of the mission is {shown}"


def _is_slip(entry: EntryAccesses, near: str) -> bool:
    """Return whether a key is used only once, and so similar to another one that it must be a misspelling."""
    plural = {entry.key, near} in ({entry.key, f"{entry.key}s"}, {near, f"{near}s"})
    numbered = entry.key.rstrip("0123456789") == near.rstrip("0123456789")
    close = _likeness(entry.key, near) >= _CLOSE
    return len(entry.uses) == 1 and close and not plural and not numbered


def _is_given_another(use: EntryAccess) -> bool:
    """Return whether the tree of a use is passed a key that it does not use."""
    place = use.instance.place
    if place is None:
        return False
    given = {*place.remapping.keys, *place.remapping.constants}
    return bool(given - {access.key for access in key_accesses_of(use.instance.tree).accesses})


def _is_name_of_key(use: EntryAccess) -> bool:
    """Return whether a port takes the name of a key, so that a key in braces holds the name."""
    role = use.bound.spec.semantics.keys.get(use.access.attribute)
    return role is not None and role.indirect


def _nearest(key: str, others: list[str]) -> str | None:
    near = nearest(key.strip(), others)
    return near if near is not None and _likeness(key.strip(), near) >= _LIKE else None


def _likeness(word: str, other: str) -> float:
    return difflib.SequenceMatcher(None, word, other).ratio()


def _may_be_enumeration(use: EntryAccess) -> bool:
    """Return whether a name in a script may be an enumeration's, which only the executing program knows."""
    return use.access.place is not None and use.access.key[0].isupper() and use.access.kind is AccessKind.READ


def _too_early(entry: EntryAccesses) -> Iterator[Diagnostic]:
    for use in entry.of(AccessKind.READ):
        if all(comes_first(use, writer) for writer in entry.writers):
            writer = entry.writers[0]
            message = (
                f"{use.access.attribute}: '{use.access.key}' is read here before it can have been written: "
                f"'{writer.bound.name}' (line {writer.bound.element.line}"
                f"{file_of(writer.bound.element, use.bound.element)}), which writes it, comes later"
            )
            hint = "write it before, or read it later"
            yield warning("read-before-write", message, use.bound, use.access.span(), hint=hint)
            return


def _overwritten(entry: EntryAccesses, context: CheckContext) -> Iterator[Diagnostic]:
    writers = entry.of(AccessKind.WRITE)
    if entry.of(AccessKind.BOTH, AccessKind.CHANGE):
        return
    for first, second in itertools.pairwise(writers):
        if not _follow_each_other(first, second):
            continue
        lost = _only_read_after(entry, second) or all(
            _just_succeeds(node, context.outcomes) for node in between(first, second)
        )
        if lost and not any(_lies_between(use, first, second) for use in entry.readers):
            message = (
                f"{second.access.attribute}: '{second.access.key}' is written again here, before anybody can have "
                f"read what '{first.bound.name}' (line {first.bound.element.line}) wrote"
            )
            hint = "use two keys, or delete one of the two"
            yield warning("overwritten-key", message, second.bound, second.access.span(), hint=hint)


def _side_by_side(entry: EntryAccesses) -> Iterator[Diagnostic]:
    for first, second in itertools.pairwise(entry.of(AccessKind.WRITE)):
        together = parting(first, second)
        if 0 < together < min(len(first.path), len(second.path)):
            around = first.path[together - 1][1]
            # A key that is also read there is a signal from one branch to the other.
            is_signal = any(parting(use, first) >= together for use in entry.readers)
            if around.spec.semantics.order is Order.TOGETHER and not is_signal:
                message = (
                    f"{second.access.attribute}: '{second.access.key}' is written here and by '{first.bound.name}' "
                    f"(line {first.bound.element.line}), side by side in '{around.name}': which one stays is left to "
                    "their timing"
                )
                yield warning("shared-key", message, second.bound, second.access.span(), hint="use two keys")
                return


def _follow_each_other(first: EntryAccess, second: EntryAccess) -> bool:
    if first.bound is second.bound or first.instance is not second.instance:
        return False
    if not second.access.is_certain or second.access.time is AccessTime.AFTER:
        return False
    if first.bound.spec.is_only_described or second.bound.spec.is_only_described:
        return False
    together = parting(first, second)
    within = together and together < min(len(first.path), len(second.path))
    in_sequence = within and first.path[together - 1][1].spec.semantics.is_sequence
    return bool(in_sequence) and comes_first(first, second)


def _only_read_after(entry: EntryAccesses, second: EntryAccess) -> bool:
    """Return whether all reads of an entry come after a write in the same sequence."""
    return bool(entry.readers) and all(comes_first(second, use) for use in entry.readers)


def _lies_between(use: EntryAccess, first: EntryAccess, second: EntryAccess) -> bool:
    """Return whether a use may come between two successive writes in a sequence."""
    together = parting(first, second)
    if use.bound is second.bound:
        return True
    if parting(use, first) < together:
        return False
    around = first.path[together - 1][1]
    order = list(around.children)
    mine = use.path[together][1] if len(use.path) > together else around
    if mine not in order:
        return True
    start, end = (order.index(each.path[together][1]) for each in (first, second))
    return start <= order.index(mine) <= end


def _just_succeeds(bound: BoundNode, outcomes: PossibleOutcomes) -> bool:
    return outcomes.may_return(bound) & ~K == S


def _unread(entry: EntryAccesses, board: EntryTable) -> Iterator[Diagnostic]:
    if entry.readers or entry.of(AccessKind.CHANGE):
        return
    wanting = [other.key for other in board.entries if other.scope is entry.scope and not other.is_made]
    if _nearest(entry.key, wanting) is not None:
        return  # the one that is misspelt is reported where it is read
    if _is_given_for_nothing(entry, board):
        return  # `check_subtrees` finds the attribute that means nothing
    for use in entry.writers:
        if _is_meant_elsewhere(use):
            return  # `check_texts` finds the brace that is missing
        only_writes = use.bound.spec.kind.is_leaf and use.bound.spec.effects == WRITES
        if only_writes and use.access.attribute not in use.bound.conditions:
            message = f"{use.access.attribute}: '{use.access.key}' is written here, and nothing ever reads it"
            hint = "delete it, unless somebody looks at the blackboard from outside"
            yield information("unread-key", message, use.bound, use.access.span(), hint=hint)
            return


def _is_given_for_nothing(entry: EntryAccesses, board: EntryTable) -> bool:
    """Return whether a subtree is passed an entry by a key that it does not use."""
    owner = (entry.scope, entry.key)
    return any(
        instance.scope.owner(key) == owner
        and name not in {access.key for access in key_accesses_of(inner.tree).accesses}
        for instance in board.top.iterate()
        for place, inner in instance.inner.items()
        for name, key in place.remapping.keys.items()
    )


def _is_meant_elsewhere(use: EntryAccess) -> bool:
    """Return whether a text in the same tree is the key of a use without one brace."""
    meant = f"{{{use.access.key}}}"
    texts = (text for bound in use.instance.tree.nodes for text in bound.element.attributes.values())
    return any(closed(text) == meant for text in texts)
