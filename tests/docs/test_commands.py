"""Tests of the commands in the documentation: they parse, and the files and targets that they name exist."""

import ast
import re
from importlib.metadata import entry_points
from itertools import pairwise, takewhile
from pathlib import Path

from sar_compiler.cli import compile as sar_compile
from sar_compiler.cli import journal_command as sar_journal
from sar_compiler.cli import run as sar_run
from sar_compiler.cli import sim as sar_sim
from sar_compiler.ros.arguments import split_arguments
from tests.docs.markdown import PAGES, codes, commands, tables
from tests.launch.launch_file import LaunchFile

ALL = [command for page in PAGES for command in commands(page)]
PROJECT_COMMANDS = {
    script.name
    for script in entry_points(group="console_scripts")
    if script.value.startswith(("sar_compiler.", "search_and_rescue."))
}
FILE = re.compile(r"(?:.*:=)?([\w./-]+\.(?:xml|yaml|py|sh|txt|json|xsd|pgm|md))(?:::.*)?")
_RULES = {
    "-p": r"[\w./*]+:=.+",
    "--param": r"[\w./*]+:=.+",
    "-r": r"[^:]+(:[^=]+)?:=.+",
    "--remap": r".+:=.+",
}


def program(command):
    return command.words[0].removeprefix(".venv/bin/")


def commands_of(*programs):
    """Return the documented commands of some programs."""
    chosen = [command for command in ALL if program(command) in programs]
    assert chosen, f"the documentation never shows {programs}"
    return chosen


def parse(command):
    """Parse a command's arguments with its own parser. A usage error raises SystemExit."""
    name, arguments = program(command), command.words[1:]
    if name == "sar-run":
        sar_run._options(arguments)
    elif name == "sar-compile":
        sar_compile._parser().parse_args(arguments)
    elif name == "sar-journal":
        sar_journal._parser().parse_args(arguments)
    elif name == "sar-sim":
        sar_sim._parser().parse_args(split_arguments(arguments).own)
    else:
        assert split_arguments(arguments).own in ([], ["--help"]), f"{name} takes ROS arguments only"


def is_refused(command):
    """Return whether a command's own parser refuses it; `--help` exits with 0."""
    try:
        parse(command)
    except SystemExit as end:
        return end.code != 0
    return False


def test_every_documented_project_command_parses():
    assert [str(command) for command in commands_of(*PROJECT_COMMANDS) if is_refused(command)] == []


def test_ros_arguments_of_documented_commands_are_well_formed():
    wrong = []
    for command in commands_of(*PROJECT_COMMANDS):
        for flag, value in list(pairwise([*split_arguments(command.words[1:]).ros, ""]))[::2]:
            known = flag in {"--params-file", "--log-level"}
            if not known and not re.fullmatch(_RULES.get(flag, "(?!)"), value):
                wrong.append(f"{command}: {flag} {value}")
    assert wrong == []


def test_files_named_in_documented_commands_exist():
    missing = []
    for command in commands_of("python", "python3", "bash", "sh", *PROJECT_COMMANDS):
        outputs = output_files(command)
        named = [
            found[1] for word in command.words[1:] if word not in outputs and (found := FILE.fullmatch(word))
        ]
        modules = [value for flag, value in pairwise(command.words) if flag == "--nodes"]
        missing += [f"{command}: {name}" for name in named if not file_exists(command, name)]
        missing += [f"{command}: {name}" for name in modules if not module_exists(command, name)]
    assert missing == []


def output_files(command):
    """Return the files that a command writes."""
    flags = {"-o", "--output", "--report"}
    outputs = {value for flag, value in pairwise(command.words) if flag in flags}
    if program(command) == "sar-journal" and "-o" in command.words:  # several files
        behind = command.words[command.words.index("-o") + 1 :]
        outputs.update(takewhile(lambda word: not word.startswith("-"), behind))
    return outputs


def file_exists(command, name):
    return Path(name).exists() or name in command.made


def module_exists(command, name):
    path = name.replace(".", "/")
    return file_exists(command, f"{path}.py") or file_exists(command, f"{path}/__init__.py")


def test_documented_make_targets_exist():
    makefile = Path("Makefile").read_text(encoding="utf-8")
    targets = {word for line in re.findall(r"^([\w -]+):", makefile, re.MULTILINE) for word in line.split()}
    variables = set(re.findall(r"^(\w+) [?:]?=", makefile, re.MULTILINE))
    unknown = [
        f"{command}: {word}"
        for command in commands_of("make")
        for word in command.words[1:]
        if (word.split("=")[0] not in variables if "=" in word else word not in targets)
    ]
    assert unknown == []


ROS2 = [command for command in ALL if command.words[0] == "ros2" and "sar_compiler" in command.words]


def test_documented_ros2_run_commands_exist_and_parse():
    runs = [command for command in ROS2 if command.words[1] == "run"]
    assert runs
    assert [str(command) for command in runs if command.words[3] not in PROJECT_COMMANDS] == []
    for command in runs:
        if command.words[3] == "sar-run":
            sar_run._options(command.words[4:])


def test_documented_ros2_launch_arguments_are_declared():
    wrong = []
    for command in ROS2:
        if command.words[1] == "launch":
            found = [
                path for folder in ("launch", "examples") for path in Path(folder).rglob(command.words[3])
            ]
            given = {word.split(":=")[0] for word in command.words[4:] if ":=" in word}
            if len(found) != 1 or not given <= declared_arguments(found[0]):
                wrong.append(f"{command}: {found}")
    assert wrong == []


def declared_arguments(launch_file):
    """Return the names of the arguments that a launch file declares."""
    declared = LaunchFile(launch_file).declared()
    if all(name.isidentifier() for name in declared):
        return declared
    # The other names are strings in a table of the launch file.
    texts = (node for node in ast.walk(ast.parse(launch_file.read_text(encoding="utf-8"))))
    return declared | {
        node.value for node in texts if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }


def test_launch_file_argument_table_is_complete():
    path = Path("launch/search_and_rescue.launch.py")
    declared = {
        node.args[0].value
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in {"declare", "DeclareLaunchArgument"}
        and isinstance(node.args[0], ast.Constant)
    }
    explained = {
        code
        for heading, _, cells in tables(Path("docs/how-to/run-on-a-robot.md"))
        if heading == "Arguments of the launch file"
        for code in codes(cells[0])
    }
    assert explained == declared
