"""Verifying a tree: whether properties hold in all of its possible runs.

The tree is compiled with stub leaves and brought into flat form; every combination of answers is played in
every state that can be reached, those that fewest ticks lead to first.
"""

from collections.abc import Collection

from sar_compiler.checks.verify.branches import has_parallels
from sar_compiler.checks.verify.composing import proved_apart
from sar_compiler.checks.verify.properties import Properties, PropertyFile, properties_of
from sar_compiler.checks.verify.state import Prepared
from sar_compiler.checks.verify.state_space import StateSpace
from sar_compiler.checks.verify.stepping import TreeStepper
from sar_compiler.checks.verify.verdicts import OWN_RECORDS, Questions, Verification
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.runtime.kernel.searching import Report, explore, keep_quiet


def verify(
    simulated: SimulatedTree,
    file: PropertyFile | None,
    tags: Collection[str],
    max_states: int,
    on_progress: Report = keep_quiet,
    *,
    forgets: bool = True,
    keep_states: bool = False,
    plainly: int = 10_000,
) -> Verification:
    """Search the states of a tree and answer every question.

    A larger tree with parallel branches that share nothing is proved branch by branch (`composing`), if that leads to answers.

    Args:
        simulated: The tree with stub leaves; it is used up.
        file: What must hold; None for nothing but what is asked of every tree.
        tags: The tags of leaves that a tree can have.
        max_states: How many states to find at most.
        on_progress: Is told now and then how far it is, and when a property is broken.
        forgets: Whether states are the same that differ only in how nodes have ended, where that makes no difference.
        keep_states: Whether the result has the states that were found.
        plainly: With how many states a tree is searched as it is in any case.

    Raises:
        TreeError: If the file says something that makes no sense for the tree; carries the findings.
        UndecidableError: If the tree has a node whose rules are not known, or keeps values that cannot be compared; or if a condition cannot be evaluated.
    """
    prepared = Prepared.of(simulated)
    properties = properties_of(file, prepared, tags)
    stepper = TreeStepper(prepared, properties.rules, forgets=forgets)
    if keep_states or not forgets or max_states <= plainly or not has_parallels(stepper.flat):
        return _verified(stepper, prepared, properties, max_states, on_progress, keep_states=keep_states)
    found = _verified(stepper, prepared, properties, plainly, on_progress)
    if found.complete or found.stopped:
        return found
    composed = proved_apart(prepared, stepper.flat, properties, max_states, on_progress, found)
    if composed is not None:
        return composed
    stepper = TreeStepper(prepared, properties.rules)
    return _verified(stepper, prepared, properties, max_states, on_progress)


def _verified(
    stepper: TreeStepper,
    prepared: Prepared,
    properties: Properties,
    max_states: int,
    on_progress: Report,
    *,
    keep_states: bool = False,
) -> Verification:
    """Search the states of a tree as it is."""
    simulated = prepared.simulated
    graph = explore(stepper.steps, max_states, on_progress, (*properties.names, OWN_RECORDS))
    space = StateSpace(stepper, graph, properties.names, properties.owing)
    questions = Questions(space, simulated.explain)
    verdicts = (
        questions.no_error(),
        questions.every_leaf([node for node in stepper.flat.nodes if not node.children], stepper.ran),
        *(questions.endings() if properties.has_end else ()),
        *questions.properties(properties),
        *([questions.own_records(len(properties.names), lambda: stepper.wrong)] if stepper.claims else ()),
    )
    growing = () if graph.complete else stepper.states.growing(graph.states)
    return Verification(
        verdicts,
        len(graph.states),
        graph.step_count,
        graph.depth,
        graph.complete,
        properties.left_out,
        growing,
        simulated.leaves,
        graph.stopped,
        space if keep_states else None,
        simulated.by_semantics,
    )
