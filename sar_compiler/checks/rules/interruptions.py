"""Rules about actions that reactive controls and parallels repeat or interrupt."""

from collections.abc import Iterator
from typing import NamedTuple

from sar_compiler.checks.rules import CheckContext
from sar_compiler.checks.rules.outcome_analysis import (
    FoundLeaf,
    PossibleOutcomes,
    consequence,
    has_world_effect,
    is_question,
    name_next_to,
)
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.outcome_sets import F, R, S
from sar_compiler.nodes.semantics import Order
from sar_compiler.nodes.spec import Use
from sar_compiler.tree.diagnostic import Diagnostic


def check_reactive(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about nodes that a control without memory restarts or interrupts in every tick."""
    if not context.is_informative:
        return
    outcomes = context.outcomes
    for bound in outcomes.running:
        if bound.is_reactive and bound not in context.nodes_with_errors:
            check = _check_sequence if bound.spec.semantics.is_sequence else _check_selector
            yield from check(bound, outcomes)
    for top in context.bound_forest.tops:
        if top.tree.root is not None:
            yield from (
                each for each in _check_finished_work(top.tree.root, outcomes) if context.is_main(top.tree)
            )


def _check_sequence(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    for child, later in _pairs_with_later(bound, outcomes):
        if not outcomes.possible_results(child) & S:
            return  # the later nodes are never reached
        found = outcomes.find_restarted(child, outcomes.always_takes_time)
        if found is not None and outcomes.certain_results(child) & S:
            yield _restart(found, later, bound, f"while {name_next_to(later, found.leaf)} runs")
            return
        found = outcomes.find_restarted(child, outcomes.acts_at_once)
        if found is not None:
            message = (
                f"{found.name_next_to(later)} {consequence(found.leaf)} while {name_next_to(later, found.leaf)} runs: "
                f"'{bound.name}' re-evaluates every child in each tick"
            )
            yield found.place.element.finding("repeated-effect", message, hint=_remember(bound))


def _pairs_with_later(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[tuple[BoundNode, BoundNode]]:
    """Yield pairs of a child and the next child after it that takes time."""
    later: BoundNode | None = None
    pairs: list[tuple[BoundNode, BoundNode]] = []
    for child in reversed(bound.children):
        if later is not None:
            pairs.append((child, later))
        if outcomes.takes_time(child):
            later = child
    return reversed(pairs)


def _check_selector(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    for child, later in _pairs_with_later(bound, outcomes):
        found = outcomes.find_restarted(_first_node(child), outcomes.always_takes_time)
        if (
            found is not None
            and outcomes.certain_results(found.leaf) & F
            and outcomes.certain_results(child) & F
        ):
            place = FoundLeaf(found.leaf, child) if child.subtree is not None else found
            yield _restart(place, later, bound, "after it has failed")
            return
    if outcomes.takes_time(bound.children[-1]):
        yield from _check_lost_progress(bound, outcomes)


def _first_node(bound: BoundNode) -> BoundNode:
    """Return the first node in nested sequences. Its result decides whether the later nodes are ticked."""
    while (
        bound.children and bound.spec.semantics.is_sequence and not bound.conditions and bound.oneshot is None
    ):
        bound = bound.children[0]
    return bound


def _restart(found: FoundLeaf, later: BoundNode, bound: BoundNode, when: str) -> Diagnostic:
    message = (
        f"{found.name_next_to(later)} is restarted in the next tick {when}, and interrupts "
        f"{name_next_to(later, found.leaf)} before that ends: "
        f"'{bound.name}' re-evaluates every child in each tick"
    )
    return found.place.element.finding("endless-restart", message, hint=_remember(bound))


def _check_lost_progress(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    before: BoundNode | None = None
    for child in bound.children:
        interrupting = before
        if outcomes.certain_results(child) & (S | R):
            before = child
        if interrupting is None or not _starts_over(child):
            continue
        steps = [
            found for step in child.children if (found := outcomes.find_restarted(step, outcomes.is_work))
        ]
        if len(steps) > 1:
            message = (
                f"'{child.name}' starts over with {steps[0].name} whenever '{interrupting.name}' has interrupted it, "
                f"because '{child.name}' remembers its position only while it is running"
            )
            hint = 'if a node must not run twice, add oneshot="ON_SUCCESSFUL_COMPLETION" to that node'
            yield child.element.finding("lost-progress", message, hint=hint)


def _starts_over(bound: BoundNode) -> bool:
    """Return whether a node is a sequence with memory that starts over after an interruption."""
    means = bound.spec.semantics
    return means.is_sequence and not means.resumes and not bound.is_reactive and bound.oneshot is None


def _check_finished_work(root: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    """Yield findings about finished work that a reactive selector restarts because no condition prevents it."""
    waiting = [root]
    while waiting:
        bound = waiting.pop()
        if bound.conditions or bound.oneshot is not None:
            continue
        if bound.subtree is not None and bound.subtree.root is not None:
            waiting.append(bound.subtree.root)
        elif bound.spec.semantics.steady:
            waiting.extend(bound.children)
        elif bound.spec.semantics.is_selector and bound.is_reactive:
            yield from _check_repeated_work(bound, outcomes)
            waiting.extend(bound.children)


def _check_repeated_work(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    for index, child in enumerate(bound.children):
        # An earlier branch may check whether the work is done. A branch that begins with a condition and has an effect does not.
        if index and not _fails_after_effect(bound.children[index - 1], outcomes):
            return
        # A branch that begins with a condition may itself check whether work is left.
        if not index or not outcomes.certain_results(child) & S or is_question(_first_node(child)):
            continue
        found = outcomes.find_restarted(child, has_world_effect)
        if found is not None:
            what = "it" if found.place is child else f"'{child.name}'"
            message = (
                f"{found.name} {consequence(found.leaf)}: after {what} has succeeded, '{bound.name}' re-evaluates every "
                f"child in each tick and restarts {what}"
            )
            yield found.place.element.finding("repeated-effect", message, hint=_oneshot_hint(child, found))


def _oneshot_hint(child: BoundNode, found: FoundLeaf) -> str:
    what = "it" if found.place is child else f"'{child.name}'"
    return f'wrap {what} in OneShot: write oneshot="ON_COMPLETION"'


def _fails_after_effect(bound: BoundNode, outcomes: PossibleOutcomes) -> bool:
    """Return whether a node affects the world, and begins with a condition that fails in some run."""
    first = _first_node(bound)
    asks = is_question(first) and outcomes.certain_results(first) & F and first is not bound
    return bool(asks) and outcomes.find_leaf(bound, has_world_effect) is not None


def _remember(bound: BoundNode) -> str:
    if "memory" in bound.element.attributes:
        return f"write memory=\"true\" in '{bound.name}'"
    other = bound.spec.semantics.with_memory
    return (
        f"write <{other}> instead of <{bound.spec.tag}>"
        if other
        else "use a node that resumes at the running child"
    )


def check_parallels(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about children of a parallel node that interfere with each other."""
    for bound in context.parents():
        if bound.spec.semantics.order is Order.TOGETHER:
            yield from _check_cancelled(bound, context.outcomes)
            yield from _check_simultaneous_success(bound, context.outcomes)
            yield from _check_shared_actions(bound)


def _check_cancelled(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    if bound.values.get("policy") != "SuccessOnOne" and bound.values.get("success_count") != 1:
        return
    work = [found for child in bound.children if (found := outcomes.find_leaf(child, outcomes.is_work))]
    if len(work) > 1:
        message = (
            f"in '{bound.name}', the first child that succeeds interrupts the others: {work[1].name} is interrupted when "
            f"{work[0].name} succeeds, and vice versa"
        )
        attribute = "policy" if "policy" in bound.element.attributes else "success_count"
        hint = "require all children to succeed, or move the watching branch out of this Parallel"
        yield bound.element.finding("cancelled-branch", message, value=attribute, hint=hint)


def _check_simultaneous_success(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    if bound.values.get("policy") != "SuccessOnAll" or bound.values.get("synchronise") is not False:
        return
    running = [child for child in bound.children if outcomes.takes_time(child)]
    for child in bound.children:
        others = [other for other in running if other is not child]
        if others and (child in running or outcomes.find_leaf(child, has_world_effect)):
            message = (
                f"'{child.name}' is restarted whenever it has succeeded and '{others[0].name}' still runs: "
                f"'{bound.name}' succeeds only in a tick in which all its children succeed"
            )
            yield bound.element.finding("out-of-step", message, value="synchronise", suggestion="true")
            return


class _Action(NamedTuple):
    name: str
    found: FoundLeaf


def _check_shared_actions(bound: BoundNode) -> Iterator[Diagnostic]:
    first: dict[str, _Action] = {}
    for child in bound.children:
        actions = list(_actions(child, None))
        for action in actions:
            other = first.get(action.name)
            if other is not None:
                message = (
                    f"{action.found.name} sends goals to '{action.name}' at the same time as {other.found.name}: a new goal "
                    "preempts the active one"
                )
                hint = f"run the children one after the other: replace '{bound.name}' by a <Sequence>"
                yield action.found.place.element.finding("shared-action", message, hint=hint)
                return
        for action in actions:
            first.setdefault(action.name, action)


def _actions(bound: BoundNode, place: BoundNode | None) -> Iterator[_Action]:
    if bound.subtree is not None and bound.subtree.root is not None:
        yield from _actions(bound.subtree.root, place or bound)
    for use in bound.spec.uses:
        name = _resource_name(use, bound)
        if use.kind == "action" and name:
            yield _Action(name, FoundLeaf(bound, place or bound))
    for child in bound.children:
        yield from _actions(child, place)


def _resource_name(use: Use, bound: BoundNode) -> str:
    """Return the name of the server or topic that a leaf uses; empty if a key provides a part of the name."""
    name = use.name
    for parameter in bound.spec.parameters.values():
        placeholder = f"{{{parameter.name}}}"
        if placeholder in name:
            if parameter.name in bound.keys:
                return ""
            name = name.replace(placeholder, str(bound.values.get(parameter.name, parameter.default)))
    return name
