"""Tests of the tools for agents, called by the client of the MCP SDK over the pipes of a real process."""

import asyncio
import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from mcp import Client, StdioServerParameters
from mcp.server.mcpserver.exceptions import ToolError

from sar_compiler.agent.call_limits import CallLimits
from sar_compiler.agent.mcp_server import ToolAccess
from tests.cli.command_runner import run
from tests.processes import BIN, children_of
from tests.trees import document

RIGHT = document("<Sequence><ZonesRemaining/><DetectSurvivor/></Sequence>")
WRONG = document('<Sequnce memroy="true"><ZonesRemaining/><DetectSurvivor/></Sequnce>')
PROPERTIES = "properties: {nobody is there: {never: DetectSurvivor found}}\n"
TOOLS = {"nodes", "validate", "explain", "simulate", "verify", "predict", "diff", "convert", "propose"}


@pytest.fixture
def work(tmp_path, monkeypatch):
    """Work in the folder of an agent, as a user without approvals."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    folder = tmp_path / "work"
    folder.mkdir()
    (folder / "right.xml").write_text(RIGHT, encoding="utf-8")
    (folder / "wrong.xml").write_text(WRONG, encoding="utf-8")
    (folder / "p.yaml").write_text(PROPERTIES, encoding="utf-8")
    (folder / "s.yaml").write_text("name: quick\nleaves: {DetectSurvivor: found}\n", encoding="utf-8")
    (tmp_path / "outside.xml").write_text(RIGHT, encoding="utf-8")
    (folder / "link.xml").symlink_to(tmp_path / "outside.xml")
    monkeypatch.chdir(folder)
    return folder


def session(talk, *options):
    """Start the server in the current folder, as an agent's program does; return the result of a conversation."""
    command = StdioServerParameters(
        command=str(BIN / "sar-compile"), args=["mcp", *map(str, options)], cwd=Path.cwd(), env={**os.environ}
    )

    async def talked():
        async with Client(command) as client:
            return await talk(client)

    return asyncio.run(talked())


def call(*calls, options=()):
    """Call tools; return the result of each, or the text of its error."""

    async def talk(client):
        results = [await client.call_tool(name, arguments) for name, arguments in calls]
        return [each.content[0].text if each.is_error else each.structured_content for each in results]

    return session(talk, *options)


def test_server_offers_only_read_only_tools(work):
    async def talk(client):
        return (await client.list_tools()).tools

    tools = session(talk)
    assert {each.name for each in tools} == TOOLS
    assert all(each.description and each.annotations.read_only_hint for each in tools)


# Tools with their arguments, and the commands with the same output.
TOOL_COMMANDS = [
    ("nodes", {}, "nodes --format json"),
    ("nodes", {"tag": "Retry"}, "nodes Retry --format json"),
    ("validate", {"file": "right.xml"}, "validate right.xml --format json"),
    ("validate", {"file": "wrong.xml"}, "validate wrong.xml --format json"),
    ("explain", {"code": "unknown-node"}, "explain unknown-node"),
    ("simulate", {"file": "right.xml"}, "simulate right.xml --format json"),
    ("simulate", {"file": "right.xml", "scenario": "s.yaml", "until": "tick >= 2", "ticks": 3, "seed": 4},
     "simulate right.xml --scenario s.yaml --until tick>=2 --ticks 3 --seed 4 --format json"),
    ("verify", {"file": "right.xml"}, "verify right.xml --format json"),
    ("verify", {"file": "right.xml", "properties": "p.yaml", "facts": {"zones_left": 2}, "max_states": 3},
     "verify right.xml --properties p.yaml --set zones_left=2 --max-states 3 --format json"),
    ("verify", {"file": "right.xml", "against": "search_and_rescue", "properties": "p.yaml"},
     "verify right.xml --against search_and_rescue --properties p.yaml --format json"),
    ("predict", {"file": "right.xml", "properties": "p.yaml", "facts": {"zones_left": 2}},
     "predict right.xml --properties p.yaml --set zones_left=2 --format json"),
    ("diff", {"old": "right.xml", "new": "search_and_rescue"}, "diff right.xml search_and_rescue --format json"),
    ("convert", {"file": "right.xml", "to": "yaml"}, "convert right.xml --to yaml"),
    ("propose", {"file": "right.xml", "properties": "p.yaml"}, "approve right.xml --propose --properties p.yaml"),
]  # fmt: skip


