"""Verifies a tree: determines whether properties hold in all possible runs of the tree.

The tree is compiled with stub leaves and converted to its flat form. Then every combination of leaf outcomes is
played in every reachable state, breadth first.
"""

from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import partial

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.searching import Report
from sar_compiler.analysis.verify.branches import has_parallels
from sar_compiler.analysis.verify.composing import prove_by_branches
from sar_compiler.analysis.verify.properties import Properties, PropertyFile, properties_of
from sar_compiler.analysis.verify.slicing import merge_values
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.state_space import StateSpace
from sar_compiler.analysis.verify.stepping import TreeStepper, plain_stepper
from sar_compiler.analysis.verify.unknown_values import explore_decidable, search_decidable
from sar_compiler.analysis.verify.verdicts import (
    OWN_RECORDS,
    ProofQuestions,
    ProofStatus,
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
    """Search the states of a tree, and return a verdict on every question.

    A larger tree with independent parallel branches is proved branch by branch (`composing`), if that is possible. A
    property whose condition needs an unknown value is undecided, and the search continues without the property. The
    same applies to the condition for the end of a run, and to the properties that depend on the end.

    Args:
        simulated: The tree with stub leaves; not usable afterwards.
        file: The properties file; None for only the general questions about every tree.
        tags: The tags of all leaves that a tree may contain.
        max_states: The maximum number of states to find.
        budget: Receives the progress, violations and intermediate results, and can end the search.
        forgets: Whether states forget the last statuses of nodes that make no difference between ticks.
        plainly: The number of states up to which a tree is searched without replacing branches.
        merges: Whether to merge values that no run can distinguish (`slicing`).

    Raises:
        TreeError: If the properties file contradicts the tree; contains the findings.
        UndecidableError: If the tree contains a node with unknown behaviour or values that cannot be compared, or if a
            condition cannot be evaluated for another reason than an unknown value.
    """
    prepared = PreparedTree.prepare(simulated)
    search = partial(
        _search,
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


def _search(
    properties: Properties,
    *,
    prepared: PreparedTree,
    max_states: int,
    budget: Budget,
    forgets: bool,
    plainly: int,
) -> Verification:
    """Search the states of a tree. If there are too many, search independent branches separately."""
    simulated = prepared.simulated
    stepper = TreeStepper(prepared, properties.rules, forgets=forgets)
    asked = [*questions_of(properties), *([OWN_RECORDS] if stepper.claims else ())]

    def report(progress: Progress) -> bool:
        budget.publish(partial(_partial_result, asked, progress, properties, simulated))
        return budget.report(progress)

    budget.publish(partial(_partial_result, asked, Progress(0, 0, 0, 0), properties, simulated))
    verified = partial(
        _search_whole, asked=asked, prepared=prepared, properties=properties, report=report, budget=budget
    )
    if not forgets or max_states <= plainly or not has_parallels(stepper.flat):
        return verified(stepper, max_states=max_states)
    found = verified(stepper, max_states=plainly)
    if found.complete or found.stopped:
        return found
    composed = prove_by_branches(prepared, stepper.flat, properties, max_states, report, found)
    if composed is not None:
        return composed
    return verified(TreeStepper(prepared, properties.rules), max_states=max_states)


def _partial_result(
    asked: Collection[str], progress: Progress, properties: Properties, simulated: SimulatedTree
) -> Verification:
    """Return an intermediate result, in which violated properties have no counterexamples yet."""
    violated = "the property is violated, but the search stopped before a run could be shown"
    verdicts = tuple(
        Verdict(each, ProofStatus.BROKEN, violated)
        if each in progress.broken
        else Verdict(each, ProofStatus.UNDECIDED, "the search stopped early")
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


def _search_whole(
    stepper: TreeStepper,
    *,
    asked: Collection[str],
    prepared: PreparedTree,
    properties: Properties,
    max_states: int,
    report: Report,
    budget: Budget,
) -> Verification:
    """Search the states of a tree without replacing branches by automata."""
    simulated = prepared.simulated
    graph, unknown = explore_decidable(stepper, max_states, report, (*properties.names, OWN_RECORDS))
    plain = plain_stepper(prepared, properties.rules)
    space = StateSpace(stepper, graph, properties.names, properties.owing, unknown, plain)
    questions = ProofQuestions(space, simulated.explain)
    found = Verification(
        tuple(
            Verdict(each, ProofStatus.UNDECIDED, "the search stopped before this question was decided")
            for each in asked
        ),
        len(graph.states),
        graph.step_count,
        graph.depth,
        graph.complete,
        properties.left_out,
        () if graph.complete else stepper.states.growing_values(graph.states),
        simulated.leaves,
        graph.stopped,
        simulated.by_semantics,
    )
    for number, verdict in enumerate(_verdicts(questions, stepper, properties)):
        found = replace(found, verdicts=(*found.verdicts[:number], verdict, *found.verdicts[number + 1 :]))
        budget.publish(partial(replace, found, stopped=True))
    return found


def _verdicts(questions: ProofQuestions, stepper: TreeStepper, properties: Properties) -> Iterator[Verdict]:
    yield questions.verdict_on_errors()
    yield questions.verdict_on_leaves([node for node in stepper.flat.nodes if not node.children], stepper.ran)
    if properties.has_end:
        yield from questions.endings()
    yield from questions.properties(properties)
    if stepper.claims:
        yield questions.verdict_on_declarations(len(properties.names), lambda: stepper.wrong)
