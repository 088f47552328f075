"""Rules about blackboard keys that are read but never written, read too early, or written but never read."""

import itertools
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace

from sar_compiler.checks.rules import CheckContext
from sar_compiler.checks.rules.entry_accesses import (
    AccessTime,
    EntryAccess,
    EntryAccesses,
    EntryTable,
    TreePosition,
    argument_of,
    branching_position,
    comes_first,
    common_position,
    entry_table_of,
    nodes_between,
)
from sar_compiler.checks.rules.outcome_analysis import PossibleOutcomes
from sar_compiler.checks.rules.scripts import is_condition, is_statement
from sar_compiler.checks.rules.written_types import KeyTypeRules
from sar_compiler.gc_pause import gc_paused
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.collector import file_of
from sar_compiler.nodes.outcome_sets import ALLOWED, BITS, K, S
from sar_compiler.nodes.semantics import WRITES, AccessKind, Order
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.outcomes import Outcome
from sar_compiler.tree.diagnostic import Advice, Diagnostic, Severity
from sar_compiler.tree.guessing import Guesses, likeness
from sar_compiler.tree.model import SUBTREE_TAG

_WORD = re.compile(r"\w+")
_LIKE, _CLOSE = 0.7, 0.75
"""The minimum similarities of two keys at which one is possibly, or certainly, a typo of the other."""


