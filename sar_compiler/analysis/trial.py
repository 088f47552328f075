"""Search of a tree file's runs before its first run; other modules are imported only if that is needed."""

import shlex
from collections.abc import Callable
from typing import TYPE_CHECKING

from sar_compiler.analysis.plain_scripts import is_plain
from sar_compiler.nodes.binding.attributes import CONDITIONS
from sar_compiler.nodes.registry import Registry
from sar_compiler.project.file_check import TrialOutcome
from sar_compiler.project.project_tree import ProjectTree
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError
from sar_compiler.tree.model import Element

if TYPE_CHECKING:
    from sar_compiler.analysis.bounded_search import SearchBudget


def try_within(
    tree: ProjectTree, work: int | None, seconds: float | None, is_spent: Callable[[], bool]
) -> TrialOutcome:
    """Try the runs of a tree file.

    Args:
        tree: The tree file.
        work: How much may be tried; None for any amount of work.
        seconds: The processor time for it; None for any.
        is_spent: Returns whether the user wants it to end.
    """
    budgets: list[SearchBudget] = []

    def budget() -> "SearchBudget":
        from sar_compiler.analysis.bounded_search import SearchBudget

        budgets.append(SearchBudget(work, seconds, is_spent))
        return budgets[0]

    found = try_tree(tree, budget)
    if not budgets:
        return TrialOutcome(found)
    return TrialOutcome(found, budgets[0].spent, budgets[0].is_limited, budgets[0].is_cut)


def try_tree(tree: ProjectTree, budget: "Callable[[], SearchBudget]") -> list[Diagnostic]:
    """Return findings about ticks that raise, within a budget; none for a file with errors.

    A tree without keys and scripts cannot raise, and is not even compiled.

    Args:
        tree: The tree file.
        budget: Returns the budget for the file; called only if there is something to try.
    """
    if tree.is_malformed or any(each.severity is Severity.ERROR for each in tree.findings_of_the_tree):
        return []
    forest, registry = tree.forest, tree.project.registry
    executable = forest.executable
    if not executable or not any(_may_raise(each, registry) for each in forest.iterate()):
        return []
    bound = {id(each.element): each for each in tree.context.bound.trees}
    if not tree.palettes and all(id(each) in bound and is_plain(bound[id(each)]) for each in executable):
        return []
    from sar_compiler.analysis.proofs import try_runs

    limit, is_chosen = budget(), forest.main_tree() is None
    # A rule's finding at the same location is the same error, and so is one of another tree's run.
    told = {(each.source.path, each.span) for each in tree.findings if each.severity is not Severity.INFO}
    raised = []
    for number, element in enumerate(executable):
        limit.allot(len(executable) - number)
        tree_id = element.attributes.get("ID") if is_chosen else None
        chosen = "" if tree_id is None else f" --tree {shlex.quote(tree_id)}"
        try:
            binding = tree.binding(tree_id)
        except TreeError:
            continue
        for finding in try_runs(tree, binding, limit, f"sar-compile verify{chosen}"):
            place = finding.source.path, finding.span
            raised += [finding] if place not in told else []
            told.add(place)
    return tree.project.configuration.decide(raised)


def _may_raise(tree: Element, registry: Registry) -> bool:
    """Return whether a tree has keys or scripts, which only have values in a run."""
    return any(
        "{" in text or name in CONDITIONS or _is_script(element.tag, name, registry)
        for element in tree.iterate()
        for name, text in element.attributes.items()
    )


def _is_script(tag: str, name: str, registry: Registry) -> bool:
    parameters = (spec.parameters.get(name) for spec in registry.variants(tag))
    return any(each is not None and each.value_type.python is Script for each in parameters)
