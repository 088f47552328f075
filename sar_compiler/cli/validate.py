"""`sar-compile validate`: report errors in tree files, and fix typos."""

import argparse

from sar_compiler.cli.arguments import TREE_INPUT, add_budget, seconds
from sar_compiler.cli.loading import INPUT_HELP, add_mission, add_project_options, require_there

FORMATS = ("text", "json", "sarif", "github")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `validate`."""
    more = f"{INPUT_HELP}; or a folder, for all tree files in it and below"
    add = parser.add_argument
    add("files", nargs="+", type=TREE_INPUT, metavar="FILE", help=more)
    add_project_options(parser)
    add_mission(parser)
    add("--strict", action="store_true", help="exit with 1 for warnings, too")
    trial = parser.add_mutually_exclusive_group()
    text = "try the runs of each file for SEC seconds, to find errors raised in ticks (default: a fixed amount of work)"
    trial.add_argument("--deep", type=seconds, metavar="SEC", help=text)
    trial.add_argument("--no-deep", action="store_true", help="try no runs to find errors raised in ticks")
    add_budget(parser)
    text = "check every file, and store no results (default: unchanged files are not checked again)"
    add("--no-cache", action="store_true", help=text)
    add("--fix", action="store_true", help="first fix typos in the files")
    text = "print one file with all suggestions applied, including guesses, instead of the findings; no file is changed"
    add("--print-fixed", action="store_true", help=text)
    text = "with text and github: report each location, instead of each cause once"
    add("--all", action="store_true", help=text)
    text = "for people (default text), for scripts, for code scanning (SARIF), or as annotations of GitHub Actions"
    add("--format", choices=FORMATS, default=FORMATS[0], help=text)
    parser.set_defaults(run=_validate)


def _validate(arguments: argparse.Namespace) -> int:
    if not arguments.files[1:] and arguments.format == FORMATS[0]:
        require_there(arguments.files[0], or_folder=True)
    from sar_compiler.cli.validation import validate_files

    return validate_files(arguments)
