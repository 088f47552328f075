"""`sar-compile validate`: report errors in tree files, and fix typos."""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import nullcontext
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import (
    INPUT_HELP,
    TREE_INPUT,
    add_budget,
    add_mission,
    add_project_options,
    additions,
    budget_of,
    further_checks,
    seconds,
    workspace,
)
from sar_compiler.commands import FINDINGS, OK, RULE_FAILED, USAGE, print_error, print_note, print_text
from sar_compiler.errors import SarError
from sar_compiler.opener import is_folder, read_files_once
from sar_compiler.parts import is_part_installed
from sar_compiler.resources import require_tree_file
from sar_compiler.terminal import findings_as_text
from sar_compiler.tree.display_text import visible
from sar_compiler.tree.plain import count_with_noun

if TYPE_CHECKING:
    from pathlib import Path

    from sar_compiler.tree.diagnostic import Diagnostic
    from sar_compiler.validation.check_cache import TextFix

_TEXT, _JSON, _SARIF, _GITHUB = FORMATS = ("text", "json", "sarif", "github")
_FAILED = "internal-error"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `validate`."""
    text = f"{INPUT_HELP}; or a folder, to check all tree files in it and in its subfolders"
    add = parser.add_argument
    add("files", nargs="+", type=TREE_INPUT, metavar="FILE", help=text)
    add_project_options(parser)
    add_mission(parser)
    add("--strict", action="store_true", help="exit with 1 also for warnings")
    trial = parser.add_mutually_exclusive_group()
    text = "search the possible runs of each file for errors raised in ticks, for at most SEC seconds (default: a fixed amount of work)"
    trial.add_argument("--deep", type=seconds, metavar="SEC", help=text)
    trial.add_argument("--no-deep", action="store_true", help="do not search for errors raised in ticks")
    add_budget(parser)
    text = "check every file, and do not store the results (default: unchanged files are not checked again)"
    add("--no-cache", action="store_true", help=text)
    add("--fix", action="store_true", help="first fix typos in the files")
    text = "print one file with all suggestions applied, including guesses, instead of the findings; no file is changed"
    add("--print-fixed", action="store_true", help=text)
    text = "with --format text or github, report every location of a finding instead of only the first location for each cause"
    add("--all", action="store_true", help=text)
    text = "the output format: text for people (default), json for scripts, sarif for code scanning, or github for annotations in GitHub Actions"
    add("--format", choices=FORMATS, default=_TEXT, help=text)
    parser.set_defaults(run=_validate)


def _validate(arguments: argparse.Namespace) -> int:
    """Print the findings about files, and return the exit status. After Ctrl-C, print the findings so far."""
    if not arguments.files[1:] and arguments.format == _TEXT:
        require_tree_file(arguments.files[0], or_folder=True)
    if arguments.print_fixed:
        return _print_fixed(arguments)
    if not (is_part_installed("validation") or arguments.fix or any(map(is_folder, arguments.files))):
        return _validate_singly(arguments)
    # Imported late, because the import is slow and a missing file is reported without it.
    from sar_compiler.validation.validation import CheckOptions, Validation

    with nullcontext() if arguments.fix else read_files_once():
        added, further = additions(arguments), further_checks()
        validation = Validation(arguments.files, added, further, _print_error, print_note)
        budget = budget_of(arguments, patience_sec=0.5, clock=validation.processor_sec)
        if arguments.fix:
            output = sys.stdout if arguments.format == _TEXT else sys.stderr
            validation.fix(lambda fix: print(visible(fix.describe()), file=output))
        trial_sec, max_sec = arguments.deep, arguments.max_seconds
        options = CheckOptions(not arguments.no_deep, trial_sec, not arguments.no_cache, max_sec)
        validation.check(options, budget)
    fixable = validation.fixable
    _print_findings(
        arguments, validation.findings, validation.clean, validation.checked, fixable, validation.fixes
    )
    if validation.unchecked_count:
        _print_error(f"{budget.reason} ({count_with_noun(validation.unchecked_count, 'file')} not checked)")
        return budget.exit_status
    if validation.unreadable:
        return USAGE
    return _status(arguments, validation.findings)


def _validate_singly(arguments: argparse.Namespace) -> int:
    """Check files one by one, for an installation without `sar_compiler.validation`."""
    trees = [*map(workspace(arguments).load, arguments.files)]
    found = {tree.path: tree.check() for tree in trees}
    findings = [each for some in found.values() for each in some]
    _print_findings(arguments, findings, [path for path, some in found.items() if not some], len(trees))
    return _status(arguments, findings)


def _print_error(text: str) -> None:
    print_error(f"sar-compile: {text}")


def _status(arguments: argparse.Namespace, findings: "Sequence[Diagnostic]") -> int:
    from sar_compiler.tree.diagnostic import Severity

    if any(each.code == _FAILED for each in findings):
        return RULE_FAILED
    counted = (Severity.ERROR, Severity.WARNING) if arguments.strict else (Severity.ERROR,)
    return FINDINGS if any(each.severity in counted for each in findings) else OK


def _print_fixed(arguments: argparse.Namespace) -> int:
    """Print a file with all suggestions applied; return 1 if errors are left, otherwise 0.

    Raises:
        SarError: If the argument is not a single file, or cannot be read.
        TreeError: If the project's configuration, or a palette, has errors.
    """
    from sar_compiler.agent.suggestion_fixes import apply_suggestions
    from sar_compiler.project import Workspace
    from sar_compiler.tree.diagnostic import Severity
    from sar_compiler.tree.discovery import find_tree

    if len(arguments.files) > 1 or arguments.fix:
        raise SarError("--print-fixed prints a single file: name one file, and remove --fix")
    path, added = find_tree(arguments.files[0]), additions(arguments)
    tree = apply_suggestions(
        path, lambda read: Workspace(added, read, print_note, further_checks()).load_file(path)
    )
    print(tree.source.text, end="")
    return FINDINGS if any(each.severity is Severity.ERROR for each in tree.findings) else OK


def _print_findings(
    arguments: argparse.Namespace,
    findings: "Sequence[Diagnostic]",
    clean: "Sequence[Path]",
    checked: int,
    fixable: int = 0,
    fixes: "Sequence[tuple[Diagnostic, TextFix]]" = (),
) -> None:
    """Print findings, files without findings, and the numbers of findings, files and possible fixes."""
    form = arguments.format
    if form == _TEXT:
        shown = findings if arguments.all else _group_by_cause(findings)
        if shown:
            print(findings_as_text(shown, sys.stdout))
        for path in clean:
            print_text(f"{path}: no findings")
        if shown or checked > 1:
            sys.stdout.flush()
            print(_summary(findings, shown, checked, fixable), file=sys.stderr)
        return
    from sar_compiler.views import findings as views

    if form == _JSON:
        print(views.findings_as_json(findings))
    elif form == _SARIF:
        from sar_compiler.checks.fixing import Fix

        by_identity: dict[object, Fix] = {
            each.identity: Fix(each, fix.start, fix.end, fix.text) for each, fix in fixes
        }
        print(views.findings_as_sarif(findings, by_identity))
    elif findings:
        print(views.findings_as_github(findings if arguments.all else _group_by_cause(findings)))


def _group_by_cause(findings: "Sequence[Diagnostic]") -> "Sequence[Diagnostic]":
    """Return one finding for each cause."""
    if len(findings) <= 1:
        return findings
    from sar_compiler.views.findings import group_by_cause

    return group_by_cause(findings)


def _summary(
    findings: "Sequence[Diagnostic]", shown: "Sequence[Diagnostic]", checked: int, fixable: int
) -> str:
    """Return the summary line: the number of findings by severity, checked files, fixable findings and locations."""
    counts = Counter(finding.severity.value for finding in shown if finding.code != "more-findings")
    listed = [count_with_noun(counts[each], each) for each in ("error", "warning", "info") if counts[each]]
    if any(each.code == "more-findings" for each in findings):
        listed.append("others not shown")
    more = f"; {fixable:,} fixable with --fix" if fixable else ""
    hidden = len(findings) != len(shown)
    places = f"; --all lists {count_with_noun(len(findings), 'location')}" if hidden else ""
    return f"{', '.join(listed) or 'no findings'} in {count_with_noun(checked, 'file')}{more}{places}"