def without_times(data):
    return {key: value for key, value in data.items() if key != "seconds"} if isinstance(data, dict) else data


def test_tool_returns_command_output_and_changes_no_file(work, tmp_path):
    before = {path: path.read_bytes() for path in work.iterdir()}
    answers = call(*((tool, arguments) for tool, arguments, _ in TOOL_COMMANDS))
    for (_, _, command), answer in zip(TOOL_COMMANDS, answers, strict=True):
        done = subprocess.run(
            [BIN / "sar-compile", *command.split()], capture_output=True, text=True, check=False
        )
        is_text = isinstance(answer["output"], str)
        expected = done.stdout if is_text else json.loads(done.stdout)
        assert without_times(answer["output"]) == without_times(expected), command
        assert (answer["ok"], answer["notes"]) == (done.returncode == 0, done.stderr.rstrip()), command
    assert {path: path.read_bytes() for path in work.iterdir()} == before
    assert not (tmp_path / "state" / "sar_compiler" / "approved").exists()


def test_validate_returns_fixed_text_of_wrong_tree(work):
    right, wrong = call(("validate", {"file": "right.xml"}), ("validate", {"file": "wrong.xml"}))
    assert right["fixed"] is None
    assert wrong["fixed"] == WRONG.replace("Sequnce", "Sequence").replace("memroy", "memory")


def test_tree_with_errors_is_not_verified_and_notes_name_them(work):
    (answer,) = call(("verify", {"file": "wrong.xml"}))
    assert (answer["ok"], answer["output"]) == (False, None)
    assert "error[unknown-node]" in answer["notes"]


OUTSIDE = ["../outside.xml", "/etc/passwd", "link.xml", "{above}/outside.xml"]
PATH_ARGUMENTS = [
    ("validate", "file", {}),
    ("simulate", "file", {}),
    ("simulate", "scenario", {"file": "right.xml"}),
    ("verify", "file", {}),
    ("verify", "properties", {"file": "right.xml"}),
    ("verify", "against", {"file": "right.xml"}),
    ("predict", "file", {}),
    ("predict", "properties", {"file": "right.xml"}),
    ("diff", "old", {"new": "right.xml"}),
    ("diff", "new", {"old": "right.xml"}),
    ("convert", "file", {"to": "yaml"}),
    ("propose", "file", {}),
    ("propose", "properties", {"file": "right.xml"}),
    ("propose", "params", {"file": "right.xml"}),
]


def test_no_tool_argument_reads_outside_the_folders(work):
    paths = [each.format(above=work.parent) for each in OUTSIDE]
    answers = call(
        *((tool, {**others, name: path}) for tool, name, others in PATH_ARGUMENTS for path in paths)
    )
    assert len(answers) == len(PATH_ARGUMENTS) * len(OUTSIDE)
    assert [each for each in answers if "is outside the folders that the tools may read: " not in each] == []


def test_call_argument_is_never_parsed_as_option(work):
    folder, missing, option, code = call(
        ("validate", {"file": "."}),
        ("validate", {"file": "missing.xml"}),
        ("validate", {"file": "--fix"}),
        ("explain", {"code": "--help"}),
    )
    assert "'.' is a folder. Name a file" in folder
    assert "cannot read missing.xml: No such file or directory" in missing
    assert "there is no tree file '--fix'" in option
    assert "there is no finding code '--help'" in code


def test_all_roots_are_readable_and_paths_are_relative_to_the_first(work, tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "other.xml").write_text(RIGHT, encoding="utf-8")
    options = ["--root", inner, "--root", tmp_path / "work"]
    first, second, above = call(
        ("validate", {"file": "other.xml"}),
        ("validate", {"file": "../work/right.xml"}),
        ("validate", {"file": "../outside.xml"}),
        options=options,
    )
    assert (first["ok"], second["ok"]) == (True, True)
    assert "is outside the folders that the tools may read: " in above


