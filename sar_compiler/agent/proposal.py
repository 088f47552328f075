"""An agent's proposal for a person to approve: a tree file, the findings about it, and the proofs."""

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
    """Return the findings that `sar-compile validate` reports about a tree.

    Raises:
        SarError: As for `ProjectTree.check`.
    """
    return [*tree.check(), *try_tree(tree, lambda: SearchBudget(WORK))]


def has_errors(findings: list[Diagnostic]) -> bool:
    """Return whether any of the findings is an error. A tree with errors cannot be approved."""
    return any(each.severity is Severity.ERROR for each in findings)


def proposal(
    tree: ProjectTree,
    properties: Path | None,
    max_states: int,
    *,
    tree_id: str | None = None,
    params: Path | None = None,
) -> dict[str, object]:
    """Return the proposal of a tree as data that can be written as JSON.

    Args:
        tree: The tree file.
        properties: The file with the properties to prove; by default the properties of the mission.
        max_states: The maximum number of states to explore.
        tree_id: The ID of the tree to run; by default the main tree of the file.
        params: The parameter file of the runs, with which the properties are proved; by default the mission's parameter
            file, with the initial facts that the leaves declare.

    Raises:
        TreeError: If the property file has errors, or the tree does not exist.
        SarError: As for `ProjectTree.check` and `Fingerprint.from_tree`, or if a file changes during the proof.
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
            "why": "nothing was proved, because the tree has errors. Fix the errors first",
        }
    now = Fingerprint.from_tree(tree, tree_id, params, properties)
    how = f"{approve_command(tree, tree_id, params, properties)} --digest {now.digest}"
    proposed |= {"digest": now.digest, **now._asdict(), "file": str(tree.path), "approve": how}
    try:
        verification = verify_tree(tree, properties, params=params, tree_id=tree_id, max_states=max_states)
    except UndecidableError as error:
        return {**proposed, "is_proved": False, "why": f"no property could be decided: {error}"}
    if Fingerprint.from_tree(tree, tree_id, params, properties) != now:
        raise ApprovalError(
            "a tree, parameter or property file was changed during the proof. Run the command again"
        )
    return {**proposed, "is_proved": verification.is_proved, "proofs": verification_data(verification)}
