"""Tests of the messages for usage and installation errors, which `docs/operate/troubleshooting.md` explains if necessary."""

import os
import re
import shutil
import socket
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from tests.docs.markdown import codes, tables
from tests.processes import BIN
from tests.terminals import Terminal
from tests.trees import document

ROOT = Path.cwd()
TROUBLESHOOTING = Path("docs/operate/troubleshooting.md")
INSTALLING, USAGE = "Installing", "Wrong usage, status 2"

SECTIONS = "/robot1/search_and_rescue:\n  ros__parameters: {zone_order: [zone_a]}\n"
FILES = {
    "wrong.xml": document("<NavigateToZne/>"),
    "plain.xml": document("<AlwaysSuccess/>"),
    "section.yaml": SECTIONS,
    "misspelt.yaml": SECTIONS.replace("ros__parameters", "ros_parameters"),
    "yesterday.mcap": "",
}

# The command that causes each message. {folder} is the folder of the test.
USAGE_ERRORS = {
    "… cannot be run with these options. The robot has not moved": "sar-run {folder}/wrong.xml",
    "there is no journal … to resume. Omit --resume": "sar-run --resume --journal {folder}/none",
    "cannot read …: …": "sar-run nowhere.xml",
    "there is no tree file '…', nor a shipped tree of that name": "sar-run nowhere",
    "there is no node '…'": "sar-run {folder}/wrong.xml",
    "'…' (--nodes) is a file; write its import path": "sar-run --nodes examples/decorators/leaves.py",
    "the module '…' (--nodes) registers no node": "sar-run --nodes examples.decorators",
    "the module of leaves '…' (…) cannot be imported: …": "sar-run --nodes my.leaves",
    "…: the mission has no parameter '…'": "sar-run examples/drive_to_goal/drive_to_goal.xml "
    "--nodes examples.drive_to_goal.leaves",
    "parameter …": "sar-run --ros-args -p tick_rate_hz:=0",
    "… errors in the parameters:…": "sar-run --ros-args -p tick_rate_hz:=0 -p zone_order:=[moon]",
    "sections are for …, but this node is …": "sar-run --params {folder}/section.yaml",
    "did you mean 'ros__parameters' (two underscores)?": "sar-run --params {folder}/misspelt.yaml",
    "unknown ROS argument: …": "sar-run --ros-args tick_rate_hz:=2.0",
    "write a parameter as name:=value. All values of a list must have the same type": "sar-run --ros-args -p x=1",
    "a namespace must begin with a slash: __ns:=/…": "sar-run --ros-args -r __ns:=front",
    "'…' is not allowed in a name: use letters, digits, _ and /": "sar-run --ros-args -r __ns:=/front-1",
    "write from:=to for a name": "sar-run --ros-args -r scan=front/scan",
    "the ROS arguments are invalid: …": "sar-run --ros-args -r __ns:=/front/",
    "… requires --sim": "sar-run --speed 5",
    "--sim expects a world, but '…' looks like a tree. Write the tree before --sim": "sar-run --sim my.xml",
    "there is no world file '…', nor a shipped world of that name": "sar-run --sim moon",
    "there is no mission '…' (installed: …)": "sar-run --mission serch_and_rescue",
    "--until complete requires a mission with an end condition. For this tree, use --until end, success, failure or forever": (
        "sar-run {folder}/plain.xml --until complete"
    ),
    "… already exists and is not overwritten. Choose another name": "sar-run {folder}/plain.xml "
    "--record {folder}/yesterday.mcap",
    "fault '…': …": "sar-run --sim --fault report_survivor:drp=1",
    "robot '…': …": "sar-sim run --robot robot-1",
    "unrecognized arguments: …; write ROS arguments after --ros-args": "sar-run --sim -p zone_order:=[a]",
    "unrecognized arguments: …; write --scenario low.yaml or --params low.yaml": (
        "sar-compile simulate {folder}/plain.xml low.yaml"
    ),
    "did you mean the shipped tree search_and_rescue?": "sar-compile validate search_and_rescue.xml",
    "… is a folder: name a tree file in it, or check all its trees with sar-compile validate": (
        "sar-compile verify {folder}"
    ),
    "the journal … cannot be used: No such file or directory. Journals are in …": "sar-journal show nowhere.journal",
}
# Commands that need a shell.
SHELL_ERRORS = {
    "cannot read …: it is a device, not a file": "sar-compile validate /dev/zero",
    "cannot read …: it is a pipe, not a file": "mkfifo {folder}/pipe; sar-compile validate {folder}/pipe",
    "the name of the tree file is empty": "sar-compile validate ''",
    "… has no tree file": "mkdir {folder}/empty; sar-compile validate {folder}/empty",
    "standard output cannot be written: …": "sar-compile validate {folder}/plain.xml > /dev/full",
    "standard output is closed": "sar-compile validate {folder}/plain.xml >&-",
}
# Errors if the journal exists; whether another process still has it open.
JOURNAL_ERRORS = {
    "the mission in the journal … is not over: …": False,
    "… is the journal of a mission that runs in another process": True,
}
# Messages that need no row on the page, because they name the remedy.
SELF_EXPLANATORY = {
    "there is no journal … to resume. Omit --resume",
    "… cannot be run with these options. The robot has not moved",
    "… already exists and is not overwritten. Choose another name",
    "the name of the tree file is empty",
    "there is no tree file '…', nor a shipped tree of that name",
    "there is no world file '…', nor a shipped world of that name",
    "'…' (--nodes) is a file; write its import path",
    "did you mean 'ros__parameters' (two underscores)?",
    "a namespace must begin with a slash: __ns:=/…",
    "'…' is not allowed in a name: use letters, digits, _ and /",
    "write from:=to for a name",
    "the ROS arguments are invalid: …",
    "… requires --sim",
    "--sim expects a world, but '…' looks like a tree. Write the tree before --sim",
    "there is no mission '…' (installed: …)",
    "fault '…': …",
    "robot '…': …",
    "unrecognized arguments: …; write ROS arguments after --ros-args",
    "unrecognized arguments: …; write --scenario low.yaml or --params low.yaml",
    "did you mean the shipped tree search_and_rescue?",
    "… is a folder: name a tree file in it, or check all its trees with sar-compile validate",
    "the journal … cannot be used: No such file or directory. Journals are in …",
}
PORT_IN_USE = "port … of 127.0.0.1 cannot be used: …"
SECOND_CLOCK = (
    "… already provides … in this ROS domain, and a simulated robot must not mix with another robot."
)
MAKE = {
    "make: … is Python …, but ROS 2 from PyPI needs 3.10 to 3.13": ("python", "echo 3.9"),
    "make: the headers of … are missing (apt install python…": (
        "python",
        f'case "$2" in *Python.h*) exit 1;; *) exec {sys.executable} "$@";; esac',
    ),
    "make: a C and C++ compiler is missing (apt install g++)": ("other", ""),
    "make: ROS 2 from PyPI needs x86-64 Linux": ("uname", "echo Linux aarch64"),
}
MISSING_LIBRARIES = {
    "ROS 2 is missing (…). On a robot, source its installation and workspace": "rclpy",
    "ROS 2 is installed, but not the interface package '…'": "nav2_msgs",
    "a library of the simulator is missing (…)": "scipy",
}
NO_EXTRA = "… needs a library that is missing (…). Install it with pip install 'sar_compiler[…]'"
GEOREFERENCE = "-p georeference.lat:=48.2 -p georeference.lon:=16.4 -p georeference.heading:=90.0"
# For each extra: one of its modules, and a command that needs it.
EXTRAS = {
    "groot2": ("msgpack", "sar-run {folder}/plain.xml --groot2 1667"),
    "lsp": ("pygls", "sar-compile lsp"),
    "mcp": ("mcp", "sar-compile mcp"),
    "record": ("mcap", "sar-run {folder}/plain.xml --record {folder}/today.mcap"),
    "report": (
        "pyproj",
        f"sar-run {{folder}}/plain.xml --report {{folder}}/report.geojson --ros-args {GEOREFERENCE}",
    ),
    "search": (
        "shapely",
        f"sar-run search_sweeps --check --params {Path('config/search_sweeps_params.yaml').resolve()}",
    ),
    "view": ("rich", "sar-run {folder}/plain.xml --view text"),
    "web": ("uvicorn", "sar-run {folder}/plain.xml --view web"),
}
NOT_SHIPPED = "… has no shipped file '…'"
NO_MIDDLEWARE = "RMW_IMPLEMENTATION is set to '…', which is not installed. The installed middlewares are: …"
BROKEN_ENGINE = "--engine py_trees_ros: py_trees_ros cannot be loaded (…)"
NO_ENGINE = "--engine py_trees_ros: py_trees_ros is not installed (…)"


