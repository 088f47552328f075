"""A proposal of an agent: a tree file with its findings and proofs, for a person's approval."""

from pathlib import Path

from sar_compiler.analysis.approval import ApprovalError, Fingerprint, approve_command
from sar_compiler.analysis.bounded_search import SearchBudget
from sar_compiler.analysis.tree_analysis import verify_tree
from sar_compiler.analysis.trial import try_tree
from sar_compiler.analysis.verification_view import verification_data
from sar_compiler.budget import WORK
from sar_compiler.errors import UndecidableError
from sar_compiler.project import ProjectTree
from sar_compiler.tree.diagnostic import Diagnostic, Severity
from sar_compiler.views.findings import finding_data


def all_findings(tree: ProjectTree) -> list[Diagnostic]:
    """Return the findings of `validate` for a tree.

    Raises:
        SarError: As `ProjectTree.check` does.
    """
    return [*tree.check(), *try_tree(tree, lambda: SearchBudget(WORK))]


def has_errors(findings: list[Diagnostic]) -> bool:
    """Return whether these findings prevent an approval."""
    return any(each.severity is Severity.ERROR for each in findings)


def proposal(
    tree: ProjectTree,
    properties: Path | None,
    max_states: int,
    *,
    tree_id: str | None = None,
    params: Path | None = None,
) -> dict[str, object]:
    """Return the proposal of a tree, as data for JSON.

    Args:
        tree: The tree file.
        properties: A file with the properties to prove; by default the mission's own.
        max_states: The largest number of states to explore.
        tree_id: The tree in the file to run; by default the one that the file executes.
        params: The parameter file of its runs, for which the properties are proved; by default that of the mission,
            with the start values that the leaves declare.

    Raises:
        TreeError: If the file of properties is wrong, or there is no such tree.
        SarError: As `ProjectTree.check` and `Fingerprint.from_tree` do, or if the file of properties changes meanwhile.
    """
    findings = all_findings(tree)
    proposed: dict[str, object] = {
        "file": str(tree.path),
        "findings": [*map(finding_data, findings)],
    }
    if has_errors(findings):
        return {
            **proposed,
            "is_proved": False,
            "why": "the tree has errors, so nothing was proved. Fix them first",
        }
    now = Fingerprint.from_tree(tree, tree_id, params, properties)
    how = f"{approve_command(tree, tree_id, params, properties)} --digest {now.digest}"
    proposed |= {"digest": now.digest, **now._asdict(), "file": str(tree.path), "approve": how}
    try:
        verification = verify_tree(tree, properties, params=params, tree_id=tree_id, max_states=max_states)
    except UndecidableError as error:
        return {**proposed, "is_proved": False, "why": f"no property could be decided: {error}"}
    if Fingerprint.from_tree(tree, tree_id, params, properties) != now:
        raise ApprovalError("a file of parameters or properties has changed during the proof. Start over")
    return {**proposed, "is_proved": verification.is_proved, "proofs": verification_data(verification)}
