"""Tests that a command opens each file once, so that its output is about one state of the file."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import sar_compiler

PACKAGE = Path(sar_compiler.__file__).parent
TREE = """<root BTCPP_format="4" main_tree_to_execute="A"><include path="sub.xml"/>
  <BehaviorTree ID="A"><Sequence><SubTree ID="B"/><AlwaysSuccess/></Sequence></BehaviorTree></root>"""
SUBTREE = '<root BTCPP_format="4"><BehaviorTree ID="B"><AlwaysSuccess/></BehaviorTree></root>'
_PROGRAM = """
import collections, json, os, sys
from sar_compiler.cli.compile import main

opened = collections.Counter()

def count(event, arguments):
    if event == "open" and isinstance(arguments[0], (str, bytes)):
        opened[os.path.abspath(os.fsdecode(arguments[0]))] += 1

sys.addaudithook(count)
main(sys.argv[1:])
print(json.dumps(opened), file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("command", "read"),
    [
        (["validate", "tree.xml"], {"tree.xml", "sub.xml", "sar.toml"}),
        (["validate", "."], {"tree.xml", "other.xml", "sub.xml", "sar.toml", "s.yaml"}),
        (["validate", "--no-cache", "."], {"tree.xml", "other.xml", "sub.xml", "sar.toml", "s.yaml"}),
        (["show", "tree.xml"], {"tree.xml", "sub.xml", "sar.toml"}),
        (["verify", "tree.xml"], {"tree.xml", "sub.xml", "sar.toml"}),
        (["simulate", "tree.xml", "--scenario", "s.yaml"], {"tree.xml", "sub.xml", "sar.toml", "s.yaml"}),
        (["convert", "tree.xml", "--to", "yaml"], {"tree.xml"}),
        (["format", "--check", "tree.xml"], {"tree.xml"}),
    ],
    ids=lambda each: " ".join(each) if isinstance(each, list) else "",
)
def test_command_opens_each_file_once(command, read, tmp_path):
    for name, text in {
        "tree.xml": TREE,
        "other.xml": TREE.replace('"A"', '"Other"'),
        "sub.xml": SUBTREE,
        "sar.toml": '[language]\nbtcpp = "4.9"\n',
        "s.yaml": "leaves: {}\n",
    }.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM, *command], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    opened = json.loads(done.stderr.splitlines()[-1])
    # The opener opens a file in two steps. The second one uses a path in /proc/self/fd, which is left out here.
    ours = {
        path: count
        for path, count in opened.items()
        if path.startswith((str(tmp_path), str(PACKAGE))) and not path.endswith((".py", ".pyc"))
    }
    assert {path.rpartition("/")[2] for path in ours if path.startswith(str(tmp_path))} == read
    assert {path: count for path, count in ours.items() if count > 1} == {}
