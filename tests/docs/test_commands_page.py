"""Tests of the commands page: it is generated from the parsers, with each command, argument, choice and default."""

import argparse
import os
import re
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from sar_compiler.cli import compile as sar_compile
from sar_compiler.cli import journal_command as sar_journal
from sar_compiler.cli import run as sar_run
from sar_compiler.cli import sim as sar_sim
from sar_compiler.cli.arguments import PROJECT_OPTIONS, add_project_options
from sar_compiler.ros.serving import server_parser
from sar_compiler.testing import RENEW
from search_and_rescue import server_commands
from tests.docs.markdown import headings

PAGE = Path("docs/reference/commands.md")
PARSERS = [
    sar_compile._parser(),
    sar_run._parser(),
    sar_journal._parser(),
    sar_sim._parser(),
    server_parser(*server_commands.DETECT),
    server_parser(*server_commands.REPORT),
]
SCREEN = {"sar-run": 45}
"""The lines of a command's help that fit one screen of 80 columns; 50 for the others."""
# Pages with more information, by command, or by command and option.
FURTHER_PAGES = {
    "sar-compile validate": ["tree-files.md", "configuration.md"],
    "sar-compile validate --fix": ["configuration.md#changes-made-by---fix"],
    "sar-compile validate --print-fixed": ["../how-to/agents.md#fixing"],
    "sar-compile validate --deep": ["../findings/failing-tick.md"],
    "sar-compile show": ["../how-to/draw-a-tree.md"],
    "sar-compile convert": ["yaml.md", "btcpp.md"],
    "sar-compile simulate": ["scenarios.md"],
    "sar-compile sweep": ["../how-to/monte-carlo.md"],
    "sar-compile verify": ["properties.md"],
    "sar-compile predict": ["../how-to/success-probability.md"],
    "sar-compile conform": ["../how-to/compare-runs.md"],
    "sar-compile mcp": ["../how-to/agents.md#tools"],
    "sar-compile approve": ["../how-to/agents.md#the-gate"],
    "sar-compile explain": ["../findings/README.md"],
    "sar-compile nodes --from-use": ["../how-to/from-btcpp.md#check-a-whole-workspace"],
    "sar-compile completion": ["../start/install.md#completion-in-the-shell"],
    "sar-run": ["../how-to/run-a-mission.md"],
    "sar-run --params": ["parameters.md"],
    "sar-run --like": ["../how-to/nav2-trees.md#the-simulated-nav2"],
    "sar-run --mission": ["../how-to/write-a-mission.md"],
    "sar-run --view": ["../how-to/debug-a-run.md", "../operate/page.md"],
    "sar-run --groot2": ["../how-to/other-tools.md#groot2"],
    "sar-run --publish": ["../how-to/other-tools.md#in-ros"],
    "sar-run --record": ["../how-to/other-tools.md#a-recording"],
    "sar-run --check": ["../missions/search-and-rescue.md#before-the-run"],
    "sar-run --guardian": ["../concepts/security.md#the-guardian"],
    "sar-run --engine": ["../how-to/run-on-a-robot.md#choose-the-engine"],
    "sar-run --executor": ["../how-to/run-on-a-robot.md#choose-the-engine"],
    "sar-run --journal": ["journal.md"],
    "sar-run --properties": ["../how-to/watch-a-run.md"],
    "sar-run --approved": ["../how-to/agents.md#the-gate"],
    "sar-run --supervise": ["journal.md#a-supervisor"],
    "sar-run --report": ["reports.md"],
    "sar-run --fault": ["../how-to/run-a-mission.md#rehearsing-faults"],
    "sar-journal": ["journal.md#sar-journal"],
    "sar-journal check": ["journal.md#tamper-detection"],
    "sar-journal stats": ["journal.md#outcome-statistics"],
    "sar-journal why": ["../operate/why.md"],
    "sar-journal report": ["reports.md"],
    "sar-journal replay": ["../operate/page.md#replay-and-several-robots"],
    "sar-sim run": ["../how-to/nav2-trees.md#the-simulated-nav2", "world.md"],
    "sar-sim map": ["../how-to/make-a-map.md"],
    "sar-sim sweep": ["../how-to/monte-carlo.md#in-the-simulator"],
}
HEAD = """# Commands

This page lists all commands and their options, as `--help-all` describes them. Every command also has `--version`, which shows whether the
kernel is compiled. You cannot abbreviate options, but your shell can [complete them](../start/install.md#completion-in-the-shell).
You can repeat an argument that is followed by `…`.

<!-- Made of the parsers by `make schemas`. -->
"""
SHARED = """## For every command that reads trees

You can also set these options for all trees of a project in its [configuration](configuration.md).

"""


def page():
    """Generate the page from the parsers."""
    project = argparse.ArgumentParser(add_help=False)
    add_project_options(project)
    every = [section(parser, f"## {parser.prog}", parser.prog) for parser in PARSERS]
    return "\n".join([HEAD, *every, f"{SHARED}{table(project, '')}\n"])


def section(parser, heading, prog):
    """Return the section about a command, and the sections about its subcommands."""
    about = f"{prose(parser.description)}{links_to_further_pages(prog, ' See')}"
    parts = [
        heading,
        about if about.endswith(".") else f"{about}.",
        epilog(parser.epilog or ""),
        table(parser, prog),
    ]
    commands = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    for name, command in commands[0].choices.items() if commands else ():
        parts.append(section(command, f"### {prog} {name}", f"{prog} {name}"))
    return "\n\n".join(part.rstrip("\n") for part in parts if part) + "\n"