def explained_messages(heading):
    return {
        message
        for each, _, cells in tables(TROUBLESHOOTING)
        if each == heading
        for message in codes(cells[0])
    }


def test_explained_usage_errors_match_tested_ones():
    typed = {*USAGE_ERRORS, *SHELL_ERRORS, *JOURNAL_ERRORS, PORT_IN_USE, SECOND_CLOCK}
    assert explained_messages(USAGE) == typed - SELF_EXPLANATORY
    assert typed >= SELF_EXPLANATORY


def test_explained_installation_errors_match_tested_ones():
    plain = {message for message in MAKE if "apt install" in message}  # these messages name the remedy
    assert explained_messages(INSTALLING) == {*MAKE, *MISSING_LIBRARIES, NOT_SHIPPED, NO_ENGINE} - plain
    declared = (
        Path("pyproject.toml").read_text(encoding="utf-8").partition("\n[project.optional-dependencies]\n")[2]
    )
    extras = re.findall(r"^(\w+) = \[", declared.partition("\n[")[0], re.MULTILINE)
    assert {*extras} - {"ros", "interfaces", "sim", "dev"} == {*EXTRAS}
    explained_extras = (
        Path("docs/start/install.md")
        .read_text(encoding="utf-8")
        .partition("\nChoose the extras that you need:\n\n")[2]
    )
    assert {*extras} - {"dev"} <= {*re.findall(r"`(\w+)` ", explained_extras.partition("\n\n")[0])}


