"""Whoever types a mistake reads the message that is expected here, and that `docs/operate/troubleshooting.md` explains where it must."""

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

# What is typed, for each message. What is a file of the test's own folder is written as {folder}/….
TYPED = {
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
# What is typed into a shell.
IN_A_SHELL = {
    "cannot read …: it is a device, not a file": "sar-compile validate /dev/zero",
    "cannot read …: it is a pipe, not a file": "mkfifo {folder}/pipe; sar-compile validate {folder}/pipe",
    "the name of the tree file is empty": "sar-compile validate ''",
    "… has no tree file": "mkdir {folder}/empty; sar-compile validate {folder}/empty",
    "standard output cannot be written: …": "sar-compile validate {folder}/plain.xml > /dev/full",
    "standard output is closed": "sar-compile validate {folder}/plain.xml >&-",
}
# What is typed, once there is a journal; whether another process still has it.
BESIDE_A_JOURNAL = {
    "the mission in the journal … is not over: …": False,
    "… is the journal of a mission that runs in another process": True,
}
# Messages that need no row on the page, because they say what to write instead.
PLAIN = {
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
TAKEN_PORT = "port … of 127.0.0.1 cannot be used: …"
COMPANY = "… already provides … in this ROS domain, and a simulated robot must not mix with another robot."
MAKE = {
    "make: … is Python …; ROS 2 from PyPI has 3.10 to 3.13": ("python", "echo 3.9"),
    "make: the headers of … are missing (apt install python…": (
        "python",
        f'case "$2" in *Python.h*) exit 1;; *) exec {sys.executable} "$@";; esac',
    ),
    "make: there is no C and C++ compiler (apt install g++)": ("other", ""),
    "make: ROS 2 from PyPI exists for x86-64 Linux only": ("uname", "echo Linux aarch64"),
}
LACKING = {
    "ROS 2 is missing (…). On a robot, source its installation and workspace": "rclpy",
    "ROS 2 is installed, but not the interface package '…'": "nav2_msgs",
    "a library of the simulator is missing (…)": "scipy",
}
NO_EXTRA = "… needs a library that is missing (…). Install it with pip install 'sar_compiler[…]'"
PLACE = "-p georeference.lat:=48.2 -p georeference.lon:=16.4 -p georeference.heading:=90.0"
# For each extra that an option takes: a module of it, and what is typed.
EXTRAS = {
    "groot2": ("msgpack", "sar-run {folder}/plain.xml --groot2 1667"),
    "lsp": ("pygls", "sar-compile lsp"),
    "mcp": ("mcp", "sar-compile mcp"),
    "record": ("mcap", "sar-run {folder}/plain.xml --record {folder}/today.mcap"),
    "report": (
        "pyproj",
        f"sar-run {{folder}}/plain.xml --report {{folder}}/report.geojson --ros-args {PLACE}",
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


def explained(heading):
    return {
        message
        for each, _, cells in tables(TROUBLESHOOTING)
        if each == heading
        for message in codes(cells[0])
    }


def test_every_mistake_of_usage_that_is_explained_is_typed_and_the_others_say_what_to_write():
    typed = {*TYPED, *IN_A_SHELL, *BESIDE_A_JOURNAL, TAKEN_PORT, COMPANY}
    assert explained(USAGE) == typed - PLAIN
    assert typed >= PLAIN


def test_every_hindrance_to_installing_that_is_explained_is_met():
    plain = {message for message in MAKE if "apt install" in message}  # they say what to do
    assert explained(INSTALLING) == {*MAKE, *LACKING, NOT_SHIPPED, NO_ENGINE} - plain
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


def said(*words, env=None, expected=2):
    """Run a command that must be refused; return what it said."""
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


def assert_read(message, text):
    pattern = ".*".join(re.escape(part) for part in message.split("…"))
    assert re.search(pattern, text, re.DOTALL), text


@pytest.mark.ros
@pytest.mark.parametrize("message", TYPED)
def test_a_mistake_of_usage_is_answered_as_the_page_says(message, tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    command, *arguments = TYPED[message].format(folder=tmp_path).split()
    assert_read(message, said(BIN / command, *arguments))


@pytest.mark.parametrize("message", IN_A_SHELL)
def test_a_mistake_in_a_shell_is_answered_as_the_page_says(message, tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    path = f"{BIN}{os.pathsep}{os.environ['PATH']}"
    typed = IN_A_SHELL[message].format(folder=tmp_path)
    assert_read(message, said("bash", "-c", typed, env={"PATH": path}))


@pytest.mark.ros
@pytest.mark.parametrize("message", BESIDE_A_JOURNAL)
def test_a_start_beside_a_journal_is_refused_as_the_page_says(message, tmp_path):
    from sar_compiler.journal.journal_opening import open_journal

    (tmp_path / "plain.xml").write_text(FILES["plain.xml"], encoding="utf-8")
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.begin({}, {})
    if not BESIDE_A_JOURNAL[message]:
        journal.close()
    assert_read(message, said(BIN / "sar-run", tmp_path / "plain.xml", "--journal", place))
    journal.close()


@pytest.mark.ros
def test_a_port_that_others_have_is_refused_as_the_page_says(tmp_path):
    (tmp_path / "plain.xml").write_text(FILES["plain.xml"], encoding="utf-8")
    with closing(socket.create_server(("127.0.0.1", 0))) as others:
        port = str(others.getsockname()[1])
        assert_read(TAKEN_PORT, said(BIN / "sar-run", tmp_path / "plain.xml", "--groot2", port))


@pytest.mark.ros
@pytest.mark.parametrize("command", [["sar-run", "--sim"], ["sar-sim", "run"]], ids=" ".join)
def test_a_simulation_beside_another_clock_is_refused_as_the_page_says(command):
    import rclpy
    from rclpy.context import Context
    from rosgraph_msgs.msg import Clock

    context = Context()
    rclpy.init(context=context)
    try:
        node = rclpy.create_node("somebody_else", context=context)
        node.create_publisher(Clock, "/clock", 10)
        assert_read(COMPANY, said(BIN / command[0], *command[1:]))
    finally:
        context.try_shutdown()


@pytest.mark.parametrize("message", MAKE)
def test_make_names_what_the_machine_lacks_as_the_page_says(message, tmp_path):
    name, lines = MAKE[message]
    make = shutil.which("make")
    assert make is not None, "there is no make on this machine"
    for tool in ("find", "uname"):
        (tmp_path / tool).symlink_to(str(shutil.which(tool)))
    (tmp_path / "python").symlink_to(sys.executable)
    (tmp_path / name).unlink(missing_ok=True)
    (tmp_path / name).write_text(f"#!/bin/sh\n{lines}\n", encoding="utf-8")
    (tmp_path / name).chmod(0o755)
    # Of the machine's own tools there are those alone; `require` looks, and makes nothing.
    assert_read(message, said(make, "require", "PYTHON=python", env={"PATH": str(tmp_path)}))


@pytest.mark.costly
@pytest.mark.parametrize("message", LACKING)
def test_a_library_that_is_not_installed_is_named_as_the_page_says(message):
    program = (
        f"import sys; sys.modules[{LACKING[message]!r}] = None; sys.argv[1:] = ['--sim']\n"
        "from sar_compiler.cli.run import main; sys.exit(main())"
    )
    assert_read(message, said(sys.executable, "-c", program))


@pytest.mark.ros
@pytest.mark.parametrize("extra", EXTRAS)
def test_an_extra_that_is_not_installed_is_named_as_the_page_says(extra, tmp_path):
    module, typed = EXTRAS[extra]
    (tmp_path / "plain.xml").write_text(FILES["plain.xml"], encoding="utf-8")
    missing = f"raise ModuleNotFoundError('No module named {module}', name='{module}')\n"
    (tmp_path / f"{module}.py").write_text(missing, encoding="utf-8")
    command, *arguments = typed.format(folder=tmp_path).split()
    # Into a pipe, --view takes nothing.
    terminal = Terminal(command, *arguments, env={"PYTHONPATH": str(tmp_path)}, columns=400)
    try:
        status, text = terminal.end(), "\n".join(terminal.history)
    finally:
        terminal.kill()
    assert (status, "Traceback" in text) == (2, False), text
    assert_read(NO_EXTRA.replace("[…]", f"[{extra}]"), text)


@pytest.mark.costly
@pytest.mark.ros
def test_an_installation_without_a_shipped_file_is_named_as_the_page_says(tmp_path):
    shutil.copytree(ROOT / "sar_compiler", tmp_path / "sar_compiler")
    shutil.copytree(ROOT / "trees", tmp_path / "trees")
    shutil.copy(ROOT / "package.xml", tmp_path)
    run = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); sys.argv[1:] = []; "
        "from sar_compiler.cli.run import main; sys.exit(main())"
    )
    assert_read(NOT_SHIPPED, said(sys.executable, "-c", run))


@pytest.mark.ros
def test_a_middleware_that_is_not_installed_is_named_as_the_page_says():
    assert_read(NO_MIDDLEWARE, said(BIN / "sar-run", env={"RMW_IMPLEMENTATION": "rmw_nowhere_cpp"}))


@pytest.mark.costly
@pytest.mark.ros
def test_an_engine_that_cannot_be_loaded_is_named_as_the_page_says(tmp_path):
    (tmp_path / "py_trees_ros").mkdir()
    (tmp_path / "py_trees_ros" / "trees.py").write_text("import nowhere\n", encoding="utf-8")
    command = (BIN / "sar-run", "--engine", "py_trees_ros")
    assert_read(BROKEN_ENGINE, said(*command, env={"PYTHONPATH": str(tmp_path)}))


@pytest.mark.costly
@pytest.mark.ros
def test_an_engine_that_is_not_installed_is_named_as_the_page_says():
    program = (
        "import sys; sys.modules['py_trees_ros'] = None; sys.argv[1:] = ['--engine', 'py_trees_ros']\n"
        "from sar_compiler.cli.run import main; sys.exit(main())"
    )
    assert_read(NO_ENGINE, said(sys.executable, "-c", program))
