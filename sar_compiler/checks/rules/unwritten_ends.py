"""Keys that are read after a leaf has ended with an outcome for which it does not write them.

Only leaves whose outcomes declare the keys that they write are checked (`Answer.writes`). A read is reported if a run
is possible in which it is the first access after such an end. This is decided from the positions of the two nodes.
From the writer upwards, the rule computes what the nodes around it can return after such an end, up to the node in
which writer and reader are in different children. The reader is reached if that node then continues to the reader's
branch. If anything on the way may depend on the same end (a condition, a script before a node, a branch that is
chosen), nothing is reported: a wrong finding is worse than none.
"""

from collections.abc import Iterator

from sar_compiler.checks.rules.entry_accesses import EntryAccess, EntryAccesses, Place, common_place
from sar_compiler.checks.rules.outcome_analysis import PossibleOutcomes
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.collector import file_of
from sar_compiler.nodes.outcome_sets import ALLOWED, BITS
from sar_compiler.nodes.semantics import AccessKind, Order
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.answers import Answer
from sar_compiler.tree.diagnostic import Diagnostic


def find_unwritten_ends(entry: EntryAccesses, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    """Yield the first read of an entry that can follow an end of its writers without a write."""
    if not entry.writers or any(_silent_answers(writer) is None for writer in entry.writers):
        return
    for use in entry.of(AccessKind.READ):
        before = [each for each in entry.writers if each.place.number < use.place.number]
        if before and all(_can_pass(writer, use, outcomes) for writer in before):
            yield _finding(before[-1], use)
            return


def _finding(writer: EntryAccess, use: EntryAccess) -> Diagnostic:
    answers = _silent_answers(writer) or []
    labels = ", ".join(f"'{each.name}'" for each in answers if each.status != "RUNNING")
    when = f"ends with {labels}" if labels else "runs"
    key, element = use.access.key, use.bound.element
    message = (
        f"{use.access.attribute}: '{key}' may not be written yet: '{writer.bound.name}' (line {writer.bound.element.line}"
        f"{file_of(writer.bound.element, element)}) does not write it when it {when}"
    )
    hint = f'assign it in an earlier node: <Script code="{key} := ..."/>'
    return element.finding("maybe-unwritten-key", message, use.access.span(), hint=hint)


def _silent_answers(writer: EntryAccess) -> list[Answer] | None:
    """Return the outcomes of a leaf with which it does not write a key; None if that is not known."""
    answers = writer.bound.spec.answers
    if not answers or any(answer.writes is None for answer in answers):
        return None
    return [answer for answer in answers if writer.access.attribute not in (answer.writes or ())]


def _can_pass(writer: EntryAccess, use: EntryAccess, outcomes: PossibleOutcomes) -> bool:
    """Return whether a read can be the first access to a key after its writer has ended without writing it."""
    around = common_place(writer.place, use.place)
    if around in (writer.place, use.place):
        return False
    first, second = around.child(writer.place), around.child(use.place)
    ended = _ends_of(writer, first, outcomes)
    means = around.bound.spec.semantics
    if means.order is Order.CHOSEN or not ended:
        return False
    if means.order is Order.IN_ORDER and not ended & means.goes_on:
        return False
    siblings = around.bound.children[first.index + 1 : second.index]
    return not any(map(_has_condition, siblings)) and not _is_guarded(use, second)


def _ends_of(writer: EntryAccess, top: Place, outcomes: PossibleOutcomes) -> int:
    """Return the outcome set of a node after a leaf in it has not written a key; empty if unknown."""
    ended = 0
    for answer in _silent_answers(writer) or ():
        ended |= BITS[answer.status]
    place = writer.place
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
                ended if number == place.index else outcomes.may_return(child)
                for number, child in enumerate(parent.bound.children)
            ]
            ended = possible(parent.bound, sets, ALLOWED)
        place = parent
    return 0


def _is_guarded(use: EntryAccess, top: Place) -> bool:
    """Return whether a node before a read, in its branch, may prevent the read."""
    place = use.place
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