def test_paths_in_options_are_relative_to_start_folder(work, tmp_path):
    model = '<root BTCPP_format="4"><TreeNodesModel><Action ID="Wave"/></TreeNodesModel></root>'
    (tmp_path / "palette.xml").write_text(model, encoding="utf-8")
    (work / "inner").mkdir()
    (work / "inner" / "waving.xml").write_text(document("<Wave/>"), encoding="utf-8")
    options = ["--root", "inner", "--model", "../palette.xml"]
    (answer,) = call(("validate", {"file": "waving.xml"}), options=options)
    assert answer["output"] == []


def test_node_options_apply_to_every_call(work):
    calls = ("nodes", {"tag": "ComputePathToPose"}), ("verify", {"file": "right.xml"})
    known, verified = call(*calls, options=["--model", "nav2:jazzy", "--include-path", "."])
    assert [each["tag"] for each in known["output"]] == ["ComputePathToPose"]
    assert verified["notes"] == ""
    (unknown,) = call(calls[0])
    assert "there is no node 'ComputePathToPose'" in unknown


def test_call_over_time_limit_is_aborted_and_next_one_is_answered(work):
    given_up, outside = call(
        ("verify", {"file": "right.xml"}), ("validate", {"file": "/"}), options=["--limit", "0.01"]
    )
    assert "verify was aborted after 0.01 s, the time limit of a call" in given_up
    assert "is outside" in outside


TEXT_ARGUMENTS = [
    *((tool, {**others, name: None}) for tool, name, others in PATH_ARGUMENTS),
    ("nodes", {"tag": None}),
    ("explain", {"code": None}),
    ("simulate", {"file": "right.xml", "until": None}),
    ("verify", {"file": "right.xml", "facts": {"zones_left": None}}),
    ("propose", {"file": "right.xml", "tree": None}),
]


def fill_arguments(arguments, word):
    """Return arguments with a word for None."""
    return {
        name: word if value is None else fill_arguments(value, word) if isinstance(value, dict) else value
        for name, value in arguments.items()
    }


@pytest.mark.parametrize(
    "word",
    ["a\0b.xml", "x" * 5000, "x" * 300_000],
    ids=["zero byte", "long", "too long to pass"],
)
def test_invalid_arguments_are_errors_without_traceback(work, word):
    calls = [(tool, fill_arguments(arguments, word)) for tool, arguments in TEXT_ARGUMENTS]
    script = f"exec {BIN}/sar-compile mcp 2>complaints"
    command = StdioServerParameters(command="sh", args=["-c", script], cwd=work, env={**os.environ})

    async def talked():
        async with Client(command) as client:
            return [await client.call_tool(name, arguments) for name, arguments in calls]

    for (tool, _), answer in zip(calls, asyncio.run(talked()), strict=True):
        text = answer.content[0].text
        assert answer.is_error, (tool, text[:200])
        assert "Traceback" not in text
    assert "Traceback" not in (work / "complaints").read_text(encoding="utf-8")


def test_file_replaced_after_check_is_never_read_outside(work, tmp_path):
    secret = document("<AlwaysFailure/>", main="Secret")
    (tmp_path / "secret.xml").write_text(secret, encoding="utf-8")
    stop, rounds = threading.Event(), []

    def exchange():
        while not stop.is_set():
            (work / "new").symlink_to(tmp_path / "secret.xml")
            (work / "new").replace(work / "right.xml")
            (work / "new").write_text(RIGHT, encoding="utf-8")
            (work / "new").replace(work / "right.xml")
            rounds.append(1)

    thread = threading.Thread(target=exchange)
    thread.start()
    try:
        answers = call(*[("convert", {"file": "right.xml", "to": "xml"})] * 8)
    finally:
        stop.set()
        thread.join()
    assert len(rounds) > 100
    assert [each for each in answers if "Secret" in str(each)] == []


