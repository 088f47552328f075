"""The tools for agents, as the client of the Model Context Protocol's own SDK uses them: over the pipes of a real process."""

import asyncio
import json
import os
import subprocess
from pathlib import Path

import pytest
from mcp import Client, StdioServerParameters

from tests.cli.running import run
from tests.processes import BIN
from tests.trees import document

RIGHT = document("<Sequence><ZonesRemaining/><DetectSurvivor/></Sequence>")
WRONG = document('<Sequnce memroy="true"><ZonesRemaining/><DetectSurvivor/></Sequnce>')
PROPERTIES = "properties: {nobody is there: {never: DetectSurvivor found}}\n"
TOOLS = {"nodes", "validate", "explain", "simulate", "verify", "predict", "diff", "convert", "propose"}


@pytest.fixture
def work(tmp_path, monkeypatch):
    """Work in the folder of an agent, as a user who has approved nothing."""
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
    """Start the server in the current folder, as an agent's program does, and return what a conversation with it comes to."""
    command = StdioServerParameters(
        command=str(BIN / "sar-compile"), args=["mcp", *map(str, options)], cwd=Path.cwd(), env={**os.environ}
    )

    async def talked():
        async with Client(command) as client:
            return await talk(client)

    return asyncio.run(talked())


def call(*calls, options=()):
    """Call tools, and return for each its answer, or the text of its error."""

    async def talk(client):
        results = [await client.call_tool(name, arguments) for name, arguments in calls]
        return [each.content[0].text if each.is_error else each.structured_content for each in results]

    return session(talk, *options)


def test_there_are_these_tools_and_none_that_approves_or_writes(work):
    async def talk(client):
        return (await client.list_tools()).tools

    tools = session(talk)
    assert {each.name for each in tools} == TOOLS
    assert all(each.description and each.annotations.read_only_hint for each in tools)


# Each: a tool with its arguments, and the command that says the same.
SAME = [
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


def test_a_tool_answers_what_the_command_says_and_leaves_the_folder_as_it_was(work, tmp_path):
    before = {path: path.read_bytes() for path in work.iterdir()}
    answers = call(*((tool, arguments) for tool, arguments, _ in SAME))
    for (_, _, command), answer in zip(SAME, answers, strict=True):
        done = subprocess.run(
            [BIN / "sar-compile", *command.split()], capture_output=True, text=True, check=False
        )
        is_text = isinstance(answer["output"], str)
        expected = done.stdout if is_text else json.loads(done.stdout)
        assert without_times(answer["output"]) == without_times(expected), command
        assert (answer["ok"], answer["notes"]) == (done.returncode == 0, done.stderr.rstrip()), command
    assert {path: path.read_bytes() for path in work.iterdir()} == before
    assert not (tmp_path / "state" / "sar_compiler" / "approved").exists()


def test_what_is_wrong_comes_with_the_text_as_it_is_suggested(work):
    right, wrong = call(("validate", {"file": "right.xml"}), ("validate", {"file": "wrong.xml"}))
    assert right["mended"] is None
    assert wrong["mended"] == WRONG.replace("Sequnce", "Sequence").replace("memroy", "memory")


def test_a_tree_with_errors_is_not_verified_and_the_notes_have_them(work):
    (answer,) = call(("verify", {"file": "wrong.xml"}))
    assert (answer["ok"], answer["output"]) == (False, None)
    assert "error[unknown-node]" in answer["notes"]


OUTSIDE = ["../outside.xml", "/etc/passwd", "link.xml", "{above}/outside.xml"]
NAMING = [
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
]


def test_no_argument_of_any_tool_reads_what_lies_outside(work):
    paths = [each.format(above=work.parent) for each in OUTSIDE]
    answers = call(*((tool, {**others, name: path}) for tool, name, others in NAMING for path in paths))
    assert len(answers) == len(NAMING) * len(OUTSIDE)
    assert [
        each for each in answers if "lies outside the folders that the tools may read: " not in each
    ] == []


def test_a_call_names_a_file_and_no_option(work):
    folder, missing, option, code = call(
        ("validate", {"file": "."}),
        ("validate", {"file": "missing.xml"}),
        ("validate", {"file": "--fix"}),
        ("explain", {"code": "--help"}),
    )
    assert "'.' is a folder; name a file" in folder
    assert "cannot read missing.xml: No such file or directory" in missing
    assert "there is no tree file '--fix'" in option
    assert "no finding is called '--help'" in code


def test_the_folders_that_somebody_names_are_read_and_paths_begin_at_the_first(work, tmp_path):
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
    assert "lies outside the folders that the tools may read: " in above


def test_the_options_about_nodes_are_those_of_every_call(work):
    calls = ("nodes", {"tag": "ComputePathToPose"}), ("verify", {"file": "right.xml"})
    known, verified = call(*calls, options=["--model", "nav2:jazzy", "--include-path", "."])
    assert [each["tag"] for each in known["output"]] == ["ComputePathToPose"]
    assert verified["notes"] == ""
    (unknown,) = call(calls[0])
    assert "no node is called 'ComputePathToPose'" in unknown


def test_a_call_that_takes_too_long_is_given_up_and_the_next_one_is_answered(work):
    given_up, outside = call(
        ("verify", {"file": "right.xml"}), ("validate", {"file": "/"}), options=["--limit", "0.01"]
    )
    assert "verify was given up after 0.01 s, the limit of a call" in given_up
    assert "lies outside" in outside


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--root", "nowhere"], "sar-compile: --root nowhere is no folder\n"),
        (
            ["--trust"],
            "sar-compile: --trust would trust what an agent makes of the modules; say it to another command, once\n",
        ),
    ],
)
def test_a_server_that_could_not_keep_its_word_does_not_begin(work, options, said, capsys):
    assert run(capsys, "mcp", *options) == (2, "", said)


@pytest.mark.parametrize("folder", ["/", "~"])
def test_nobody_offers_all_files_by_not_saying_which(work, folder, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(work))
    monkeypatch.chdir(work if folder == "~" else folder)
    status, _, said = run(capsys, "mcp")
    assert (status, "name the folder of the trees, --root FOLDER" in said) == (2, True)
