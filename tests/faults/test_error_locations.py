"""Tests that each reader of a file that people write reports errors with file, line and column; a new reader must be added."""

import re
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main as compile_command
from tests.faults.test_hostile_files import SURFACES, folder
from tests.trees import document

__all__ = ["folder"]  # a fixture

# For each form of file, a malformed text and the location of its error.
MALFORMED = {
    "xml": ("<root BTCPP_format='4'>\n  <BehaviorTree ID='A'", "2:3"),
    "yaml": ("a: 1\nb: [", "2:5"),
    "toml": ("a = 1\nb = ", "2:4"),
    "json": ('{"a": 1,\n"b": }', "2:6"),
}
# For each surface, a well-formed file with a wrong value and its location.
PLANTED = {
    "a tree": (document("\n<Sleep msec='soon'/>"), "4:14"),
    "a tree that is fixed": (document("\n<Sleep msec='soon'/>"), "4:14"),
    "an included tree": (document("\n<Sleep msec='soon'/>").replace("Main", "Other"), "4:14"),
    "a palette": ("<root BTCPP_format='4'><TreeNodesModel>\n<Action/></TreeNodesModel></root>", "2:1"),
    "a palette of the settings": ("<root BTCPP_format='4'><TreeNodesModel>\n<Action/></TreeNodesModel></root>", "2:1"),
    "a tree in a folder": (document("\n<Sleep msec='soon'/>"), "4:14"),
    "settings": ("[language]\nbtcpp = 9", "2:9"),
    "settings for all tools": ("[tool.sar.language]\nbtcpp = 9", "2:9"),
    "a scenario": ("name: a\nticks: soon", "2:8"),
    "a scenario of many runs": ("name: a\nuntil: [1]", "2:8"),
    "properties": ("end: none\nfacts: [1]", "2:8"),
    "parameters": ("/**:\n  ros__parameters:\n    tick_rate_hz: fast", "3:5"),
    "areas": ('{"features": [\n  {"geometry": {"type": "Polygon"}}]}', "2:3"),
    "a world": ("walls: []\nrobot: {x: 0, y: 0, radius: wide}", "2:29"),
    "the map of a world": ("image: a.pgm\nresolution: fine\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.6\nfree_thresh: 0.2", "2:13"),
}  # fmt: skip
# Surfaces of files that people do not write, or whose errors are located in the file that names them.
WITHOUT_LOCATION = {
    "a tree that is formatted": "only whether it is well-formed is asked",
    "a tree of a set": "its errors are those of a tree",
    "a palette that lies beside a tree": "the user has not named it, so it is skipped",
    "the trace of a scenario": "recorded by the project; the difference is shown",
    "properties that are approved": "read for its digest alone",
    "the image of a map": "an image; the location is that of its name in the map",
    "the poses of robots": "written by the project",
    "a journal": "written by the project",
    "a recorded run": "written by another program, in binary: findings name the byte or the message",
    "a journal that is judged": "written by the project",
    "the log beside a journal": "written by SQLite",
    "the reserve of a journal": "written by the project",
    "the refused start beside a journal": "written by the project",
    "an approval": "written by the project",
    "a module that is trusted": "read for its digest alone",
    "a module of a package": "searched for a word; errors of its import have a test below",
    "the metadata of a package": "written by a builder of packages",
    **dict.fromkeys(
        ("a tree in an editor", "an include in an editor", "a palette in an editor", "a tree of a set in an editor", "settings in an editor"),
        "read as for the command, and shown as ranges: tests/lsp/test_same_as_validate.py compares them",
    ),
}  # fmt: skip


def reported_locations(name, text, capsys):
    """Return the locations that are reported when a surface reads a text, and the output."""
    surface = SURFACES[name]
    path = "odd.xml" if surface.form == "xml" else "odd"
    Path(path).write_text(text, encoding="utf-8")
    surface.read(path)
    out, err = capsys.readouterr()
    file = r"(?:odd|one|sar|pyproject|params)\S*?"
    return re.findall(rf"{file}:(\d+:\d+)", out + err), out + err


def test_each_surface_has_a_planted_error_or_a_reason():
    """Add an error for a new reader to `PLANTED`, or the reason for having none to `WITHOUT_LOCATION`."""
    assert PLANTED.keys() | WITHOUT_LOCATION.keys() == SURFACES.keys()
    assert PLANTED.keys() & WITHOUT_LOCATION.keys() == set()


@pytest.mark.parametrize("name", PLANTED)
def test_wrong_value_is_reported_with_line_and_column(name, capsys):
    text, place = PLANTED[name]
    said, output = reported_locations(name, text, capsys)
    assert place in said, output


@pytest.mark.parametrize(
    "name",
    [
        each
        for each in {**PLANTED, "a tree that is formatted": 0}
        if not SURFACES[each].is_sought and each != "parameters"
    ],
)
def test_malformed_file_is_reported_with_line_and_column(name, capsys):
    text, place = MALFORMED[SURFACES[name].form]
    said, output = reported_locations(name, text, capsys)
    assert place in said, output


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (
            "from sar_compiler.leaves import register\nx = (\n",
            r"2:5: .*: SyntaxError: '\(' was never closed\n",
        ),
        (
            "from sar_compiler.leaves import register\n\n@register\nclass A: ...\n",
            r"3:\d+: .*: RegistrationError: .* needs the tag and the kind",
        ),
        ("import os\nimport nonsense_module\n", r"2:\d+: .*: ModuleNotFoundError"),
        ("import json\nfirst = 1\nsecond = json.loads('{')\n", r"3:\d+: .*: JSONDecodeError"),
    ],
)
def test_leaf_module_that_cannot_be_imported_is_reported_with_line(text, place, folder, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(folder))
    name = f"leaves_{abs(hash(text))}"
    Path(f"{name}.py").write_text(text, encoding="utf-8")
    assert compile_command(["nodes", "--nodes", name]) == 2
    assert re.search(rf"sar-compile: {name}\.py:{place}", capsys.readouterr().err)