class TestCallProcess:
    """What the process of a call may read, and its limits."""

    @pytest.fixture
    def limited_command(self, work):
        def run_limited(*words, place=work, memory_mib=2048):
            limits = CallLimits((str(place),), "the folder of the agent", memory_mib * 2**20)
            return subprocess.run(
                [BIN / "sar-compile", *words],
                env=limits.environment(),
                capture_output=True,
                text=True,
                check=False,
            )

        return run_limited

    @pytest.mark.parametrize(
        "words",
        [
            ["validate", "link.xml"],
            ["convert", "link.xml", "--to", "yaml"],
            ["diff", "right.xml", "link.xml"],
            ["verify", "right.xml", "--properties", "link.xml"],
            ["simulate", "right.xml", "--scenario", "link.xml"],
            ["validate", "right.xml", "--model", "link.xml"],
            ["approve", "right.xml", "--propose", "--params", "link.xml"],
            ["validate", "linked/right.xml"],
        ],
        ids=" ".join,
    )
    def test_call_reads_nothing_outside_the_folders(self, limited_command, words, work, tmp_path):
        (tmp_path / "elsewhere").mkdir()
        (tmp_path / "elsewhere" / "right.xml").write_text(RIGHT, encoding="utf-8")
        (work / "linked").symlink_to(tmp_path / "elsewhere")
        done = limited_command(*words)
        assert done.returncode == 2
        assert "it is outside the folder of the agent" in done.stderr

    def test_call_lists_no_folder_outside_the_folders(self, limited_command, work, tmp_path):
        (work / "linked").symlink_to(tmp_path)
        done = limited_command("validate", "linked")
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == "sar-compile: cannot read linked: it is outside the folder of the agent\n"

    def test_call_has_low_priority_and_memory_limit(self):
        program = (
            "import os, resource\n"
            "from sar_compiler.agent.call_limits import limit_this_process\n"
            "limit_this_process(os.environ)\n"
            "print(os.nice(0), *resource.getrlimit(resource.RLIMIT_AS), 'SAR_CALL_LIMITS' in os.environ)\n"
        )
        limits = CallLimits((), "", 300 * 2**20)
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=limits.environment(),
            capture_output=True,
            text=True,
            check=True,
        )
        nice = min(os.nice(0) + 10, 19)
        assert done.stdout == f"{nice} {300 * 2**20} {300 * 2**20} False\n"

    def test_call_over_memory_limit_reports_it_in_one_line(self, limited_command):
        done = limited_command("verify", "search_sweeps", "--set", "zones_left=5", place="/", memory_mib=90)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == "sar-compile: there is not enough memory for this command\n"

    def test_call_reads_configuration_above_root_and_files_it_names(self, work):
        (work / "sar.toml").write_text(
            'models = ["palettes/p.xml"]\n[project]\ntrees = ["sets/*.xml"]\n', encoding="utf-8"
        )
        for folder in ("palettes", "sets", "trees", "private"):
            (work / folder).mkdir()
        model = '<root BTCPP_format="4"><TreeNodesModel><Action ID="Wave"/></TreeNodesModel></root>'
        (work / "palettes" / "p.xml").write_text(model, encoding="utf-8")
        (work / "sets" / "part.xml").write_text(document("<Wave/>", main="Part"), encoding="utf-8")
        (work / "private" / "s.xml").write_text(RIGHT, encoding="utf-8")
        (work / "trees" / "t.xml").write_text(document('<SubTree ID="Part"/>'), encoding="utf-8")
        (work / "trees" / "link.xml").symlink_to(work / "private" / "s.xml")
        calls = [("validate", {"file": each}) for each in ("t.xml", "link.xml", "../private/s.xml")]
        right, *outside = call(*calls, options=["--root", "trees"])
        assert right["output"] == []
        assert ["is outside" in each for each in outside] == [True, True]

    @pytest.mark.parametrize(("folder", "codes"), [("trees", []), (".", ["unknown-node"])])
    def test_call_uses_nearby_palettes_only_within_the_root(self, work, folder, codes):
        # The repository is larger than the folder that the tools may read.
        (work / ".git").mkdir()
        (work / "trees").mkdir()
        model = '<root BTCPP_format="4"><TreeNodesModel><Action ID="Wave"/></TreeNodesModel></root>'
        (work / folder / "palette.xml").write_text(model, encoding="utf-8")
        (work / "trees" / "t.xml").write_text(document("<Wave/>"), encoding="utf-8")
        (answer,) = call(("validate", {"file": "t.xml"}), options=["--root", "trees"])
        assert [each["code"] for each in answer["output"] if each["severity"] == "error"] == codes


