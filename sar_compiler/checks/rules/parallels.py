"""Children of a Parallel that interfere with each other."""

from collections.abc import Iterator
from typing import NamedTuple

from sar_compiler.checks.rules.check_context import CheckContext
from sar_compiler.checks.rules.outcome_analysis import Found, PossibleOutcomes, acts
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.semantics import Order
from sar_compiler.nodes.spec import Use
from sar_compiler.tree.diagnostic import Diagnostic


def check_parallels(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about children of a Parallel that interfere with each other."""
    for tree in context.trees:
        for bound in tree.parents:
            if bound.spec.semantics.order is Order.TOGETHER and bound not in context.broken:
                yield from _cancelled(bound, context.outcomes)
                yield from _out_of_step(bound, context.outcomes)
                yield from _shared_actions(bound)


def _cancelled(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    if bound.values.get("policy") != "SuccessOnOne" and bound.values.get("success_count") != 1:
        return
    work = [found for child in bound.children if (found := outcomes.anywhere(child, outcomes.is_work))]
    if len(work) > 1:
        message = (
            f"in '{bound.name}' the first success interrupts the others: {work[1].name} stops half done when "
            f"{work[0].name} succeeds, and the other way round"
        )
        attribute = "policy" if "policy" in bound.element.attributes else "success_count"
        hint = "require all to succeed, or move the watching branch out of this Parallel"
        yield bound.element.finding("cancelled-branch", message, value=attribute, hint=hint)


def _out_of_step(bound: BoundNode, outcomes: PossibleOutcomes) -> Iterator[Diagnostic]:
    if bound.values.get("policy") != "SuccessOnAll" or bound.values.get("synchronise") is not False:
        return
    running = [child for child in bound.children if outcomes.takes_time(child)]
    for child in bound.children:
        others = [other for other in running if other is not child]
        if others and (child in running or outcomes.anywhere(child, acts)):
            message = (
                f"'{child.name}' is started again whenever it has succeeded and '{others[0].name}' still runs: "
                f"'{bound.name}' succeeds only in a tick in which all its children do"
            )
            yield bound.element.finding("out-of-step", message, value="synchronise", suggestion="true")
            return


class _Action(NamedTuple):
    name: str
    found: Found


def _shared_actions(bound: BoundNode) -> Iterator[Diagnostic]:
    first: dict[str, _Action] = {}
    for child in bound.children:
        actions = list(_actions(child, None))
        for action in actions:
            other = first.get(action.name)
            if other is not None:
                message = (
                    f"{action.found.name} sends its goals to '{action.name}' while {other.found.name} does: a new goal "
                    "takes the place of the one under way"
                )
                hint = f"put one after the other, in a <Sequence> instead of '{bound.name}'"
                yield action.found.place.element.finding("shared-action", message, hint=hint)
                return
        for action in actions:
            first.setdefault(action.name, action)


def _actions(bound: BoundNode, place: BoundNode | None) -> Iterator[_Action]:
    if bound.subtree is not None and bound.subtree.root is not None:
        yield from _actions(bound.subtree.root, place or bound)
    for use in bound.spec.uses:
        name = _name(use, bound)
        if use.kind == "action" and name:
            yield _Action(name, Found(bound, place or bound))
    for child in bound.children:
        yield from _actions(child, place)


def _name(use: Use, bound: BoundNode) -> str:
    """Return the name of a resource that a leaf uses; empty if part of it comes from a key."""
    name = use.name
    for parameter in bound.spec.parameters.values():
        placeholder = f"{{{parameter.name}}}"
        if placeholder in name:
            if parameter.name in bound.keys:
                return ""
            name = name.replace(placeholder, str(bound.values.get(parameter.name, parameter.default)))
    return name