def check_keys(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about keys whose reads and writes do not match."""
    if not context.is_complete:
        yield from _check_typos(context)
        return  # another error may be the reason why a key is not written
    reported: set[tuple[str, int, int]] = set()
    with gc_paused():  # a large file has many objects for keys, which live as long as the check
        for top in context.bound_forest.tops:
            board = entry_table_of(top, context.key_accesses)
            model = context.bound_forest.models.subtrees.get(top.tree.name)
            ports = model.ports if model is not None else {}
            for entry in board.entries if ports else ():
                # Users of the tree pass the keys that its model declares.
                entry.is_parameter = entry.is_parameter or (entry.scope is top.scope and entry.key in ports)
            for finding in _check_board(board, context):
                place = (finding.source.path, finding.span.line, finding.span.column)
                if place not in reported:
                    reported.add(place)
                    yield finding


def _check_typos(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about keys in a file with errors: only typos that cannot be a consequence of the errors."""
    doubtful = context.elements_with_errors
    if not context.is_whole or any(each.tag == SUBTREE_TAG or "ID" in each.attributes for each in doubtful):
        return
    # Looked up word by word, so that the effort grows only linearly with the file.
    words = {word for each in doubtful for text in each.attributes.values() for word in _WORD.findall(text)}
    for top in context.bound_forest.tops:
        board = entry_table_of(top, context.key_accesses)
        for entry in board.entries:
            if (
                entry.given
                or entry.is_parameter
                or entry.is_made
                or not words.isdisjoint(_WORD.findall(entry.key))
            ):
                continue
            near = _nearest(entry.key, board.written_by_scope.get(entry.scope, ()), context.guesses)
            if near is not None and _is_typo(entry, near):
                yield from _check_unwritten(entry, board, context)


def refused_key_types(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield only those findings about keys that concern their types."""
    for top in context.bound_forest.tops:
        board = entry_table_of(top, context.key_accesses)
        rules = KeyTypeRules(
            board, context.bound_forest.key_types[top], context.btcpp, context.bound_forest.models.enums
        )
        for entry in board.entries:
            yield from rules.check_entry(entry)


def _check_board(board: EntryTable, context: CheckContext) -> Iterator[Diagnostic]:
    rules = KeyTypeRules(
        board, context.bound_forest.key_types[board.top], context.btcpp, context.bound_forest.models.enums
    )
    for entry in board.entries:
        yield from rules.check_entry(entry)
        if entry.given or entry.is_parameter:
            continue
        if not entry.is_made:
            yield from _check_unwritten(entry, board, context)
            continue
        yield from _lower_severity(_too_early(entry)) if board.is_foreign else _too_early(entry)
        yield from find_unwritten_ends(entry, context.outcomes)
        yield from _check_overwritten(entry, context)
        if not board.is_foreign:
            yield from _parallel_writes(entry)
        if not board.is_open and not board.is_foreign:
            yield from (each for each in _unread(entry, board, context) if context.is_main(board.top.tree))


def _check_unwritten(entry: EntryAccesses, board: EntryTable, context: CheckContext) -> Iterator[Diagnostic]:
    readers = [
        each
        for each in entry.of_kinds(AccessKind.READ, AccessKind.PEEK, AccessKind.CHANGE)
        if each.access.place is None
        or not is_statement(each.node, each.access.attribute, each.access.place[0])
    ]
    enums = context.bound_forest.models.enums
    if not readers or _is_explained(readers[0], entry, board, enums):
        return
    use = readers[0]
    near = _nearest(entry.key, board.written_by_scope.get(entry.scope, ()), context.guesses)
    meant = _nearest(entry.key, enums, context.guesses) if near is None and use.access.place else None
    if meant is not None:
        yield _unknown_enumeration(use, meant)
        return
    if near is not None and (
        _is_typo(entry, near) or (context.is_main(board.top.tree) and not board.is_foreign)
    ):
        yield _unwritten_finding(use, entry, near)
        return
    is_open = board.is_open and not _is_name_of_key(use)
    if is_open or not context.is_main(board.top.tree):
        return
    if _may_be_enumeration(use, entry, enums):
        unless = "unless it is an enumerator; to declare enumerators, use [language.enums] in sar.toml"
        yield from _lower_severity([_unwritten_finding(use, entry, None)] if board.is_foreign else [], unless)
    elif not board.is_foreign:
        yield _unwritten_finding(use, entry, None)
    else:
        # A key that only nodes of another program read is probably written by that program, unless it resembles a
        # written key of the tree.
        own = next((each for each in readers if not each.node.spec.is_foreign), use if near else None)
        if own is not None:
            yield from _lower_severity([_unwritten_finding(own, entry, near)])


def _is_explained(use: EntryAccess, entry: EntryAccesses, board: EntryTable, enums: Collection[str]) -> bool:
    """Return whether a name in a script is a declared enumerator, or another rule reports the name."""
    if enums and _may_be_enumeration(use, entry, enums):
        return True
    # `check_scripts` reports = instead of ==, and `check_subtrees` an unused attribute.
    is_assignment = use.access.kind is AccessKind.CHANGE and is_condition(use.node, use.access.attribute)
    return is_assignment or _is_passed_unused_key(use, board)


def _lower_severity(
    findings: Iterable[Diagnostic], unless: str = "unless C++ code writes it"
) -> Iterator[Diagnostic]:
    """Yield the given findings as notes, because nodes of other programs may write the keys."""
    for finding in findings:
        yield replace(finding, message=f"{finding.message}, {unless}", severity=Severity.INFO)


def _unwritten_finding(use: EntryAccess, entry: EntryAccesses, near: str | None) -> Diagnostic:
    argument = argument_of(use, entry)
    if argument is not None:
        return _unwritten_argument(*argument, entry, near)
    access, key = use.access, use.access.key
    suggestion, hint = None, _writing_hint(use, key)
    if near is not None and key == entry.key:
        suggestion = near if access.place else f"{{{near}}}" if access.attribute in use.node.keys else near
    if access.kind is AccessKind.CHANGE:
        message = f"{access.attribute}: '{key}' is never created, but '=' and similar operators need an existing variable"
        hint = f"to create it, write {key} := ..."
    elif key.startswith("{") and key.endswith("}"):
        message = f"{access.attribute}: the inner braces are part of the key, so the key is '{key}', which is never written"
        suggestion = key
    else:
        message = f"{access.attribute}: '{key}' is read here, but never written"
    advice = Advice(suggestion=suggestion, hint=hint)
    return use.node.element.finding("unwritten-key", message, use.access.span(), **advice)


def _unknown_enumeration(use: EntryAccess, meant: str) -> Diagnostic:
    access = use.access
    message = f"{access.attribute}: '{access.key}' is not a declared enumerator, and no node writes a key of this name"
    return use.node.element.finding("unwritten-key", message, access.span(), suggestion=meant)


def _unwritten_argument(
    place: BoundNode, attribute: str, entry: EntryAccesses, near: str | None
) -> Diagnostic:
    """Return the finding about an unwritten key, at the `SubTree` that passes the key to the reading tree."""
    message = f"{attribute}: '{entry.key}' is read in '{place.name}', but never written"
    suggestion = f"{{{near}}}" if near is not None else None
    hint = f"write it in an earlier node, or read the mission parameter {{@{entry.key}}}"
    return place.element.finding("unwritten-key", message, value=attribute, suggestion=suggestion, hint=hint)


def _writing_hint(use: EntryAccess, key: str) -> str:
    if _is_name_of_key(use):
        return f'{use.access.attribute} takes the name of a key without braces: write {use.access.attribute}="{key}"'
    if use.instance.around is not None:
        return f'pass it to the subtree, <SubTree ID="{use.instance.tree.name}" {key}="..."/>, or write it in a node'
    shown = f"@{key}" if use.access.place else f"{{@{key}}}"
    return f"write it in an earlier node, or read the mission parameter {shown}"


def _is_typo(entry: EntryAccesses, near: str) -> bool:
    """Return whether a key is a typo of another key.

    This is assumed if the two keys differ only in blanks, or if the key is used only once and is very similar to
    the other key.
    """
    if entry.key.strip() == near.strip():
        return True
    plural = {entry.key, near} in ({entry.key, f"{entry.key}s"}, {near, f"{near}s"})
    numbered = entry.key.rstrip("0123456789") == near.rstrip("0123456789")
    close = likeness(entry.key, near) >= _CLOSE
    return len(entry.uses) == 1 and close and not plural and not numbered


def _is_passed_unused_key(use: EntryAccess, board: EntryTable) -> bool:
    """Return whether the `SubTree` around an access passes a key that the tree does not use."""
    place = use.instance.place
    if place is None:
        return False
    used = board.accesses[use.instance.tree].keys
    return any(name not in used for name in (*place.remapping.keys, *place.remapping.constants))


def _is_name_of_key(use: EntryAccess) -> bool:
    """Return whether a port expects the name of a key. If so, a key in braces must contain the name."""
    role = use.node.spec.semantics.keys.get(use.access.attribute)
    return role is not None and role.indirect


def _nearest(key: str, others: Collection[str], guesses: Guesses) -> str | None:
    for same in (key.strip(), f"{key} ", f" {key}"):
        if same != key and same in others:
            return same
    near = guesses.nearest(key.strip(), others)
    return near if near is not None and likeness(key.strip(), near) >= _LIKE else None


def _may_be_enumeration(use: EntryAccess, entry: EntryAccesses, enums: Collection[str]) -> bool:
    """Return whether a name that scripts only read may be an enumerator.

    A name may be an enumerator if it is declared as one or begins with a capital letter.
    """
    if (
        use.access.place is None
        or use.access.kind is not AccessKind.READ
        or entry.of_kinds(AccessKind.CHANGE)
    ):
        return False
    return use.access.key in enums if enums else use.access.key[0].isupper()


def _too_early(entry: EntryAccesses) -> Iterator[Diagnostic]:
    for use in entry.of_kinds(AccessKind.READ):
        if entry.ordered_writers.is_each_preceded(use):
            writer = entry.writers[0]
            message = (
                f"{use.access.attribute}: '{use.access.key}' is read here before it is written: "
                f"'{writer.node.name}' (line {writer.node.element.line}"
                f"{file_of(writer.node.element, use.node.element)}) writes it, but is ticked later"
            )
            hint = "write it earlier, or read it later"
            yield use.node.element.finding("read-before-write", message, use.access.span(), hint=hint)
            return


def _check_overwritten(entry: EntryAccesses, context: CheckContext) -> Iterator[Diagnostic]:
    writers = entry.of_kinds(AccessKind.WRITE)
    if entry.of_kinds(AccessKind.BOTH, AccessKind.CHANGE):
        return
    for first, second in itertools.pairwise(writers):
        if not _follow_each_other(first, second):
            continue
        if _is_read_between(entry, first, second):
            continue
        only_read_after = bool(entry.readers) and entry.ordered_readers.is_each_preceded(second)
        if only_read_after or all(
            context.outcomes.possible_results(node) & ~K == S for node in nodes_between(first, second)
        ):
            message = (
                f"{second.access.attribute}: '{second.access.key}' is overwritten here before any node can "
                f"read the value from '{first.node.name}' (line {first.node.element.line})"
            )
            hint = "use two keys, or delete one of the writes"
            yield second.node.element.finding("overwritten-key", message, second.access.span(), hint=hint)


def _parallel_writes(entry: EntryAccesses) -> Iterator[Diagnostic]:
    for first, second in itertools.pairwise(entry.of_kinds(AccessKind.WRITE)):
        around = branching_position(first, second)
        if around is None or around.bound.spec.semantics.order is not Order.TOGETHER:
            continue
        # A key that a branch also reads is a signal from one branch to the other.
        if not entry.ordered_readers.has_access_in(around.number, around.last):
            message = (
                f"{second.access.attribute}: '{second.access.key}' is written here and by '{first.node.name}' "
                f"(line {first.node.element.line}), in parallel in '{around.bound.name}': which value remains depends on "
                "timing"
            )
            hint = "use two keys"
            yield second.node.element.finding("shared-key", message, second.access.span(), hint=hint)
            return


def _follow_each_other(first: EntryAccess, second: EntryAccess) -> bool:
    if first.node is second.node or first.instance is not second.instance:
        return False
    if not second.access.is_certain or second.access.time is AccessTime.AFTER:
        return False
    if first.node.spec.is_only_described or second.node.spec.is_only_described:
        return False
    around = branching_position(first, second)
    return around is not None and around.bound.spec.semantics.is_sequence and comes_first(first, second)


def _is_read_between(entry: EntryAccesses, first: EntryAccess, second: EntryAccess) -> bool:
    """Return whether an entry may be read between two successive writes in a sequence."""
    around = common_position(first.position, second.position)
    start, end = around.child(first.position), around.child(second.position)
    readers = entry.ordered_readers
    return (
        second.node in entry.possible_readers
        or readers.has_access_in(start.number, end.last)
        or readers.has_access_in(around.number, around.number)
    )


def _unread(entry: EntryAccesses, board: EntryTable, context: CheckContext) -> Iterator[Diagnostic]:
    if entry.readers or entry.of_kinds(AccessKind.CHANGE):
        return
    if _nearest(entry.key, board.unwritten.get(entry.scope, ()), context.guesses) is not None:
        return  # the misspelt key is reported at the node that reads it
    if (entry.scope, entry.key) in board.unused_arguments:
        return  # `check_subtrees` reports the unused attribute
    for use in entry.writers:
        if f"{{{use.access.key}}}" in board.unclosed_keys[use.instance.tree]:
            return  # `check_strings` reports the missing brace
        only_writes = use.node.spec.kind.is_leaf and use.node.spec.effects == WRITES
        if only_writes and use.access.attribute not in use.node.conditions:
            message = f"{use.access.attribute}: '{use.access.key}' is written here, but never read"
            hint = "delete it, unless another program reads the blackboard"
            yield use.node.element.finding("unread-key", message, use.access.span(), hint=hint)
            return


def find_unwritten_ends(entry: EntryAccesses, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    """Yield a finding about the first read that may happen although no writer has written the entry.

    The rule checks only writers that are leaves whose outcomes declare the written keys (`Outcome.writes`). A read is
    reported if, in some possible run, it is the first access after a writer has ended without writing. To decide this,
    the rule computes the possible results of the writer's ancestors after such an end, up to the node that has the
    writer and the reader in different children. If this node can then continue to the reader's branch, the reader is
    reached. Nothing is reported if a condition, a script before a node or a chosen branch on the path may depend on how
    the writer has ended, because a wrong finding is worse than a missing one.
    """
    if not entry.writers or any(_silent_outcomes(writer) is None for writer in entry.writers):
        return
    for use in entry.of_kinds(AccessKind.READ):
        before = [each for each in entry.writers if each.position.number < use.position.number]
        if before and all(_can_pass(writer, use, outcomes) for writer in before):
            yield _maybe_unwritten_finding(before[-1], use)
            return


def _maybe_unwritten_finding(writer: EntryAccess, use: EntryAccess) -> Diagnostic:
    outcomes = _silent_outcomes(writer) or []
    labels = ", ".join(f"'{each.name}'" for each in outcomes if each.status != "RUNNING")
    when = f"ends with {labels}" if labels else "runs"
    key, element = use.access.key, use.node.element
    message = (
        f"{use.access.attribute}: '{key}' may not be written yet: '{writer.node.name}' (line {writer.node.element.line}"
        f"{file_of(writer.node.element, element)}) does not write it when it {when}"
    )
    hint = f'assign it in an earlier node: <Script code="{key} := ..."/>'
    return element.finding("maybe-unwritten-key", message, use.access.span(), hint=hint)


def _silent_outcomes(writer: EntryAccess) -> list[Outcome] | None:
    """Return the outcomes for which a leaf does not write a key; None if the leaf declares no writes."""
    outcomes = writer.node.spec.outcomes
    if not outcomes or any(outcome.writes is None for outcome in outcomes):
        return None
    return [outcome for outcome in outcomes if writer.access.attribute not in (outcome.writes or ())]


def _can_pass(writer: EntryAccess, use: EntryAccess, outcomes: PossibleOutcomes) -> bool:
    """Return whether a read may directly follow the end of a writer that did not write the key."""
    around = common_position(writer.position, use.position)
    if around in (writer.position, use.position):
        return False
    first, second = around.child(writer.position), around.child(use.position)
    ended = _outcomes_without_write(writer, first, outcomes)
    means = around.bound.spec.semantics
    if means.order is Order.CHOSEN or not ended:
        return False
    if means.order is Order.IN_ORDER and not ended & means.goes_on:
        return False
    siblings = around.bound.children[first.index + 1 : second.index]
    return not any(map(_has_condition, siblings)) and not _is_guarded(use, second)


def _outcomes_without_write(writer: EntryAccess, top: TreePosition, outcomes: PossibleOutcomes) -> int:
    """Return the possible results of the node at *top* if a leaf below it did not write a key.

    Return 0 if these results are unknown.
    """
    ended = 0
    for outcome in _silent_outcomes(writer) or ():
        ended |= BITS[outcome.status]
    place = writer.position
    while not _has_scripts(place.bound):
        if place is top:
            return ended
        parent = place.around
        assert parent is not None  # noqa: S101 - the top contains it
        if parent.bound.subtree is None:
            possible = parent.bound.spec.semantics.possible
            if possible is None:
                return 0
            sets = [
                ended if number == place.index else outcomes.possible_results(child)
                for number, child in enumerate(parent.bound.children)
            ]
            ended = possible(parent.bound, sets, ALLOWED)
        place = parent
    return 0


def _is_guarded(use: EntryAccess, top: TreePosition) -> bool:
    """Return whether an earlier node in the reader's branch may prevent a read."""
    place = use.position
    if _has_scripts(place.bound) and use.access.attribute != next(iter(place.bound.conditions), None):
        return True
    while place is not top:
        parent = place.around
        assert parent is not None  # noqa: S101 - the top contains it
        before = parent.bound.children[: place.index]
        is_chosen = bool(parent.bound.children[1:]) and parent.bound.spec.semantics.order is Order.CHOSEN
        if is_chosen or _has_scripts(parent.bound) or any(map(_has_condition, before)):
            return True
        place = parent
    return False


def _has_scripts(bound: BoundNode) -> bool:
    return bool(bound.conditions) or bound.oneshot is not None


def _has_condition(bound: BoundNode) -> bool:
    """Return whether a node has a condition, or contains a node that has one."""
    if bound.spec.kind is Kind.CONDITION or _has_scripts(bound):
        return True
    inner = [bound.subtree.root] if bound.subtree is not None and bound.subtree.root is not None else []
    return any(map(_has_condition, [*bound.children, *inner]))
