"""`sar-compile approve`: approve a version of a tree file for runs, or propose it for approval."""

import argparse
import getpass
import sys
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import (
    FILE_HELP,
    TREE,
    YAML_FILE,
    add_mission,
    add_params,
    add_project_options,
    add_tree_id,
    workspace,
)
from sar_compiler.cli.verify import MAX_STATES
from sar_compiler.commands import FINDINGS, OK, RULE_FAILED, print_error, print_text
from sar_compiler.errors import SarError
from sar_compiler.terminal import findings_as_text

if TYPE_CHECKING:
    from sar_compiler.project import ProjectTree


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `approve`."""
    add = parser.add_argument
    add("file", nargs="?", type=TREE, metavar="FILE", help=FILE_HELP)
    other = parser.add_mutually_exclusive_group()
    text = "print the findings, proofs and digest of the proposed run as JSON, without approving it"
    other.add_argument("--propose", action="store_true", help=text)
    other.add_argument("--list", action="store_true", help="list the approved files, with approver and date")
    text = "revoke the approval of every version of this file"
    other.add_argument("--revoke", action="store_true", help=text)
    add("--by", metavar="NAME", help="the approver (default: your user name)")
    text = "approve the file only if it has this digest, which --propose prints"
    add("--digest", metavar="HEX", help=text)
    text = "a properties file to approve together with the tree, for runs that monitor these properties; --propose also verifies them (default: the mission's own file)"
    add("--properties", type=YAML_FILE, metavar="P.yaml", help=text)
    add_tree_id(parser, "approve")
    add_params(parser)
    add_project_options(parser)
    add_mission(parser)
    parser.set_defaults(run=approve_file)


def approve_file(arguments: argparse.Namespace) -> int:
    """Approve or propose a tree file, or list or revoke approvals, and return the exit status.

    Raises:
        SarError: If the file or the approval does not exist, or the file differs from the proposal.
        TreeError: If the configuration or a properties file has errors.
    """
    if arguments.list:
        return _list()
    if not arguments.file:
        raise SarError("name the tree file to approve, or list the approved files with --list")
    if arguments.revoke:
        return _revoke(arguments.file)
    loader = workspace(arguments)
    tree = loader.load(arguments.file)
    status = (_propose if arguments.propose else _approve)(tree, arguments)
    loader.report_use()
    return status


def _list() -> int:
    from sar_compiler.analysis.approval import approvals

    for each in approvals():
        print_text(str(each))
    return OK


def _revoke(name: str) -> int:
    from sar_compiler.analysis.approval import revoke
    from sar_compiler.resources import find

    for each in revoke(find("trees", name, ".xml")):
        print_text(f"revoked: {each}")
    return OK


def _propose(tree: "ProjectTree", arguments: argparse.Namespace) -> int:
    from sar_compiler.agent.proposal import proposal
    from sar_compiler.tree.plain import as_json

    proposed = proposal(
        tree, arguments.properties, MAX_STATES, tree_id=arguments.tree, params=arguments.params
    )
    print(as_json(proposed))
    return OK if proposed["is_proved"] else FINDINGS


def _approve(tree: "ProjectTree", arguments: argparse.Namespace) -> int:
    from sar_compiler.agent.proposal import all_findings, has_errors
    from sar_compiler.analysis.approval import Fingerprint, approve

    findings = all_findings(tree)
    if findings:
        print(findings_as_text(findings, sys.stdout))
    if has_errors(findings):
        sys.stdout.flush()
        print_error(f"sar-compile: {tree.path} is not approved: it has errors")
        return RULE_FAILED if any(each.code == "internal-error" for each in findings) else FINDINGS
    fingerprint = Fingerprint.from_tree(tree, arguments.tree, arguments.params, arguments.properties)
    if arguments.digest not in (None, fingerprint.digest):
        raise SarError(
            f"{tree.path} is not approved: it differs from the proposal. Its digest is {fingerprint.digest}"
        )
    approval = approve(fingerprint, arguments.by or getpass.getuser())
    print_text(str(approval))
    return OK