# A replacement of `sar-compile`: logs its start and end, and does what its last argument says.
FAKE_COMMAND = """
import os, sys, time
log = os.open("log", os.O_WRONLY | os.O_APPEND | os.O_CREAT)
os.write(log, b"+")
if sys.argv[-1] == "stay":
    time.sleep(0.1)
elif sys.argv[-1] == "much":
    sys.stdout.write("x" * 2**25)
elif sys.argv[-1] == "die":
    os.abort()
elif sys.argv[-1] == "forever":
    time.sleep(1000)
os.write(log, b"-")
"""


class TestConcurrentCalls:
    @pytest.fixture
    def access(self, work):
        (work / "command.py").write_text(FAKE_COMMAND, encoding="utf-8")
        return ToolAccess([work], 60.0, 2**31, [sys.executable, "command.py"])

    def together(self, access, count, word):
        async def calls():
            running = (access.run("verify", [], word) for _ in range(count))
            return await asyncio.gather(*running, return_exceptions=True)

        return asyncio.run(calls())

    def test_two_calls_run_at_a_time_and_all_are_answered(self, access, work):
        assert self.together(access, 16, "stay") == [(0, "", "")] * 16
        marks = (work / "log").read_text(encoding="utf-8")
        running = [marks[:end].count("+") - marks[:end].count("-") for end in range(len(marks) + 1)]
        assert (max(running), len(marks)) == (2, 32)

    def test_calls_beyond_queue_limit_are_refused(self, access):
        answers = self.together(access, 60, "")
        refused = [each for each in answers if isinstance(each, ToolError)]
        assert len(refused) == 10
        assert str(refused[0]) == "50 calls are still running. Call again later"
        assert self.together(access, 1, "") == [(0, "", "")]

    @pytest.mark.parametrize(
        ("word", "said"),
        [
            ("much", "the result of verify is larger than 16 MiB. Request less"),
            ("die", "verify was ended by signal 6. The server's option --memory limits it to 2048 MiB"),
        ],
    )
    def test_too_large_result_and_killed_call_are_reported(self, access, word, said):
        (answer,) = self.together(access, 1, word)
        assert str(answer) == said

    def test_aborted_call_ends_its_process_and_frees_its_slot(self, work):
        (work / "command.py").write_text(FAKE_COMMAND, encoding="utf-8")
        access = ToolAccess([work], 1.0, 2**31, [sys.executable, "command.py"])
        answers = self.together(access, 4, "forever")
        assert {str(each) for each in answers} == {"verify was aborted after 1 s, the time limit of a call"}
        assert (work / "log").read_text(encoding="utf-8") == "++++"
        assert children_of(os.getpid(), "command.py") == []


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--root", "nowhere"], "sar-compile: --root nowhere is not a folder\n"),
        (
            ["--trust"],
            "sar-compile: --trust cannot be used with this command, because it would also trust changes that an agent makes to the modules. To trust the current modules, run sar-compile validate with --trust once\n",
        ),
    ],
)
def test_server_with_missing_root_or_trust_option_does_not_start(work, options, said, capsys):
    assert run(capsys, "mcp", *options) == (2, "", said)


@pytest.mark.parametrize("folder", ["/", "~"])
def test_server_in_root_or_home_folder_requires_root_option(work, folder, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(work))
    monkeypatch.chdir(work if folder == "~" else folder)
    status, _, said = run(capsys, "mcp")
    assert (status, "Name the folder of the trees with --root FOLDER" in said) == (2, True)
