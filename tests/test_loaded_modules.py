"""Tests that checking commands load no robot modules, and that short commands load no slow ones."""

import subprocess
import sys
from contextlib import closing

import pytest

from sar_compiler.journal.journal_opening import open_journal
from tests.trees import document
from tests.views.recorded_runs import ScriptedPolicy, run_and_record, simulated

# The packages that these commands must not load, each with the allowed exceptions.
FORBIDDEN: dict[str, set[str]] = {
    "sar_compiler.agent": set(),
    "sar_compiler.execution": set(),
    "sar_compiler.groot2": set(),
    "sar_compiler.lsp": set(),
    "sar_compiler.missions": {
        "sar_compiler.missions",
        "sar_compiler.missions.mission_choice",
        "sar_compiler.missions.tree_check",
    },
    "sar_compiler.ros": set(),
    "sar_compiler.sim": set(),
    "sar_compiler.web": set(),
    # An installed package of leaves, whose entry point declares them.
    "search_and_rescue": {"search_and_rescue"},
    "rclpy": set(),
}
# Scripts, clocks and keys are passed to nodes like the objects of a mission.
TREE = '<Sequence><Script code="a := 1"/><Timeout msec="5000"><Sleep msec="5"/></Timeout><A name="Drive"/></Sequence>'
NODES = ("--nodes", "tests.analysis.verify.leaves")
SHIPPED = "search_and_rescue"
"""A tree of a mission, whose leaves are declared by the paths of their classes."""
COMMANDS = [
    ("sar_compiler.cli.compile", "validate", "tree.xml"),
    ("sar_compiler.cli.compile", "validate", SHIPPED),
    ("sar_compiler.cli.compile", "verify", "tree.xml"),
    ("sar_compiler.cli.compile", "show", "tree.xml"),
    ("sar_compiler.cli.journal_command", "why", "run.journal"),
]
_PROGRAM = """
import sys
from {module} import main

status = main(sys.argv[1:])
print(*sorted(sys.modules), file=sys.stderr)
sys.exit(status)
"""


@pytest.mark.parametrize(
    ("module", "command", "file"), COMMANDS, ids=[" ".join(each[1:]) for each in COMMANDS]
)
def test_checking_command_loads_no_robot_modules(module, command, file, tmp_path):
    tree = tmp_path / "tree.xml"
    tree.write_text(document(TREE), encoding="utf-8")
    if command == "why":
        with closing(open_journal(tmp_path / file)) as journal:
            run_and_record(
                simulated(tree),
                ScriptedPolicy(Drive=["FAILURE"]),
                journal,
                tree_file=str(tree),
                tree_id="Main",
            )
    name = file if file == SHIPPED else str(tmp_path / file)
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM.format(module=module), command, name, *NODES],
        capture_output=True,
        text=True,
        check=False,
    )
    loaded = set(done.stderr.split())
    assert done.returncode == 0, done.stderr
    assert "sar_compiler.project" in loaded, "the tree was not read"
    found = {
        part: {each for each in loaded if f"{each}.".startswith(f"{part}.")} - allowed
        for part, allowed in FORBIDDEN.items()
    }
    assert {part: sorted(modules) for part, modules in found.items() if modules} == {}


SHORT_COMMANDS = {
    "sar-compile --help": ("compile", 0),
    "sar-compile --version": ("compile", 0),
    "sar-compile validate none.xml": ("compile", 2),
    "sar-compile show none.xml": ("compile", 2),
    "sar-run --help": ("run", 0),
    "sar-run none.xml": ("run", 2),
}
"""Commands that end at once, with the module of the command and the exit status."""
SLOW_MODULES = (
    "importlib.metadata",
    "lxml",
    "py_trees",
    "rclpy",
    "yaml",
    "sar_compiler.checks",
    "sar_compiler.nodes",
)
"""Modules whose import takes longer than these commands."""


@pytest.mark.parametrize("command", SHORT_COMMANDS)
def test_short_command_imports_no_slow_module(command, tmp_path):
    module, status = SHORT_COMMANDS[command]
    program = (
        "import atexit, os, sys; from sar_compiler.cli.{0} import main\n"
        "try: status = main(sys.argv[1:])\n"
        "except SystemExit as end: status = end.code or 0\n"
        "print(*sorted(sys.modules), file=sys.stderr); sys.stderr.flush(); os._exit(status)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program.format(module), *command.split()[1:]],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    loaded = done.stderr.splitlines()[-1].split()
    assert done.returncode == status, done.stderr
    assert [each for each in SLOW_MODULES if each in loaded] == []
    assert len(loaded) < 220