def epilog(text):
    """Return the epilog of a help text, with its exit statuses as a table."""
    before, sign, statuses = prose(text).partition("Exit status: ")
    rows = re.findall(r"([\d, ]*\d) (?:for )?(.*?)(?:; |\.$)", statuses)
    listed = "".join(f"| {status} | {meaning} |\n" for status, meaning in rows)
    return f"{before}\n\n| Exit status | Description |\n|---|---|\n{listed}".lstrip() if sign else before


def table(parser, prog):
    """Return the list of a parser's arguments, with the shared project options in one item."""
    shared = [
        action
        for group in parser._action_groups
        if group.title == PROJECT_OPTIONS and prog
        for action in group._group_actions
    ]
    rows = [
        f"- **{argument_form(action)}**: {argument_help(parser, action)}{links_to_further_pages(' '.join([prog, *action.option_strings[:1]]), '; see')}"
        for action in arguments(parser)
        if action not in shared
    ]
    if shared:
        options = ", ".join(f"`{action.option_strings[0]}`" for action in shared)
        rows.append(
            f"- {options}: see [for every command that reads trees](#for-every-command-that-reads-trees)"
        )
    return "\n".join(rows)


def arguments(parser):
    """Return the arguments of a parser, without subcommands and the options that every command has."""
    return [
        each
        for each in parser._actions
        if not isinstance(each, argparse._SubParsersAction)
        and not {"--help", "--help-all", "--version"} & {*each.option_strings}
    ]


def argument_form(action):
    """Return an argument as it is typed, with its value."""
    value = action.metavar or "|".join(action.choices or ()) or action.dest.upper()
    if action.nargs == 0:
        value = ""
    elif action.nargs == "?":
        value = f"[{value}]"
    repeated = action.nargs == "+" or isinstance(action, argparse._AppendAction)
    value += "…" if repeated and value else ""
    names = action.option_strings or [""]
    return ", ".join(f"`{f'{name} {value}'.strip()}`" for name in names)


def argument_help(parser, action):
    """Return the help of an argument, and the arguments that exclude it."""
    others = [
        f"`{other.option_strings[0]}`"
        for group in parser._mutually_exclusive_groups
        if action in group._group_actions
        for other in group._group_actions
        if other is not action
    ]
    text = prose(action.help.replace("; may be repeated", ""))
    return f"{text}; not with {' or '.join(others)}" if others else text


def prose(text):
    """Return a help text as Markdown, with its options as code."""
    text = re.sub(r"(?<![\w-])-(-[a-z]\w*)+(-\w+)*", lambda found: f"`{found[0]}`", text)
    return text.replace("<", "\\<").replace("][", "]\\[")


def links_to_further_pages(key, before):
    """Return the links to further pages after a prefix; an empty string if there are none."""
    found = [f"[{title(goal)}]({goal})" for goal in FURTHER_PAGES.get(key, ())]
    return f"{before} {', '.join(found)}" if found else ""


def title(goal):
    """Return the heading at the target of a link."""
    path, _, anchor = goal.partition("#")
    found = headings(PAGE.parent / path)
    return next(text for slug, text in found if anchor in ("", slug))


def test_commands_page_matches_parsers_as_reviewed():
    made = page()
    if os.environ.get(RENEW):
        PAGE.write_text(made, encoding="utf-8")
    assert PAGE.read_text(encoding="utf-8") == made, "renew it: make schemas"


def test_every_console_command_is_on_the_page():
    scripts = entry_points(group="console_scripts").names & {
        each.name
        for each in entry_points(group="console_scripts")
        if each.value.startswith(("sar_compiler.", "search_and_rescue."))
    }
    assert {parser.prog for parser in PARSERS} == scripts


def walk_parsers(parser, prog):
    yield prog, parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, command in action.choices.items():
                yield from walk_parsers(command, f"{prog} {name}")


ALL_PARSERS = [each for root in PARSERS for each in walk_parsers(root, root.prog)]
HELP_TEXTS = {prog: parser.format_help() for prog, parser in ALL_PARSERS}
for each in PARSERS:
    each.show_all()


@pytest.mark.parametrize("prog", HELP_TEXTS)
def test_command_help_fits_one_screen(prog):
    lines = HELP_TEXTS[prog].splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) <= SCREEN.get(prog, 50), HELP_TEXTS[prog]


def test_no_two_arguments_of_a_command_have_the_same_help():
    said = [
        (prog, action.help) for prog, parser in ALL_PARSERS for action in arguments(parser) if action.help
    ]
    assert [each for each in said if said.count(each) > 1] == []


def test_every_argument_has_help_that_names_its_default():
    silent = [
        (prog, argument_form(action))
        for prog, parser in ALL_PARSERS
        for action in arguments(parser)
        if not action.help or (is_value(action.default) and not names_default(action.help, action.default))
    ]
    assert silent == []


def is_value(default):
    return default not in (None, False, [], argparse.SUPPRESS)


def names_default(text, default):
    """Return whether a help text contains a default, as a value or in words such as the number of processors."""
    value = ",".join(f"{each:g}" for each in default) if isinstance(default, tuple) else default
    value = f"{value:g}" if isinstance(value, float) else value
    return f"default {value}" in text or "(default: " in text or ("default)" in text and str(value) in text)


def test_further_pages_belong_to_existing_commands_and_options():
    known = {prog for root in PARSERS for prog, _ in walk_parsers(root, root.prog)}
    known |= {
        f"{prog} {action.option_strings[0]}"
        for root in PARSERS
        for prog, parser in walk_parsers(root, root.prog)
        for action in arguments(parser)
        if action.option_strings
    }
    assert set(FURTHER_PAGES) <= known
