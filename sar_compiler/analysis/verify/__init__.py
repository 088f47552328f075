"""Verifying a tree: whether properties hold in all of its possible runs.

The tree is compiled with stub leaves and brought into flat form; every combination of answers is played in
every state that can be reached, those that fewest ticks lead to first.
"""

from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import partial

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.searching import Report
from sar_compiler.analysis.verify.branches import has_parallels
from sar_compiler.analysis.verify.composing import proved_apart
from sar_compiler.analysis.verify.properties import Properties, PropertyFile, properties_of
from sar_compiler.analysis.verify.slicing import merge_values
from sar_compiler.analysis.verify.state import Prepared
from sar_compiler.analysis.verify.state_space import StateSpace
from sar_compiler.analysis.verify.stepping import TreeStepper, plain_stepper
from sar_compiler.analysis.verify.unknown_values import explored, search_decidable
from sar_compiler.analysis.verify.verdicts import (
    OWN_RECORDS,
    ProofStatus,
    Questions,
    Verdict,
    Verification,
    questions_of,
)
from sar_compiler.budget import Budget, Progress


def verify(
    simulated: SimulatedTree,
    file: PropertyFile | None,
    tags: Collection[str],
    max_states: int,
    budget: Budget | None = None,
    *,
    forgets: bool = True,
    plainly: int = 10_000,
    merges: bool = True,
) -> Verification:
    """Search the states of a tree and answer every question.

    A larger tree with parallel branches that share nothing is proved branch by branch (`composing`), if that leads to answers.
    A property whose condition needs an unknown value is not decided; the others are, without it. Likewise the end of a run, and what depends on it.

    Args:
        simulated: The tree with stub leaves; it is used up.
        file: What must hold; None for nothing but what is asked of every tree.
        tags: The tags of leaves that a tree can have.
        max_states: How many states to find at most.
        budget: Is told now and then how far it is, and when a property is violated; ends the search. What is known by then is published in it.
        forgets: Whether states are the same that differ only in how nodes have ended, where that makes no difference.
        plainly: With how many states a tree is searched as it is in any case.
        merges: Whether values are one that no run can tell apart (`slicing`).

    Raises:
        TreeError: If the file says something that makes no sense for the tree; carries the findings.
        UndecidableError: If the tree has a node whose rules are not known, or keeps values that cannot be compared; or if a condition
            cannot be evaluated, and no unknown value is the reason.
    """
    prepared = Prepared.of(simulated)
    search = partial(
        _searched,
        prepared=prepared,
        max_states=max_states,
        budget=budget or Budget(),
        forgets=forgets,
        plainly=plainly,
    )
    properties = properties_of(file, prepared, tags)
    if merges:
        merge_values(prepared, properties)
    found, reasons = search_decidable(properties, search)
    found = replace(found, merged=tuple(each for each in prepared.merged if each.is_used))
    if not reasons:
        return found
    verdicts = {each.question: each for each in found.verdicts}
    verdicts |= {each: Verdict(each, ProofStatus.UNDECIDED, reason) for each, reason in reasons.items()}
    in_order = dict.fromkeys((*questions_of(properties), *verdicts))
    return replace(found, verdicts=tuple(verdicts[each] for each in in_order))


def _searched(
    properties: Properties,
    *,
    prepared: Prepared,
    max_states: int,
    budget: Budget,
    forgets: bool,
    plainly: int,
) -> Verification:
    """Search the states of a tree, branch by branch if that is needed; raises `ConditionError` as well."""
    simulated = prepared.simulated
    stepper = TreeStepper(prepared, properties.rules, forgets=forgets)
    asked = [*questions_of(properties), *([OWN_RECORDS] if stepper.claims else ())]

    def report(progress: Progress) -> bool:
        budget.publish(partial(_so_far, asked, progress, properties, simulated))
        return budget.report(progress)

    budget.publish(partial(_so_far, asked, Progress(0, 0, 0, 0), properties, simulated))
    verified = partial(
        _verified, asked=asked, prepared=prepared, properties=properties, report=report, budget=budget
    )
    if not forgets or max_states <= plainly or not has_parallels(stepper.flat):
        return verified(stepper, max_states=max_states)
    found = verified(stepper, max_states=plainly)
    if found.complete or found.stopped:
        return found
    composed = proved_apart(prepared, stepper.flat, properties, max_states, report, found)
    if composed is not None:
        return composed
    return verified(TreeStepper(prepared, properties.rules), max_states=max_states)


def _so_far(
    asked: Collection[str], progress: Progress, properties: Properties, simulated: SimulatedTree
) -> Verification:
    """Return what is known while the search goes on: what is violated, without a run."""
    violated = "it is violated; the search was stopped before a run could be shown"
    verdicts = tuple(
        Verdict(each, ProofStatus.BROKEN, violated)
        if each in progress.broken
        else Verdict(each, ProofStatus.UNDECIDED, "the search was stopped")
        for each in asked
    )
    return Verification(
        verdicts,
        progress.states,
        progress.steps,
        progress.depth,
        complete=False,
        left_out=properties.left_out,
        leaves=simulated.leaves,
        stopped=True,
        by_semantics=simulated.by_semantics,
    )


def _verified(
    stepper: TreeStepper,
    *,
    asked: Collection[str],
    prepared: Prepared,
    properties: Properties,
    max_states: int,
    report: Report,
    budget: Budget,
) -> Verification:
    """Search the states of a tree as it is."""
    simulated = prepared.simulated
    graph, unknown = explored(stepper, max_states, report, (*properties.names, OWN_RECORDS))
    plain = plain_stepper(prepared, properties.rules)
    space = StateSpace(stepper, graph, properties.names, properties.owing, unknown, plain)
    questions = Questions(space, simulated.explain)
    found = Verification(
        tuple(Verdict(each, ProofStatus.UNDECIDED, "it was not worked out any more") for each in asked),
        len(graph.states),
        graph.step_count,
        graph.depth,
        graph.complete,
        properties.left_out,
        () if graph.complete else stepper.states.growing(graph.states),
        simulated.leaves,
        graph.stopped,
        simulated.by_semantics,
    )
    for number, verdict in enumerate(_verdicts(questions, stepper, properties)):
        found = replace(found, verdicts=(*found.verdicts[:number], verdict, *found.verdicts[number + 1 :]))
        budget.publish(partial(replace, found, stopped=True))
    return found


def _verdicts(questions: Questions, stepper: TreeStepper, properties: Properties) -> Iterator[Verdict]:
    yield questions.no_error()
    yield questions.every_leaf([node for node in stepper.flat.nodes if not node.children], stepper.ran)
    if properties.has_end:
        yield from questions.endings()
    yield from questions.properties(properties)
    if stepper.claims:
        yield questions.own_records(len(properties.names), lambda: stepper.wrong)
