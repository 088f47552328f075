"""Tests of shell completion, as the Tab key requests it, and of the option --version."""

import argparse
import os
import shutil
import subprocess
import sys
from importlib.metadata import entry_points, version
from pathlib import Path

import pytest

from sar_compiler.cli import compile as sar_compile
from sar_compiler.cli import journal_command as sar_journal
from sar_compiler.cli import run as sar_run
from sar_compiler.cli import sim as sar_sim
from sar_compiler.cli.arguments import ArgumentKind
from sar_compiler.cli.completion import COMPLETERS, SHELLS

TREE = """\
<root BTCPP_format="4">
  <BehaviorTree ID="Morning"><AlwaysSuccess/></BehaviorTree>
  <BehaviorTree ID="Evening"><AlwaysSuccess/></BehaviorTree>
</root>
"""
LEAVES = """\
from py_trees.behaviour import Behaviour
from sar_compiler.leaves import Kind, register

@register("WaterPlants", kind=Kind.ACTION)
class WaterPlants(Behaviour):
    '''Water them.'''
"""
# Script for each shell: completes the line $1 as the Tab key does, and prints the choices.
COMPLETION_SCRIPTS = {
    "bash": 'COMP_LINE=$1 COMP_POINT=${#1} COMP_TYPE=9; _python_argcomplete "${1%% *}"; printf "%s\\n" "${COMPREPLY[@]}"',
    "zsh": 'compdef() { } 2>/dev/null; eval "$CODE"; _describe() { print -l -- "${(@P)2}" }; '
    "words=(${(z)1}) BUFFER=$1 CURSOR=${#1}; _python_argcomplete",
    "fish": "complete -C $argv[1]",
}
# Arguments whose values are free text, numbers or new names.
WITHOUT_COMPLETION = {
    "by",
    "digest",
    "at_least", "confidence", "count", "deep", "fault", "georeference", "groot2", "half_width", "head", "jobs", "last_run", "limit", "max_memory", "max_seconds", "max_states", "memory", "period", "robot",
    "runs", "seed", "set", "speed", "supervise", "ticks", "topic", "tree_id", "until", "unusual", "vary", "web_port",
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("completion")
    made.joinpath("garden.xml").write_text(TREE)
    made.joinpath("leaves.py").write_text(LEAVES)
    made.joinpath("notes.txt").write_text("")
    return made


def choices(shell, line, folder):
    """Return the choices of a shell at the end of a line, without blanks and descriptions."""
    if not shutil.which(shell):
        pytest.skip(f"{shell} is not installed")
    printed = subprocess.run(
        [Path(sys.executable).with_name("sar-compile"), "completion", shell],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    script = COMPLETION_SCRIPTS[shell] if shell == "zsh" else f"{printed}\n{COMPLETION_SCRIPTS[shell]}"
    plain = {"bash": ["--norc", "-c", script, "bash"], "zsh": ["-f", "-c", script, "zsh"]}
    command = [shell, *plain.get(shell, ["--no-config", "-c", script]), line]
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "CODE": printed,
    }
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder, env=environment)
    return {each.partition("\t")[0].partition(":")[0].strip() for each in done.stdout.splitlines()} - {""}


@pytest.mark.parametrize("shell", SHELLS)
def test_shell_completes_commands_options_and_names(shell, folder):
    assert choices(shell, "sar-compile va", folder) == {"validate"}
    assert {"--strict", "--fix"} <= choices(shell, "sar-compile validate --", folder)
    assert choices(shell, "sar-run search", folder) == {
        "search_and_rescue",
        "search_and_rescue_guarded",
        "search_and_rescue_resilient",
        "search_areas",
        "search_areas_guarded",
        "search_sweeps",
        "search_sweeps_guarded",
    }


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("sar-compile show --format ", {"unicode", "ascii", "json", "svg", "mermaid", "dot"}),
        ("sar-compile validate gar", {"garden.xml"}),
        ("sar-compile validate no", set()),
        ("sar-compile show garden.xml --tree ", {"Morning", "Evening"}),
        ("sar-compile nodes NavigateToZ", {"NavigateToZone"}),
        ("sar-compile nodes --nodes lea", {"leaves"}),
        ("sar-compile nodes --nodes leaves Wat", {"WaterPlants"}),
        ("sar-compile nodes --model gar", {"garden.xml"}),
        ("sar-compile nodes --model nav2:ja", {"jazzy"}),
        ("sar-compile explain unknown-n", {"unknown-node"}),
        ("sar-run --sim dis", {"disaster_zone"}),
        ("sar-run --mission sea", {"search_and_rescue"}),
        ("sar-sim ma", {"map"}),
        ("sar-sim map em", {"empty"}),
        ("sar-detect-survivor-server --v", {"--version"}),
        ("sar-run --ros-args --sp", set()),
    ],
)
def test_argument_values_are_completed(line, offered, folder):
    assert choices("bash", line, folder) == offered


@pytest.mark.parametrize(
    "command", [each.name for each in entry_points(group="console_scripts") if each.name.startswith("sar-")]
)
def test_every_command_shows_its_version(command):
    path = Path(sys.executable).with_name(command)
    shown = subprocess.run([path, "--version"], capture_output=True, text=True, check=True).stdout
    assert shown.startswith(f"{command} {version('sar_compiler')} (Python ")


def test_missing_file_offers_no_completions(folder):
    assert choices("bash", "sar-compile show missing.xml --tree ", folder) == set()


def arguments_of(parser):
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from arguments_of(command)
        elif action.choices is None and action.nargs != 0:
            yield action


def test_every_argument_with_value_has_completer_or_is_listed_without_one():
    parsers = sar_compile._parser(), sar_journal._parser(), sar_run._parser(), sar_sim._parser()
    arguments = [each for parser in parsers for each in arguments_of(parser)]
    assert {each.type.name for each in arguments if isinstance(each.type, ArgumentKind)} == {*COMPLETERS} - {
        ""
    }
    assert {each.dest for each in arguments if not isinstance(each.type, ArgumentKind)} == WITHOUT_COMPLETION


def test_command_does_not_import_completion_modules():
    program = (
        "import sys; from sar_compiler.cli.compile import main; main(['explain', 'unknown-node']); "
        "sys.exit(any('complet' in name for name in sys.modules))"
    )
    assert (
        subprocess.run([sys.executable, "-c", program], stdout=subprocess.DEVNULL, check=False).returncode
        == 0
    )


def test_nodes_of_project_are_completed_only_after_it_is_trusted(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    project = shutil.copytree(folder, tmp_path / "project")
    project.joinpath("sar.toml").write_text('nodes = ["leaves"]\n')
    for asked in ("sar-compile nodes Wat", "sar-compile nodes --trust Wat"):
        assert choices("bash", asked, project) == set()
    nodes = str(Path(sys.executable).with_name("sar-compile")), "nodes", "--trust"
    subprocess.run(nodes, check=True, cwd=project, capture_output=True)
    assert choices("bash", "sar-compile nodes Wat", project) == {"WaterPlants"}
