"""What an agent proposes: a tree file with all findings and proofs about it, for a person to look at and approve."""

import shlex
from pathlib import Path

from sar_compiler.agent.approval import Fingerprint
from sar_compiler.checks.trying import WORK, TrialBudget
from sar_compiler.errors import UndecidableError
from sar_compiler.project import LoadedTree
from sar_compiler.tree.diagnostic import Diagnostic, Severity
from sar_compiler.views.findings import finding_data
from sar_compiler.views.verification import verification_data


def all_findings(tree: LoadedTree) -> list[Diagnostic]:
    """Return what `validate` finds in a tree.

    Raises:
        SarError: As `LoadedTree.check` does.
    """
    return [*tree.check(), *tree.try_runs(lambda: TrialBudget(WORK))]


def has_errors(findings: list[Diagnostic]) -> bool:
    """Return whether a person may not approve a tree with some findings."""
    return any(each.severity is Severity.ERROR for each in findings)


def proposal(tree: LoadedTree, properties: str | Path | None, max_states: int) -> dict[str, object]:
    """Return what is proposed of a tree, as data for JSON.

    Args:
        tree: The tree.
        properties: A file with the properties to prove; by default the mission's own.
        max_states: The largest number of states to explore.

    Raises:
        TreeError: If the file of properties is wrong.
        SarError: As `LoadedTree.check` does.
    """
    findings = all_findings(tree)
    proposed: dict[str, object] = {
        "file": str(tree.path),
        "findings": [*map(finding_data, findings)],
    }
    if has_errors(findings):
        return {**proposed, "is_proved": False, "why": "errors come first: nothing is proved of such a tree"}
    now = Fingerprint.of(tree)
    how = f"sar-compile approve {shlex.quote(str(tree.path))} --digest {now.digest}"
    proposed |= {"digest": now.digest, "files": now.files, "approve": how}
    try:
        verification = tree.verify(properties, max_states=max_states)
    except UndecidableError as error:
        return {**proposed, "is_proved": False, "why": f"nothing can be decided: {error}"}
    return {**proposed, "is_proved": verification.proved, "proofs": verification_data(verification)}