def run_refused(*words, env=None, expected=2):
    """Run a command that must be refused; return its output."""
    done = subprocess.run(
        words,
        capture_output=True,
        text=True,
        env={**os.environ, **(env or {})},
        timeout=60.0,
        check=False,
    )
    assert (done.returncode, "Traceback" in done.stderr) == (expected, False), done.stderr
    return done.stdout + done.stderr


def assert_message_in(message, text):
    pattern = ".*".join(re.escape(part) for part in message.split("…"))
    assert re.search(pattern, text, re.DOTALL), text


@pytest.mark.ros
@pytest.mark.parametrize("message", USAGE_ERRORS)
def test_usage_error_is_reported_as_documented(message, tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    command, *arguments = USAGE_ERRORS[message].format(folder=tmp_path).split()
    assert_message_in(message, run_refused(BIN / command, *arguments))


@pytest.mark.parametrize("message", SHELL_ERRORS)
def test_usage_error_in_shell_is_reported_as_documented(message, tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    path = f"{BIN}{os.pathsep}{os.environ['PATH']}"
    typed = SHELL_ERRORS[message].format(folder=tmp_path)
    assert_message_in(message, run_refused("bash", "-c", typed, env={"PATH": path}))


@pytest.mark.ros
@pytest.mark.parametrize("message", JOURNAL_ERRORS)
def test_start_with_unfinished_or_locked_journal_is_refused_as_documented(message, tmp_path):
    from sar_compiler.journal.journal_opening import open_journal

    (tmp_path / "plain.xml").write_text(FILES["plain.xml"], encoding="utf-8")
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.begin({}, {})
    if not JOURNAL_ERRORS[message]:
        journal.close()
    assert_message_in(message, run_refused(BIN / "sar-run", tmp_path / "plain.xml", "--journal", place))
    journal.close()


@pytest.mark.ros
def test_port_in_use_is_reported_as_documented(tmp_path):
    (tmp_path / "plain.xml").write_text(FILES["plain.xml"], encoding="utf-8")
    with closing(socket.create_server(("127.0.0.1", 0))) as others:
        port = str(others.getsockname()[1])
        assert_message_in(PORT_IN_USE, run_refused(BIN / "sar-run", tmp_path / "plain.xml", "--groot2", port))


@pytest.mark.ros
@pytest.mark.parametrize("command", [["sar-run", "--sim"], ["sar-sim", "run"]], ids=" ".join)
def test_simulation_with_second_clock_is_refused_as_documented(command):
    import rclpy
    from rclpy.context import Context
    from rosgraph_msgs.msg import Clock

    context = Context()
    rclpy.init(context=context)
    try:
        node = rclpy.create_node("somebody_else", context=context)
        node.create_publisher(Clock, "/clock", 10)
        assert_message_in(SECOND_CLOCK, run_refused(BIN / command[0], *command[1:]))
    finally:
        context.try_shutdown()


@pytest.mark.parametrize("message", MAKE)
def test_make_reports_missing_tools_as_documented(message, tmp_path):
    name, lines = MAKE[message]
    make = shutil.which("make")
    assert make is not None, "there is no make on this machine"
    for tool in ("find", "uname"):
        (tmp_path / tool).symlink_to(str(shutil.which(tool)))
    (tmp_path / "python").symlink_to(sys.executable)
    (tmp_path / name).unlink(missing_ok=True)
    (tmp_path / name).write_text(f"#!/bin/sh\n{lines}\n", encoding="utf-8")
    (tmp_path / name).chmod(0o755)
    # No other tools of the machine are on the path. `require` only checks.
    assert_message_in(message, run_refused(make, "require", "PYTHON=python", env={"PATH": str(tmp_path)}))


@pytest.mark.costly
@pytest.mark.parametrize("message", MISSING_LIBRARIES)
def test_missing_library_is_reported_as_documented(message):
    program = (
        f"import sys; sys.modules[{MISSING_LIBRARIES[message]!r}] = None; sys.argv[1:] = ['--sim']\n"
        "from sar_compiler.cli.run import main; sys.exit(main())"
    )
    assert_message_in(message, run_refused(sys.executable, "-c", program))


@pytest.mark.ros
@pytest.mark.parametrize("extra", EXTRAS)
def test_missing_extra_is_reported_as_documented(extra, tmp_path):
    module, typed = EXTRAS[extra]
    (tmp_path / "plain.xml").write_text(FILES["plain.xml"], encoding="utf-8")
    missing = f"raise ModuleNotFoundError('No module named {module}', name='{module}')\n"
    (tmp_path / f"{module}.py").write_text(missing, encoding="utf-8")
    command, *arguments = typed.format(folder=tmp_path).split()
    # --view needs a terminal, not a pipe.
    terminal = Terminal(command, *arguments, env={"PYTHONPATH": str(tmp_path)}, columns=400)
    try:
        status, text = terminal.end(), "\n".join(terminal.history)
    finally:
        terminal.kill()
    assert (status, "Traceback" in text) == (2, False), text
    assert_message_in(NO_EXTRA.replace("[…]", f"[{extra}]"), text)


@pytest.mark.costly
@pytest.mark.ros
def test_missing_shipped_file_is_reported_as_documented(tmp_path):
    shutil.copytree(ROOT / "sar_compiler", tmp_path / "sar_compiler")
    shutil.copytree(ROOT / "trees", tmp_path / "trees")
    shutil.copy(ROOT / "package.xml", tmp_path)
    run = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); sys.argv[1:] = []; "
        "from sar_compiler.cli.run import main; sys.exit(main())"
    )
    assert_message_in(NOT_SHIPPED, run_refused(sys.executable, "-c", run))


@pytest.mark.ros
def test_missing_middleware_is_reported_as_documented():
    assert_message_in(
        NO_MIDDLEWARE, run_refused(BIN / "sar-run", env={"RMW_IMPLEMENTATION": "rmw_nowhere_cpp"})
    )


@pytest.mark.costly
@pytest.mark.ros
def test_broken_engine_is_reported_as_documented(tmp_path):
    (tmp_path / "py_trees_ros").mkdir()
    (tmp_path / "py_trees_ros" / "trees.py").write_text("import nowhere\n", encoding="utf-8")
    command = (BIN / "sar-run", "--engine", "py_trees_ros")
    assert_message_in(BROKEN_ENGINE, run_refused(*command, env={"PYTHONPATH": str(tmp_path)}))


@pytest.mark.costly
@pytest.mark.ros
def test_missing_engine_is_reported_as_documented():
    program = (
        "import sys; sys.modules['py_trees_ros'] = None; sys.argv[1:] = ['--engine', 'py_trees_ros']\n"
        "from sar_compiler.cli.run import main; sys.exit(main())"
    )
    assert_message_in(NO_ENGINE, run_refused(sys.executable, "-c", program))
